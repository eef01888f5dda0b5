/* Face lists of leaves against the faces that touch them. */
#ifndef EBPO_VERIFY_LISTS_H
#define EBPO_VERIFY_LISTS_H

#include "verify/tally.h"
#include "verify/twin_tree.h"

/* `faces`: numbers of the `count` faces that touch the cell, ascending. A leaf must list them all,
 * a white or black cell has none. */
void ebpo_check_terminal_lists(ebpo_tally *tally, const ebpo_twin_tree *view,
                               const ebpo_twin_node *node, const uint32_t *faces, uint64_t count);

/* Whether the leaves below a gray node list more than `limit` different faces. */
bool ebpo_lists_more_faces(const ebpo_twin_tree *view, const ebpo_twin_node *node, uint64_t limit);

#endif
