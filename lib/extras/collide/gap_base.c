/* The walk for any processor. */
#include "core/strict_fp.h"

#include "extras/collide/gap_walk.inc"

void ebpo_gap_walk_base(ebpo_gap_search *g) { walk(g); }

ebpo_gap_walk_fn *ebpo_gap_walk_best(void)
{
#if defined(EBPO_HAVE_AVX2)
    if (__builtin_cpu_supports("avx2"))
        return ebpo_gap_walk_avx2;
#endif
    return ebpo_gap_walk_base;
}
