/* Kernels for processors with AVX2; the same operations in the same order. */
#include "core/strict_fp.h"

#include "query/kernels.inc"
#include "query/near_kernel.inc"
#include "query/ray_kernel.inc"
#include "query/wall_kernel.inc"

const ebpo_kernels ebpo_kernels_avx2 = { crossings, walls, near_walk, ray_walk };
