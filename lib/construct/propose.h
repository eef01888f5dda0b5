/* Selections from the leaves up (the theses'), before the walk from the root down writes what they
 * chose. */
#ifndef EBPO_CONSTRUCT_PROPOSE_H
#define EBPO_CONSTRUCT_PROPOSE_H

#include "construct/builder.h"

/* All branches; nothing to do for a selection from the root. After the corner windings.
 * Pieces are partitioned for it, and forgotten again. */
EBPO_MUST_USE ebpo_status ebpo_build_propose(ebpo_builder *b, ebpo_error *error);

#endif
