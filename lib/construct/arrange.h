/* Sorts vertices and faces along a Morton curve. */
#ifndef EBPO_CONSTRUCT_ARRANGE_H
#define EBPO_CONSTRUCT_ARRANGE_H

#include <ebpo/mesh.h>

/* Does the same as ebpo_mesh_arrange, for trees down to `level`. With -1, the level is as deep as
 * the size of the coordinates allows without enlarging the root cell too much. A mesh that is
 * already arranged is arranged again. */
EBPO_MUST_USE ebpo_status ebpo_arrange(ebpo_mesh *mesh, int level, unsigned threads,
                                       const ebpo_progress *progress, ebpo_error *error);

/* Arranges a mesh before repairs: vertices without faces are sorted among the others, so that
 * vertices at one position are neighbours. Then checking and repairing access memory in order too;
 * afterwards ebpo_arrange sorts the changes. The final order and the source indices are the same as
 * without this call. */
EBPO_MUST_USE ebpo_status ebpo_arrange_to_repair(ebpo_mesh *mesh, unsigned threads,
                                                 const ebpo_progress *progress, ebpo_error *error);

#endif
