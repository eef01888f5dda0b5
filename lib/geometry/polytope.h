/* Defines plane codes, convex polytopes and envelopes. A plane code is a half-space in the
 * coordinates of a node's cell, in 32 bits. It is decoded to integers, so that no reader rounds.
 *
 *   bits 0-9    u
 *   bits 10-19  v
 *   bits 20-31  q
 *
 * Let U = u - 511 and V = v - 511, both in [-511, 511]. The normal n is the point (U, V) of the
 * octahedral map (Cigolle et al., "A Survey of Efficient Representations for Independent Unit
 * Vectors", 2014). Its components are integers, and the sum of their absolute values is 511. Let xi
 * be a point in cell coordinates (0 to 1 on each axis). Let m be the sum of the negative components
 * of n; m is the least value of n . xi in the cell. The half-space is
 *
 *   4096 * (n . xi) <= 4096 * m + 511 * (q + 1),   0 <= q <= 4094
 *
 * So q counts 4096ths of the cell's width in direction n. A half-space with q = 4095 would keep the
 * whole cell, so this value means no plane. */
#ifndef EBPO_GEOMETRY_POLYTOPE_H
#define EBPO_GEOMETRY_POLYTOPE_H

#include <stdbool.h>
#include <stdint.h>

#include <ebpo/file.h>

#include "geometry/cells.h"

enum { EBPO_NORMAL_NORM = 511, EBPO_OFFSET_STEPS = 4096 };

/* Decodes a plane code to the integers n and d of the half-space 4096 * (n . xi) <= d. Returns
 * false if the code is invalid. The public function ebpo_plane_decode (ebpo/file.h) calls this
 * function. */
bool ebpo_plane_code_decode(uint32_t code, int32_t n[3], int32_t *d);

/* Computes the normal part (bits 0-19) of the code that is nearest to a direction in cell
 * coordinates. The direction may have any length. Returns false for (0, 0, 0) and for non-finite
 * directions. In cell coordinates, the direction of a face's normal is the normal multiplied by the
 * cell's size, axis by axis. */
bool ebpo_plane_code_normal(const double direction[3], uint32_t *normal);

/* Returns the least q whose half-space contains every point of the cell with n . xi <= support, or
 * -1 if there is no such q. `support` is in units of n . xi. Rounding never makes the half-space
 * smaller. */
int ebpo_plane_code_offset(const int32_t n[3], double support);

static inline uint32_t ebpo_plane_code_make(uint32_t normal, int q)
{
    return normal | (uint32_t)q << 20;
}

/* Returns the d of the half-space 4096 * (n . xi) <= d in the coordinates of the child `octant`,
 * where xi_parent = (xi_child + octant) / 2. The result is exact. With each level, d gets at most
 * about one bit more. */
static inline int64_t ebpo_plane_to_child(const int32_t n[3], int64_t d, unsigned octant)
{
    int64_t shift = 0;
    for (int i = 0; i < 3; i++)
        if (octant >> i & 1)
            shift += n[i];
    return 2 * d - (int64_t)EBPO_OFFSET_STEPS * shift;
}

/* Convex polytopes in cell coordinates, cut from the unit cube by half-spaces. They are used for
 * volumes, for drawing and for the choice of planes. Their vertices are rounded. Containment never
 * depends on polytopes, only on the decoded half-spaces. Source: BP 2008, section 3.4.3 (clipping
 * of the box), here applied to vertex loops. */

/* Capacity for a cube that is cut by 255 planes (the most planes of a node), if no more than three
 * planes intersect in one point. */
enum { EBPO_POLYTOPE_VERTICES = 528, EBPO_POLYTOPE_FACES = 264, EBPO_POLYTOPE_CORNERS = 1584 };

/* Face loops run counter-clockwise seen from outside. The tag of a face identifies its half-space.
 * It is -1 - (2 * axis + side) for the faces of the unit cube, and otherwise the tag that the
 * caller of ebpo_polytope_clip gave. */
typedef struct ebpo_polytope {
    int vertex_count, face_count, corner_count;
    double vertex[EBPO_POLYTOPE_VERTICES][3];
    int32_t tag[EBPO_POLYTOPE_FACES];
    uint16_t first[EBPO_POLYTOPE_FACES + 1]; /* corners of face f: first[f] .. first[f + 1] - 1 */
    uint16_t corner[EBPO_POLYTOPE_CORNERS];  /* vertex indices */
} ebpo_polytope;

typedef enum ebpo_clip {
    EBPO_CLIP_NONE, /* nothing was removed */
    EBPO_CLIP_CUT,
    /* The polytope is unchanged (too large, never too small), because almost nothing would remain,
     * the capacity is exceeded, or rounding would make the loops invalid. */
    EBPO_CLIP_REFUSED
} ebpo_clip;

/* Makes the unit cube. */
void ebpo_polytope_cube(ebpo_polytope *p);

/* Cuts the polytope: keeps the points with n . x <= d. |n| should be about 1, because vertices
 * within a distance of 1e-10 count as on the plane. `tag`: tag of the new face. */
ebpo_clip ebpo_polytope_clip(ebpo_polytope *p, const double n[3], double d, int32_t tag);

/* Sets *out to the part of p in the octant, scaled to the unit cube. Returns false when this part
 * is empty up to rounding; then *out is a box that contains it. `out` may not be `p`. The new
 * faces, where siblings adjoin, get the tags of the unit cube. */
bool ebpo_polytope_child(const ebpo_polytope *p, unsigned octant, ebpo_polytope *out);

/* Sets *out to the part of p in one half along `axis` (side 0: lower, 1: upper), scaled to the unit
 * cube. ebpo_polytope_child halves along z, then y, then x. When the part is empty up to rounding,
 * returns false and sets *out to the whole cube. `out` may not be `p`. */
bool ebpo_polytope_half(const ebpo_polytope *p, int axis, int side, ebpo_polytope *out);

/* Copies only the used part of the struct. */
void ebpo_polytope_copy(ebpo_polytope *to, const ebpo_polytope *from);

/* For each vertex, sets bit 2 * axis + side for each face of the unit cube on which the vertex is.
 * The result comes from the tags of the faces, so it does not depend on the rounding of vertices.
 */
void ebpo_polytope_sides(const ebpo_polytope *p, uint8_t sides[EBPO_POLYTOPE_VERTICES]);

double ebpo_polytope_volume(const ebpo_polytope *p);

/* Returns the volume that clipping by n . x <= d would remove; 0 when this volume is certainly
 * below `least`. `volume` is the polytope's volume. */
double ebpo_polytope_removed(const ebpo_polytope *p, const double n[3], double d, double volume,
                             double least);

/* Returns an upper bound of the volume of the part of a convex body beyond a plane. `volume`: V, of
 * the whole body. `width`: H, extent of the body along the plane's normal. `height`: h, extent of
 * the part beyond the plane. Among all such bodies, a cone whose base is beyond the plane has the
 * largest part: V (1 - (1 - h/H)^3). */
double ebpo_polytope_cap_bound(double volume, double width, double height);

/* --- polytopes cut by plane codes --- */

/* Converts n to a direction of length about 1 and the matching offset, for ebpo_polytope_clip. */
static inline double ebpo_plane_as_double(const int32_t n[3], int64_t d, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = (double)n[k] * (1.0 / 511);
    return (double)d * (1.0 / (511.0 * 4096));
}

/* Cuts the envelope by plane codes in the coordinates of its cell. The tag of a new face is the
 * index of its code. */
void ebpo_planes_cut(ebpo_polytope *envelope, const uint32_t *codes, uint64_t count);

/* The half-space 4096 (n . xi) <= d. */
typedef struct ebpo_half_space {
    int32_t n[3];
    int64_t d;
} ebpo_half_space;

enum { EBPO_HALF_SPACES_MAX = EBPO_LEVELS_MAX * 256 }; /* a node has at most 255 planes */

/* The half-spaces that bound a node's envelope within its cell. They come from the planes of the
 * node's ancestors and of the node itself, as exact integers in the coordinates of the node's cell.
 * Half-spaces that contain the whole cell are omitted. */
typedef struct ebpo_half_spaces {
    int count;
    ebpo_half_space at[EBPO_HALF_SPACES_MAX];
} ebpo_half_spaces;

/* Adds the half-spaces of plane codes of the current cell. */
void ebpo_half_spaces_add(ebpo_half_spaces *spaces, const uint32_t *codes, uint64_t count);

/* Converts the half-spaces from the coordinates of the cell to the coordinates of its child. */
void ebpo_half_spaces_to_child(ebpo_half_spaces *spaces, unsigned octant);

/* Cuts the cell by the half-spaces, each moved outwards by `slack` (in units of n . xi / 511: 1 is
 * about the width of a cell). */
void ebpo_half_spaces_cut(const ebpo_half_spaces *spaces, double slack, ebpo_polytope *out);

/* The envelopes of the nodes on a path down the tree, as polytopes. Neighbouring nodes share the
 * envelopes of their common ancestors. The stack takes about 170 KB; initialise it with zeros. */
typedef struct ebpo_envelope_stack {
    ebpo_octcode octcode[EBPO_LEVELS_MAX]; /* node of each envelope; 0: none */
    ebpo_polytope at[EBPO_LEVELS_MAX];
} ebpo_envelope_stack;

/* Returns the node's envelope, or NULL when it is not in the stack. */
static inline const ebpo_polytope *ebpo_envelope_held(const ebpo_envelope_stack *stack,
                                                      ebpo_octcode octcode)
{
    int level = ebpo_octcode_level(octcode);
    return stack->octcode[level] == octcode ? &stack->at[level] : NULL;
}

/* Adds the envelope of a node in coordinates of its cell: the part of the parent's envelope in this
 * cell, cut by the node's own planes. The parent's envelope must be in the stack (for the root, it
 * is the cube). The result is valid until another node of the same level is added. */
const ebpo_polytope *ebpo_envelope_put(ebpo_envelope_stack *stack, ebpo_octcode octcode,
                                       const uint32_t *codes, uint64_t count);

/* Adds the envelope of a black node, which is its cell. */
const ebpo_polytope *ebpo_envelope_put_cube(ebpo_envelope_stack *stack, ebpo_octcode octcode);

#endif
