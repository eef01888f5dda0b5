/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: colours of vertices and faces.
 */
#ifndef EBPO_COLOURS_H
#define EBPO_COLOURS_H

#include <ebpo/mesh.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Red, green, blue (sRGB) and alpha, 0 to 255 each. Freed by ebpo_colours_free. */
typedef struct ebpo_colours {
    /* [vertex_count][4]; NULL: vertices have no colours. */
    uint8_t *vertex;

    /* [face_count][4]; NULL: faces have no colours. */
    uint8_t *face;

    /* 1: faces' colours say more: vertices have none, or all the same beside faces' */
    uint64_t by_face;
} ebpo_colours;

/*
 * The colours among a mesh's attributes: properties red, green and blue, and alpha
 * where there is one, else diffuse_red, diffuse_green and diffuse_blue. uint16 is
 * scaled from 65,535 and floats from 1; of other integers 0 to 255 count. What is
 * beyond is the nearest of these, NaN is 0. A mesh without attributes has none.
 *
 * EBPO_E_MEMORY. On failure `out` is cleared.
 *
 * Threads: any, while nobody changes the mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_colours(const ebpo_mesh *mesh, ebpo_colours *out,
                                                     ebpo_error *error);

/*
 * Frees the arrays and clears the struct.
 *
 * Threads: one per struct.
 */
EBPO_API void ebpo_colours_free(ebpo_colours *colours);

#ifdef __cplusplus
}
#endif
#endif
