/* Writes meshes to a PLY file for viewers, with marked faces in red. */
#ifndef EBPO_COLLIDE_RED_MESH_H
#define EBPO_COLLIDE_RED_MESH_H

#include <ebpo/mesh.h>

#include "io/publish.h"
#include "geometry/pose.h"

/* A source of vertices and faces. `vertex` is called for each vertex, then `face` for each face, in
 * ascending order of `number`. */
typedef struct ebpo_red_source {
    uint64_t vertices, faces; /* numbers of vertices and faces */
    void *user;
    /* Sets `out` to the coordinates of a vertex. */
    ebpo_status (*vertex)(void *user, uint64_t number, double out[3], ebpo_error *error);
    /* Sets `out` to the vertex indices of a face. */
    ebpo_status (*face)(void *user, uint64_t number, uint32_t out[3], ebpo_error *error);
} ebpo_red_source;

/* Returns a source for a mesh in memory; the mesh must outlive the source. */
ebpo_red_source ebpo_red_source_of(const ebpo_mesh *mesh);

/* A mesh to be printed. */
typedef struct ebpo_red_mesh {
    ebpo_red_source source;
    const ebpo_posing *posing; /* NULL: coordinates are not changed */
    const uint64_t *red;       /* a bit for each face, 1: the face is red */
    const char *colour;        /* colour of faces that are not red: "r g b", 0 to 255 */
} ebpo_red_mesh;

/* Prints all meshes to one PLY file. Fails with EBPO_E_LIMIT (more than 2^32 - 1 vertices),
 * EBPO_E_IO, EBPO_E_MEMORY and the errors of the sources. */
EBPO_MUST_USE ebpo_status ebpo_red_meshes_print(const ebpo_red_mesh *meshes, int count,
                                                ebpo_publish *target, ebpo_error *error);

#endif
