/* Going down two hierarchies on any processor. */
#include "core/strict_fp.h"

#include "extras/collide/walk_kernel.inc"

const ebpo_walk_kernels ebpo_walk_kernels_base = { walk_run, walk_start, walk_expand };

const ebpo_walk_kernels *ebpo_walk_kernels_best(void)
{
#if defined(EBPO_HAVE_AVX2)
    if (__builtin_cpu_supports("avx2"))
        return &ebpo_walk_kernels_avx2;
#endif
    return &ebpo_walk_kernels_base;
}
