/* Until when two models have common points, one of which moves along a direction: pairs of nodes of
 * both hierarchies, those first that may part last, then pairs of faces. Bounds:
 * docs/develop/collision.md, "The way out". One thread. */
#ifndef EBPO_COLLIDE_WAY_SEARCH_H
#define EBPO_COLLIDE_WAY_SEARCH_H

#include "extras/collide/collider.h"
#include "extras/collide/pair_sweep.h"

/* Children of nodes of both: the node's number * 8 + lane. */
typedef struct ebpo_way_pair {
    double most; /* they have no common point later */
    uint32_t a, b;
} ebpo_way_pair;

/* One model beside the direction: what its frame's axes, posed, are along three axes at right
 * angles, of which the first is the direction. */
typedef struct ebpo_way_side {
    const ebpo_accel *accel;
    const ebpo_posing *posing;
    double row[3][3], base[3];
} ebpo_way_side;

typedef struct ebpo_way_search {
    /* In: */
    const ebpo_collision *question;
    double direction[3]; /* in which the question's first model moves; the greatest is 1/2 .. 1 */
    /* Out: the last contact, in units of that direction, and who has it; none before 0. */
    ebpo_sweep_time last;
    ebpo_face_pair pair; /* of the caller's A and B */
    double hi;           /* what was left out is not later, certainly: less than 0, nothing was */
    /* Begins as 0: */
    ebpo_way_side side[2];
    double axis[3][3];    /* at right angles; the first is the direction */
    double step, lost;    /* direction along the first axis; what rounding moves extents by */
    double sure;          /* `last` is not earlier */
    ebpo_way_pair *pairs; /* a heap, the greatest first */
    uint64_t count, capacity, looked;
} ebpo_way_search;

/* Where a convex set, or what is in it, is along the axes. */
typedef struct ebpo_way_extent {
    double low[3], high[3];
} ebpo_way_extent;

/* Once; `last` is the caller's to clear. */
void ebpo_way_search_begin(ebpo_way_search *search);

/* The greatest t at which what has these extents may have a common point; less than 0: none. */
double ebpo_way_most(const ebpo_way_search *search, const ebpo_way_extent *a,
                     const ebpo_way_extent *b);

/* Goes on with two accels of the question's models. EBPO_E_MEMORY, EBPO_E_CANCELLED. */
EBPO_MUST_USE ebpo_status ebpo_way_search_run(ebpo_way_search *search,
                                              const ebpo_accel *const accel[2], ebpo_error *error);

#endif
