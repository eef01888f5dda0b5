/* Decides for whole cells what is inside a surface with holes: refines the bounds of w_D until they
 * decide, or until more refinements are useless. */
#include "core/strict_fp.h"

#include <limits.h>
#include <math.h>

#include "geometry/cap_cells.h"

/* Returns 1 if |w_D| is certainly below t and 1 - t, 0 if more refinements cannot show this, else
 * -1. `angles`: bounds of 2 pi w_D. */
static int is_small(ebpo_bounded angles, double threshold)
{
    const double t = fmin(threshold, 1 - threshold);
    ebpo_bounded b = ebpo_cap_winding_of(angles, 0);
    return fabs(b.middle) + b.error < t - 0x1p-40   ? 1
           : fabs(b.middle) - b.error > t - 0x1p-41 ? 0
                                                    : -1;
}

int ebpo_cap_front_small(ebpo_cap_front *front, double threshold, double variation, int steps,
                         uint64_t *terms)
{
    int small;
    do {
        ebpo_cap_sum sum = ebpo_cap_front_sum(front);
        *terms += front->count;
        sum.all.error += variation;
        small = is_small(sum.all, threshold);
        if (small < 0 && sum.spread > 0) /* |w_D| may be certainly greater at some points */
            small = is_small((ebpo_bounded){ fabs(sum.all.middle) + sum.spread, 0 }, threshold) ? -1
                                                                                                : 0;
    } while (small < 0 && steps-- > 0 && ebpo_cap_front_refine(front));
    return small;
}

int ebpo_cap_front_result(ebpo_cap_front *front, const ebpo_cap_rule *rule, int32_t winding,
                          double variation, uint64_t *terms)
{
    int result;
    do {
        ebpo_cap_sum sum = ebpo_cap_front_sum(front);
        ebpo_bounded b = sum.all;
        *terms += front->count;
        b.error += fmax(variation, 0);
        b = ebpo_cap_winding_of(b, winding);
        result = sum.apart || variation >= 0
                     ? ebpo_cap_rule_result(rule, b.middle - b.error, b.middle + b.error)
                     : -1;
        double spread = sum.spread / (2 * EBPO_PI_LOW);
        if (result < 0 && sum.apart && spread > 0 &&
            ebpo_cap_rule_result(rule, b.middle - spread, b.middle + spread) < 0)
            return EBPO_CAP_BOTH;
    } while (result < 0 && ebpo_cap_front_refine(front));
    return result;
}

int ebpo_cap_small_in(ebpo_cap_front *front, const ebpo_cap_tree *tree, const double low[3],
                      const double high[3], const uint32_t *entry, uint64_t count,
                      const ebpo_cap_field *far, double threshold)
{
    const ebpo_cap_box box = ebpo_cap_box_of(low, high), centre = ebpo_cap_point(box.centre);
    uint64_t terms = 0;
    if (ebpo_caps_near(tree, low, high))
        return -1;
    ebpo_cap_front_begin(front, tree, &box, entry, count, far);
    int small = ebpo_cap_front_small(front, threshold, 0, INT_MAX, &terms);
    if (small >= 0)
        return small;
    /* no cap touches the box, so w_D varies in it as w_S would without faces */
    double variation = ebpo_cap_variation(tree, &box, NULL, 0, EBPO_PI_LOW);
    if (variation == INFINITY)
        return -1;
    ebpo_cap_front_begin_all(front, tree, &centre);
    return ebpo_cap_front_small(front, threshold, variation, INT_MAX, &terms);
}
