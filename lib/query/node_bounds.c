#include "core/strict_fp.h"

#include "query/point_bounds.h"

#include <math.h>

#include "geometry/plane_code.h"

/* A node may list a face that only comes near, within 1/256 of the cell's size on each axis
 * (format-spec, section 5); and some room for rounding. */
static const double near_share = 0x1.1p-8;

static void cell_size(const ebpo_box *box, ebpo_cell cell, double low[3], double size[3])
{
    for (int k = 0; k < 3; k++) {
        low[k] = ebpo_wall(box, k, cell.level, cell.at[k]);
        size[k] = box->size[k] / (double)(1u << cell.level);
    }
}

/* sqrt(x0^2 + x1^2 + x2^2) without overflow, right to a few ulp. */
static double length3(const double x[3])
{
    double most = fmax(fabs(x[0]), fmax(fabs(x[1]), fabs(x[2])));
    if (!(most > 0) || isinf(most))
        return most;
    double a = x[0] / most, b = x[1] / most, c = x[2] / most;
    return most * sqrt(a * a + b * b + c * c);
}

double ebpo_cell_diagonal(const ebpo_box *box, ebpo_cell cell)
{
    double low[3], size[3];
    cell_size(box, cell, low, size);
    return length3(size) * (1 + near_share);
}

/* Value of a half-space at p, 4096 n . xi - d, and a bound on its error. */
static double plane_value(const double xi[3], uint32_t code, int32_t n[3], double *error)
{
    int32_t d;
    if (!ebpo_plane_code_decode(code, n, &d)) {
        *error = INFINITY;
        return 0;
    }
    double sum = 0, size = fabs((double)d);
    for (int k = 0; k < 3; k++) {
        sum += 4096.0 * n[k] * xi[k];
        size += 4096.0 * fabs((double)n[k]) * (fabs(xi[k]) + 1);
    }
    *error = size * 0x1p-48;
    return sum - d;
}

bool ebpo_outside_planes(const ebpo_box *box, ebpo_cell cell, const uint32_t *codes, uint32_t count,
                         const double p[3])
{
    double low[3], size[3], xi[3], error;
    int32_t n[3];
    cell_size(box, cell, low, size);
    for (int k = 0; k < 3; k++)
        xi[k] = (p[k] - low[k]) / size[k];
    for (uint32_t i = 0; i < count; i++)
        if (plane_value(xi, codes[i], n, &error) > error)
            return true;
    return false;
}

double ebpo_envelope_distance(const ebpo_box *box, ebpo_cell cell, const uint32_t *codes,
                              uint32_t count, const double p[3], double enough)
{
    double low[3], size[3], xi[3], d[3];
    cell_size(box, cell, low, size);
    for (int k = 0; k < 3; k++) {
        xi[k] = (p[k] - low[k]) / size[k];
        d[k] = fmax(fmax(low[k] - p[k], p[k] - (low[k] + size[k])), 0);
    }
    double best = length3(d) * (1 - 0x1p-48);
    for (uint32_t i = 0; i < count && !(best > enough); i++) {
        int32_t n[3];
        double error, value = plane_value(xi, codes[i], n, &error);
        if (!(value > error))
            continue;
        double gradient[3] = { 4096.0 * n[0] / size[0], 4096.0 * n[1] / size[1],
                               4096.0 * n[2] / size[2] };
        double length = length3(gradient), distance = (value - error) / length * (1 - 0x1p-48);
        if (length > 0 && isfinite(length) && distance > best)
            best = distance;
    }
    return isnan(best) ? 0 : best;
}

double ebpo_cell_far(const ebpo_box *box, ebpo_cell cell, const double p[3])
{
    double low[3], size[3], d[3];
    cell_size(box, cell, low, size);
    for (int k = 0; k < 3; k++)
        d[k] = fmax(fabs(p[k] - low[k]), fabs(p[k] - (low[k] + size[k])));
    return length3(d) * (1 + 0x1p-40) + length3(size) * near_share;
}
