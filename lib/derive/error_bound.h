/* Bounds of the distance by which one envelope extends beyond the model. */
#ifndef EBPO_DERIVE_ERROR_BOUND_H
#define EBPO_DERIVE_ERROR_BOUND_H

#include <ebpo/query.h>

#include "derive/fragments.h"
#include "geometry/cells.h"

/* The goal of a search; lengths in the model's unit. */
typedef struct ebpo_bound_goal {
    double enough;   /* stop at an upper bound of at most this; 0: never */
    double too_much; /* stop once the distance is certainly larger; INFINITY: never */
    /* > 1: stop when the upper bound is at most `ratio` times the lower bound; 0: never */
    double ratio;
    uint64_t queries; /* stop after about this many distance queries */
} ebpo_bound_goal;

/* The result of a search: bounds of the distance. */
typedef struct ebpo_reach_bound {
    double lo, hi;      /* in the model's unit */
    double location[3]; /* a point of the envelope at lo; not set when lo is 0 */
    uint64_t queries;
} ebpo_reach_bound;

EBPO_MUST_USE ebpo_status ebpo_bounder_make(ebpo_bounder *out, const ebpo_lod_model *whole,
                                            ebpo_model *model, ebpo_error *error);
void ebpo_bounder_free(ebpo_bounder *b);

/* Bounds the maximum of d(x) over all points x of an envelope: the part of `cell` within b->halves.
 * d is the distance to the closed solid and to the faces, 0 inside the solid.
 *
 * The search is a branch and bound over convex fragments of the envelope. When x moves, d changes
 * by at most the length of the move (the signed distance has this property within the solid, too).
 * The distance to a single face is convex, so its largest value over a fragment is at a corner of
 * the fragment. Fragments follow the model's tree down to leaves. Within leaves, fragments are cut
 * along the faces' planes, until each fragment is inside or outside. The order and the cuts depend
 * on the envelope alone, so a larger `enough` never needs more queries. */
EBPO_MUST_USE ebpo_status ebpo_bound_envelope(ebpo_bounder *b, ebpo_cell cell,
                                              const ebpo_bound_goal *goal, ebpo_reach_bound *out,
                                              ebpo_error *error);

/* Improves the bounds in *out until their ratio is goal->ratio. On entry, *out has the known bounds
 * (0, INFINITY and 0 queries if nothing is known). Each step searches with half the upper bound as
 * `enough`, so that far places are found before close ones are examined. When the queries are used
 * up, *out has the bounds that are certain by then. */
EBPO_MUST_USE ebpo_status ebpo_bound_closely(ebpo_bounder *b, ebpo_cell cell,
                                             const ebpo_bound_goal *goal, ebpo_reach_bound *out,
                                             ebpo_error *error);

/* --- decides which envelopes are close enough to the model; keeps results for other limits --- */

typedef struct ebpo_tolerance ebpo_tolerance;

/* A gray node, as stored; or a leaf, with its parent's envelope in its cell. */
typedef struct ebpo_tolerance_node {
    ebpo_cell cell;
    bool required; /* if false, the result does not matter */
    bool enough;   /* the result; false where not required */
} ebpo_tolerance_node;

/* Opens a model of all of the file. Fails with EBPO_E_ABSENT for a file without mesh or a subset.
 * If `planes` is false, envelopes are cells. The file must stay open until ebpo_tolerance_close. */
EBPO_MUST_USE ebpo_status ebpo_tolerance_open(ebpo_tolerance **out, const ebpo_file *file,
                                              bool planes, unsigned threads, ebpo_progress progress,
                                              ebpo_error *error);
void ebpo_tolerance_close(ebpo_tolerance *tolerance);

/* Sets nodes[i].enough if the node's envelope certainly extends at most max_error beyond the model.
 * If it is set for a max_error, it is also set for every larger max_error. Results do not depend on
 * earlier calls or on threads. */
EBPO_MUST_USE ebpo_status ebpo_tolerance_judge(ebpo_tolerance *tolerance,
                                               ebpo_tolerance_node *nodes, uint64_t count,
                                               double max_error, ebpo_error *error);

/* Computes a max_error for which the root's envelope is close enough. */
EBPO_MUST_USE ebpo_status ebpo_tolerance_max(ebpo_tolerance *tolerance, double *out,
                                             ebpo_error *error);

#endif
