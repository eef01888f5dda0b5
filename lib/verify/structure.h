/* Structure: whether the arrays fit together, and whether the tree is one that the format allows.
 */
#ifndef EBPO_VERIFY_STRUCTURE_H
#define EBPO_VERIFY_STRUCTURE_H

#include "verify/tally.h"
#include "verify/twin_tree.h"

/* Everything that the other checks rely on to stay within arrays. False when something is wrong:
 * then nothing else can be checked. */
bool ebpo_check_shape(ebpo_tally *tally, const ebpo_tree *tree);

/* The rest: summaries, leaf sizes, order of faces, root box around the vertices, balanced edges of
 * a solid. */
void ebpo_check_structure(ebpo_tally *tally, const ebpo_twin_tree *view);

#endif
