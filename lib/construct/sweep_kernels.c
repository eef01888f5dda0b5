/* Implements the kernels of sweep.h, which process four doubles at a time.
 * meson.build compiles this file once for each instruction set. All variants do the same operations
 * in the same order, so they give the same results. core/cpu.h chooses the variant. */
#include "core/strict_fp.h"

#include "construct/sweep.h"

#include <math.h>
#include <string.h>

#include "core/simd.h"
#include "geometry/vec3.h"

typedef v4d v4d_stored __attribute__((aligned(8), may_alias));

static v4d load_four(const double *at) { return *(const v4d_stored *)at; }

/* Implements ebpo_sweep.find_extremes. Two vectors have a point's coordinates along the axes and
 * along the diagonals; the last lane of the first vector is unused. */
static void find_extreme_points(const double (*p)[3], int count, int at[EBPO_SWEEP_EXTREMES])
{
    v4d high[2], low[2];
    v4l at_high[2], at_low[2];
    for (int j = 0; j < 2; j++) {
        high[j] = v4d_all(-INFINITY), low[j] = v4d_all(INFINITY);
        at_high[j] = at_low[j] = (v4l){ 0, 0, 0, 0 };
    }
    for (int i = 0; i < count; i++) {
        double x = p[i][0], y = p[i][1], z = p[i][2], sum = x + y, difference = x - y;
        const v4d along[2] = { { x, y, z, z },
                               (v4d){ sum, sum, difference, difference } + (v4d){ z, -z, z, -z } };
        const v4l index = { i, i, i, i };
        for (int j = 0; j < 2; j++) {
            v4l higher = along[j] > high[j], lower = along[j] < low[j];
            high[j] = v4d_pick(higher, along[j], high[j]);
            low[j] = v4d_pick(lower, along[j], low[j]);
            at_high[j] = (index & higher) | (at_high[j] & ~higher);
            at_low[j] = (index & lower) | (at_low[j] & ~lower);
        }
    }
    for (int w = 0; w < EBPO_SWEEP_EXTREMES / 2; w++) {
        int j = w >= 3, lane = w >= 3 ? w - 3 : w;
        at[2 * w] = (int)at_high[j][lane];
        at[2 * w + 1] = (int)at_low[j][lane];
    }
}

/* Implements ebpo_sweep.make_planes. */
static void make_planes_of_edges(const double (*p)[3], const uint32_t *edge, int count, int apex,
                                 ebpo_sweep_plane *out)
{
    for (int first = 0; first < count; first += 4) {
        v4d a[3], u[3], v[3], n[3], length;
        const double *from[4], *to[4];
        for (int i = 0; i < 4; i++) {
            uint32_t e = edge[first + i < count ? first + i : count - 1];
            from[i] = p[e >> 16];
            to[i] = p[e & 0xffff];
        }
        for (int k = 0; k < 3; k++) {
            a[k] = (v4d){ from[0][k], from[1][k], from[2][k], from[3][k] };
            u[k] = (v4d){ to[0][k], to[1][k], to[2][k], to[3][k] } - a[k];
            v[k] = v4d_all(p[apex][k]) - a[k];
        }
        for (int k = 0; k < 3; k++) {
            int i = (k + 1) % 3, j = (k + 2) % 3;
            n[k] = u[i] * v[j] - u[j] * v[i];
        }
        v4d square = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
        for (int i = 0; i < 4; i++)
            length[i] = sqrt(square[i]);
        for (int k = 0; k < 3; k++)
            n[k] = n[k] / length;
        v4d d = n[0] * a[0] + n[1] * a[1] + n[2] * a[2];
        for (int i = 0; i < 4 && first + i < count; i++)
            out[first + i] = (ebpo_sweep_plane){ { n[0][i], n[1][i], n[2][i] }, d[i], length[i] };
    }
}

/* Adds first + i to the list for each bit i that is set in `bits`. Returns the new count, which
 * also counts elements beyond `capacity`. */
static int list_bits(unsigned bits, int first, uint16_t *list, int capacity, int count)
{
    for (; bits; bits &= bits - 1, count++)
        if (count < capacity)
            list[count] = (uint16_t)(first + __builtin_ctz(bits));
    return count;
}

/* Implements ebpo_sweep.find_visible. */
static int find_visible_planes(const ebpo_sweep_planes *planes, const double p[3], double beyond,
                               double above, uint16_t *list, int capacity)
{
    uint8_t visible[EBPO_SWEEP_PLANES / 4 + 1];
    v4d x = v4d_all(p[0]), y = v4d_all(p[1]), z = v4d_all(p[2]), far = v4d_all(beyond),
        near = v4d_all(above);
    v4l any = { 0, 0, 0, 0 };
    for (int i = 0; i < planes->fours; i++) {
        v4d height = load_four(planes->nx + 4 * i) * x + load_four(planes->ny + 4 * i) * y +
                     load_four(planes->nz + 4 * i) * z - load_four(planes->d + 4 * i);
        any |= height > far;
        visible[i] = (uint8_t)v4l_mask(height > near);
    }
    int count = 0;
    if (v4l_mask(any))
        for (int i = 0; i < planes->fours; i++)
            count = list_bits(visible[i], 4 * i, list, capacity, count);
    return count;
}

/* Returns an upper bound of the values of a stretch's points. It is computed by the same operations
 * as the values, so rounding does not make it less than a value. */
static double bound_of_stretch(const double box[7], const double n[3])
{
    return n[0] * box[n[0] < 0 ? 0 : 3] + n[1] * box[n[1] < 0 ? 1 : 4] +
           n[2] * box[n[2] < 0 ? 2 : 5] + box[6];
}

/* Returns the values of four points: n . x plus the added value. */
static v4d values_of(const double p[4][4], v4d nx, v4d ny, v4d nz)
{
    return nx * load_four(p[0]) + ny * load_four(p[1]) + nz * load_four(p[2]) + load_four(p[3]);
}

static v4d greater_of(v4d a, v4d b)
{
    v4l m = a > b;
    return (v4d)(((v4l)a & m) | ((v4l)b & ~m));
}

/* Implements ebpo_sweep.highest. */
static uint64_t highest_value(const ebpo_sweep_points *points, const double n[3], double enough,
                              double *best)
{
    v4d nx = v4d_all(n[0]), ny = v4d_all(n[1]), nz = v4d_all(n[2]);
    uint64_t stretch = UINT64_MAX;
    for (uint64_t first = 0; first < points->fours && *best < enough; first += EBPO_STRETCH) {
        if (bound_of_stretch(points->box[first / EBPO_STRETCH], n) <= *best)
            continue;
        uint64_t end = points->fours - first < EBPO_STRETCH ? points->fours : first + EBPO_STRETCH;
        v4d greatest = v4d_all(*best);
        for (uint64_t i = first; i < end; i++)
            greatest = greater_of(values_of(points->point[i], nx, ny, nz), greatest);
        for (int lane = 0; lane < 4; lane++)
            if (greatest[lane] > *best)
                *best = greatest[lane], stretch = 4 * first;
    }
    return stretch;
}

/* Sides of the centres of four octants on two axes, as distances from the lower side of the cell.
 * Lane i is the lower or the upper side, on the first axis by bit 0 of i, on the second axis by bit
 * 1. */
static const v4d first_sides = { 0.25, 0.75, 0.25, 0.75 },
                 second_sides = { 0.25, 0.25, 0.75, 0.75 };

/* [axis][lanes] the octants whose positions on the next axis and the axis after it are those of the
 * lanes (a mask) */
static const uint8_t octants_of_lanes[3][16] = {
    { 0x00, 0x03, 0x0c, 0x0f, 0x30, 0x33, 0x3c, 0x3f, 0xc0, 0xc3, 0xcc, 0xcf, 0xf0, 0xf3, 0xfc,
      0xff },
    { 0x00, 0x05, 0x50, 0x55, 0x0a, 0x0f, 0x5a, 0x5f, 0xa0, 0xa5, 0xf0, 0xf5, 0xaa, 0xaf, 0xfa,
      0xff },
    { 0x00, 0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88, 0x99, 0xaa, 0xbb, 0xcc, 0xdd, 0xee,
      0xff },
};

/* Returns a mask of the octants on one side of the face's plane. `x`: a corner of the face in cell
 * coordinates; `tolerance`: bound of the rounding error. */
static unsigned beyond_plane(const double x[3], const double normal[3], double tolerance)
{
    double radius = fabs(normal[0]) + fabs(normal[1]) + fabs(normal[2]);
    v4d reach = v4d_all(0.25 * radius + tolerance),
        xy = v4d_all(normal[0]) * (v4d_all(x[0]) - first_sides) +
             v4d_all(normal[1]) * (v4d_all(x[1]) - second_sides),
        lower = xy + v4d_all(normal[2] * (x[2] - 0.25)),
        upper = xy + v4d_all(normal[2] * (x[2] - 0.75));
    return v4l_mask(v4d_abs(lower) > reach) | v4l_mask(v4d_abs(upper) > reach) << 4;
}

/* [bit k: the face is above the centre on axis k] the octants that the face may touch; the same for
 * faces below the centre */
static const uint8_t octants_of_above[8] = { 0xff, 0xaa, 0xcc, 0x88, 0xf0, 0xa0, 0xc0, 0x80 },
                     octants_of_below[8] = { 0xff, 0x55, 0x33, 0x11, 0x0f, 0x05, 0x03, 0x01 };

/* Implements ebpo_sweep.find_octants. First the face's bounding box is compared with the centre,
 * exactly. Then two kinds of planes are tested: the plane of the face, and planes whose normal is
 * the cross product of an edge of the face with an axis. Let M be the greatest cell coordinate (at
 * least 1) and u = 2^-53. The rounding errors are at most 4 u M for edges, 64 u M^2 for cross
 * products, and 512 u M^3 for the plane. The tolerances are at least as large. */
static unsigned find_octants_of_face(const ebpo_sweep_cell *cell, const double face[3][3])
{
    double x[3][4], edge[3][3], normal[3];
    v4d corner[3], centre = load_four(cell->centre), greatest = v4d_all(1);
    for (int i = 0; i < 3; i++)
        corner[i] = (v4d){ face[i][0], face[i][1], face[i][2], face[i][2] };
    v4l above = (corner[0] > centre) & (corner[1] > centre) & (corner[2] > centre),
        below = (corner[0] < centre) & (corner[1] < centre) & (corner[2] < centre);
    unsigned octants =
        octants_of_above[v4l_mask(above) & 7] & octants_of_below[v4l_mask(below) & 7];
    if ((octants & (octants - 1)) == 0)
        return octants;
    for (int i = 0; i < 3; i++) {
        v4d at = (corner[i] - load_four(cell->low)) / load_four(cell->size);
        greatest = v4d_max(v4d_abs(at), greatest);
        memcpy(x[i], &at, sizeof at);
    }
    for (int i = 0; i < 3; i++)
        ebpo_vec3_subtract(x[(i + 1) % 3], x[i], edge[i]);
    ebpo_vec3_cross(edge[0], edge[1], normal);
    double m = v4d_greatest(greatest), tolerance = 0x1p-46 * m * m;
    unsigned separated = beyond_plane(x[0], normal, 0x1p-44 * m * m * m);
    for (int k = 0; k < 3; k++) {
        int a = (k + 1) % 3, b = (k + 2) % 3;
        v4l any = { 0, 0, 0, 0 };
        for (int i = 0; i < 3; i++) {
            const double *p = x[i], *q = x[(i + 2) % 3], *e = edge[i];
            v4d ea = v4d_all(e[a]), eb = v4d_all(e[b]),
                dp = ea * (v4d_all(p[b]) - second_sides) - eb * (v4d_all(p[a]) - first_sides),
                dq = ea * (v4d_all(q[b]) - second_sides) - eb * (v4d_all(q[a]) - first_sides),
                r = v4d_all(0.25 * (fabs(e[a]) + fabs(e[b])) + tolerance);
            any |= ((dp > r) & (dq > r)) | ((dp < -r) & (dq < -r));
        }
        separated |= octants_of_lanes[k][v4l_mask(any)];
    }
    return octants & ~separated;
}

const ebpo_sweep EBPO_KERNEL(ebpo_sweep) = { find_extreme_points, make_planes_of_edges,
                                             find_visible_planes, highest_value,
                                             find_octants_of_face };
