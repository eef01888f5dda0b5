/* Bounds the greatest distance of the points of a triangle from a surface by the triangles of the
 * surface that cover the triangle. */
#ifndef EBPO_CONSTRUCT_SURFACE_COVER_H
#define EBPO_CONSTRUCT_SURFACE_COVER_H

#include "construct/simplify.h"

enum { EBPO_COVER_GUESSES = 4 };

/* A vertex of the surface in the frame of a triangle. */
typedef struct ebpo_cover_vertex {
    /* coordinates along the triangle's first edge, across this edge, and along the normal; the
     * triangle's first corner has the coordinates 0 */
    double at[3];
    unsigned outside; /* bit k: the vertex is outside of side k of the prism over the triangle */
    uint32_t turn;    /* the number of the triangle (ebpo_cover.turn) */
} ebpo_cover_vertex;

/* A side of the prism over a triangle. Points with x * at[0] + y * at[1] <= most are inside. */
typedef struct ebpo_cover_side {
    double x, y, most; /* (x, y): unit vector to the outside */
} ebpo_cover_side;

/* The surface, and the frame of the current triangle. */
typedef struct ebpo_cover {
    const ebpo_patch_mesh *surface;
    uint32_t *across;          /* [3 * triangles] triangle on the other side of each edge, or
                                * UINT32_MAX. Entry 3 * t + k belongs to the edge from corner k */
    uint32_t *seen;            /* [triangles] value of `turn` when the triangle was last visited */
    ebpo_cover_vertex *vertex; /* [vertices] */
    uint32_t turn;             /* number of the current triangle, from 1 */
    double axis[3][3], origin[3], centre[2];
    ebpo_cover_side side[3];
} ebpo_cover;

/* Prepares the use of a surface, which must remain unchanged. Returns false when out of memory;
 * then, too, ebpo_cover_free must be called. At most UINT32_MAX / 3 triangles. */
bool ebpo_cover_make(ebpo_cover *cover, const ebpo_patch_mesh *surface);
void ebpo_cover_free(ebpo_cover *cover);

/* Returns an upper bound of the distance of the points of a triangle from the surface. Returns
 * INFINITY if no covering was found. `p`: its corners, of at most 2 in absolute value. `guess`:
 * triangles of the surface that are probably near, or UINT64_MAX; the best guess is the last one.
 * Bounds of at most `least` need not be close to the distance. Sets *near to a triangle of the
 * surface, and `far` to a point whose distance is probably near the bound, unless the result is
 * INFINITY. */
double ebpo_cover_bound(ebpo_cover *cover, const double p[3][3],
                        const uint64_t guess[EBPO_COVER_GUESSES], double least, uint64_t *near,
                        double far[3]);

#endif
