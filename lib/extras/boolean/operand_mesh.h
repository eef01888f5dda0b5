/* Reads operands: their posed meshes, and the parts of their surfaces that no face intersects. */
#ifndef EBPO_BOOLEAN_OPERAND_MESH_H
#define EBPO_BOOLEAN_OPERAND_MESH_H

#include "extras/boolean/boolean.h"

/* Reads the mesh of an operand at its pose, into the workspace (NULL: malloc), and if `attributes`
 * is true its attributes, which are not moved. Coordinates become
 * doubles; a pose that moves nothing leaves them as they are, with their signs of zero. Freed by
 * ebpo_mesh_free. */
EBPO_MUST_USE ebpo_status ebpo_operand_mesh_read(ebpo_mesh *out, const ebpo_boolean *b,
                                                 uint32_t operand, bool attributes,
                                                 ebpo_workspace *workspace, ebpo_error *error);

/* Returns true if the pose leaves all coordinates as they are, apart from the sign of zero. */
bool ebpo_moves_nothing(const ebpo_posing *posing);

/* The faces of a posed mesh. *Whole* faces have an area, and are in no pair of intersecting faces.
 * They are connected to *components* by edges (pairs of equal positions) of exactly two faces with
 * an area, both of them whole: along a component all winding numbers in front are constant, and so
 * are those behind. */
typedef struct ebpo_whole_faces {
    ebpo_workspace *workspace;
    /* [faces] number of the component; EBPO_NO_COMPONENT: not whole. NULL: no face is. */
    uint32_t *component;
    uint32_t components;
    bool repeats; /* several vertices have one position */
    /* A bit for each face that must be listed: the faces that are not whole; whole faces of which
     * two corners belong to faces in pairs; whole faces of edges of more than two faces; and the
     * first face of each component that has no such face. */
    uint64_t *listed;
} ebpo_whole_faces;

#define EBPO_NO_COMPONENT UINT32_MAX

/* Finds the components. paired: a bit for each face that is in a pair. Fails with EBPO_E_FORMAT if
 * an edge of whole faces does not have both directions equally often. Must be freed, also after a
 * failure. */
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
