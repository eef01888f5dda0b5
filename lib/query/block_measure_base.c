/* Blocks measured on any processor. */
#include "core/strict_fp.h"

#include "query/block_measure.inc"

const ebpo_block_measures ebpo_block_measures_base = { measure_extent, measure_slab };

const ebpo_block_measures *ebpo_block_measures_best(void)
{
#if defined(EBPO_HAVE_AVX2)
    if (__builtin_cpu_supports("avx2"))
        return &ebpo_block_measures_avx2;
#endif
    return &ebpo_block_measures_base;
}
