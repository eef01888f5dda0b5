/* Double-double distances for processors with FMA. */
#define EBPO_PRODUCTS_BY_FMA
#include "core/strict_fp.h"

#include "geometry/distance_pairs.inc"

const ebpo_distance_pairs ebpo_distance_pairs_fma = { to_feature, unit_normal };
