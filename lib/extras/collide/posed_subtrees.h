/* Finds the subtrees of a posed model and convex envelopes of their faces, and bounds the distance
 * of envelopes. */
#ifndef EBPO_COLLIDE_POSED_SUBTREES_H
#define EBPO_COLLIDE_POSED_SUBTREES_H

#include "geometry/pose.h"
#include "query/query_model.h"

/* The convex hull of some points. */
typedef struct ebpo_convex {
    int count; /* number of points, at least 1 */
    const double (*point)[3];
} ebpo_convex;

/* Returns a lower bound of the distance of two hulls; 0 if no greater bound was found. Because of
 * rounding, the bound may be too great by 2^-48 times the greatest coordinate. In most cases the
 * bound is close to the distance. The search ends when it finds a bound above `enough`. The result
 * is the same on every processor. */
double ebpo_convex_gap(const ebpo_convex *a, const ebpo_convex *b, double enough);

/* Returns an upper bound of the distances of all points of a from all points of b. */
double ebpo_convex_span(const ebpo_convex *a, const ebpo_convex *b);

/* The subtrees of a posed model. They are loaded on demand; a model that is entirely in memory (a
 * whole model) is a single subtree. */
typedef struct ebpo_posed_subtrees {
    const ebpo_model *model;
    ebpo_posing posing;
    uint64_t count;           /* number of subtrees */
    uint32_t *rank;           /* [count] rank of each subtree in the order of the file's faces */
    struct posed_hull **hull; /* [slots] hash table, by octcodes, of the envelopes that were
                               * requested; NULL: the entry is free */
    uint64_t hulls, slots;    /* number of envelopes; size of the table */
    uint64_t bytes;           /* memory of the envelopes and of the table */
    struct posed_hull **deep_hull; /* some envelopes of nodes below the roots of subtrees; NULL:
                                    * none was requested yet */
    struct posed_hull *replaced;   /* the last envelope that left `deep_hull`, or NULL */
    struct envelope_chain *chain;  /* for the next envelope; NULL: none was requested yet */
} ebpo_posed_subtrees;

/* A node in the part of the tree that is in memory. */
typedef struct ebpo_posed_node {
    uint32_t entry; /* the node's entry in the model (ebpo_entry_kind_of) */
    ebpo_cell cell;
} ebpo_posed_node;

/* Prepares the subtrees of a posed model, for one thread at a time. Must be freed, also after a
 * failure. */
EBPO_MUST_USE ebpo_status ebpo_posed_subtrees_make(ebpo_posed_subtrees *out,
                                                   const ebpo_model *model,
                                                   const ebpo_posing *posing, ebpo_error *error);
/* Frees the memory; a zero struct is allowed. */
void ebpo_posed_subtrees_free(ebpo_posed_subtrees *s);

/* Sets *out to the posed envelope of a cell, which belongs to a node in memory or to the root of a
 * subtree; the subtree is not loaded. Except for errors up to ebpo_posed_slack, the envelope
 * contains the part of every face that is in the cell. *out is valid as long as `s`. */
EBPO_MUST_USE ebpo_status ebpo_posed_envelope(ebpo_posed_subtrees *s, ebpo_cell cell,
                                              ebpo_convex *out, ebpo_error *error);

/* Returns the root of the tree. */
ebpo_posed_node ebpo_posed_root(const ebpo_posed_subtrees *s);
/* Returns the node at which a search for subtrees begins: the root of the tree, or, for a whole
 * model, the root of its only subtree. */
ebpo_posed_node ebpo_posed_subtree_root(const ebpo_posed_subtrees *s);
/* Returns a child of a gray node. */
ebpo_posed_node ebpo_posed_child(const ebpo_posed_subtrees *s, const ebpo_posed_node *gray,
                                 unsigned octant);

/* Nodes of a partly loaded model below the roots of subtrees, if deep bounds (query/nearest.h) are
 * in memory. ebpo_posed_deep_node returns the root of a subtree with this cell as a node of the
 * deep bounds; it is gray if it has children. ebpo_posed_deep_child returns a child of a gray node.
 * ebpo_posed_deep_envelope does the same as ebpo_posed_envelope for such nodes, but *out is valid
 * only until the second next call, so that two nodes of the same model can be compared. */
ebpo_posed_node ebpo_posed_deep_node(const ebpo_posed_subtrees *s, ebpo_cell cell);
ebpo_posed_node ebpo_posed_deep_child(const ebpo_posed_subtrees *s, const ebpo_posed_node *gray,
                                      unsigned octant);
EBPO_MUST_USE ebpo_status ebpo_posed_deep_envelope(ebpo_posed_subtrees *s, ebpo_cell cell,
                                                   ebpo_convex *out, ebpo_error *error);

/* Computes the posed corners of a cell. If bit k of a corner's index is 1, the corner has the
 * cell's upper coordinate on axis k. */
void ebpo_posed_cell(const ebpo_posed_subtrees *s, ebpo_cell cell, double out[8][3]);
/* Computes the sum of the first and the last posed corner of a cell: twice the cell's middle. */
void ebpo_posed_ends(const ebpo_posed_subtrees *s, ebpo_cell cell, double out[3]);
/* Returns a bound of the errors that posing and cutting cause in the corners of the envelope of a
 * cell. max_coordinate: upper bound of the absolute values of posed coordinates. */
double ebpo_posed_slack(const ebpo_posed_subtrees *s, ebpo_cell cell, double max_coordinate);
/* Returns the length of the cell's diagonal in the world. */
double ebpo_posed_diagonal(const ebpo_posed_subtrees *s, ebpo_cell cell);

#endif
