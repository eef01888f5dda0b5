/* Visits pairs of nodes of two posed trees, the pair with the least gap of its envelopes first. For
 * one thread at a time. */
#ifndef EBPO_COLLIDE_SUBTREE_SEARCH_H
#define EBPO_COLLIDE_SUBTREE_SEARCH_H

#include "extras/collide/collider.h"
#include "extras/collide/posed_subtrees.h"

/* A pair of nodes, one of each model, that both have faces. */
typedef struct ebpo_node_gap {
    ebpo_posed_node node[2];
    double gap; /* lower bound of the distance of their faces */
} ebpo_node_gap;

/* A heap of pairs of nodes. Zero before ebpo_node_gaps_begin. */
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

/* Adds a pair to the heap. */
EBPO_MUST_USE ebpo_status ebpo_node_gaps_push(ebpo_node_gaps *g, const ebpo_node_gap *pair,
                                              ebpo_error *error);
/* Removes and returns the pair with the least gap; the heap must not be empty. */
ebpo_node_gap ebpo_node_gaps_pop(ebpo_node_gaps *g);

/* Sets *out to a guaranteed lower bound, 0 or more, of the distance of the envelopes of two nodes.
 */
EBPO_MUST_USE ebpo_status ebpo_node_gap_of(ebpo_node_gaps *g, const ebpo_posed_node node[2],
                                           double *out, ebpo_error *error);
/* Returns an upper bound of the distance of the faces of two nodes, which each have a face in or
 * near their cell. */
double ebpo_node_far_bound(const ebpo_node_gaps *g, const ebpo_posed_node node[2]);
/* Returns the index, 0 or 1, of the node with the larger cell. Both nodes are gray, or neither is.
 */
int ebpo_node_larger(const ebpo_node_gaps *g, const ebpo_posed_node node[2]);

/* A node may list a face that is outside its cell but near it: within 1/256 of the cell's size on
 * each axis (format-spec, section 7). This value adds a margin for rounding. */
#define EBPO_FACE_MARGIN 0x1.1p-8

/* A search through the subtrees of a query's models. Zero before ebpo_subtree_search_begin. */
typedef struct ebpo_subtree_search {
    const ebpo_collision *collision;
    ebpo_node_gaps nodes;
    ebpo_context *context[2]; /* for partly loaded models */
    bool *visited[2];         /* [subtree] true after its first visit */
    uint64_t read_before;     /* bytes that had been read before the search */
} ebpo_subtree_search;

/* Begins a search, which must be ended, also after a failure. */
EBPO_MUST_USE ebpo_status ebpo_subtree_search_begin(ebpo_subtree_search *s,
                                                    const ebpo_collision *collision,
                                                    ebpo_error *error);
/* Adds the loads and bytes read to the collider's counts, and frees the search. */
void ebpo_subtree_search_end(ebpo_subtree_search *s);

/* Returns the index, 0 or 1, of the node that is divided next; -1: neither is divided, but the pair
 * of subtrees is loaded. */
int ebpo_subtree_search_side(const ebpo_subtree_search *s, const ebpo_posed_node node[2]);

/* Sets accel (acceleration structure of a subtree)[2] to the hierarchies of two subtrees, loaded if
 * necessary; they are valid until the next call. *loaded is false, and nothing is set, if a subtree
 * has no faces or the pair was visited before. */
EBPO_MUST_USE ebpo_status ebpo_subtree_search_load(ebpo_subtree_search *s,
                                                   const ebpo_posed_node node[2],
                                                   const ebpo_accel *accel[2], bool *loaded,
                                                   ebpo_error *error);

#endif
