/* A straight piece of a ball's way: where it first touches a face, and that its centre goes
 * through none. The work is done in shares, and goes on where it ended. */
#ifndef EBPO_HAPTIC_BALL_WALK_H
#define EBPO_HAPTIC_BALL_WALK_H

#include "extras/haptic/face_box.h"

enum { EBPO_PLANES_MOST = 12 };

typedef struct ebpo_held_planes {
    double normal[EBPO_PLANES_MOST][3]; /* unit vectors to the side that is free */
    int count;
} ebpo_held_planes;

/* One more, unless it is there already, or there is no room. */
void ebpo_held_planes_add(ebpo_held_planes *planes, const double normal[3]);

/* `out` is the way `want` projected onto the cone n . x >= 0 for all planes; 0 if rounding finds
 * none. Returns how far below 0 n . out may be. */
double ebpo_hold_back(const ebpo_held_planes *planes, const double want[3], double out[3]);

/* A straight piece of a ball's way: where it first touches a face, and that its centre went through
 * none. The work is done in shares, and goes on where it ended: so a ball may have any number of
 * faces around it. */

enum {
    /* Of a tick. */
    EBPO_BALL_FACES = 512,
    EBPO_BALL_NODES = 2048
};

/* What was looked at: all pieces of a tick add to it. */
typedef struct ebpo_ball_work {
    uint32_t faces, nodes;
} ebpo_ball_work;

typedef enum ebpo_ball_stage {
    EBPO_BALL_STANDS,
    EBPO_BALL_LOOKS, /* for what it touches first */
    EBPO_BALL_CHECKS /* that the centre goes through nothing */
} ebpo_ball_stage;

typedef struct ebpo_ball_walk {
    ebpo_ball_stage stage;
    const ebpo_face_box *box; /* as it is until the ball stands; NULL: no face is where it goes */
    double from[3], way[3];
    double reach, band, slack, least_slack; /* as of ebpo_ball_way */
    double part;                            /* of the way, until what it touches first */
    ebpo_held_planes met;                   /* away from what it touches there */
    bool cut;                               /* it ends before what it touches: work was done */
    double to[3];                           /* known when it has looked */
    ebpo_near_queue queue;                  /* of LOOKS */
    uint64_t stack[64];                     /* of CHECKS; a level leaves one behind */
    int depth;
} ebpo_ball_walk;

/* Room for boxes of so many faces; all pages are written. */
EBPO_MUST_USE ebpo_status ebpo_ball_walk_new(ebpo_ball_walk *w, uint64_t faces, ebpo_error *error);
void ebpo_ball_walk_free(ebpo_ball_walk *w);
uint64_t ebpo_ball_walk_bytes(uint64_t faces);

/* Begins; from, way, box, reach, band and slacks are set. */
void ebpo_ball_set_out(ebpo_ball_walk *w);

typedef enum ebpo_ball_end {
    EBPO_BALL_LATER,  /* there is more to look at than a tick may */
    EBPO_BALL_THERE,  /* the way to `to` is free; it stands */
    EBPO_BALL_THROUGH /* it is not, by exact arithmetic; it stands */
} ebpo_ball_end;

ebpo_ball_end ebpo_ball_go_on(ebpo_ball_walk *w, ebpo_ball_work *work);

#endif
