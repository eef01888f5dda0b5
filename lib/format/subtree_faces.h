/* Checks the faces of a subtree against the file's table of subtrees. Any thread. */
#ifndef EBPO_FORMAT_SUBTREE_FACES_H
#define EBPO_FORMAT_SUBTREE_FACES_H

#include "format/chunks.h"
#include "format/file_nodes.h"

/* Checks that the leaves of the subtree that contains a node below the subtrees' roots have the new
 * faces that the table's row states, in depth-first order. For files with a mesh. Reads the lists
 * of the whole subtree, once for recently checked subtrees. Does nothing for counted chunks. */
EBPO_MUST_USE ebpo_status ebpo_subtree_faces_check(ebpo_chunks *chunks, const ebpo_node *node,
                                                   ebpo_error *error);

#endif
