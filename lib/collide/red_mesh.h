/* Meshes in a PLY file for looking at, with faces that matter in red. */
#ifndef EBPO_COLLIDE_RED_MESH_H
#define EBPO_COLLIDE_RED_MESH_H

#include <ebpo/mesh.h>

#include "io/publish.h"
#include "pair/pose.h"

typedef struct ebpo_red_mesh {
    const ebpo_mesh *mesh;
    const ebpo_posing *posing; /* NULL: as it is */
    const uint64_t *red;       /* a bit for each face */
    const char *colour;        /* of the others: "r g b" */
} ebpo_red_mesh;

/* One after the other. EBPO_E_LIMIT: more than 2^32 - 1 vertices. EBPO_E_IO, EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_red_meshes_print(const ebpo_red_mesh *meshes, int count,
                                                ebpo_publish *target, ebpo_error *error);

#endif
