/* Blocks measured on processors with AVX2. */
#include "core/strict_fp.h"

#include "query/block_measure.inc"

const ebpo_block_measures ebpo_block_measures_avx2 = { measure_extent, measure_slab };
