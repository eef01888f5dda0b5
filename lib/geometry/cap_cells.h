/* Decides for whole cells what is inside a surface with holes, by bounds of w_D (cap_bounds.h). */
#ifndef EBPO_GEOMETRY_CAP_CELLS_H
#define EBPO_GEOMETRY_CAP_CELLS_H

#include "geometry/cap_bounds.h"

/* Returns 1 if |w_D| is certainly below the threshold t and below 1 - t in the box of the front,
 * with bounds that are enlarged by `variation`, so that the rule for k decides; 0 if more
 * refinements cannot show this; -1 if `steps` refinements show neither. Adds the number of terms of
 * all sums to *terms. */
int ebpo_cap_front_small(ebpo_cap_front *front, double threshold, double variation, int steps,
                         uint64_t *terms);

/* Returns 1 if all points of the front's box are certainly inside, 0 if all are outside,
 * EBPO_CAP_BOTH if certainly some are inside and others are outside, else -1.
 * The box has no faces. `winding`: k in the box, in which no cap may be; or, with `variation` >= 0
 * and a front at the centre of the box, k at the centre. *terms: as above. */
enum { EBPO_CAP_BOTH = -2 };
int ebpo_cap_front_result(ebpo_cap_front *front, const ebpo_cap_rule *rule, int32_t winding,
                          double variation, uint64_t *terms);

/* Returns 1 if certainly no cap touches the box and |w_D| < t and |w_D| < 1 - t in it, 0 if |w_D|
 * is certainly greater (with bounds of the first order, in the whole box), else -1. The caps near
 * the box are entry[0 .. count - 1], and `far` has the bounds of the others. */
int ebpo_cap_small_in(ebpo_cap_front *front, const ebpo_cap_tree *tree, const double low[3],
                      const double high[3], const uint32_t *entry, uint64_t count,
                      const ebpo_cap_field *far, double threshold);

#endif
