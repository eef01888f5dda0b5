/* The subtrees of a model at a pose and the convex envelopes of their faces, with gaps between
 * envelopes. */
#ifndef EBPO_COLLIDE_POSED_SUBTREES_H
#define EBPO_COLLIDE_POSED_SUBTREES_H

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

/* The subtrees that are loaded on demand, or a whole model as a single one. */

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

#endif
