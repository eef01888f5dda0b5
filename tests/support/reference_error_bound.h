/* Reference implementation of the error bound of a level: thousands of points against every face.
 * Shares no code with lib/derive, nor with the queries. */
#ifndef EBPO_TESTS_REFERENCE_ERROR_BOUND_H
#define EBPO_TESTS_REFERENCE_ERROR_BOUND_H

#include <ebpo/lod.h>

/* Returns the rounded distance to the nearest face or, if `solid` and the point is inside, 0. A
 * point is inside if its winding number, the sum of the solid angles, is not zero. */
double reference_distance(const ebpo_mesh *mesh, bool solid, const double p[3]);

/* Returns the largest distance among points of a level's envelopes (ebpo_lod_level): corners,
 * points of polygons and of the interior (between corners of a node). */
double reference_max_distance(ebpo_file *file, int level, const ebpo_mesh *mesh, bool solid,
                              uint64_t points, uint64_t seed);

#endif
