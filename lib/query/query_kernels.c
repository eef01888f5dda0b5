/* The kernels of queries; lib/core/cpu.h says for which processors. */
#include "core/strict_fp.h"

#include "query/kernels.inc"
#include "query/near_kernel.inc"
#include "query/ray_kernel.inc"
#include "query/wall_kernel.inc"

const ebpo_kernels EBPO_KERNEL(ebpo_kernels) = { crossings, walls, near_walk, ray_walk };
