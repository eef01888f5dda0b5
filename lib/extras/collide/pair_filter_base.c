/* The filter of pairs for any processor. */
#include "core/strict_fp.h"

#include "extras/collide/pair_filter.inc"

const ebpo_pair_kernels ebpo_pair_kernels_base = { filter_one, filter_eight, filter_blocks };

const ebpo_pair_kernels *ebpo_pair_kernels_best(void)
{
#if defined(EBPO_HAVE_AVX2)
    if (__builtin_cpu_supports("avx2"))
        return &ebpo_pair_kernels_avx2;
#endif
    return &ebpo_pair_kernels_base;
}
