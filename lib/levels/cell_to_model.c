#include "core/strict_fp.h"

#include "levels/cell_to_model.h"

#include <math.h>

#include "geometry/cells.h"

/* With t the cell's shortest side and N = t n / size, the half-space is N . (p - corner) <= t d /
 * 4096. For any normal a, any factor f > 0, and p in the cell: a . p = a . corner + f N . (p -
 * corner) + (a - f N) . (p - corner) <= a . corner + f t d / 4096 + sum |a - f N| size. Here f is 1
 * / |N| as computed and a is f N as computed, so that |a - f N| <= 4 u |a| with u = DBL_EPSILON /
 * 2, the other roundings of this function sum to less than 8 u times sum |a| (|corner| + size), and
 * evaluating a . p to another 4 u of that. 32 u covers them all; what underflows is covered by the
 * rest. */
void ebpo_plane_to_world(const ebpo_box *box, ebpo_cell cell, const int32_t n[3], int32_t d,
                         double out[4])
{
    double corner[3], size[3], reach = 0, bulk = 0, at = 0, square = 0;
    for (int k = 0; k < 3; k++) {
        corner[k] = ebpo_wall(box, k, cell.level, cell.at[k]);
        size[k] = box->size[k] / (double)(1u << cell.level);
    }
    double shortest = fmin(size[0], fmin(size[1], size[2]));
    for (int k = 0; k < 3; k++) {
        out[k] = (double)n[k] * (shortest / size[k]);
        square += out[k] * out[k];
    }
    double factor = 1 / sqrt(square);
    for (int k = 0; k < 3; k++) {
        out[k] *= factor;
        at += out[k] * corner[k];
        reach += fabs(out[k]) * (fabs(corner[k]) + size[k]);
        bulk += fabs(corner[k]) + size[k];
    }
    out[3] = at + factor * shortest * ((double)d / 4096) +
             (16 * DBL_EPSILON * reach + 4 * DBL_MIN * bulk + 64 * DBL_TRUE_MIN);
}

void ebpo_polytope_to_world(const ebpo_polytope *p, const ebpo_box *box, ebpo_cell cell,
                            double (*out)[3])
{
    uint8_t sides[EBPO_POLYTOPE_VERTICES];
    ebpo_polytope_sides(p, sides);
    for (int v = 0; v < p->vertex_count; v++)
        for (int k = 0; k < 3; k++)
            out[v][k] = ebpo_wall_point(box, cell, k, p->vertex[v][k], sides[v]);
}
