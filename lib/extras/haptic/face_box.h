/* The faces in a box, with a tree of boxes over them, for haptic steps; distances from faces and
 * the side of a point. The loading thread makes a box; a box never changes while a step uses it. */
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
    /* Box of ball centres for which all faces within the margin are loaded. */
    ebpo_extent centres;
    ebpo_extent loaded;               /* all faces that intersect this extent are in the box */
    uint64_t count, capacity, leaves; /* leaves: a power of two */
    double (*corner)[3][3];           /* [capacity] */
    uint64_t *face;                   /* [capacity] face numbers that callers get */
    ebpo_extent *node;                /* [2 leaves] the root is node 1, the children of node n are 2
                                       * n and 2 n + 1 */
} ebpo_face_box;

EBPO_MUST_USE ebpo_status ebpo_face_box_new(ebpo_face_box *out, uint64_t capacity,
                                            ebpo_error *error);
void ebpo_face_box_free(ebpo_face_box *box);
uint64_t ebpo_face_box_bytes(uint64_t capacity);
uint64_t ebpo_face_box_leaves(uint64_t capacity); /* Returns the maximum number of leaves of a box's
                                                   * tree. */

/* Loads the faces within `margin` of the centres. *fits is false if there are more faces than the
 * box has memory for. */
EBPO_MUST_USE ebpo_status ebpo_face_box_load(ebpo_face_box *box, ebpo_context *context,
                                             const ebpo_extent *centres, double margin, bool *fits,
                                             ebpo_error *error);

/* Finds faces whose boxes intersect `around`, into found[most]. Returns false if there are more
 * than `most` faces, or more than *visits nodes to visit. *visits is reduced by the number of
 * visited nodes. */
bool ebpo_face_box_find(const ebpo_face_box *box, const ebpo_extent *around, uint32_t *found,
                        uint32_t most, uint32_t *visits, uint32_t *count);

/* Returns a lower bound of the distance of `around` from the faces of the box. The bound is weaker
 * when the limit of nodes is reached. Adds the visited nodes to *visits. */
double ebpo_face_box_clearance(const ebpo_face_box *box, const ebpo_extent *around,
                               uint32_t max_visits, uint64_t *visits);

/* The distance of a point from a face, computed fast; moving balls use it, too. */

typedef struct ebpo_face_near {
    double distance;
    double away[3];   /* unit vector that points away from the nearest point of the face; 0 at
                       * distance 0 */
    double weight[3]; /* weights of the corners at the nearest point */
} ebpo_face_near;

/* Computes in doubles: correct to some ulps of the coordinates. */
void ebpo_face_nearest(const double p[3], const double face[3][3], ebpo_face_near *out);

typedef struct ebpo_ball_motion {
    const double *from, *motion; /* [3] */
    double reach, band; /* the ball's radius; contact begins at a distance of reach + band */
    /* An approach to a face by less than this over the whole path is ignored. least_slack applies
     * where the ball is already closer than its radius. */
    double slack, least_slack;
} ebpo_ball_motion;

/* Returns the part of the path, 0 to 1 or slightly less, at which the ball touches the face; 2 if
 * it does not. `away` is as in ebpo_face_near, at that point. */
double ebpo_ball_intersects(const ebpo_ball_motion *w, const double face[3][3], double away[3]);

/* Returns false if the closed segment and the closed face certainly have no common point. Returns
 * true if they have one, or if numbers are so large or small that only integers of any size could
 * decide. A face without area has no common point. Allocates no memory. */
bool ebpo_segment_may_intersect(const double p[3], const double q[3], const double face[3][3]);

/* Returns the change of the winding number from p to q by this face: 1 from outside to inside, -1
 * from inside to outside, 0 without a common point. EBPO_CROSSES_BADLY: the segment crosses an edge
 * or a corner, begins or ends in the face's plane, or it cannot be decided whether they have a
 * common point. Allocates no memory. */
enum { EBPO_CROSSES_BADLY = 2 };

/* A heap of nodes of the tree over a box's faces, the least key first. The caller owns the array.
 */

typedef struct ebpo_near_node {
    double key; /* not NAN */
    uint64_t node;
} ebpo_near_node;

typedef struct ebpo_near_queue {
    ebpo_near_node *item; /* space for all nodes that are pushed */
    uint64_t count;
} ebpo_near_queue;

void ebpo_near_push(ebpo_near_queue *queue, double key, uint64_t node);
/* Removes and returns item[0], the node with the least key. */
ebpo_near_node ebpo_near_pop(ebpo_near_queue *queue);

/* The side of a probe: its winding number, which exact arithmetic changes at each face that the
 * probe crosses. */

typedef struct ebpo_side {
    double at[3]; /* the point of this winding number; it is on no face */
    int32_t winding;
    bool known;
    uint32_t turns; /* number of detours around degenerate crossings */
} ebpo_side;

/* Moves the side to `place`, as far as bounded work allows: in a few pieces of path, with at most
 * `most` faces each (their indices are in found[most]). Returns true if `place` is reached.
 * Otherwise the side stops at a point with a known winding number, or has left the box (then
 * `known` is false). */
bool ebpo_side_go(ebpo_side *side, const ebpo_face_box *box, const double place[3], uint32_t *found,
                  uint32_t most, uint32_t visits, uint64_t *work);

/* Returns true if the point is on a face, or if that cannot be decided without memory. */
bool ebpo_side_on(const ebpo_face_box *box, const double place[3], uint32_t *found, uint32_t most,
                  uint32_t visits);

#endif
