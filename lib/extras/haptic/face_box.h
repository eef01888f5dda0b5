/* Loads the faces in a box, with a tree of boxes over the faces, for haptic steps (cycles of the
 * force computation). Computes distances from these faces, and the winding number of a moving
 * point. The loading thread makes a box; a box never changes while a step uses it. */
#ifndef EBPO_HAPTIC_FACE_BOX_H
#define EBPO_HAPTIC_FACE_BOX_H

#include <stdbool.h>
#include <stdint.h>

#include <ebpo/query.h>

#include "extras/collide/posed_solid.h"

/* Number of faces of a leaf of the tree. */
enum { EBPO_FACE_BOX_LEAF = 8 };

/* A box along the axes. */
typedef struct ebpo_extent {
    double min[3], max[3];
} ebpo_extent;

/* Returns true if `e` contains p. */
static inline bool ebpo_extent_holds(const ebpo_extent *e, const double p[3])
{
    for (int i = 0; i < 3; i++)
        if (!(p[i] >= e->min[i] && p[i] <= e->max[i]))
            return false;
    return true;
}

typedef struct ebpo_face_box {
    uint64_t serial;     /* differs for each filling of the boxes of an object; at least 1 */
    ebpo_extent allowed; /* allowed positions of the proxy: all faces that are not farther from one
                            of these positions than the margin are loaded */
    ebpo_extent loaded;  /* `allowed`, widened by the margin: all faces that intersect this
                          * extent are loaded */
    uint64_t count, capacity; /* number of loaded faces; greatest possible number */
    uint64_t leaves;          /* number of leaves of the tree: a power of two */
    double (*corner)[3][3];   /* [capacity] in the world: posed coordinates */
    uint64_t *face;           /* [capacity] face indices for the caller (ebpo_triangles.faces) */
    uint32_t *instance;       /* [capacity] index of the instance that has the face */
    ebpo_extent *node;        /* [2 leaves] the root is node 1, the children of node n are 2
                               * n and 2 n + 1 */
} ebpo_face_box;

EBPO_MUST_USE ebpo_status ebpo_face_box_new(ebpo_face_box *out, uint64_t capacity,
                                            ebpo_error *error);
void ebpo_face_box_free(ebpo_face_box *box);
/* Returns the bytes of memory of a box with this capacity. */
uint64_t ebpo_face_box_bytes(uint64_t capacity);
/* Returns the number of leaves of a tree over `count` faces. */
uint64_t ebpo_face_box_leaves(uint64_t count);

/* Empties a box, whose faces will be those within `margin` of the box `allowed`. */
void ebpo_face_box_begin(ebpo_face_box *box, uint64_t serial, const ebpo_extent *allowed,
                         double margin);
/* Adds the faces of an instance of the context's model. posed: its pose; NULL: the coordinates of
 * the model are those of the world. *fits is false if the box has too little memory for these
 * faces. */
EBPO_MUST_USE ebpo_status ebpo_face_box_add(ebpo_face_box *box, ebpo_context *context,
                                            const ebpo_posed_solid *posed, uint32_t instance,
                                            bool *fits, ebpo_error *error);
/* Makes the tree over the faces of all instances. */
void ebpo_face_box_end(ebpo_face_box *box);

/* Finds the faces whose boxes intersect `around`, and writes their indices in box->corner to
 * found[most]. Sets *count to their number. Reduces *visits by the number of visited nodes. Returns
 * false if there are more than `most` faces, or if *visits is too small to visit all nodes that are
 * needed. Then *count faces have been found. */
bool ebpo_face_box_find(const ebpo_face_box *box, const ebpo_extent *around, uint32_t *found,
                        uint32_t most, uint32_t *visits, uint32_t *count);

/* Returns a lower bound of the distance of `around` from the faces of the box, at most `most`: the
 * search visits no farther nodes. The bound is less accurate if the search ends because of
 * max_visits, the limit of visited nodes. Adds the number of visited nodes to *visits. *leaf: a
 * leaf that may be near, at which the search begins; any value is valid. It is set to the nearest
 * leaf that was visited, if that one is nearer than `most`. */
double ebpo_face_box_gap(const ebpo_face_box *box, const ebpo_extent *around, double most,
                         uint32_t max_visits, uint64_t *leaf, uint64_t *visits);

/* --- distances of points and of moving balls from a face, in doubles --- */

/* The nearest point of a face. */
typedef struct ebpo_face_near {
    double distance;
    double away[3];   /* unit vector from the nearest point of the face to the query point; 0 if the
                       * distance is 0 */
    double weight[3]; /* weights of the corners at the nearest point */
} ebpo_face_near;

/* Finds the point of the face that is nearest to p, with an error of some ulps of the coordinates.
 */
void ebpo_face_nearest(const double p[3], const double face[3][3], ebpo_face_near *out);

/* A ball that moves along a straight path. */
typedef struct ebpo_ball_motion {
    const double *from, *motion; /* [3] first centre, and vector to the last centre */
    double radius, band;         /* contact begins at a distance of radius + band */
    /* A face is ignored if the ball's distance from the face decreases by less than a slack over
     * the whole path. This slack is `least_slack` while the distance is at most the radius, and
     * `slack` while the distance is greater. Both are lengths. */
    double slack, least_slack;
} ebpo_ball_motion;

/* Returns the fraction of the path, 0 to 1, after which the ball touches the face; the result may
 * be slightly too small. Returns 2 if the ball does not touch the face. `away` is set as in
 * ebpo_face_near, for the ball's centre at the returned fraction. */
double ebpo_ball_first_contact(const ebpo_ball_motion *ball, const double face[3][3],
                               double away[3]);

/* Returns false if the segment pq, with its ends, and the face, with its edges, certainly have no
 * common point. Returns true if they have a common point. Also returns true if coordinates are so
 * large or small that only GMP integers could decide, because GMP allocates memory. Returns false
 * for a face without area. */
bool ebpo_segment_may_intersect(const double p[3], const double q[3], const double face[3][3]);

/* --- a heap of nodes of the tree over a box's faces --- */

typedef struct ebpo_near_node {
    double key; /* not NAN */
    uint64_t node;
} ebpo_near_node;

/* The heap; item[0] has the least key. */
typedef struct ebpo_near_queue {
    ebpo_near_node *item; /* the caller's array, with space for all nodes that are pushed */
    uint64_t count;
} ebpo_near_queue;

void ebpo_near_push(ebpo_near_queue *queue, double key, uint64_t node);
/* Removes and returns item[0], the node with the least key. */
ebpo_near_node ebpo_near_pop(ebpo_near_queue *queue);

/* A point whose winding number in an instance is known. When the point moves, the winding number
 * changes at each face of the instance that it crosses, by exact arithmetic. */
typedef struct ebpo_known_winding {
    uint32_t instance;
    double at[3];    /* the point; it is on no face */
    int32_t winding; /* winding number at the point */
    bool known;      /* false: there is no such point, and `at` and `winding` are not valid */
    uint32_t random; /* state of the pseudorandom numbers that choose detours */
} ebpo_known_winding;

/* Moves the point to `place`. The work is bounded: at most twelve attempts, each with at most
 * `most` faces and `visits` nodes. found[most] is workspace. Adds the number of faces to *work.
 * Returns true if the point is now at `place`. If not, the point is at the last position whose
 * winding number was found; if this position is outside box->allowed, `known` is false. */
bool ebpo_known_winding_move(ebpo_known_winding *start, const ebpo_face_box *box,
                             const double place[3], uint32_t *found, uint32_t most, uint32_t visits,
                             uint64_t *work);

/* Returns true if the point is on a face of the instance, or if coordinates are so large or small
 * that this cannot be decided without allocating memory. Returns false if it is on no face, or if
 * more than `most` faces and `visits` nodes would have to be examined. found[most] is workspace. */
bool ebpo_is_on_face(const ebpo_face_box *box, uint32_t instance, const double place[3],
                     uint32_t *found, uint32_t most, uint32_t visits);

#endif
