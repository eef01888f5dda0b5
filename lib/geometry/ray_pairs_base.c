/* Double-double arithmetic for rays, for any processor. */
#include "core/strict_fp.h"

#include "geometry/ray_pairs.inc"

const ebpo_ray_pairs ebpo_ray_pairs_base = { plane, edge };

const ebpo_ray_pairs *ebpo_ray_pairs_best(void)
{
#if defined(EBPO_HAVE_FMA)
    if (__builtin_cpu_supports("fma"))
        return &ebpo_ray_pairs_fma;
#endif
    return &ebpo_ray_pairs_base;
}
