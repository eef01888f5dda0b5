/* Which of two faces is nearer. */
#ifndef EBPO_QUERY_NEAR_ORDER_H
#define EBPO_QUERY_NEAR_ORDER_H

#include "geometry/distance.h"

/* Sign of distance(p, a) - distance(p, b), exact; with what their bounds tell it is rarely costly.
 */
int ebpo_near_compare(const double p[3], const double a[3][3], const ebpo_distance_bounds *a_bounds,
                      const double b[3][3], const ebpo_distance_bounds *b_bounds);

#endif
