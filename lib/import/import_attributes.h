/* What a scene that assimp made of an OBJ file says beyond positions and corners. */
#ifndef EBPO_IMPORT_ATTRIBUTES_H
#define EBPO_IMPORT_ATTRIBUTES_H

#include <ebpo/mesh.h>

struct aiScene;

/* How the mesh was made of the scene, whose meshes' vertices are numbered one after the other. */
typedef struct ebpo_imported {
    uint64_t vertices;
    const uint32_t *map;    /* [vertices] the mesh's number of each */
    const uint32_t *corner; /* [face_count][3] which of them a corner was */
} ebpo_imported;

/* Whether there is any of what follows. */
bool ebpo_import_has_attributes(const struct aiScene *scene);

/* Adds to the mesh's attributes what an OBJ file says: colours, normals and texture coordinates, of
 * the vertices, where all corners at a vertex say the same; else of the faces, one for the face or
 * as lists of its three corners'. Where materials are named, their numbers, and the names in the
 * header. What does not fit is noted. EBPO_E_MEMORY, EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_import_attributes(ebpo_mesh *mesh, const struct aiScene *scene,
                                                 const ebpo_imported *how, ebpo_error *error);

#endif
