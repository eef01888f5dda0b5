/* SPDX-License-Identifier: MIT
 * Gets the colours of vertices and faces of a mesh.
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

    /*
     * Colours that a viewer should prefer. 1: colours of faces, because vertices have no colours or
     * all have the same colour; 0: colours of vertices
     */
    uint64_t by_face;
} ebpo_colours;

/*
 * Gets the colours from a mesh's attributes red, green, blue and alpha. If red, green or blue is
 * missing, the attributes diffuse_red, diffuse_green, diffuse_blue and diffuse_alpha are used. If
 * alpha is missing, it is 255. Values are scaled to 0 .. 255: for uint16 the maximum is 65,535, for
 * floats it is 1, and for other integers 255. Values out of range are clamped; NaN becomes 0. A
 * mesh without attributes has no colours.
 *
 * On failure `out` is cleared.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_colours(const ebpo_mesh *mesh, ebpo_colours *out,
                                                     ebpo_error *error);

/*
 * Frees the arrays and clears the struct.
 *
 * Threads: one at a time per struct.
 */
EBPO_API void ebpo_colours_free(ebpo_colours *colours);

#ifdef __cplusplus
}
#endif
#endif
