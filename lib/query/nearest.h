/* The nearest face: in one accel (nearest.c), and in a model under a budget (nearest_subtrees.c).
 */
#ifndef EBPO_QUERY_NEAREST_H
#define EBPO_QUERY_NEAREST_H

#include "core/os.h"
#include "geometry/distance.h"
#include "query/query_node.h"

/* Sign of distance(p, a) - distance(p, b), exact; with what their bounds tell it is rarely costly.
 */
int ebpo_near_compare(const double p[3], const double a[3][3], const ebpo_distance_bounds *a_bounds,
                      const double b[3][3], const ebpo_distance_bounds *b_bounds);

/* --- a search, which may go through several accels --- */

typedef struct ebpo_nearest {
    double p[3];
    ebpo_far far;
    double key_limit; /* of a far point: what has a greater key does not matter; certain */
    double limit;     /* what is farther does not matter; certain */
    double upper;     /* some face of the model is at most so far away, or INFINITY */
    bool found;
    ebpo_distance_bounds bounds; /* of the winner */
    ebpo_far_keys keys;          /* likewise, where the point is far */
    double triangle[3][3];
    uint64_t file_face, source_face;
    uint32_t block, node;             /* of the winner; EBPO_NO_BLOCK: it was known from before */
    uint32_t first_block, first_node; /* where a search begins, or EBPO_NO_BLOCK */
    uint64_t deadline;                /* of ebpo_clock, or 0 */
    bool late;                        /* it passed */
    double passed_over;               /* lower bound of what was not looked at for want of time */
} ebpo_nearest;

/* Nothing found yet. */
void ebpo_nearest_begin(ebpo_nearest *n, const ebpo_model *model, const double p[3],
                        double max_distance);

/* Bounds of nodes are compared with this. */
static inline double ebpo_nearest_limit(const ebpo_nearest *n)
{
    return n->far.far ? n->key_limit : n->limit;
}
/* A bound that is not gone into for want of time. */
static inline void ebpo_nearest_pass_over(ebpo_nearest *n, double lower)
{
    double distance = n->far.far ? ebpo_far_lower(&n->far, lower) : lower;
    n->passed_over = distance < n->passed_over ? distance : n->passed_over;
}

/* True from the first time on that the deadline is found to have passed. */
static inline bool ebpo_nearest_is_late(ebpo_nearest *n)
{
    return n->late = n->late || (n->deadline && ebpo_clock() > n->deadline);
}

/* Begins with a face of the model that is known from before. */
void ebpo_nearest_begin_with(ebpo_nearest *n, const double triangle[3][3], uint64_t file_face,
                             uint64_t source_face);

/* Begins with a block of the accel that will be searched, the only one, and the node above it. */
static inline void ebpo_nearest_begin_at(ebpo_nearest *n, uint32_t block, uint32_t node)
{
    n->first_block = block;
    n->first_node = node;
}

/* Searches all faces of a subtree. */
void ebpo_nearest_search(ebpo_nearest *n, const ebpo_context *context, const ebpo_accel *s);

/* Looks at the faces that a leaf lists. */
void ebpo_nearest_leaf(ebpo_nearest *n, const ebpo_accel *s, const ebpo_accel_leaf *leaf);

/* The answer but for its sign; nothing within the limit: INFINITY. */
void ebpo_nearest_end(const ebpo_nearest *n, double max_distance, ebpo_distance_result *out);

/* --- a context's queue ---
 *
 * Nodes to be come to: the nearest first, of equal ones that with the least
 * entry. */

EBPO_MUST_USE ebpo_status ebpo_queue_push(ebpo_context *context, const ebpo_ranked *item,
                                          ebpo_error *error);
/* Of a queue that is not empty. */
ebpo_ranked ebpo_queue_pop(ebpo_context *context);

/* --- deep bounds ---
 *
 * Nodes of the levels right below the cut, with their envelopes and nothing of their faces: a few
 * bytes for each. They tell of subtrees that have never been loaded what their own envelopes do
 * not, as skeletons (query/model_parts.h) tell of those that have. Read at once, when questions
 * have loaded about as much for nothing as reading them takes, so that neither opening nor paths
 * wait for them; of local files only: of others a request more would cost what it saves. Counted
 * with skeletons, and of their room. */

/* Reads them, unless there is no room, or nothing below the cut. Once; what cannot be read will
 * be told by the questions that come to it. */
void ebpo_deep_bounds_make(ebpo_model *model);

/* A question has loaded so many subtrees of which nothing was known. Makes them when it is time.
 * Any thread. */
void ebpo_deep_bounds_tell(ebpo_model *model, unsigned loaded);

/* --- a model: all of it, or subtree by subtree, the nearest first --- */

/* Nodes of the top and subtrees are come to in the order of certain lower bounds of their distance,
 * until the next is beyond what has been found: a subtree is searched, and loaded if need be, only
 * if its bound is at most the answer, whatever else is in memory. Under a deadline, the first bound
 * that was not come to is what was passed over. */
EBPO_MUST_USE ebpo_status ebpo_nearest_first(ebpo_context *context, ebpo_nearest *search,
                                             ebpo_error *error);

#endif
