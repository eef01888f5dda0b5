/* Finds the nearest face: in one accel (acceleration structure of a subtree) (nearest.c), and in a
 * model under a budget (nearest_subtrees.c). */
#ifndef EBPO_QUERY_NEAREST_H
#define EBPO_QUERY_NEAREST_H

#include "core/os.h"
#include "geometry/distance.h"
#include "query/query_node.h"

/* Returns the exact sign of distance(p, a) - distance(p, b). Rarely slow, because it uses the
 * bounds of both distances. */
int ebpo_near_compare(const double p[3], const double a[3][3], const ebpo_distance_bounds *a_bounds,
                      const double b[3][3], const ebpo_distance_bounds *b_bounds);

/* --- a search, which may go through several accels --- */

typedef struct ebpo_nearest {
    double p[3];
    ebpo_far far;
    double key_limit; /* for a far point: faces with a greater key certainly do not matter */
    double limit;     /* faces that are farther away certainly do not matter */
    double upper;     /* upper bound of the distance to the model's nearest face, or INFINITY */
    bool found;
    ebpo_distance_bounds bounds; /* bounds of the distance of the nearest face so far, which is
                                  * called the winner below */
    ebpo_far_keys keys;          /* keys of the winner, for a far point */
    double triangle[3][3];
    uint64_t file_face, source_face;
    uint32_t block, node; /* block of the winner, and the node above it; EBPO_NO_BLOCK: the winner
                           * was known before */
    uint32_t first_block, first_node; /* block and node where a search starts, or EBPO_NO_BLOCK */
    uint64_t deadline;                /* time of ebpo_clock, or 0 */
    bool late;                        /* true once the deadline has passed */
    double passed_over;               /* lower bound of the part not visited before the deadline */
} ebpo_nearest;

/* Begins a search with nothing found. */
void ebpo_nearest_begin(ebpo_nearest *n, const ebpo_model *model, const double p[3],
                        double max_distance);

/* Returns the limit for bounds of nodes. */
static inline double ebpo_nearest_limit(const ebpo_nearest *n)
{
    return n->far.far ? n->key_limit : n->limit;
}
/* Records the bound of a part that is not visited because of the deadline. */
static inline void ebpo_nearest_pass_over(ebpo_nearest *n, double lower)
{
    double distance = n->far.far ? ebpo_far_lower(&n->far, lower) : lower;
    n->passed_over = distance < n->passed_over ? distance : n->passed_over;
}

/* Returns true once the deadline has passed. */
static inline bool ebpo_nearest_is_late(ebpo_nearest *n)
{
    return n->late = n->late || (n->deadline && ebpo_clock() > n->deadline);
}

/* Begins with a known face of the model. */
void ebpo_nearest_begin_with(ebpo_nearest *n, const double triangle[3][3], uint64_t file_face,
                             uint64_t source_face);

/* Begins with a block of the only accel that will be searched, and the node above the block. */
static inline void ebpo_nearest_begin_at(ebpo_nearest *n, uint32_t block, uint32_t node)
{
    n->first_block = block;
    n->first_node = node;
}

/* Searches all faces of a subtree. */
void ebpo_nearest_search(ebpo_nearest *n, const ebpo_context *context, const ebpo_accel *s);

/* Searches the faces that a leaf lists. */
void ebpo_nearest_leaf(ebpo_nearest *n, const ebpo_accel *s, const ebpo_accel_leaf *leaf);

/* Writes the result, without sign; if nothing is within the limit, the distance is INFINITY. */
void ebpo_nearest_end(const ebpo_nearest *n, double max_distance, ebpo_distance_result *out);

/* --- a context's queue ---
 *
 * Nodes to visit: the nearest first; of equally near nodes the one with the least entry first. */

EBPO_MUST_USE ebpo_status ebpo_queue_push(ebpo_context *context, const ebpo_ranked *item,
                                          ebpo_error *error);
/* Removes and returns the first node; the queue must not be empty. */
ebpo_ranked ebpo_queue_pop(ebpo_context *context);

/* --- deep bounds ---
 *
 * Deep bounds are nodes of the levels right below the cut, with their envelopes but without faces:
 * a few bytes for each node. They bound subtrees that have never been loaded more closely than the
 * subtrees' envelopes do, as skeletons (upper nodes of the hierarchies over faces)
 * (query/model_parts.h) bound subtrees that have been loaded. They are read at once, when queries
 * have loaded about as much without need as reading them costs, so that neither opening nor paths
 * wait for them. They are for local files only: for remote files one more request would cost as
 * much as it saves. They count towards the quota of skeletons. */

/* Reads the deep bounds once, unless the quota is too small or no levels exist below the cut. If
 * data cannot be read, queries that need them return the error later. */
void ebpo_deep_bounds_make(ebpo_model *model);

/* Counts subtrees without bounds that a query has loaded. Makes the deep bounds when enough have
 * been loaded. Any thread. */
void ebpo_deep_bounds_report(ebpo_model *model, unsigned loaded);

/* --- a model: as a whole, or subtree by subtree, the nearest first --- */

/* Visits nodes of the top and subtrees in the order of guaranteed lower bounds of their distance,
 * until the next bound is beyond the found distance. A subtree is searched, and loaded if needed,
 * only if its bound is at most the result, independent of the data in memory. After a deadline, the
 * first unvisited bound limits the result. */
EBPO_MUST_USE ebpo_status ebpo_nearest_first(ebpo_context *context, ebpo_nearest *search,
                                             ebpo_error *error);

#endif
