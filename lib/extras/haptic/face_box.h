/* The faces in a box with a tree of boxes over them, for haptic steps; distances from faces and the
 * side of a point. The loading thread makes a box; it never changes while a step uses it. */
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
    /* Centres of balls for which the box has all faces within the margin. */
    ebpo_extent centres;
    ebpo_extent loaded;               /* the box has all faces that intersect it */
    uint64_t count, capacity, leaves; /* leaves: a power of two */
    double (*corner)[3][3];           /* [capacity] */
    uint64_t *face;                   /* [capacity] numbers for callers */
    ebpo_extent *node;                /* [2 leaves] the root is 1, children of n are 2 n, 2 n + 1 */
} ebpo_face_box;

EBPO_MUST_USE ebpo_status ebpo_face_box_new(ebpo_face_box *out, uint64_t capacity,
                                            ebpo_error *error);
void ebpo_face_box_free(ebpo_face_box *box);
uint64_t ebpo_face_box_bytes(uint64_t capacity);
uint64_t ebpo_face_box_leaves(uint64_t capacity); /* Returns the most leaves of its tree. */

/* Loads the faces within `margin` of the centres. *fits is false if there are more than there is
 * memory for. */
EBPO_MUST_USE ebpo_status ebpo_face_box_load(ebpo_face_box *box, ebpo_context *context,
                                             const ebpo_extent *centres, double margin, bool *fits,
                                             ebpo_error *error);

/* Finds faces whose boxes intersect `around`, into found[most]. Returns false if there are more, or
 * more than *visits nodes to visit; *visits is reduced by the visited nodes. */
bool ebpo_face_box_find(const ebpo_face_box *box, const ebpo_extent *around, uint32_t *found,
                        uint32_t most, uint32_t *visits, uint32_t *count);

/* Returns a lower bound of the distance of `around` from the faces of the box; it is weaker when
 * the limit of nodes is reached. *visits counts them. */
double ebpo_face_box_clearance(const ebpo_face_box *box, const ebpo_extent *around,
                               uint32_t max_visits, uint64_t *visits);

/* Distance of a point from a face, computed fast; also for a moving ball. */

typedef struct ebpo_face_near {
    double distance;
    double away[3];   /* unit vector from the nearest point of the face; 0 at distance 0 */
    double weight[3]; /* weights of the corners at the nearest point */
} ebpo_face_near;

/* Computes in doubles: correct to some ulps of the coordinates. */
void ebpo_face_nearest(const double p[3], const double face[3][3], ebpo_face_near *out);

typedef struct ebpo_ball_way {
    const double *from, *way; /* [3] */
    double reach, band;       /* the ball's radius; contact begins at that distance plus the band */
    /* An approach to a face by less than this over the whole path is none; least_slack where the
     * ball is closer than its radius already. */
    double slack, least_slack;
} ebpo_ball_way;

/* Returns the part 0 to 1 of the path at which the ball touches the face, or a little less; 2 if it
 * does not. `away` as above at that point. */
double ebpo_ball_intersects(const ebpo_ball_way *w, const double face[3][3], double away[3]);

/* Returns false if the closed segment and the closed face certainly have no common point; true if
 * they have one, or if numbers are so large or small that only integers of any size could decide.
 * Faces without area have none. Allocates no memory. */
bool ebpo_segment_may_intersect(const double p[3], const double q[3], const double face[3][3]);

/* Returns the change of the winding number from p to q through the face: 1 from outside to inside,
 * -1 back, 0: no common point. EBPO_CROSSES_BADLY: through an edge, a corner, from or to the face's
 * plane, or perhaps not at all. Allocates no memory. */
enum { EBPO_CROSSES_BADLY = 2 };

/* A heap of nodes of the tree over a box's faces, the least key first, in an array of its owner. */

typedef struct ebpo_near_node {
    double key; /* not NAN */
    uint64_t node;
} ebpo_near_node;

typedef struct ebpo_near_queue {
    ebpo_near_node *item; /* with space for all that are pushed */
    uint64_t count;
} ebpo_near_queue;

void ebpo_near_push(ebpo_near_queue *queue, double key, uint64_t node);
/* Removes and returns item[0], the first. */
ebpo_near_node ebpo_near_pop(ebpo_near_queue *queue);

/* The side of a probe: its winding number, which exact arithmetic changes at each face that it
 * crosses. */

typedef struct ebpo_side {
    double at[3]; /* for this point, which is on no face */
    int32_t winding;
    bool known;
    uint32_t turns; /* number of detours around degenerate crossings */
} ebpo_side;

/* Continues to `place`, as far as bounded work allows: at most `most` faces for each of some
 * pieces, into found[most]. Returns true if it is there. Otherwise it stops where the winding
 * number is known, or has left the box (then known is false). */
bool ebpo_side_go(ebpo_side *side, const ebpo_face_box *box, const double place[3], uint32_t *found,
                  uint32_t most, uint32_t visits, uint64_t *work);

/* Returns true if the point is on a face, or if that cannot be decided without memory. */
bool ebpo_side_on(const ebpo_face_box *box, const double place[3], uint32_t *found, uint32_t most,
                  uint32_t visits);

#endif
