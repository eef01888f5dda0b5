/* Double-double arithmetic for rays, for processors with FMA. */
#define EBPO_PRODUCTS_BY_FMA
#include "core/strict_fp.h"

#include "geometry/ray_pairs.inc"

const ebpo_ray_pairs ebpo_ray_pairs_fma = { plane, edge };
