/* Nesting: plane codes that decode, and coordinates that agree from level to level. */
#ifndef EBPO_VERIFY_NESTING_H
#define EBPO_VERIFY_NESTING_H

#include "verify/tally.h"
#include "verify/twin_tree.h"

/* A node's envelope is its own planes and all its ancestors', so it lies in its parent's by
 * definition, as long as a plane means the same in every cell's coordinates: checked in integers on
 * points of sampled cells, with each plane taken down to the cell and the point taken up to the
 * plane. */
void ebpo_check_nesting(ebpo_tally *tally, const ebpo_twin_tree *view);

#endif
