#include "core/strict_fp.h"

#include "derive/frame.h"

#include <math.h>

#include "geometry/distance.h"

/* outweighs the few roundings of a sum of squares and its root */
static const double up = 1 + 0x1p-40;

void ebpo_cell_frame_make(ebpo_cell_frame *out, const ebpo_box *box, ebpo_cell cell)
{
    double longest = 0, largest = 0;
    out->cell = cell;
    for (int k = 0; k < 3; k++) {
        out->low[k] = ebpo_wall(box, k, cell.level, cell.at[k]);
        out->high[k] = ebpo_wall(box, k, cell.level, cell.at[k] + 1);
        out->size[k] = box->size[k] * ebpo_half_power(cell.level);
        longest = fmax(longest, out->size[k]);
        largest = fmax(largest, fmax(fabs(out->low[k]), fabs(out->high[k])));
    }
    frexp(longest, &out->exponent);
    out->factor[0] = ldexp(1, -out->exponent / 2);
    out->factor[1] = ldexp(1, -out->exponent - -out->exponent / 2);
    for (int k = 0; k < 3; k++)
        out->side[k] = out->size[k] * out->factor[0] * out->factor[1];
    /* A few ulp of the largest coordinate, and of the least number there is. */
    out->grain = 0x1p-49 * ebpo_cell_frame_length(out, largest) + 0x1p-50 +
                 ebpo_cell_frame_length(out, 0x1p-1070);
}

void ebpo_cell_frame_point(const ebpo_cell_frame *f, const double xi[3], double out[3])
{
    for (int k = 0; k < 3; k++) {
        double x = xi[k] <= 0   ? f->low[k]
                   : xi[k] >= 1 ? f->high[k]
                                : f->low[k] + xi[k] * f->size[k];
        out[k] = fmin(fmax(x, f->low[k]), f->high[k]);
    }
}

double ebpo_cell_frame_length(const ebpo_cell_frame *f, double length)
{
    return length * f->factor[0] * f->factor[1];
}

double ebpo_cell_frame_model_length(const ebpo_cell_frame *f, double length)
{
    double out = ldexp(length, f->exponent);
    return length > 0 && ebpo_cell_frame_length(f, out) < length ? nextafter(out, INFINITY) : out;
}

double ebpo_cell_frame_apart(const ebpo_cell_frame *f, const double a[3], const double b[3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        double d = (a[k] - b[k]) * f->side[k];
        sum += d * d;
    }
    return sqrt(sum) * up + f->grain;
}

double ebpo_cell_frame_diagonal(const ebpo_cell_frame *f, int levels)
{
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += f->side[k] * f->side[k];
    return sqrt(sum) * up * (1 + 1 / 128.0) * ebpo_half_power(levels) + f->grain;
}

double ebpo_cell_frame_distance(const ebpo_cell_frame *f, const double xi[3],
                                const double triangle[3][3])
{
    double p[3], t[3][3];
    ebpo_distance_bounds bounds;
    ebpo_cell_frame_point(f, xi, p);
    for (int k = 0; k < 3; k++) {
        p[k] = ebpo_cell_frame_length(f, p[k]);
        for (int i = 0; i < 3; i++)
            t[i][k] = ebpo_cell_frame_length(f, triangle[i][k]);
    }
    ebpo_triangle_distance_bounds(p, (const double(*)[3])t, &bounds);
    return bounds.hi + f->grain;
}

double ebpo_cell_frame_triangle(const ebpo_cell_frame *f, const double triangle[3][3],
                                double out[3][3])
{
    double largest = 1, least = INFINITY;
    for (int k = 0; k < 3; k++) {
        least = fmin(least, f->side[k]);
        for (int i = 0; i < 3; i++) {
            out[i][k] = (triangle[i][k] - f->low[k]) / f->size[k];
            largest = fmax(largest, fabs(out[i][k]));
        }
    }
    return 0x1p-50 * largest + f->grain / least;
}
