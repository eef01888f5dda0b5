/* Sweeps for any processor. */
#include "core/strict_fp.h"

#include "construct/sweep.inc"

const ebpo_sweep ebpo_sweep_base = { seen, highest };

const ebpo_sweep *ebpo_sweep_best(void)
{
#if defined(EBPO_HAVE_AVX2)
    if (__builtin_cpu_supports("avx2"))
        return &ebpo_sweep_avx2;
#endif
    return &ebpo_sweep_base;
}
