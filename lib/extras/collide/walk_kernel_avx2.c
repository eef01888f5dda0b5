/* Going down two hierarchies on processors with AVX2; the same operations in the same order. */
#include "core/strict_fp.h"

#include "extras/collide/walk_kernel.inc"

const ebpo_walk_kernels ebpo_walk_kernels_avx2 = { walk_run, walk_start, walk_expand };
