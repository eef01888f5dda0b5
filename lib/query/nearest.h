/* Finds the nearest face: in one accel (acceleration structure of a subtree, accel.h; nearest.c),
 * and in a model that is loaded subtree by subtree (nearest_subtrees.c). */
#ifndef EBPO_QUERY_NEAREST_H
#define EBPO_QUERY_NEAREST_H

#include "core/os.h"
#include "geometry/distance.h"
#include "query/query_node.h"

/* Returns the exact sign of distance(p, a) - distance(p, b). The function is fast if the bounds of
 * the two distances do not overlap. */
int ebpo_near_compare(const double p[3], const double a[3][3], const ebpo_distance_bounds *a_bounds,
                      const double b[3][3], const ebpo_distance_bounds *b_bounds);

/* --- a search, which may go through several accels --- */

/* A far point is a point so far from the model that keys replace distances (point_bounds.h). The
 * *winner* is the nearest face so far. */
typedef struct ebpo_nearest {
    double p[3]; /* the query's point */
    ebpo_far far;
    double key_limit; /* for a far point: faces with a greater key are certainly not the result */
    double limit;     /* faces that are farther away are certainly not the result */
    double upper;     /* upper bound of the distance to the model's nearest face, or INFINITY */
    bool found;       /* there is a winner; the fields `bounds` to `node` are valid */
    ebpo_distance_bounds bounds; /* bounds of the winner's distance */
    ebpo_far_keys keys;          /* for a far point: bounds of the winner's key */
    double triangle[3][3];       /* corners of the winner */
    uint64_t file_face;          /* index of the winner in the file */
    uint32_t block, node; /* block of the winner, and the node above the block; EBPO_NO_BLOCK: the
                           * winner was known before the search */
    uint32_t first_block, first_node; /* block and node where a search starts, or EBPO_NO_BLOCK */
    uint64_t deadline;                /* a time of ebpo_clock; 0: none */
    bool late;                        /* the deadline has passed */
    double passed_over; /* lower bound of the distance of all parts that were not visited because
                         * of the deadline; INFINITY: none */
} ebpo_nearest;

/* Begins a search with nothing found. */
void ebpo_nearest_begin(ebpo_nearest *n, const ebpo_model *model, const double p[3],
                        double max_distance);

/* Returns the limit for lower bounds of nodes: a limit of keys for a far point, otherwise a limit
 * of distances. */
static inline double ebpo_nearest_limit(const ebpo_nearest *n)
{
    return n->far.far ? n->key_limit : n->limit;
}
/* Records that a part of the model is not visited because of the deadline. `lower`: lower bound of
 * the part (a distance, or a key for a far point). */
static inline void ebpo_nearest_pass_over(ebpo_nearest *n, double lower)
{
    double distance = n->far.far ? ebpo_far_lower(&n->far, lower) : lower;
    n->passed_over = distance < n->passed_over ? distance : n->passed_over;
}

/* Returns true if the deadline has passed. */
static inline bool ebpo_nearest_is_late(ebpo_nearest *n)
{
    return n->late = n->late || (n->deadline && ebpo_clock() > n->deadline);
}

/* Makes a known face of the model the winner, if it is within the limit. */
void ebpo_nearest_begin_with(ebpo_nearest *n, const double triangle[3][3], uint64_t file_face);

/* Sets the block where the search starts, and the node above it. Only one accel may then be
 * searched: the accel of this block. */
static inline void ebpo_nearest_begin_at(ebpo_nearest *n, uint32_t block, uint32_t node)
{
    n->first_block = block;
    n->first_node = node;
}

/* Searches all faces of a subtree. */
void ebpo_nearest_search(ebpo_nearest *n, const ebpo_context *context, const ebpo_accel *s);

/* Searches the faces that a leaf lists. */
void ebpo_nearest_leaf(ebpo_nearest *n, const ebpo_accel *s, const ebpo_accel_leaf *leaf);

/* Writes the result, without sign. If no face is within max_distance, the distance is INFINITY. */
EBPO_MUST_USE ebpo_status ebpo_nearest_end(const ebpo_nearest *n, const ebpo_model *model,
                                           double max_distance, ebpo_distance_result *out,
                                           ebpo_error *error);

/* --- a context's queue ---
 *
 * The queue has the nodes that are still to be visited, ordered by their lower bounds; nodes with
 * equal bounds are ordered by ebpo_node.entry. */

EBPO_MUST_USE ebpo_status ebpo_queue_push(ebpo_context *context, const ebpo_ranked *item,
                                          ebpo_error *error);
/* Removes and returns the first node; the queue must not be empty. */
ebpo_ranked ebpo_queue_pop(ebpo_context *context);

/* --- deep bounds ---
 *
 * Deep bounds are nodes of the first levels below the cut level (at which the roots of subtrees
 * are), with their envelopes but without faces: a few bytes for each node. For a subtree that was
 * never loaded, they give a better bound than the envelope of the subtree's root. (For a subtree
 * that was loaded before, its skeleton gives a good bound: query/model_parts.h.) All deep bounds
 * are read together, after queries have spent about as much time on loading subtrees without need
 * as reading deep bounds takes. So they delay neither opening a model nor queries along a path.
 * Their memory counts towards the quota of skeletons. Queries of a remote file do not use them, but
 * read the same envelopes of the subtrees near the point only (load_ahead.h), as soon as many of
 * these subtrees may have the nearest face. For 11 points deep inside a model of 4.3 million faces,
 * a query takes 266 requests and 7.57 MB without envelopes, 24 requests and 1.42 MB with them. */

/* Reads deep bounds of EBPO_DEEP_LEVELS levels, or of fewer levels if the quota is too small or the
 * file has fewer levels below the cut level. Does nothing if some were read before. If the file
 * cannot be read, later queries fail. */
void ebpo_deep_bounds_make(ebpo_model *model);

/* Counts `loaded` subtrees that a query has loaded and that had no skeleton before. Makes the deep
 * bounds when enough such subtrees have been loaded. Any thread may call this function. */
void ebpo_deep_bounds_report(ebpo_model *model, unsigned loaded);

/* --- a model --- */

/* Finds the nearest face of a model. If the model is not completely in memory, visits nodes of the
 * top and subtrees in the order of guaranteed lower bounds of their distance. The search ends when
 * the next bound is beyond the found distance. So a subtree is searched, and loaded if needed, only
 * if its bound is at most the result. This is true whichever subtrees are in memory. After a
 * deadline, the least bound that was not visited is in search->passed_over. */
EBPO_MUST_USE ebpo_status ebpo_nearest_first(ebpo_context *context, ebpo_nearest *search,
                                             ebpo_error *error);

#endif
