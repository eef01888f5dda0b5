/* The nearest pair of faces of two accels at poses: the walk of gap_search.h, judged in doubles
 * and, where these do not tell, exactly. One thread. */
#ifndef EBPO_COLLIDE_NEAREST_PAIR_H
#define EBPO_COLLIDE_NEAREST_PAIR_H

#include <ebpo/base.h>

#include "collide/gap_search.h"
#include "pair/pair_distance.h"

/* Two faces at their poses. */
typedef struct ebpo_face_two {
    uint32_t slot[2];
    double corner[2][3][3];
    ebpo_pair_distance_bounds bounds;
} ebpo_face_two;

typedef struct ebpo_nearest_pair {
    /* In: */
    double tolerance; /* 0: exact */
    double at_least;  /* NAN: not asked */
    uint64_t late;    /* by ebpo_clock; UINT64_MAX: never */
    const ebpo_progress *progress;
    bool warm;  /* slots of `best` are those of a search before */
    bool meets; /* it is known that `best` does; out: it does, and is not the least one */
    /* Out: lo <= distance <= hi, equal if the answer is exact. */
    double lo, hi;
    bool found;
    int is_at_least; /* 1, 0; -1: not asked, or open */
    ebpo_face_two best;
    ebpo_error *error; /* of `status`, while it is being searched */
    ebpo_status status;
} ebpo_nearest_pair;

/* `g` has been begun. EBPO_E_MEMORY, EBPO_E_CANCELLED. */
EBPO_MUST_USE ebpo_status ebpo_nearest_pair_find(ebpo_gap_search *g, ebpo_nearest_pair *n,
                                                 ebpo_error *error);

#endif
