/* Follows a straight piece of a ball's path: finds the first contact with a face, and checks that
 * the ball's centre crosses no face. If the work limit of a haptic step (one cycle of the force
 * computation) is reached, the next step continues. */
#ifndef EBPO_HAPTIC_BALL_WALK_H
#define EBPO_HAPTIC_BALL_WALK_H

#include "extras/haptic/face_box.h"

enum { EBPO_PLANES_LIMIT = 12 };

/* Planes in contact with the ball, which limit its motion. */
typedef struct ebpo_held_planes {
    double normal[EBPO_PLANES_LIMIT][3]; /* unit vectors that point to the free side */
    int count;
} ebpo_held_planes;

/* Adds a plane. Does nothing if an equal plane is present or there is no space. */
void ebpo_held_planes_add(ebpo_held_planes *planes, const double normal[3]);

/* Finds the vector `out` nearest to `want` with n . out >= 0 for the normals n of all planes; if
 * rounding makes all other candidates violate a plane, `out` is 0. Returns the tolerance: n . out
 * is at least minus this value. */
double ebpo_project_motion(const ebpo_held_planes *planes, const double want[3], double out[3]);

/* Maximum number of faces and of nodes that a haptic step examines. The next step continues the
 * work, so any number of faces may be around a ball. */
enum { EBPO_BALL_FACES = 512, EBPO_BALL_NODES = 2048 };

/* Numbers of faces and nodes that have been examined in a haptic step, for all pieces of the path.
 */
typedef struct ebpo_ball_work {
    uint32_t faces, nodes;
} ebpo_ball_work;

typedef enum ebpo_ball_stage {
    EBPO_BALL_IDLE,     /* there is no unfinished piece */
    EBPO_BALL_SEARCHES, /* search for the first contact */
    EBPO_BALL_CHECKS    /* check that the centre crosses nothing */
} ebpo_ball_stage;

/* A straight piece of the path. */
typedef struct ebpo_ball_walk {
    ebpo_ball_stage stage;
    const ebpo_face_box *box;  /* the same until the piece ends; NULL: no faces are on the path */
    double from[3], motion[3]; /* as in ebpo_ball_motion */
    double contact_distance;   /* ebpo_ball_motion.radius */
    double band, slack, least_slack; /* as in ebpo_ball_motion */
    double fraction;           /* fraction of the path until the first contact; 1: no contact */
    ebpo_held_planes contacts; /* normals of the contacts at this point of the path */
    bool work_limited;         /* the path ends before the contact, because the limit
                                * of work was reached */
    double to[3];              /* end of the piece, set after the stage EBPO_BALL_SEARCHES */
    ebpo_near_queue queue;     /* nodes to be visited in the stage EBPO_BALL_SEARCHES */
    uint64_t stack[64]; /* [depth] nodes to be visited in the stage EBPO_BALL_CHECKS; at most one
                         * node of each level */
    int depth;
} ebpo_ball_walk;

/* Allocates memory for boxes of up to `faces` faces, and writes to all pages of it, so that no
 * haptic step waits for the operating system. */
EBPO_MUST_USE ebpo_status ebpo_ball_walk_new(ebpo_ball_walk *w, uint64_t faces, ebpo_error *error);
void ebpo_ball_walk_free(ebpo_ball_walk *w);
/* Returns the bytes of memory of a walk for boxes of up to `faces` faces. */
uint64_t ebpo_ball_walk_bytes(uint64_t faces);

/* Begins a piece. from, motion, box, contact_distance, band and both slacks must be set. */
void ebpo_ball_begin(ebpo_ball_walk *w);

typedef enum ebpo_ball_end {
    EBPO_BALL_UNFINISHED, /* the limit of work is reached; the next step continues */
    EBPO_BALL_ARRIVED,    /* the path to `to` is free; the piece has ended */
    EBPO_BALL_CROSSED     /* exact arithmetic finds that the centre crosses a face; the piece has
                           * ended, and the ball must not move to `to` */
} ebpo_ball_end;

/* Continues the piece, until it ends or a limit of the haptic step is reached. Adds the work to
 * *work. */
ebpo_ball_end ebpo_ball_continue(ebpo_ball_walk *w, ebpo_ball_work *work);

#endif
