/* Computes the corner differences of one cell: the winding numbers at its corners minus the winding
 * number at its lowest corner. Each difference is the sum of the signed crossings of faces along
 * the cell's edges between the two corners (corner_windings.c). */
#include "core/strict_fp.h"

#include "construct/planes.h"
#include "geometry/cells.h"
#include "geometry/predicates.h"

/* Returns a mask of the cell faces that the triangle `f` may touch: bit 2*k for the lower and bit
 * 2*k+1 for the upper cell face along axis k. A triangle strictly on one side of a cell face
 * crosses none of that cell face's edges. A triangle strictly on one side of the cell crosses no
 * edge at all, so the mask is 0. The infinitely small shift of the corners does not change these
 * two facts. */
static unsigned cell_faces_reached(const double cell_face[3][2], const ebpo_triangle *f)
{
    unsigned reached = 0;
    for (int k = 0; k < 3; k++) {
        double a = f->corner[0][k], b = f->corner[1][k], c = f->corner[2][k];
        double low = a < b ? a : b, high = a < b ? b : a;
        low = c < low ? c : low;
        high = c > high ? c : high;
        if (high < cell_face[k][0] || low > cell_face[k][1])
            return 0;
        reached |= (unsigned)(low <= cell_face[k][0] && high >= cell_face[k][0]) << 2 * k |
                   (unsigned)(low <= cell_face[k][1] && high >= cell_face[k][1]) << (2 * k + 1);
    }
    return reached;
}

/* For each corner except corner 0, an edge to this corner from an earlier corner. `axis`: axis of
 * the edge; `before`: the earlier corner; `cell_faces`: the two cell faces that contain the edge,
 * as a mask of cell_faces_reached. */
static const struct {
    int axis, before;
    unsigned cell_faces;
} edge_to[8] = { { 0, 0, 0 },    { 0, 0, 0x14 }, { 1, 0, 0x11 }, { 1, 1, 0x12 },
                 { 2, 0, 0x05 }, { 2, 1, 0x06 }, { 2, 2, 0x09 }, { 2, 3, 0x0a } };

void ebpo_corner_windings(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *faces,
                          uint64_t count, int32_t delta[8])
{
    double cell_face[3][2];
    int32_t along[8] = { 0 }; /* [corner] crossings along the edge edge_to[corner] */
    for (int k = 0; k < 3; k++)
        for (uint32_t s = 0; s < 2; s++)
            cell_face[k][s] = ebpo_cell_face(box, k, cell.level, cell.at[k] + s);
    for (uint64_t i = 0; i < count; i++) {
        const ebpo_triangle *f = &faces[i];
        unsigned reached = cell_faces_reached((const double(*)[2])cell_face, f);
        /* an edge is in two cell faces, so the triangle crosses none */
        if ((reached & (reached - 1)) == 0)
            continue;
        for (int corner = 1; corner < 8; corner++) {
            int axis = edge_to[corner].axis, before = edge_to[corner].before;
            if ((reached & edge_to[corner].cell_faces) != edge_to[corner].cell_faces)
                continue;
            const double from[3] = { cell_face[0][before & 1], cell_face[1][before >> 1 & 1],
                                     cell_face[2][before >> 2 & 1] };
            along[corner] += ebpo_axis_crossing(from, cell_face[axis][1], axis, f->corner[0],
                                                f->corner[1], f->corner[2]);
        }
    }
    delta[0] = 0;
    for (int corner = 1; corner < 8; corner++)
        delta[corner] = delta[edge_to[corner].before] + along[corner];
}
