/* Reference implementation of the error bound of a level: thousands of points against every face.
 * Shares no code with lib/derive, nor with the queries. */
#ifndef EBPO_TESTS_REFERENCE_REACH_H
#define EBPO_TESTS_REFERENCE_REACH_H

#include <ebpo/lod.h>

/* Returns the distance to the nearest face; 0 inside (by the sum of solid angles: nonzero winding
 * number) if `solid`. Rounded. */
double reference_distance(const ebpo_mesh *mesh, bool solid, const double p[3]);

/* Returns the largest distance among points of a level's envelopes (ebpo_lod_level): corners,
 * points of polygons and of the interior (between corners of a node). */
double reference_reach(ebpo_file *file, int level, const ebpo_mesh *mesh, bool solid,
                       uint64_t points, uint64_t seed);

#endif
