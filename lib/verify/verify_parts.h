/* Verifying a tree in memory. */
#ifndef EBPO_VERIFY_VERIFY_PARTS_H
#define EBPO_VERIFY_VERIFY_PARTS_H

#include "verify/tally.h"

/* All checks but content and source. A tree whose arrays do not fit together ends with structure
 * violations and is not looked at further. */
EBPO_MUST_USE ebpo_status ebpo_verify_tree(ebpo_tally *tally, const ebpo_tree *tree,
                                           const ebpo_verify_options *options, ebpo_error *error);

#endif
