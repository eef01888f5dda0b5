/* Sweeps for processors with AVX2; the same operations in the same order. */
#include "core/strict_fp.h"

#include "construct/sweep.inc"

const ebpo_sweep ebpo_sweep_avx2 = { seen, highest };
