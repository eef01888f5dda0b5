/* The next faces by their distance from a point: those that come after a given one and before there
 * are too many. Bands follow each other, so that a stream of any length needs little memory. */
#ifndef EBPO_QUERY_NEAR_BAND_H
#define EBPO_QUERY_NEAR_BAND_H

#include "query/accel.h"
#include "query/nearest.h"

typedef struct ebpo_near {
    const double *p;
    ebpo_distance_bounds bounds;
    uint64_t file_face, source_face;
    double triangle[3][3];
} ebpo_near;

typedef struct ebpo_near_band {
    double p[3];
    double radius;  /* what is farther is in no band: exact */
    double limit;   /* what is farther is not in this one: certain */
    uint64_t most;  /* faces in it, at least 1 */
    bool has_after; /* faces up to `after` were in bands before */
    ebpo_near after;
    ebpo_near *near;
    uint64_t count, capacity;
    bool cut; /* there may be faces after the last one */
    bool no_memory;
} ebpo_near_band;

/* Before the search for a band; `after` and what memory there is are kept. */
void ebpo_near_band_begin(ebpo_near_band *band, uint64_t most);

/* Adds what the subtree has of it. Faces may come again in another subtree. */
void ebpo_near_band_search(ebpo_near_band *band, const ebpo_accel *s);

/* In order: by exact distance, then by number in the file, each once, at most `most`. The limit
 * falls to what may still come in between. */
void ebpo_near_band_settle(ebpo_near_band *band);

/* Everything that has a distance of at most `far` was in bands before. */
static inline bool ebpo_near_band_is_past(const ebpo_near_band *band, double far)
{
    return band->has_after && far < band->after.bounds.lo;
}

#endif
