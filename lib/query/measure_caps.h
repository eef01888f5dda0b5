/* Bounds how much a volume depends on the choice of the cap of a loop (of border edges). */
#ifndef EBPO_QUERY_MEASURE_CAPS_H
#define EBPO_QUERY_MEASURE_CAPS_H

#include <stdint.h>

/* Returns an upper bound of the volume of the convex hull of `count` points. Each coordinate is
 * first multiplied by factor[0] and factor[1]. *farthest: upper bound of the distance of the hull's
 * points from the point `from`, whose coordinates are already multiplied. */
double ebpo_loop_hull(const double *point, uint64_t count, const double factor[2],
                      const double from[3], double *farthest);

#endif
