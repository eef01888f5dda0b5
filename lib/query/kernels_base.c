/* Kernels for any processor. */
#include "core/strict_fp.h"

#include "query/kernels.inc"
#include "query/near_kernel.inc"
#include "query/ray_kernel.inc"
#include "query/wall_kernel.inc"

const ebpo_kernels ebpo_kernels_base = { crossings, walls, near_walk, ray_walk };

const ebpo_kernels *ebpo_kernels_best(void)
{
#if defined(EBPO_HAVE_AVX2)
    if (__builtin_cpu_supports("avx2"))
        return &ebpo_kernels_avx2;
#endif
    return &ebpo_kernels_base;
}
