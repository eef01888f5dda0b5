/* Declares the computation of the volumes of the levels' envelopes. */
#ifndef EBPO_FORMAT_LEVEL_VOLUMES_H
#define EBPO_FORMAT_LEVEL_VOLUMES_H

#include <ebpo/file.h>

/* Computes the volumes of the envelopes of each level's gray nodes and leaves, with the planes that
 * `parts` includes. The tree must be checked. */
void ebpo_tree_volumes(const ebpo_tree *tree, uint32_t parts, double gray[EBPO_LEVELS_MAX],
                       double leaf[EBPO_LEVELS_MAX]);

#endif
