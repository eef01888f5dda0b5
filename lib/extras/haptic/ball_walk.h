/* Follows a straight piece of a ball's path: finds its first contact with a face, and checks that
 * the ball's centre crosses no face. If the work of one haptic step does not suffice, the next step
 * continues. */
#ifndef EBPO_HAPTIC_BALL_WALK_H
#define EBPO_HAPTIC_BALL_WALK_H

#include "extras/haptic/face_box.h"

enum { EBPO_PLANES_LIMIT = 12 };

typedef struct ebpo_held_planes {
    double normal[EBPO_PLANES_LIMIT][3]; /* unit vectors that point to the free side */
    int count;
} ebpo_held_planes;

/* Adds a plane, unless an equal plane is present or there is no space. */
void ebpo_held_planes_add(ebpo_held_planes *planes, const double normal[3]);

/* Finds the vector `out` nearest to `want` with n . out >= 0 for the normals n of all planes; it is
 * 0 if because of rounding no other vector is found. Returns the tolerance of this condition: n .
 * out may be below 0 by so much. */
double ebpo_project_motion(const ebpo_held_planes *planes, const double want[3], double out[3]);

/* Limits of the work in a haptic step. The work continues in the next step, so any number of faces
 * may be around a ball. */

enum {
    /* Maximum number of faces and of nodes in each haptic step. */
    EBPO_BALL_FACES = 512,
    EBPO_BALL_NODES = 2048
};

/* Numbers of faces and nodes that have been examined in a haptic step, for all pieces of path. */
typedef struct ebpo_ball_work {
    uint32_t faces, nodes;
} ebpo_ball_work;

typedef enum ebpo_ball_stage {
    EBPO_BALL_IDLE,     /* no piece has begun */
    EBPO_BALL_SEARCHES, /* search for the first contact */
    EBPO_BALL_CHECKS    /* check that the centre crosses nothing */
} ebpo_ball_stage;

typedef struct ebpo_ball_walk {
    ebpo_ball_stage stage;
    const ebpo_face_box *box;  /* unchanged until the ball stops; NULL: no faces are on the path */
    double from[3], motion[3]; /* these and the next members are as in ebpo_ball_motion */
    double reach, band, slack, least_slack;
    double part;               /* part of the path until the first contact */
    ebpo_held_planes contacts; /* normals of the contacts there */
    bool work_limited;         /* the path ends before the contact, because the limit
                                * of work was reached */
    double to[3];              /* end of the piece, known after the search */
    ebpo_near_queue queue;     /* used at EBPO_BALL_SEARCHES */
    uint64_t stack[64]; /* used at EBPO_BALL_CHECKS: [depth], at most one node of each level */
    int depth;
} ebpo_ball_walk;

/* Allocates memory for boxes of up to this many faces, and writes to all of it. */
EBPO_MUST_USE ebpo_status ebpo_ball_walk_new(ebpo_ball_walk *w, uint64_t faces, ebpo_error *error);
void ebpo_ball_walk_free(ebpo_ball_walk *w);
uint64_t ebpo_ball_walk_bytes(uint64_t faces);

/* Begins a piece; from, motion, box, reach, band and slacks must be set. */
void ebpo_ball_begin(ebpo_ball_walk *w);

typedef enum ebpo_ball_end {
    EBPO_BALL_UNFINISHED, /* the limit of work is reached; the next step continues */
    EBPO_BALL_ARRIVED,    /* the path to `to` is free; the ball stops */
    EBPO_BALL_CROSSED /* exact arithmetic finds that the centre crosses a face; the ball stops */
} ebpo_ball_end;

/* Continues the piece, as far as the limits of the haptic step allow. Adds to *work. */
ebpo_ball_end ebpo_ball_continue(ebpo_ball_walk *w, ebpo_ball_work *work);

#endif
