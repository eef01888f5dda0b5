/* Vertices and faces along a Morton curve. */
#ifndef EBPO_CONSTRUCT_ARRANGE_H
#define EBPO_CONSTRUCT_ARRANGE_H

#include <ebpo/mesh.h>

/* ebpo_mesh_arrange, good for trees down to `level`; -1: as deep as the coordinates' size allows
 * without a root cell larger than need be. A mesh that is arranged already is so again. */
EBPO_MUST_USE ebpo_status ebpo_arrange(ebpo_mesh *mesh, int level, unsigned threads,
                                       const ebpo_progress *progress, ebpo_error *error);

/* The same for what is to be mended: vertices that no face names stand among the others, so that
 * those at one position are neighbours. Mending, and checking before it, then go through memory in
 * order too; afterwards ebpo_arrange puts in order what mending changed. The source's numbers are
 * those of the mended mesh in the source's order: the result is the same as without it. */
EBPO_MUST_USE ebpo_status ebpo_arrange_to_mend(ebpo_mesh *mesh, unsigned threads,
                                               const ebpo_progress *progress, ebpo_error *error);

#endif
