/* Visits pairs of nodes of two posed trees. The pair with the least gap is visited first; the gap
 * of a pair is a lower bound of the distance of both nodes' envelopes (posed_subtrees.h). A search
 * is for one thread at a time. */
#ifndef EBPO_COLLIDE_SUBTREE_SEARCH_H
#define EBPO_COLLIDE_SUBTREE_SEARCH_H

#include "extras/collide/collider.h"
#include "extras/collide/posed_subtrees.h"

/* A pair of a node of each model. */
typedef struct ebpo_node_gap {
    ebpo_posed_node node[2];
    double gap; /* key of the heap: lower bound of the distance of the nodes' contents */
} ebpo_node_gap;

/* A heap of pairs of nodes. Zero before ebpo_node_gaps_begin. */
typedef struct ebpo_node_gaps {
    ebpo_posed_subtrees side[2]; /* both models, in the query's order */
    double max_coordinate;       /* upper bound of the absolute values of posed coordinates */
    ebpo_node_gap *heap;         /* [count] heap[0] has the least gap */
    uint64_t count, capacity;
} ebpo_node_gaps;

/* Begins an empty heap, which must be freed, also after a failure. */
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
/* Returns an upper bound of the distance of the faces of two nodes. Each node must have a face that
 * is in its cell or within EBPO_FACE_MARGIN of it. */
double ebpo_node_far_bound(const ebpo_node_gaps *g, const ebpo_posed_node node[2]);
/* Returns the index, 0 or 1, of the node with the larger cell. */
int ebpo_node_larger(const ebpo_node_gaps *g, const ebpo_posed_node node[2]);

/* Maximum distance of a node's face from the node's cell, as a share of the cell's size on each
 * axis. A node may list a face that is outside its cell but within 1/256 of the cell's size
 * (format-spec, section 7). The value is 17/4096, which includes a margin for rounding. */
#define EBPO_FACE_MARGIN 0x1.1p-8

/* A search through the subtrees of a query's models. Zero before ebpo_subtree_search_begin. */
typedef struct ebpo_subtree_search {
    const ebpo_collision *collision;
    ebpo_node_gaps nodes;     /* pairs that will be visited */
    ebpo_context *context[2]; /* contexts of partly loaded models; otherwise NULL */
    bool *visited[2];         /* [model][subtree] the subtree has been visited */
    uint64_t read_before; /* bytes that had been read from the models' files before the search */
} ebpo_subtree_search;

/* Begins a search, which must be ended, also after a failure. */
EBPO_MUST_USE ebpo_status ebpo_subtree_search_begin(ebpo_subtree_search *s,
                                                    const ebpo_collision *collision,
                                                    ebpo_error *error);
/* Adds the numbers of loads and of bytes read to the collider's counts, and frees the search. */
void ebpo_subtree_search_end(ebpo_subtree_search *s);

/* Returns the index, 0 or 1, of the node of a pair that must be divided next. Returns -1 if the
 * pair of subtrees must be loaded: each node is the root of a subtree, or belongs to a model that
 * is entirely in memory. */
int ebpo_subtree_search_side(const ebpo_subtree_search *s, const ebpo_posed_node node[2]);

/* Sets accel[2] to the accels (acceleration structures) of two subtrees, and loads the subtrees if
 * necessary. The accels are valid until the next call. If a subtree has no faces in this file or
 * the pair was visited before, sets only *loaded to false. */
EBPO_MUST_USE ebpo_status ebpo_subtree_search_load(ebpo_subtree_search *s,
                                                   const ebpo_posed_node node[2],
                                                   const ebpo_accel *accel[2], bool *loaded,
                                                   ebpo_error *error);

#endif
