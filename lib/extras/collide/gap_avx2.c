/* The walk for processors with AVX2; the same operations in the same order. */
#include "core/strict_fp.h"

#include "extras/collide/gap_walk.inc"

void ebpo_gap_walk_avx2(ebpo_gap_search *g) { walk(g); }
