/* Declares the search for bounds of an envelope's error, and the tests of envelopes against a limit
 * of the error (max_error). The error is the distance by which an envelope extends beyond the
 * model. The envelope of a node is a convex polyhedron that contains the part of the solid in the
 * node's cell. */
#ifndef EBPO_DERIVE_ERROR_BOUND_H
#define EBPO_DERIVE_ERROR_BOUND_H

#include <ebpo/query.h>

#include "derive/fragments.h"
#include "geometry/cells.h"

/* The goal of a search; lengths in the model's unit. */
typedef struct ebpo_bound_goal {
    double enough;   /* stop at an upper bound of at most this; 0: never */
    double too_much; /* stop when the lower bound is larger than this; INFINITY: never */
    /* greater than 1: stop when the upper bound is at most `ratio` times the lower bound; 0: never
     */
    double ratio;
    uint64_t queries; /* stop after about this number of distance queries of the model */
} ebpo_bound_goal;

/* The result of a search: bounds of the distance. */
typedef struct ebpo_envelope_bound {
    double lo, hi;      /* lower and upper bound, in the model's unit */
    double location[3]; /* a point of the envelope that is at least `lo` from the model; not set if
                           `lo` is 0 */
    uint64_t queries;   /* number of distance queries so far */
} ebpo_envelope_bound;

/* Prepares the searches of one thread. `model_tree` is the tree of the model's file. The caller
 * keeps `model_tree` and `model` until ebpo_bounder_free. */
EBPO_MUST_USE ebpo_status ebpo_bounder_make(ebpo_bounder *out, const ebpo_lod_model *model_tree,
                                            ebpo_model *model, ebpo_error *error);
void ebpo_bounder_free(ebpo_bounder *b);

/* Bounds the maximum of d(x) over all points x of an envelope, which is the part of `cell` within
 * b->half_spaces. d(x) is the distance of x from the solid and the faces; d is 0 in the solid.
 *
 * The search is a branch and bound over convex fragments of the envelope. When x moves, d changes
 * by at most the length of the move. (The same is true for the signed distance, also within the
 * solid.) The distance to a single face is convex, so its largest value over a fragment is at a
 * corner of the fragment. Fragments are first cut along the cells of the model's tree, down to
 * leaves. Within leaves, fragments are cut along the faces' planes, until each fragment is inside
 * or outside. The order and the cuts depend on the envelope alone, so a larger goal->enough never
 * needs more queries. */
EBPO_MUST_USE ebpo_status ebpo_bound_envelope(ebpo_bounder *b, ebpo_cell cell,
                                              const ebpo_bound_goal *goal, ebpo_envelope_bound *out,
                                              ebpo_error *error);

/* Improves the bounds in *out until their ratio is at most goal->ratio. On entry, *out has the
 * known bounds (0, INFINITY and 0 queries if nothing is known). Each step is a search with half the
 * upper bound as `enough`. So the first steps find the points that are far from the model, before
 * later steps examine closer points. After goal->queries queries, *out has the best bounds that
 * were found. */
EBPO_MUST_USE ebpo_status ebpo_bound_closely(ebpo_bounder *b, ebpo_cell cell,
                                             const ebpo_bound_goal *goal, ebpo_envelope_bound *out,
                                             ebpo_error *error);

/* --- deciding which envelopes are close enough to the model --- */

/* A model, and the results of the tests of its nodes so far. The results are used again for other
 * values of max_error. */
typedef struct ebpo_tolerance ebpo_tolerance;

/* A node whose envelope is tested: a gray node with its stored envelope, or a leaf with the part of
 * its parent's envelope in the leaf's cell. */
typedef struct ebpo_tolerance_node {
    ebpo_cell cell;
    bool required; /* false: the node is not tested */
    bool enough;   /* result of ebpo_tolerance_judge; false if the node is not tested */
} ebpo_tolerance_node;

/* Opens the model of a file. Fails with EBPO_E_ABSENT if the file has no mesh or is a subset. If
 * `planes` is false, each envelope is the whole cell of its node. The file must stay open until
 * ebpo_tolerance_close. */
EBPO_MUST_USE ebpo_status ebpo_tolerance_open(ebpo_tolerance **out, const ebpo_file *file,
                                              bool planes, unsigned threads, ebpo_progress progress,
                                              ebpo_error *error);
void ebpo_tolerance_close(ebpo_tolerance *tolerance);

/* Sets nodes[i].enough to true if the node's envelope is guaranteed to extend at most max_error
 * beyond the model. If `enough` is true for a max_error, it is also true for every larger
 * max_error. Results do not depend on earlier calls or on the number of threads. */
EBPO_MUST_USE ebpo_status ebpo_tolerance_judge(ebpo_tolerance *tolerance,
                                               ebpo_tolerance_node *nodes, uint64_t count,
                                               double max_error, ebpo_error *error);

/* Computes a max_error, not much larger than necessary, for which ebpo_tolerance_judge accepts the
 * root's envelope. */
EBPO_MUST_USE ebpo_status ebpo_tolerance_max(ebpo_tolerance *tolerance, double *out,
                                             ebpo_error *error);

#endif
