/* Pairs of nodes of two posed trees, those of the least gaps first: gaps of envelopes, which bound
 * the distance of what is in them. One thread. */
#ifndef EBPO_COLLIDE_NODE_GAPS_H
#define EBPO_COLLIDE_NODE_GAPS_H

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

#endif
