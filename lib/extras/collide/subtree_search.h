/* Visits pairs of nodes of two posed trees, the smallest gap of envelopes first. One thread. */
#ifndef EBPO_COLLIDE_SUBTREE_SEARCH_H
#define EBPO_COLLIDE_SUBTREE_SEARCH_H

#include "extras/collide/collider.h"
#include "extras/collide/posed_subtrees.h"

/* A node of each model, both with content; `gap`: lower bound of their distance. */
typedef struct ebpo_node_gap {
    ebpo_posed_node node[2];
    double gap;
} ebpo_node_gap;

/* Heap of pairs of nodes. Zero at first. */
typedef struct ebpo_node_gaps {
    ebpo_posed_subtrees side[2];
    double reach;        /* bound of posed coordinates */
    ebpo_node_gap *heap; /* a heap: the least gap first */
    uint64_t count, capacity;
} ebpo_node_gaps;

/* Begins a heap, which must be freed, also after a failure. */
EBPO_MUST_USE ebpo_status ebpo_node_gaps_begin(ebpo_node_gaps *g, const ebpo_collision *collision,
                                               ebpo_error *error);
void ebpo_node_gaps_free(ebpo_node_gaps *g);

EBPO_MUST_USE ebpo_status ebpo_node_gaps_push(ebpo_node_gaps *g, const ebpo_node_gap *pair,
                                              ebpo_error *error);
/* Removes and returns the pair with the least gap; the heap must not be empty. */
ebpo_node_gap ebpo_node_gaps_pop(ebpo_node_gaps *g);

/* Computes a guaranteed lower bound of the gap of two nodes' envelopes, 0 or more. */
EBPO_MUST_USE ebpo_status ebpo_node_gap_of(ebpo_node_gaps *g, const ebpo_posed_node node[2],
                                           double *out, ebpo_error *error);
/* Returns an upper bound of the distance of two nodes that each have a face in or near their cell.
 */
double ebpo_node_far_bound(const ebpo_node_gaps *g, const ebpo_posed_node node[2]);
/* Returns which of two nodes is divided first; both are gray, or neither is. */
int ebpo_node_larger(const ebpo_node_gaps *g, const ebpo_posed_node node[2]);

/* A node may list a face that is outside its cell but near it: within 1/256 of the cell's size on
 * each axis (format-spec, section 7). This value adds a margin for rounding. */
#define EBPO_NEAR_SHARE 0x1.1p-8

/* Zero at first. */
typedef struct ebpo_subtree_search {
    const ebpo_collision *collision;
    ebpo_node_gaps nodes;
    ebpo_context *context[2]; /* for models in parts */
    bool *visited[2];         /* visited subtrees */
    uint64_t read_before;
} ebpo_subtree_search;

/* Begins a search, which must be freed, also after a failure. */
EBPO_MUST_USE ebpo_status ebpo_subtree_search_begin(ebpo_subtree_search *s,
                                                    const ebpo_collision *collision,
                                                    ebpo_error *error);
/* Adds the loads and bytes read to the collider's counts. */
void ebpo_subtree_search_end(ebpo_subtree_search *s);

/* Returns which of two nodes is divided; -1: neither, the pair is to be visited. */
int ebpo_subtree_search_side(const ebpo_subtree_search *s, const ebpo_posed_node node[2]);

/* Returns the accels of two undivided nodes, loaded if necessary; they are valid until the next
 * call. *any is false if there is nothing to visit, or if the pair was visited before. */
EBPO_MUST_USE ebpo_status ebpo_subtree_search_load(ebpo_subtree_search *s,
                                                   const ebpo_posed_node node[2],
                                                   const ebpo_accel *accel[2], bool *any,
                                                   ebpo_error *error);

#endif
