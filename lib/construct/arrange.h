/* Sorts (arranges) vertices and faces along a Morton curve: a curve through the cells of a grid, on
 * which cells that are neighbours in space are mostly neighbours. */
#ifndef EBPO_CONSTRUCT_ARRANGE_H
#define EBPO_CONSTRUCT_ARRANGE_H

#include <ebpo/mesh.h>

/* Does the same as ebpo_mesh_arrange, for trees down to `level`. Cell faces must be exact in
 * doubles down to this level; this condition may enlarge the root cell. If `level` is -1, the
 * function uses the deepest level that hardly enlarges the root cell. A mesh that is already
 * arranged is arranged again only if it was arranged for another level or was changed afterwards.
 */
EBPO_MUST_USE ebpo_status ebpo_arrange(ebpo_mesh *mesh, int level, unsigned threads,
                                       const ebpo_progress *progress, ebpo_error *error);

/* Arranges a mesh before repairs, so that checking and repairing access memory in order. Vertices
 * without faces are sorted among the other vertices, so that all vertices at one position are
 * neighbours. Call ebpo_arrange after the repairs; the final order and the source indices are the
 * same as without this call. */
EBPO_MUST_USE ebpo_status ebpo_arrange_to_repair(ebpo_mesh *mesh, unsigned threads,
                                                 const ebpo_progress *progress, ebpo_error *error);

#endif
