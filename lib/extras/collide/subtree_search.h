/* Pairs of nodes of two posed trees, the smallest gap of envelopes first, down to subtrees that
 * are loaded on demand. One thread. */
#ifndef EBPO_COLLIDE_SUBTREE_SEARCH_H
#define EBPO_COLLIDE_SUBTREE_SEARCH_H

#include "extras/collide/collider.h"
#include "extras/collide/posed_subtrees.h"

/* Two nodes with something of each model in them; `gap`: they are not nearer to each other. */
typedef struct ebpo_node_gap {
    ebpo_posed_node node[2];
    double gap;
} ebpo_node_gap;

/* Zero at first. */
typedef struct ebpo_node_gaps {
    ebpo_posed_subtrees side[2];
    double reach;        /* no posed coordinate is greater */
    ebpo_node_gap *heap; /* those of the least gaps first */
    uint64_t count, capacity;
} ebpo_node_gaps;

/* Freed also after a failure. */
EBPO_MUST_USE ebpo_status ebpo_node_gaps_begin(ebpo_node_gaps *g, const ebpo_collision *question,
                                               ebpo_error *error);
void ebpo_node_gaps_free(ebpo_node_gaps *g);

EBPO_MUST_USE ebpo_status ebpo_node_gaps_push(ebpo_node_gaps *g, const ebpo_node_gap *pair,
                                              ebpo_error *error);
/* The least one; there is one. */
ebpo_node_gap ebpo_node_gaps_pop(ebpo_node_gaps *g);

/* The certain gap of two nodes' envelopes, 0 or more. */
EBPO_MUST_USE ebpo_status ebpo_node_gap_of(ebpo_node_gaps *g, const ebpo_posed_node node[2],
                                           double *out, ebpo_error *error);
/* Both have faces, one each in its cell or near it: these are not farther apart. */
double ebpo_node_far_bound(const ebpo_node_gaps *g, const ebpo_posed_node node[2]);
/* Which of two nodes, both gray or neither, is to be divided first. */
int ebpo_node_larger(const ebpo_node_gaps *g, const ebpo_posed_node node[2]);

/* A node may list a face that only comes near, within 1/256 of the cell's size on each axis
 * (format-spec, section 5); and some room for rounding. */
#define EBPO_NEAR_SHARE 0x1.1p-8

/* Zero at first. */
typedef struct ebpo_subtree_search {
    const ebpo_collision *question;
    ebpo_node_gaps nodes;
    ebpo_context *context[2]; /* of models that are in parts */
    bool *seen[2];            /* subtrees that have been looked at */
    uint64_t read_before;
} ebpo_subtree_search;

/* Ended also after a failure. */
EBPO_MUST_USE ebpo_status ebpo_subtree_search_begin(ebpo_subtree_search *s,
                                                    const ebpo_collision *question,
                                                    ebpo_error *error);
/* Adds what has been loaded and read to the collider's counts. */
void ebpo_subtree_search_end(ebpo_subtree_search *s);

/* Which of two nodes is to be divided; -1: neither, they are to be looked at. */
int ebpo_subtree_search_side(const ebpo_subtree_search *s, const ebpo_posed_node node[2]);

/* What is to be looked at of two nodes that are not divided, loaded if need be: until the next
 * call. *there: false if nothing is, or it has been looked at. */
EBPO_MUST_USE ebpo_status ebpo_subtree_search_load(ebpo_subtree_search *s,
                                                   const ebpo_posed_node node[2],
                                                   const ebpo_accel *accel[2], bool *there,
                                                   ebpo_error *error);

#endif
