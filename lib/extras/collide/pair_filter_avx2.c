/* The filter of pairs for processors with AVX2; the same operations in the same order. */
#include "core/strict_fp.h"

#include "extras/collide/pair_filter.inc"

const ebpo_pair_kernels ebpo_pair_kernels_avx2 = { filter_one, filter_eight, filter_blocks };
