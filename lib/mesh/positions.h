/* Vertices with one and the same position. */
#ifndef EBPO_MESH_POSITIONS_H
#define EBPO_MESH_POSITIONS_H

#include "mesh/mesh_parts.h"

/* A hash table of all positions; each keeps the lowest vertex number that has it. 5.3 to 10.7 bytes
 * a vertex. */
typedef struct ebpo_positions {
    const ebpo_mesh *mesh; /* borrowed */
    uint32_t *slots;
    uint64_t mask;
    ebpo_workspace *workspace; /* the mesh's */
    uint64_t repeated;         /* vertices whose position an earlier vertex has */
} ebpo_positions;

/* -0 equals 0; NaNs are compared by their bits. `out` is cleared on failure. The result is the same
 * for any thread count. */
EBPO_MUST_USE ebpo_status ebpo_positions_build(ebpo_positions *out, const ebpo_mesh *mesh,
                                               unsigned threads, const ebpo_progress *progress,
                                               ebpo_error *error);
void ebpo_positions_free(ebpo_positions *positions);

/* The lowest vertex number with the position of v. */
uint32_t ebpo_positions_first(const ebpo_positions *positions, uint32_t v);

#endif
