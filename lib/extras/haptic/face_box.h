/* The faces in a box with a tree of boxes over them, on which a haptic step works; distances from
 * faces and the side of a point. The loading thread makes a box; it never changes while a step
 * uses it. */
#ifndef EBPO_HAPTIC_FACE_BOX_H
#define EBPO_HAPTIC_FACE_BOX_H

#include <stdbool.h>
#include <stdint.h>

#include <ebpo/query.h>

enum { EBPO_FACE_BOX_LEAF = 8 };

typedef struct ebpo_extent {
    double min[3], max[3];
} ebpo_extent;

static inline bool ebpo_extent_holds(const ebpo_extent *e, const double p[3])
{
    for (int i = 0; i < 3; i++)
        if (!(p[i] >= e->min[i] && p[i] <= e->max[i]))
            return false;
    return true;
}

typedef struct ebpo_face_box {
    /* Of every ball whose centre is in it, all faces within the margin are there. */
    ebpo_extent centres;
    ebpo_extent loaded;               /* all faces that meet it are there */
    uint64_t count, capacity, leaves; /* leaves: a power of two */
    double (*corner)[3][3];           /* [capacity] */
    uint64_t *face;                   /* [capacity] as callers are told */
    ebpo_extent *node;                /* [2 leaves] the root is 1, children of n are 2 n, 2 n + 1 */
} ebpo_face_box;

EBPO_MUST_USE ebpo_status ebpo_face_box_new(ebpo_face_box *out, uint64_t capacity,
                                            ebpo_error *error);
void ebpo_face_box_free(ebpo_face_box *box);
uint64_t ebpo_face_box_bytes(uint64_t capacity);
uint64_t ebpo_face_box_leaves(uint64_t capacity); /* of its tree, at most */

/* Loads what is within `margin` of the centres. *fits is false if that is more than there is room
 * for. The order of faces is the file's, along a curve: so the tree needs no sorting. */
EBPO_MUST_USE ebpo_status ebpo_face_box_load(ebpo_face_box *box, ebpo_context *context,
                                             const ebpo_extent *centres, double margin, bool *fits,
                                             ebpo_error *error);

/* Faces whose boxes meet `around`, into found[most]; false: there are more, or more than *visits
 * nodes would have to be looked at, which is less by those that were. */
bool ebpo_face_box_find(const ebpo_face_box *box, const ebpo_extent *around, uint32_t *found,
                        uint32_t most, uint32_t *visits, uint32_t *count);

/* Of what is in `around`, no point is closer to a face of the box than this; after so many nodes it
 * says less. *visits counts them. */
double ebpo_face_box_clearance(const ebpo_face_box *box, const ebpo_extent *around,
                               uint32_t most_visits, uint64_t *visits);

/* How far a place is from a face, fast, and what a moving ball and a face are to each other. */

typedef struct ebpo_face_near {
    double distance;
    double away[3];   /* unit vector from the nearest point of the face; 0 at distance 0 */
    double weight[3]; /* of the corners at the nearest point */
} ebpo_face_near;

/* In doubles: right within some ulps of the coordinates. */
void ebpo_face_nearest(const double p[3], const double face[3][3], ebpo_face_near *out);

typedef struct ebpo_ball_way {
    const double *from, *way; /* [3] */
    double reach, band;       /* the ball's radius; it touches if it is that much farther away */
    /* Going towards a face by less than this over the whole way is none; the least where the ball
     * is closer than its radius already. */
    double slack, least_slack;
} ebpo_ball_way;

/* The part 0 to 1 of the way at which the ball comes to touch the face, or a little less; 2 if it
 * does not. `away` as above there. */
double ebpo_ball_meets(const ebpo_ball_way *w, const double face[3][3], double away[3]);

/* False: the closed segment and the closed face have certainly no common point. True: they have
 * one, or numbers are so large or small that only integers of any size could tell. Faces without
 * area have none. No memory is taken. */
bool ebpo_segment_may_meet(const double p[3], const double q[3], const double face[3][3]);

/* How the winding number changes from p to q through the face: 1 from outside to inside, -1 back,
 * 0: they have no common point. EBPO_CROSSES_BADLY: through an edge, a corner, from or to the
 * face's plane, or perhaps not at all. No memory is taken. */
enum { EBPO_CROSSES_BADLY = 2 };

/* Nodes of the tree over a box's faces, the one with the least key first. A heap in an array that
 * its owner gives. */

typedef struct ebpo_near_node {
    double key; /* not NAN */
    uint64_t node;
} ebpo_near_node;

typedef struct ebpo_near_queue {
    ebpo_near_node *item; /* there is room for all that are pushed */
    uint64_t count;
} ebpo_near_queue;

void ebpo_near_push(ebpo_near_queue *queue, double key, uint64_t node);
/* item[0] is the first; this takes it out. */
ebpo_near_node ebpo_near_pop(ebpo_near_queue *queue);

/* On which side a probe is: its winding number, which exact arithmetic changes at each face that it
 * goes through. */

typedef struct ebpo_side {
    double at[3]; /* of this place, which is on no face, */
    int32_t winding;
    bool known;
    uint32_t turns; /* of ways around what is met badly */
} ebpo_side;

/* Goes on to `place`, as far as it gets with so little work: at most `most` faces for each of some
 * pieces, into found[most]. True: it is there. Else it stands where the winding number is known, or
 * has left the box (known is false then). */
bool ebpo_side_go(ebpo_side *side, const ebpo_face_box *box, const double place[3], uint32_t *found,
                  uint32_t most, uint32_t visits, uint64_t *work);

/* Whether a place is on a face: true also where that is not to be told without memory. */
bool ebpo_side_on(const ebpo_face_box *box, const double place[3], uint32_t *found, uint32_t most,
                  uint32_t visits);

#endif
