/* Colours of gray nodes against those of the faces below. */
#ifndef EBPO_VERIFY_VERIFY_COLOURS_H
#define EBPO_VERIFY_VERIFY_COLOURS_H

#include "verify/tally.h"
#include "verify/twin_tree.h"

/* Of a tree with colours whose shape was checked; where it has no mesh, its mesh has no colours, or
 * it is a subset, nothing can be said. EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_check_colours(ebpo_tally *tally, const ebpo_twin_tree *view,
                                             ebpo_error *error);

#endif
