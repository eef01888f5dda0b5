/* How far a level reaches beyond the model, found again by plain means: points by the thousand
 * against every face. Shares no code with lib/derive, nor with the queries. */
#ifndef EBPO_TESTS_TWIN_REACH_H
#define EBPO_TESTS_TWIN_REACH_H

#include <ebpo/lod.h>

/* Distance to the nearest face; 0 inside (by the sum of solid angles: nonzero winding number) when
 * `solid`. Rounded. */
double twin_distance(const ebpo_mesh *mesh, bool solid, const double p[3]);

/* The largest distance among points of a level's envelopes (ebpo_lod_level): corners, points of
 * polygons and of the insides (between corners of a node). */
double twin_reach(ebpo_file *file, int level, const ebpo_mesh *mesh, bool solid, uint64_t points,
                  uint64_t seed);

#endif
