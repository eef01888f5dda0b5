/* Checks the faces of a subtree against the file's table of subtrees (/subtrees/counts). A new face
 * of a leaf is a face that no earlier leaf of the file lists. Any thread may call this function. */
#ifndef EBPO_FORMAT_SUBTREE_FACES_H
#define EBPO_FORMAT_SUBTREE_FACES_H

#include "format/chunks.h"
#include "format/file_nodes.h"

/* Finds the subtree that contains `node`, a node below the subtrees' roots. Checks that the new
 * faces of this subtree's leaves, in depth-first order, are the faces that the table's row states.
 * The file must have a mesh. Reads the lists of all leaves of the subtree, except if the subtree is
 * known to be checked (ebpo_subtree_faces_known). Does nothing for counted chunks
 * (ebpo_chunks_make_counted). */
EBPO_MUST_USE ebpo_status ebpo_subtree_faces_check(ebpo_chunks *chunks, const ebpo_node *node,
                                                   ebpo_error *error);

#endif
