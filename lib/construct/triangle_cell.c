/* Compares a face with a cell: finds the octants of the cell that the face may touch, and clips the
 * face to the cell.
 *
 * All tests use a bound of the rounding error and are conservative, so no exact arithmetic is
 * needed. A test may keep a face that does not touch the cell, but it never drops a face that
 * touches the cell. (If the list of a cell has a face that does not touch the cell, this costs
 * little time. If a face were missing, the file would be wrong.) The tests use the face's bounding
 * box, its plane, and the cross products of its edges with the axes (separating axes). Clipping
 * enlarges the cell by the bound, so that the clipped polygon of a face that touches the closed
 * cell is never empty. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "construct/construct_stages.h"
#include "construct/planes.h"
#include "construct/sweep.h"
#include "geometry/polytope.h"
#include "geometry/vec3.h"

/* Converts a face to cell coordinates `x`. Returns their greatest absolute value, or 1 if this is
 * greater. Corners and sizes of cells are exact, so a coordinate is rounded only twice: in the
 * subtraction and in the division. */
static double to_cell(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *face,
                      double x[3][3])
{
    double greatest = 1;
    for (int k = 0; k < 3; k++) {
        double corner = ebpo_cell_face(box, k, cell.level, cell.at[k]);
        double size = box->size[k] * ebpo_half_power(cell.level);
        for (int i = 0; i < 3; i++) {
            x[i][k] = (face->corner[i][k] - corner) / size;
            double a = fabs(x[i][k]);
            greatest = a > greatest ? a : greatest;
        }
    }
    return greatest;
}

/* Returns the slack: an upper bound of the rounding error of a coordinate. `greatest`: result of
 * to_cell, M in the following. With u = 2^-53, the error of to_cell is at most 2.01 u M, and the
 * error of each of six clips is at most 8 u M. The value 128 u M is more than the sum of these
 * errors. The slack is the same for all faces with coordinates up to 2, so that a common point of
 * two faces is computed identically from both. */
static double slack_for(double greatest) { return greatest <= 2 ? 0x1p-45 : greatest * 0x1p-46; }

/* Clips a polygon by the half-space of the points with sign * x[axis] <= limit. Returns the number
 * of remaining corners. */
static int clip_cell_face(double in[9][3], int count, int axis, double sign, double limit,
                          double out[9][3])
{
    int kept = 0;
    for (int i = 0; i < count; i++) {
        const double *a = in[i], *b = in[i + 1 < count ? i + 1 : 0];
        double da = sign * a[axis] - limit, db = sign * b[axis] - limit;
        if (da <= 0) {
            for (int k = 0; k < 3; k++)
                out[kept][k] = a[k];
            kept++;
        }
        if ((da < 0 && db > 0) || (da > 0 && db < 0)) {
            /* interpolates from the end inside the half-space, so that the result does not depend
             * on the edge's direction */
            bool back = da > 0;
            const double *from = back ? b : a, *to = back ? a : b;
            double t = back ? db / (db - da) : da / (da - db);
            for (int k = 0; k < 3; k++)
                out[kept][k] = from[k] + t * (to[k] - from[k]);
            out[kept][axis] = sign * limit;
            kept++;
        }
    }
    return kept;
}

static void swap_buffers(double (**a)[3], double (**b)[3])
{
    double(*c)[3] = *a;
    *a = *b;
    *b = c;
}

int ebpo_clip_triangle(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *face,
                       double points[9][3], double *slack)
{
    double x[3][3], buffer[9][3], (*at)[3] = points, (*other)[3] = buffer,
                                  e = slack_for(to_cell(box, cell, face, x));
    *slack = e;
    int count = 3;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            points[i][k] = x[i][k];
    for (int k = 0; k < 3; k++) {
        double low = ebpo_min3(x[0][k], x[1][k], x[2][k]),
               high = ebpo_max3(x[0][k], x[1][k], x[2][k]);
        if (low > 1 + e || high < -e)
            return 0;
        if (high <= 1 + e && low >= -e)
            continue;
        /* A corner that an earlier clip made may be beyond the face's bounds, but by less than e.
         * So a clip at a cell face that the bounds do not cross changes nothing, and is omitted. */
        if (high > 1)
            count = clip_cell_face(at, count, k, 1, 1 + e, other), swap_buffers(&at, &other);
        if (low < 0)
            count = clip_cell_face(at, count, k, -1, e, other), swap_buffers(&at, &other);
    }
    if (at != points)
        memcpy(points, at, (size_t)count * sizeof *points);
    return count;
}

ebpo_sweep_cell ebpo_octants_prepare(const ebpo_box *box, ebpo_cell cell)
{
    ebpo_sweep_cell out;
    for (int lane = 0; lane < 4; lane++) {
        int k = lane < 3 ? lane : 2;
        out.low[lane] = ebpo_cell_face(box, k, cell.level, cell.at[k]);
        out.centre[lane] = ebpo_cell_face(box, k, cell.level + 1, 2 * cell.at[k] + 1);
        out.size[lane] = box->size[k] * ebpo_half_power(cell.level);
    }
    return out;
}

unsigned ebpo_octants_visited(const ebpo_sweep_cell *cell, const ebpo_triangle *face)
{
    return ebpo_sweep_best()->find_octants(cell, face->corner);
}

bool ebpo_face_normal_code(const ebpo_box *box, const ebpo_triangle *face, uint32_t *normal)
{
    /* every cell has the shape of the root box, so the normal in the root's coordinates is the
     * normal in any cell's coordinates */
    double x[3][3], edge[2][3], direction[3];
    (void)to_cell(box, (ebpo_cell){ 0, { 0, 0, 0 } }, face, x);
    ebpo_vec3_subtract(x[1], x[0], edge[0]);
    ebpo_vec3_subtract(x[2], x[1], edge[1]);
    ebpo_vec3_cross(edge[0], edge[1], direction);
    return ebpo_plane_code_normal(direction, normal);
}
