/* How far apart two convex sets are, from their corners. Pure functions, any thread. */
#ifndef EBPO_COLLIDE_POSED_SUBTREES_H
#define EBPO_COLLIDE_POSED_SUBTREES_H

#include "extras/collide/collider.h"
#include "geometry/pose.h"
#include "query/query_model.h"

/* The hull of its points. */
typedef struct ebpo_convex {
    int count; /* 1 at least */
    const double (*point)[3];
} ebpo_convex;

/* A lower bound of the distance, 0 if none was found: right to 2^-48 of the greatest coordinate. It
 * is near the distance, but need not be it; one that is beyond `enough` ends the search. The same
 * on every processor. */
double ebpo_convex_gap(const ebpo_convex *a, const ebpo_convex *b, double enough);

/* No two of their points are farther apart; rounded up. */
double ebpo_convex_span(const ebpo_convex *a, const ebpo_convex *b);

/* A model's subtrees at a pose, and where each can have faces: those that are loaded on demand, or
 * the whole model as a single one. */

typedef struct ebpo_posed_subtrees {
    const ebpo_model *model;
    ebpo_posing posing;
    uint64_t count;
    uint32_t *rank;           /* [count] place of each in the order of the file's faces */
    struct posed_hull **hull; /* [slots] envelopes that were asked for, by their octcodes */
    uint64_t hulls, slots, bytes;
} ebpo_posed_subtrees;

/* A node of the tree as far as it is in memory. */
typedef struct ebpo_posed_node {
    uint32_t entry;
    ebpo_cell cell;
} ebpo_posed_node;

/* Freed also after a failure. One thread at a time. */
EBPO_MUST_USE ebpo_status ebpo_posed_subtrees_make(ebpo_posed_subtrees *out,
                                                   const ebpo_model *model,
                                                   const ebpo_posing *posing, ebpo_error *error);
void ebpo_posed_subtrees_free(ebpo_posed_subtrees *s);

/* The envelope of a node that is in memory, posed, or that of a subtree as far as it is known
 * without loading it. Of every face, all that is in the cell is within it, but for what
 * ebpo_posed_slack says. It lives as long as `s`. */
EBPO_MUST_USE ebpo_status ebpo_posed_envelope(ebpo_posed_subtrees *s, ebpo_cell cell,
                                              ebpo_convex *out, ebpo_error *error);

/* The root; and that of what is loaded on demand, as which a whole model is its only subtree. */
ebpo_posed_node ebpo_posed_root(const ebpo_posed_subtrees *s);
ebpo_posed_node ebpo_posed_subtree_root(const ebpo_posed_subtrees *s);
/* A child of a gray node. */
ebpo_posed_node ebpo_posed_child(const ebpo_posed_subtrees *s, const ebpo_posed_node *gray,
                                 unsigned octant);
/* Corners of a cell, posed. */
void ebpo_posed_cell(const ebpo_posed_subtrees *s, ebpo_cell cell, double out[8][3]);
/* What posing, and the cutting of envelopes, may have moved corners of such a cell by. `reach`: no
 * posed coordinate is greater. */
double ebpo_posed_slack(const ebpo_posed_subtrees *s, ebpo_cell cell, double reach);
/* How long the cell's diagonal is in the world. */
double ebpo_posed_diagonal(const ebpo_posed_subtrees *s, ebpo_cell cell);

/* Pairs of nodes of two posed trees, those of the least gaps first: gaps of envelopes, which bound
 * the distance of what is in them. One thread. */

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

/* Pairs of nodes of two models, some in parts, best first, down to subtrees that are loaded for
 * what may be in them. Used by distances and by the way out; what is best, and when it is enough,
 * is theirs to say. One thread. */

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
