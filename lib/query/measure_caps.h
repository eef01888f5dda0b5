/* How much of a volume depends on the caps of a loop. */
#ifndef EBPO_QUERY_MEASURE_CAPS_H
#define EBPO_QUERY_MEASURE_CAPS_H

#include <stdint.h>

/* Returns an upper bound of the volume of the convex hull of `count` points, times factor[0] and
 * factor[1] on each axis. *farthest: upper bound of the distance of the hull's points from `from`,
 * which is scaled already. */
double ebpo_loop_hull(const double *point, uint64_t count, const double factor[2],
                      const double from[3], double *farthest);

#endif
