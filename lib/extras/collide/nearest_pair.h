/* The nearest pair of faces of accels at poses: the walk of gap_search.h, judged in doubles
 * and, where these do not tell, exactly. One thread. */
#ifndef EBPO_COLLIDE_NEAREST_PAIR_H
#define EBPO_COLLIDE_NEAREST_PAIR_H

#include <ebpo/base.h>

#include "extras/collide/gap_search.h"
#include "extras/collide/pair_distance.h"

/* Two faces, as in their files and at their poses. */
typedef struct ebpo_face_two {
    uint64_t file[2], source[2]; /* their numbers */
    double own[2][3][3], corner[2][3][3];
    ebpo_pair_distance_bounds bounds;
} ebpo_face_two;

/* Of one pair of accels, or of several, one after the other. */
typedef struct ebpo_nearest_pair {
    /* In: */
    double tolerance; /* 0: exact */
    double at_least;  /* NAN: not asked */
    uint64_t late;    /* by ebpo_clock; UINT64_MAX: never */
    const ebpo_progress *progress;
    /* Out: lo <= distance <= hi, equal if the answer is exact. */
    double lo, hi;
    bool found;
    bool meets;      /* `best` does, and is not the least one that does */
    int is_at_least; /* 1, 0; -1: not asked, or open */
    ebpo_face_two best;
    bool ended; /* before all was seen: what was not is not nearer than: */
    double left;
    ebpo_error *error; /* of `status`, while it is being searched */
    ebpo_status status;
} ebpo_nearest_pair;

/* What is asked has been set. */
void ebpo_nearest_pair_begin(ebpo_nearest_pair *n);
/* A pair of faces that is known from before: own, file and source are set. */
void ebpo_nearest_pair_start(ebpo_nearest_pair *n, const ebpo_posing posing[2],
                             const ebpo_face_two *pair);
/* Two faces of `g`, by their slots, that are known to meet. */
void ebpo_nearest_pair_met(ebpo_nearest_pair *n, const ebpo_gap_search *g, const uint32_t slot[2]);
/* Of two more accels, with which `g` has been begun. EBPO_E_MEMORY, EBPO_E_CANCELLED. */
EBPO_MUST_USE ebpo_status ebpo_nearest_pair_search(ebpo_nearest_pair *n, ebpo_gap_search *g,
                                                   ebpo_error *error);
/* What is farther away does not matter any more. */
double ebpo_nearest_pair_limit(const ebpo_nearest_pair *n);
/* Nothing is left to be found out. */
bool ebpo_nearest_pair_is_done(const ebpo_nearest_pair *n);
/* What was not looked at is not nearer. */
void ebpo_nearest_pair_leave(ebpo_nearest_pair *n, double left);
void ebpo_nearest_pair_end(ebpo_nearest_pair *n);

#endif
