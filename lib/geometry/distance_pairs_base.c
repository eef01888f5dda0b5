/* Double-double distances for any processor. */
#include "core/strict_fp.h"

#include "geometry/distance_pairs.inc"

const ebpo_distance_pairs ebpo_distance_pairs_base = { to_feature, unit_normal };

const ebpo_distance_pairs *ebpo_distance_pairs_best(void)
{
#if defined(EBPO_HAVE_FMA)
    if (__builtin_cpu_supports("fma"))
        return &ebpo_distance_pairs_fma;
#endif
    return &ebpo_distance_pairs_base;
}
