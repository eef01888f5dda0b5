/* Winding numbers at a cell's corners, from one corner along the cell's edges. */
#include "core/strict_fp.h"

#include "geometry/predicates.h"
#include "construct/planes.h"

/* The walls that a face reaches: bit 2 k lower, 2 k + 1 upper wall of axis k. What is strictly to
 * one side of a wall, or of the cell, is sure not to cross an edge there, however little the edge
 * is shifted. */
static unsigned walls_reached(const double wall[3][2], const ebpo_triangle *f)
{
    unsigned reached = 0;
    for (int k = 0; k < 3; k++) {
        double a = f->corner[0][k], b = f->corner[1][k], c = f->corner[2][k];
        double low = a < b ? a : b, high = a < b ? b : a;
        low = c < low ? c : low;
        high = c > high ? c : high;
        if (high < wall[k][0] || low > wall[k][1])
            return 0;
        reached |= (unsigned)(low <= wall[k][0] && high >= wall[k][0]) << 2 * k |
                   (unsigned)(low <= wall[k][1] && high >= wall[k][1]) << (2 * k + 1);
    }
    return reached;
}

/* The edge to each corner from an earlier one: its axis, that corner, and the two walls that it
 * lies in. */
static const struct {
    int axis, before;
    unsigned walls;
} edge_to[8] = { { 0, 0, 0 },    { 0, 0, 0x14 }, { 1, 0, 0x11 }, { 1, 1, 0x12 },
                 { 2, 0, 0x05 }, { 2, 1, 0x06 }, { 2, 2, 0x09 }, { 2, 3, 0x0a } };

void ebpo_corner_windings(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *faces,
                          uint64_t count, int32_t delta[8])
{
    double wall[3][2];
    int32_t along[8] = { 0 };
    for (int k = 0; k < 3; k++)
        for (uint32_t s = 0; s < 2; s++)
            wall[k][s] = ebpo_wall(box, k, cell.level, cell.at[k] + s);
    for (uint64_t i = 0; i < count; i++) {
        const ebpo_triangle *f = &faces[i];
        unsigned reached = walls_reached((const double(*)[2])wall, f);
        if ((reached & (reached - 1)) == 0) /* two at least */
            continue;
        for (int corner = 1; corner < 8; corner++) {
            int axis = edge_to[corner].axis, before = edge_to[corner].before;
            if ((reached & edge_to[corner].walls) != edge_to[corner].walls)
                continue;
            const double from[3] = { wall[0][before & 1], wall[1][before >> 1 & 1],
                                     wall[2][before >> 2 & 1] };
            along[corner] += ebpo_axis_crossing(from, wall[axis][1], axis, f->corner[0],
                                                f->corner[1], f->corner[2]);
        }
    }
    delta[0] = 0;
    for (int corner = 1; corner < 8; corner++)
        delta[corner] = delta[edge_to[corner].before] + along[corner];
}
