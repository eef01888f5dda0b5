/* Vertices and faces along a Morton curve. */
#ifndef EBPO_ARRANGE_ARRANGE_H
#define EBPO_ARRANGE_ARRANGE_H

#include <ebpo/mesh.h>

/* ebpo_mesh_arrange, good for trees down to `level`; -1: as deep as the coordinates' size allows
 * without a root cell larger than need be. A mesh that is arranged already is so again. */
EBPO_MUST_USE ebpo_status ebpo_arrange(ebpo_mesh *mesh, int level, unsigned threads,
                                       const ebpo_progress *progress, ebpo_error *error);

#endif
