/* Plane codes: a half-space in the coordinates of its node's cell, in 32 bits, decoded to integers
 * so that nobody rounds.
 *
 * bits 0-9 u, bits 10-19 v, bits 20-31 q. With U = u - 511, V = v - 511 in [-511, 511]: the normal
 * is the point (U, V) of the octahedral map (Cigolle et al., "A Survey of Efficient Representations
 * for Independent Unit Vectors", 2014) kept as integers of 1-norm 511. With m the sum of the
 * normal's negative components (the least value of n . xi over the cell), the half-space is 4096 *
 * (n . xi) <= 4096 * m + 511 * (q + 1),   0 <= q <= 4094, so q counts 4096ths of the cell's width
 * in direction n. q = 4095 would keep the whole cell and stands for no plane.
 */
#ifndef EBPO_GEOMETRY_PLANE_CODE_H
#define EBPO_GEOMETRY_PLANE_CODE_H

#include <stdbool.h>
#include <stdint.h>

enum { EBPO_NORMAL_NORM = 511, EBPO_OFFSET_STEPS = 4096 };

/* The same as the public ebpo_plane_decode (file.h), for the lower layers. */
bool ebpo_plane_code_decode(uint32_t code, int32_t n[3], int32_t *d);

/* Normal part (bits 0-19) of the code nearest to a direction in cell coordinates, of any length;
 * false for (0, 0, 0) or not finite. Cell coordinates scale each axis, so a face's world normal is
 * multiplied by the cell's size, axis by axis, to get this direction. */
bool ebpo_plane_code_normal(const double direction[3], uint32_t *normal);

/* Least q whose half-space keeps every point with n . xi <= support, or -1 when only the whole cell
 * would do. `support` is in units of n . xi; the rounding of this function itself is on the safe
 * side. */
int ebpo_plane_code_offset(const int32_t n[3], double support);

static inline uint32_t ebpo_plane_code_make(uint32_t normal, int q)
{
    return normal | (uint32_t)q << 20;
}

/* The same half-space, 4096 * (n . xi) <= d, in the coordinates of child `octant`: xi_parent =
 * (xi_child + octant) / 2. Exact; d grows by less than one bit for each level. */
static inline int64_t ebpo_plane_to_child(const int32_t n[3], int64_t d, unsigned octant)
{
    int64_t shift = 0;
    for (int i = 0; i < 3; i++)
        if (octant >> i & 1)
            shift += n[i];
    return 2 * d - (int64_t)EBPO_OFFSET_STEPS * shift;
}

#endif
