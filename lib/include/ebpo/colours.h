/* SPDX-License-Identifier: MIT
 * Returns the colours of vertices and faces.
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

    /* 1: prefer the colours of faces, because vertices have none or all have the same */
    uint64_t by_face;
} ebpo_colours;

/*
 * Gets the colours from a mesh's attributes: properties red, green, blue and, if present, alpha,
 * else diffuse_red, diffuse_green and diffuse_blue. uint16 is scaled from 65,535 and floats from 1;
 * other integers count from 0 to 255. Values out of range are clamped; NaN is 0. A mesh without
 * attributes has no colours.
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
 * Threads: one per struct.
 */
EBPO_API void ebpo_colours_free(ebpo_colours *colours);

#ifdef __cplusplus
}
#endif
#endif
