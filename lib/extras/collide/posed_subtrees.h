/* The subtrees of a model at a pose and the convex envelopes of their faces, with gaps between
 * envelopes. */
#ifndef EBPO_COLLIDE_POSED_SUBTREES_H
#define EBPO_COLLIDE_POSED_SUBTREES_H

#include "geometry/pose.h"
#include "query/query_model.h"

/* The convex hull of some points. */
typedef struct ebpo_convex {
    int count; /* at least 1 */
    const double (*point)[3];
} ebpo_convex;

/* Returns a lower bound of the distance, with an error of 2^-48 of the greatest coordinate; 0 if no
 * bound was found. The bound is usually close to the distance. The search ends at a bound beyond
 * `enough`. The result is the same on every processor. */
double ebpo_convex_gap(const ebpo_convex *a, const ebpo_convex *b, double enough);

/* Returns an upper bound of the distance of any two points, rounded up. */
double ebpo_convex_span(const ebpo_convex *a, const ebpo_convex *b);

/* The subtrees of a model that are loaded on demand; a whole model is a single one. */

typedef struct ebpo_posed_subtrees {
    const ebpo_model *model;
    ebpo_posing posing;
    uint64_t count;
    uint32_t *rank;           /* [count] rank of each subtree in the order of the file's faces */
    struct posed_hull **hull; /* [slots] envelopes that have been requested, by their octcodes */
    uint64_t hulls, slots, bytes;
} ebpo_posed_subtrees;

/* A node of the part of the tree that is in memory. */
typedef struct ebpo_posed_node {
    uint32_t entry;
    ebpo_cell cell;
} ebpo_posed_node;

/* Must be freed, also after a failure. One thread at a time. */
EBPO_MUST_USE ebpo_status ebpo_posed_subtrees_make(ebpo_posed_subtrees *out,
                                                   const ebpo_model *model,
                                                   const ebpo_posing *posing, ebpo_error *error);
void ebpo_posed_subtrees_free(ebpo_posed_subtrees *s);

/* Returns the posed envelope of a node in memory, or of a subtree as far as it is known without
 * loading the subtree. The envelope contains the part of every face in the cell, up to
 * ebpo_posed_slack. It lives as long as `s`. */
EBPO_MUST_USE ebpo_status ebpo_posed_envelope(ebpo_posed_subtrees *s, ebpo_cell cell,
                                              ebpo_convex *out, ebpo_error *error);

/* The first function returns the root of the tree. The second returns the root of a subtree that is
 * loaded on demand; a whole model is its only subtree. */
ebpo_posed_node ebpo_posed_root(const ebpo_posed_subtrees *s);
ebpo_posed_node ebpo_posed_subtree_root(const ebpo_posed_subtrees *s);
/* Returns a child of a gray node. */
ebpo_posed_node ebpo_posed_child(const ebpo_posed_subtrees *s, const ebpo_posed_node *gray,
                                 unsigned octant);
/* Computes the posed corners of a cell. */
void ebpo_posed_cell(const ebpo_posed_subtrees *s, ebpo_cell cell, double out[8][3]);
/* Bounds how far posing and the cutting of envelopes move corners of the envelope of such a cell.
 * `reach`: bound of posed coordinates. */
double ebpo_posed_slack(const ebpo_posed_subtrees *s, ebpo_cell cell, double reach);
/* Returns the length of the cell's diagonal in the world. */
double ebpo_posed_diagonal(const ebpo_posed_subtrees *s, ebpo_cell cell);

#endif
