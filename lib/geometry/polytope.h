/* Convex polytopes in cell coordinates, cut from the unit cube by half-spaces: for volumes, drawing
 * and choosing planes. Their vertices are rounded. Containment never depends on them; the decoded
 * half-spaces carry the guarantee. Source: BP 2008, section 3.4.3 (clipping of the box), done here
 * on vertex loops. */
#ifndef EBPO_GEOMETRY_POLYTOPE_H
#define EBPO_GEOMETRY_POLYTOPE_H

#include <stdbool.h>
#include <stdint.h>

/* Room for the 255 planes that a node may have, on a cube, where no more than three meet in a
 * point. */
enum { EBPO_POLYTOPE_VERTICES = 528, EBPO_POLYTOPE_FACES = 264, EBPO_POLYTOPE_CORNERS = 1584 };

/* Face loops run counter-clockwise seen from outside. A face's tag names the half-space it comes
 * from: -1 - (2 * axis + side) for the walls of the first cube, then what ebpo_polytope_clip was
 * given. */
typedef struct ebpo_polytope {
    int vertex_count, face_count, corner_count;
    double vertex[EBPO_POLYTOPE_VERTICES][3];
    int32_t tag[EBPO_POLYTOPE_FACES];
    uint16_t first[EBPO_POLYTOPE_FACES + 1]; /* corners of face f: first[f] .. first[f + 1] - 1 */
    uint16_t corner[EBPO_POLYTOPE_CORNERS];  /* vertex numbers */
} ebpo_polytope;

typedef enum ebpo_clip {
    EBPO_CLIP_NONE, /* nothing was removed */
    EBPO_CLIP_CUT,
    /* next to nothing would remain, or there is no room, or rounding spoiled the loops: left as it
       was (too large, never too small) */
    EBPO_CLIP_REFUSED
} ebpo_clip;

/* The unit cube. */
void ebpo_polytope_cube(ebpo_polytope *p);

/* Keeps n . x <= d. |n| should be about 1 (tolerance 1e-10 in cell units). */
ebpo_clip ebpo_polytope_clip(ebpo_polytope *p, const double n[3], double d, int32_t tag);

/* Cuts out the octant and scales it to the unit cube; false when (numerically) nothing lies in it:
 * *out is then a box around it. `out` may not be `p`. Walls between siblings get the wall tags
 * again. */
bool ebpo_polytope_child(const ebpo_polytope *p, unsigned octant, ebpo_polytope *out);

/* One half along `axis` (side 0: lower, 1: upper), scaled to the unit cube; ebpo_polytope_child is
 * z, then y, then x. False, and the whole cube, when (numerically) nothing lies in it. */
bool ebpo_polytope_half(const ebpo_polytope *p, int axis, int side, ebpo_polytope *out);

/* Copies what is in use: much less than the struct. */
void ebpo_polytope_copy(ebpo_polytope *to, const ebpo_polytope *from);

/* Of each vertex bit 2 * axis + side for each wall of the cube that it lies on, whatever rounding
 * made of it. */
void ebpo_polytope_sides(const ebpo_polytope *p, uint8_t sides[EBPO_POLYTOPE_VERTICES]);

double ebpo_polytope_volume(const ebpo_polytope *p);

/* Volume that clipping by n . x <= d would remove; 0 when it is certainly below `least`, for which
 * `volume` is the polytope's own. */
double ebpo_polytope_removed(const ebpo_polytope *p, const double n[3], double d, double volume,
                             double least);

/* Upper bound of the volume beyond a plane, for a body of that volume which is so wide along the
 * plane's normal and reaches so far beyond it: among convex bodies of volume V and width H the cap
 * of height h is largest for the cone with its base on the far side, V (1 - (1 - h/H)^3). */
double ebpo_polytope_cap_bound(double volume, double width, double height);

#endif
