/* Meshes in a PLY file for looking at, with faces that matter in red. */
#ifndef EBPO_COLLIDE_RED_MESH_H
#define EBPO_COLLIDE_RED_MESH_H

#include <ebpo/mesh.h>

#include "io/publish.h"
#include "geometry/pose.h"

/* Where a mesh comes from: a vertex, and the corners of a face, asked for in ascending order. */
typedef struct ebpo_red_source {
    uint64_t vertices, faces;
    void *user;
    ebpo_status (*vertex)(void *user, uint64_t number, double out[3], ebpo_error *error);
    ebpo_status (*face)(void *user, uint64_t number, uint32_t out[3], ebpo_error *error);
} ebpo_red_source;

/* That is all in memory, and stays there. */
ebpo_red_source ebpo_red_source_of(const ebpo_mesh *mesh);

typedef struct ebpo_red_mesh {
    ebpo_red_source source;
    const ebpo_posing *posing; /* NULL: as it is */
    const uint64_t *red;       /* a bit for each face */
    const char *colour;        /* of the others: "r g b" */
} ebpo_red_mesh;

/* One after the other. EBPO_E_LIMIT: more than 2^32 - 1 vertices. EBPO_E_IO, EBPO_E_MEMORY, and
 * the errors of the sources. */
EBPO_MUST_USE ebpo_status ebpo_red_meshes_print(const ebpo_red_mesh *meshes, int count,
                                                ebpo_publish *target, ebpo_error *error);

#endif
