/* Reads the posed meshes of operands, and finds the connected parts of a mesh that no face
 * intersects. */
#ifndef EBPO_BOOLEAN_OPERAND_MESH_H
#define EBPO_BOOLEAN_OPERAND_MESH_H

#include "extras/boolean/boolean.h"

/* Reads the mesh of an operand at its pose, into the workspace (NULL: malloc). If `attributes` is
 * true, reads also the attributes, which are not posed. Coordinates become doubles. If the pose
 * moves nothing, coordinates stay as they are, with their type and the signs of zero. The caller
 * frees the mesh (ebpo_mesh_free). */
EBPO_MUST_USE ebpo_status ebpo_operand_mesh_read(ebpo_mesh *out, const ebpo_boolean *b,
                                                 uint32_t operand, bool attributes,
                                                 ebpo_workspace *workspace, ebpo_error *error);

/* Returns true if applying the pose changes no coordinate, except perhaps -0 to 0. */
bool ebpo_moves_nothing(const ebpo_posing *posing);

/* The faces of a posed mesh. A *whole* face has an area, and is in no pair of intersecting faces. A
 * *component* is a set of whole faces that are connected by edges. An edge is a pair of positions.
 * It connects its faces if exactly two faces with an area have the edge, and both faces are whole.
 * The winding numbers of all operands are the same in front of all faces of a component, and the
 * same behind all its faces. */
typedef struct ebpo_whole_faces {
    ebpo_workspace *workspace;
    /* [faces] number of the component; EBPO_NO_COMPONENT: the face is not whole. NULL: no face is
     * whole. */
    uint32_t *component;
    uint32_t components; /* number of components */
    bool repeats;        /* several vertices have one position */
    /* A bit for each face that the list of faces (face_list.h) must have:
     * - each face that is not whole,
     * - each whole face with two or more corners that are corners of faces in pairs,
     * - each whole face with an edge of more than two faces,
     * - the first face of each component without a face of these three kinds. */
    uint64_t *listed;
} ebpo_whole_faces;

#define EBPO_NO_COMPONENT UINT32_MAX

/* Finds the components. paired: one bit for each face, set if the face intersects another face.
 * Fails with EBPO_E_FORMAT if the mesh is not closed: an edge of whole faces does not occur equally
 * often in both directions. Must be freed, also after a failure. */
EBPO_MUST_USE ebpo_status ebpo_whole_faces_find(ebpo_whole_faces *out, const ebpo_mesh *mesh,
                                                const uint64_t *paired, unsigned threads,
                                                const ebpo_progress *progress, ebpo_error *error);
void ebpo_whole_faces_free(ebpo_whole_faces *faces);

static inline bool ebpo_has_bit(const uint64_t *bits, uint64_t i)
{
    return bits[i / 64] >> i % 64 & 1;
}

static inline void ebpo_set_bit(uint64_t *bits, uint64_t i)
{
    bits[i / 64] |= UINT64_C(1) << i % 64;
}

#endif
