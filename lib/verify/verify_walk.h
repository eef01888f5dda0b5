/* Walking down the tree with the faces that touch each node: containment, lists and labels. */
#ifndef EBPO_VERIFY_VERIFY_WALK_H
#define EBPO_VERIFY_VERIFY_WALK_H

#include "verify/tally.h"
#include "verify/verify_tree.h"

/* Adds to the tally. The result does not depend on the number of threads. */
EBPO_MUST_USE ebpo_status ebpo_verify_walk(ebpo_tally *tally, const ebpo_twin_tree *view,
                                           const ebpo_verify_options *options, ebpo_error *error);

#endif
