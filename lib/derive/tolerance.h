/* Which envelopes are close enough to the model, for choosing by need: what was found out is
 * remembered for other limits. */
#ifndef EBPO_DERIVE_TOLERANCE_H
#define EBPO_DERIVE_TOLERANCE_H

#include <ebpo/query.h>

#include "geometry/cell.h"

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
