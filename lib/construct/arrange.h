/* Sorts (arranges) vertices and faces along a Morton curve. */
#ifndef EBPO_CONSTRUCT_ARRANGE_H
#define EBPO_CONSTRUCT_ARRANGE_H

#include <ebpo/mesh.h>

/* Does the same as ebpo_mesh_arrange, for trees down to `level`. With -1, the level is the deepest
 * that hardly enlarges the root cell (its cell faces must be exact in doubles). A mesh that is
 * already arranged is arranged again if it was arranged for another level or changed. */
EBPO_MUST_USE ebpo_status ebpo_arrange(ebpo_mesh *mesh, int level, unsigned threads,
                                       const ebpo_progress *progress, ebpo_error *error);

/* Arranges a mesh before repairs: vertices without faces are sorted among the other vertices, so
 * that all vertices at one position are neighbours. So checking and repairing access memory in
 * order. Call ebpo_arrange after the repairs; the final order and the source indices are the same
 * as without this call. */
EBPO_MUST_USE ebpo_status ebpo_arrange_to_repair(ebpo_mesh *mesh, unsigned threads,
                                                 const ebpo_progress *progress, ebpo_error *error);

#endif
