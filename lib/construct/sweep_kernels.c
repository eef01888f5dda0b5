/* Implements the two kernels of sweep.h, which process four doubles at a time. The first kernel
 * finds the planes below a point. The second kernel finds the greatest value among points.
 * meson.build compiles this file once for each instruction set. All variants do the same operations
 * in the same order, so they give the same results. core/cpu.h chooses the variant. */
#include "core/strict_fp.h"

#include "construct/sweep.h"

#include <string.h>

#include "core/simd.h"

typedef v4d v4d_stored __attribute__((aligned(8), may_alias));

static v4d load_four(const double *at) { return *(const v4d_stored *)at; }

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

const ebpo_sweep EBPO_KERNEL(ebpo_sweep) = { find_visible_planes, highest_value };
