/* How far one envelope reaches beyond the model, as bounds. */
#ifndef EBPO_DERIVE_ERROR_BOUND_H
#define EBPO_DERIVE_ERROR_BOUND_H

#include <ebpo/query.h>

#include "derive/fragments.h"
#include "geometry/cells.h"

/* What is wanted; lengths in the model's unit. */
typedef struct ebpo_bound_goal {
    double enough;   /* an upper bound of so much is good enough; 0: none is */
    double too_much; /* stop once it certainly reaches farther; INFINITY: never */
    /* an upper bound of `ratio` times the lower one is good enough, > 1; 0: none is */
    double ratio;
    uint64_t questions; /* stop after about so many distances */
} ebpo_bound_goal;

typedef struct ebpo_reach_bound {
    double lo, hi;   /* the model's unit */
    double place[3]; /* of lo, a point of the envelope; not set when lo is 0 */
    uint64_t questions;
} ebpo_reach_bound;

EBPO_MUST_USE ebpo_status ebpo_bounder_make(ebpo_bounder *out, const ebpo_lod_model *whole,
                                            ebpo_model *model, ebpo_error *error);
void ebpo_bounder_free(ebpo_bounder *b);

/* The bounds of max d(x) over the envelope of `cell` and b->halves, its inside included. d is the
 * distance to the closed solid and to the faces, 0 inside. Branch and bound over convex pieces. d
 * changes by no more than its argument moves (signed, it does so within the solid, too), and the
 * distance to a single face is convex, so that its largest value over a piece is that at a corner.
 * Pieces follow the model's tree down to leaves; within these, they are cut along the faces'
 * planes, until each is inside or outside. The order and the cuts depend on the envelope alone, so
 * with a larger `enough` no more is asked. */
EBPO_MUST_USE ebpo_status ebpo_bound_envelope(ebpo_bounder *b, ebpo_cell cell,
                                              const ebpo_bound_goal *goal, ebpo_reach_bound *out,
                                              ebpo_error *error);

/* The same for a `ratio`, from what is known on entry in *out (0, INFINITY and 0 questions:
 * nothing): step by step with half the upper bound, so that far places are found before close ones
 * are looked at closely, and with what is certain when the questions are spent. */
EBPO_MUST_USE ebpo_status ebpo_bound_closely(ebpo_bounder *b, ebpo_cell cell,
                                             const ebpo_bound_goal *goal, ebpo_reach_bound *out,
                                             ebpo_error *error);

/* Which envelopes are close enough to the model, for choosing by need: what was found out is
 * remembered for other limits. */

typedef struct ebpo_tolerance ebpo_tolerance;

/* A gray node, as stored; or a leaf, with its parent's envelope in its cell. */
typedef struct ebpo_tolerance_node {
    ebpo_cell cell;
    bool asked;  /* else the answer does not matter */
    bool enough; /* the answer; false where none was asked for */
} ebpo_tolerance_node;

/* EBPO_E_ABSENT for a file without mesh or a subset. Opens a model of all of the file. `planes`
 * false: envelopes are cells. The file stays open as long. */
EBPO_MUST_USE ebpo_status ebpo_tolerance_open(ebpo_tolerance **out, const ebpo_file *file,
                                              bool planes, unsigned threads, ebpo_progress progress,
                                              ebpo_error *error);
void ebpo_tolerance_close(ebpo_tolerance *need);

/* node[i].enough: its envelope certainly reaches at most max_error beyond the model. What is enough
 * for one max_error is so for every larger one, and the answers do not depend on what was asked
 * before, nor on threads. */
EBPO_MUST_USE ebpo_status ebpo_tolerance_judge(ebpo_tolerance *need, ebpo_tolerance_node *nodes,
                                               uint64_t count, double max_error, ebpo_error *error);

/* A max_error for which the root is enough. */
EBPO_MUST_USE ebpo_status ebpo_tolerance_most(ebpo_tolerance *need, double *out, ebpo_error *error);

#endif
