/* The nearest face: a search that may go through several subtrees. */
#ifndef EBPO_QUERY_NEAREST_H
#define EBPO_QUERY_NEAREST_H

#include "geometry/distance.h"
#include "query/query_node.h"

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

#endif
