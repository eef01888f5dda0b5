/* Winding numbers at a cell's corners, from one corner along the cell's edges. */
#include "geom/strict_fp.h"

#include <string.h>

#include "geom/predicates.h"
#include "planes/planes.h"

/* Can the face cross the (infinitely little shifted) edge at all? Only what is strictly to one side is sure not to. */
static bool off_line(const ebpo_triangle *f, const double from[3], double to, int axis)
{
    for (int k = 0; k < 3; k++) {
        double a = f->corner[0][k], b = f->corner[1][k], c = f->corner[2][k];
        double low = from[k], high = k == axis ? to : from[k];
        if ((a < low && b < low && c < low) || (a > high && b > high && c > high))
            return true;
    }
    return false;
}

static int32_t along_edge(const double from[3], double to, int axis, const ebpo_triangle *faces, uint64_t count)
{
    int32_t sum = 0;
    for (uint64_t i = 0; i < count; i++)
        if (!off_line(&faces[i], from, to, axis))
            sum += ebpo_axis_crossing(from, to, axis, faces[i].corner[0], faces[i].corner[1], faces[i].corner[2]);
    return sum;
}

void ebpo_corner_windings(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *faces, uint64_t count, int32_t delta[8])
{
    /* Each corner from an earlier one: 1 along x; 2, 3 along y; 4 to 7 along z. */
    double wall[3][2];
    for (int k = 0; k < 3; k++)
        for (uint32_t s = 0; s < 2; s++)
            wall[k][s] = ebpo_wall(box, k, cell.level, cell.at[k] + s);
    delta[0] = 0;
    for (int i = 1; i < 8; i++) {
        int axis = i >= 4 ? 2 : i >= 2 ? 1 : 0, before = i & ~(1 << axis);
        double from[3];
        for (int k = 0; k < 3; k++)
            from[k] = wall[k][before >> k & 1];
        delta[i] = delta[before] + along_edge(from, wall[axis][1], axis, faces, count);
    }
}
