/* Loads the faces in a box, with a tree of boxes over them, for haptic steps; distances from these
 * faces, and the side of a point. The loading thread makes a box; a box never changes while a step
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
    ebpo_extent centres;      /* all faces within the margin of these positions are loaded */
    ebpo_extent loaded;       /* `centres`, widened by the margin: all faces that intersect this
                               * extent are loaded */
    uint64_t count, capacity; /* numbers of faces: loaded, at most */
    uint64_t leaves;          /* number of leaves of the tree: a power of two */
    double (*corner)[3][3];   /* [capacity] */
    uint64_t *face;           /* [capacity] face indices that callers get */
    ebpo_extent *node;        /* [2 leaves] the root is node 1, the children of node n are 2
                               * n and 2 n + 1 */
} ebpo_face_box;

EBPO_MUST_USE ebpo_status ebpo_face_box_new(ebpo_face_box *out, uint64_t capacity,
                                            ebpo_error *error);
void ebpo_face_box_free(ebpo_face_box *box);
/* Returns the bytes of memory of a box with this capacity. */
uint64_t ebpo_face_box_bytes(uint64_t capacity);
/* Returns the number of leaves of a tree over this many faces. */
uint64_t ebpo_face_box_leaves(uint64_t count);

/* Loads the faces within `margin` of the centres. *fits is false if there are more faces than the
 * box has memory for. */
EBPO_MUST_USE ebpo_status ebpo_face_box_load(ebpo_face_box *box, ebpo_context *context,
                                             const ebpo_extent *centres, double margin, bool *fits,
                                             ebpo_error *error);

/* Finds the faces whose boxes intersect `around`, and writes their positions in `corner` to
 * found[most]. Returns false if there are more than `most` faces, or more than *visits nodes to
 * visit; *count faces have then been found. *visits is reduced by the number of visited nodes. */
bool ebpo_face_box_find(const ebpo_face_box *box, const ebpo_extent *around, uint32_t *found,
                        uint32_t most, uint32_t *visits, uint32_t *count);

/* Returns a lower bound of the distance of `around` from the faces of the box. The bound is smaller
 * than necessary if the search ends at `max_visits` nodes. Adds the number of visited nodes to
 * *visits. */
double ebpo_face_box_gap(const ebpo_face_box *box, const ebpo_extent *around, uint32_t max_visits,
                         uint64_t *visits);

/* Distances of points and of moving balls from a face, in doubles. */

typedef struct ebpo_face_near {
    double distance;
    double away[3];   /* unit vector that points away from the nearest point of the face; 0 at
                       * distance 0 */
    double weight[3]; /* weights of the corners at the nearest point */
} ebpo_face_near;

/* Finds the point of the face that is nearest to p; correct to some ulps of the coordinates. */
void ebpo_face_nearest(const double p[3], const double face[3][3], ebpo_face_near *out);

/* A ball that moves along a straight path. */
typedef struct ebpo_ball_motion {
    const double *from, *motion; /* [3] first centre, and vector to the last one */
    double radius, band;         /* contact begins at a distance of radius + band */
    /* If the ball comes nearer to a face by less than this over the whole path, the face is
     * ignored. `least_slack` applies if the distance is less than the radius, `slack` otherwise. */
    double slack, least_slack;
} ebpo_ball_motion;

/* Returns the part of the path, 0 to 1 or slightly less, at which the ball touches the face; 2 if
 * it does not. `away` is as in ebpo_face_near, at that point. */
double ebpo_ball_first_contact(const ebpo_ball_motion *w, const double face[3][3], double away[3]);

/* Returns false if the closed segment and the closed face certainly have no common point. Returns
 * true if they have one, or if coordinates are so large or small that only integers of any size
 * could decide, for which memory would be allocated. Returns false for a face without area. */
bool ebpo_segment_may_intersect(const double p[3], const double q[3], const double face[3][3]);

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

/* The point of a probe with its winding number, which exact arithmetic changes at each face that
 * the probe crosses. */

typedef struct ebpo_side {
    double at[3]; /* the point of this winding number; it is on no face */
    int32_t winding;
    bool known;
    uint32_t random; /* state of the pseudorandom numbers that choose detours */
} ebpo_side;

/* Moves the point to `place`, as far as bounded work allows: in at most twelve attempts, each
 * with at most `most` faces and `visits` nodes. found[most] is workspace. Adds the number of faces
 * to *work. Returns true if `place` is reached. Otherwise the point stops where its winding
 * number is known, or it has left the box; `known` is then false. */
bool ebpo_side_move(ebpo_side *side, const ebpo_face_box *box, const double place[3],
                    uint32_t *found, uint32_t most, uint32_t visits, uint64_t *work);

/* Returns true if the point is on a face, or if bounded work without allocation cannot decide it.
 * found[most] is workspace. */
bool ebpo_is_on_face(const ebpo_face_box *box, const double place[3], uint32_t *found,
                     uint32_t most, uint32_t visits);

#endif
