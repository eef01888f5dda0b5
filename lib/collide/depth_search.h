/* How deep the surface of one model is in a solid: branch and bound over its hierarchy, then its
 * faces and parts of these. Bounds: docs/develop/collision.md, "Depth". One thread. */
#ifndef EBPO_COLLIDE_DEPTH_SEARCH_H
#define EBPO_COLLIDE_DEPTH_SEARCH_H

#include "collide/posed_solid.h"

/* A part of the surface: what is below a child, or a triangle. */
typedef struct ebpo_depth_part {
    double most;         /* no point of it is deeper */
    uint32_t ref;        /* node * 8 + lane, or EBPO_NO_CHILD: the triangle */
    double corner[3][3]; /* in the world */
} ebpo_depth_part;

typedef struct ebpo_depth_search {
    /* In: */
    const ebpo_accel *surface;
    const ebpo_posing *posing;
    double reach; /* no posed coordinate of it is greater */
    const ebpo_posed_solid *solid;
    ebpo_context *context; /* of the solid's model */
    double tolerance;
    uint64_t late; /* by ebpo_clock; UINT64_MAX: never */
    const ebpo_progress *progress;
    /* Out: lo <= depth <= hi. */
    double lo, hi;
    /* Begins as 0: */
    double left, lost; /* the greatest `most` of what was left out; what rounding moves points by */
    ebpo_depth_part *part; /* a heap, the greatest first */
    uint64_t count, capacity, asked;
} ebpo_depth_search;

/* EBPO_E_MEMORY, EBPO_E_CANCELLED, and those of ebpo_distance. */
EBPO_MUST_USE ebpo_status ebpo_depth_search_run(ebpo_depth_search *search, ebpo_error *error);

#endif
