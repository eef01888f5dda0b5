/* How deep parts of a surface are in a solid: balls that hold some of it, and faces, which wait to
 * be divided. One thread. */
#ifndef EBPO_COLLIDE_DEPTH_PARTS_H
#define EBPO_COLLIDE_DEPTH_PARTS_H

#include "extras/collide/collider.h"
#include "extras/collide/posed_solid.h"

/* A part of a face. */
typedef struct ebpo_depth_part {
    double most;         /* no point of it is deeper */
    double corner[3][3]; /* in the world */
} ebpo_depth_part;

typedef struct ebpo_depth_search {
    /* In: */
    ebpo_context *from; /* of the surface's model */
    const ebpo_posing *posing;
    double reach; /* no posed coordinate of it is greater */
    const ebpo_posed_solid *solid;
    ebpo_context *context; /* of the solid's model, another one */
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

bool ebpo_depth_is_late(const ebpo_depth_search *search);

/* Something of the surface is within `radius` of a point, all of it; and a point of it certainly
 * within `far`, INFINITY if that is not known. */
typedef struct ebpo_depth_ball {
    double radius, far;
    /* Out: whether it matters still, and how deep it is at most. */
    bool open;
    double most;
} ebpo_depth_ball;

EBPO_MUST_USE ebpo_status ebpo_depth_ask_ball(ebpo_depth_search *search, const double middle[3],
                                              ebpo_depth_ball *ball, ebpo_error *error);
/* A face, at its pose. */
EBPO_MUST_USE ebpo_status ebpo_depth_offer_face(ebpo_depth_search *search,
                                                const double corner[3][3], ebpo_error *error);

/* No part that waits is deeper than what is known and the tolerance. */
bool ebpo_depth_is_done(const ebpo_depth_search *search);
/* The part that may be deepest: it is not done. */
EBPO_MUST_USE ebpo_status ebpo_depth_divide_next(ebpo_depth_search *search, ebpo_error *error);

#endif
