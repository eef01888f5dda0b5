/* Computes guaranteed bounds of the distance of a point to a cell, to an envelope, and to nodes of
 * the hierarchy over faces.
 *
 * If the point is at least 16 sizes of the model's box away (a far point), doubles hardly
 * distinguish distances. For a far point, keys replace distances, and the bounds are bounds of
 * keys. Keys have the same order as distances (point_bounds.h). Variables are named as in
 * point_bounds.h: y, h (half), u (toward). Rounding: docs/develop/bounds.md, "Points far away". */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "geometry/polytope.h"
#include "geometry/vec3.h"
#include "query/point_bounds.h"

/* A node may list a face that is outside its cell, but within 1/256 of the cell's size on each axis
 * (format-spec, section 7). This value includes a margin for rounding. */
static const double list_margin = 0x1.1p-8;

static void cell_size(const ebpo_box *box, ebpo_cell cell, double low[3], double size[3])
{
    for (int k = 0; k < 3; k++) {
        low[k] = ebpo_cell_face(box, k, cell.level, cell.at[k]);
        size[k] = box->size[k] / (double)(1u << cell.level);
    }
}

/* Returns sqrt(x0^2 + x1^2 + x2^2) without overflow; the error is a few ulp. */
static double safe_length(const double x[3])
{
    double greatest = fmax(fabs(x[0]), fmax(fabs(x[1]), fabs(x[2])));
    if (!(greatest > 0) || isinf(greatest))
        return greatest;
    double a = x[0] / greatest, b = x[1] / greatest, c = x[2] / greatest;
    return greatest * sqrt(a * a + b * b + c * c);
}

double ebpo_cell_diagonal(const ebpo_box *box, ebpo_cell cell)
{
    double low[3], size[3];
    cell_size(box, cell, low, size);
    return safe_length(size) * (1 + list_margin);
}

/* Returns the value 4096 n . xi - d of a half-space at the point xi, in cell coordinates (positive:
 * outside), and a bound of its error. For an invalid code, the error is INFINITY. */
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
    double best = safe_length(d) * (1 - 0x1p-48);
    for (uint32_t i = 0; i < count && !(best > enough); i++) {
        int32_t n[3];
        double error, value = plane_value(xi, codes[i], n, &error);
        if (!(value > error))
            continue;
        double gradient[3] = { 4096.0 * n[0] / size[0], 4096.0 * n[1] / size[1],
                               4096.0 * n[2] / size[2] };
        double length = safe_length(gradient), distance = (value - error) / length * (1 - 0x1p-48);
        if (length > 0 && isfinite(length) && distance > best)
            best = distance;
    }
    return isnan(best) ? 0 : best;
}

/* --- the distance to an envelope, from all half-spaces together ---
 *
 * Let n be the unit normals of half-spaces that contain the envelope, s the distances of p from
 * their planes (ebpo_facing_plane.beyond), and w >= 0 weights with the sum 1. A point x of the
 * envelope has n . (p - x) >= s for each half-space, so |p - x| >= sum(w s) / |sum(w n)|. At most
 * three half-spaces decide. They are found step by step: the half-space that the nearest point so
 * far violates most replaces some of the half-spaces that decided before. So the bound grows with
 * each step, and each step's bound is guaranteed.
 *
 * Rounding, with u = 2^-53: normals are right to 7u (as vectors), and s is right to 6u of its size,
 * and reduced by 32u of it. sum(w s) loses 4u of sum(w |s|), and is reduced by 32u of it. sum(w n),
 * whose length is at most 1, loses 7u with its normals and 10u with its computation; its length is
 * enlarged by 128u, which also covers the quotient. */

typedef struct facing_bound {
    ebpo_facing facing;
    double distance;
    double toward[3]; /* unit vector from the nearest point to p; 0 if `facing` is empty */
} facing_bound;

/* Sets b->distance and b->toward from the half-spaces b->facing with these weights. */
static void set_distance(facing_bound *b, const double weight[3])
{
    double sum = 0, beyond = 0, size = 0;
    memset(b->toward, 0, sizeof b->toward);
    for (int i = 0; i < b->facing.count; i++)
        sum += weight[i];
    for (int i = 0; i < b->facing.count; i++) {
        const ebpo_facing_plane *h = &b->facing.at[i];
        double share = weight[i] / sum;
        beyond += share * h->beyond;
        size += share * fabs(h->beyond);
        for (int k = 0; k < 3; k++)
            b->toward[k] += share * h->normal[k];
    }
    double length = ebpo_vec3_length(b->toward);
    b->distance = (beyond - size * 0x1p-48) / (length + 0x1p-46);
    for (int k = 0; k < 3; k++)
        b->toward[k] /= length;
}

/* Computes the weights of the point on the planes of all half-spaces that is nearest to p. Returns
 * false if a weight is not positive. Then fewer half-spaces decide. */
static bool find_weights(const ebpo_facing *f, double weight[3])
{
    const ebpo_facing_plane *a = &f->at[0], *b = &f->at[1], *c = &f->at[2];
    if (f->count == 1) {
        weight[0] = 1;
    } else if (f->count == 2) {
        double cosine = ebpo_vec3_dot(a->normal, b->normal);
        weight[0] = a->beyond - cosine * b->beyond;
        weight[1] = b->beyond - cosine * a->beyond;
    } else {
        double across[3][3], to[3];
        ebpo_vec3_cross(b->normal, c->normal, across[0]);
        ebpo_vec3_cross(c->normal, a->normal, across[1]);
        ebpo_vec3_cross(a->normal, b->normal, across[2]);
        for (int k = 0; k < 3; k++)
            to[k] = a->beyond * across[0][k] + b->beyond * across[1][k] + c->beyond * across[2][k];
        for (int i = 0; i < 3; i++)
            weight[i] = ebpo_vec3_dot(to, across[i]);
    }
    for (int i = 0; i < f->count; i++)
        if (!(weight[i] > 0))
            return false;
    return true;
}

/* Replaces *b by the greatest bound from `added` and at most two of the half-spaces of *b. Returns
 * false if no bound is greater than that of *b. */
static bool add_facing_plane(facing_bound *b, const ebpo_facing_plane *added)
{
    facing_bound best = *b;
    const ebpo_facing *before = &b->facing;
    for (unsigned kept = 0; kept < 1u << before->count; kept++) {
        facing_bound next = { .distance = 0 };
        double weight[3];
        int count = 0;
        if (kept == 7)
            continue;
        for (int i = 0; i < before->count; i++)
            if (kept >> i & 1)
                next.facing.at[count++] = before->at[i];
        next.facing.at[count++] = *added;
        next.facing.count = count;
        if (!find_weights(&next.facing, weight))
            continue;
        set_distance(&next, weight);
        if (next.distance > best.distance && isfinite(next.distance))
            best = next;
    }
    bool greater = best.distance > b->distance;
    *b = best;
    return greater;
}

/* Sets *out to the half-space of a plane code. Returns false if the code is invalid, or if
 * coordinates overflow. `xi`: p in cell coordinates. */
static bool see_plane(const double size[3], const double xi[3], uint32_t code,
                      ebpo_facing_plane *out)
{
    int32_t n[3] = { 0, 0, 0 };
    double error, value = plane_value(xi, code, n, &error);
    double gradient[3] = { 4096.0 * n[0] / size[0], 4096.0 * n[1] / size[1],
                           4096.0 * n[2] / size[2] };
    double length = safe_length(gradient), beyond = (value - error) / length;
    for (int k = 0; k < 3; k++)
        out->normal[k] = gradient[k] / length;
    out->beyond = beyond - fabs(beyond) * 0x1p-48;
    return length > 0 && isfinite(length) && isfinite(out->beyond);
}

/* Lists the half-spaces of the cell and of its planes. Returns their number. */
static unsigned see_planes(const ebpo_box *box, ebpo_cell cell, const uint32_t *codes,
                           uint32_t count, const double p[3], ebpo_facing_plane out[])
{
    double low[3], size[3], xi[3];
    unsigned seen = 0;
    cell_size(box, cell, low, size);
    for (int k = 0; k < 3; k++) {
        double above = p[k] - (low[k] + size[k]), below = low[k] - p[k];
        xi[k] = (p[k] - low[k]) / size[k];
        out[seen] = (ebpo_facing_plane){ { 0, 0, 0 }, above - fabs(above) * 0x1p-48 };
        out[seen++].normal[k] = 1;
        out[seen] = (ebpo_facing_plane){ { 0, 0, 0 }, below - fabs(below) * 0x1p-48 };
        out[seen++].normal[k] = -1;
    }
    for (uint32_t i = 0; i < count && i < EBPO_NODE_PLANES; i++)
        seen += see_plane(size, xi, codes[i], &out[seen]);
    return seen;
}

double ebpo_facing_distance(const ebpo_box *box, ebpo_cell cell, const uint32_t *codes,
                            uint32_t count, const double p[3], double enough, ebpo_facing *facing)
{
    enum { STEPS = 16 }; /* nearly all envelopes need at most five */
    ebpo_facing_plane all[6 + EBPO_NODE_PLANES + 3];
    facing_bound b = { .facing = { .count = 0 } };
    unsigned seen = see_planes(box, cell, codes, count, p, all);
    for (int i = 0; i < facing->count; i++)
        all[seen++] = facing->at[i];
    for (int step = 0; step < STEPS && !(b.distance > enough); step++) {
        const ebpo_facing_plane *worst = NULL;
        double most = b.distance * 0x1p-30;
        for (unsigned i = 0; i < seen; i++) {
            double violation = all[i].beyond - b.distance * ebpo_vec3_dot(all[i].normal, b.toward);
            if (violation > most) {
                most = violation;
                worst = &all[i];
            }
        }
        if (!worst || !add_facing_plane(&b, worst))
            break;
    }
    *facing = b.facing;
    /* the relative errors of denormal numbers are larger */
    return b.distance > 0x1p-900 ? b.distance : 0;
}

/* Shortens [t[0], t[1]] to the part that is not certainly outside the half-space a + b t <= 0. `a`
 * and `b` were reduced by their errors. */
static void clip_interval(double a, double b, double t[2])
{
    double end = -a / b;
    if (!isfinite(a) || !isfinite(b) || isnan(end))
        return;
    if (b > 0)
        t[1] = fmin(t[1], end + fabs(end) * 0x1p-50);
    else if (b < 0)
        t[0] = fmax(t[0], end - fabs(end) * 0x1p-50);
    else if (a > 0)
        t[1] = -INFINITY;
}

bool ebpo_ray_may_enter(const ebpo_box *box, ebpo_cell cell, const uint32_t *codes, uint32_t count,
                        const double origin[3], const double direction[3], double begin, double end)
{
    /* smaller slopes may have lost accuracy by underflow */
    static const double least_slope = 0x1p-900;
    double low[3], size[3], xi[3], step[3], t[2] = { begin, end };
    cell_size(box, cell, low, size);
    for (int k = 0; k < 3; k++) {
        xi[k] = (origin[k] - low[k]) / size[k];
        step[k] = direction[k] / size[k];
    }
    for (uint32_t i = 0; i < count && t[0] <= t[1]; i++) {
        int32_t n[3];
        double error, value = plane_value(xi, codes[i], n, &error), slope = 0, greatest = 0;
        for (int k = 0; k < 3; k++) {
            slope += 4096.0 * n[k] * step[k];
            greatest += fabs(4096.0 * n[k] * step[k]);
        }
        if (greatest >= least_slope)
            clip_interval(value - error, slope - greatest * 0x1p-48, t);
    }
    return t[0] <= t[1];
}

double ebpo_cell_far(const ebpo_box *box, ebpo_cell cell, const double p[3])
{
    double low[3], size[3], d[3];
    cell_size(box, cell, low, size);
    for (int k = 0; k < 3; k++)
        d[k] = fmax(fabs(p[k] - low[k]), fabs(p[k] - (low[k] + size[k])));
    return safe_length(d) * (1 + 0x1p-40) + safe_length(size) * list_margin;
}

/* Points at this distance or more, in sizes of the model's box, are far. */
static const double far_away = 16;
/* Error of keys, relative to the largest coordinate (docs/develop/bounds.md). */
static const double key_error = 0x1p-46;

void ebpo_far_make(ebpo_far *f, const ebpo_box *box, const double p[3])
{
    double size = 0, greatest = 0, sum = 0, to[3];
    int unit, exponent;
    bool near = true;
    memset(f, 0, sizeof *f);
    for (int k = 0; k < 3; k++) {
        f->centre[k] = box->origin[k] + box->size[k] / 2;
        size = box->size[k] > size ? box->size[k] : size;
    }
    /* The distance of most points is certainly less than 7 sizes, by this test. It is much faster
     * than the exponents below. */
    for (int k = 0; k < 3; k++)
        near = near && fabs(p[k] - f->centre[k]) < 4 * size;
    if (near)
        return;
    for (int k = 0; k < 3; k++)
        greatest = fmax(greatest, fmax(fabs(p[k]), fabs(f->centre[k])));
    if (!(size > 0) || !isfinite(size) || !isfinite(greatest))
        return;
    frexp(size, &unit);
    frexp(greatest, &exponent);
    for (int k = 0; k < 3; k++) {
        to[k] = ldexp(p[k], -exponent) - ldexp(f->centre[k], -exponent);
        sum += to[k] * to[k];
    }
    double length = sqrt(sum);
    f->distance_in_units = ldexp(length, exponent - unit);
    if (!(f->distance_in_units >= far_away))
        return;
    f->far = true;
    f->distance = ldexp(length, exponent);
    f->half = ldexp(1 / (2 * length), unit - exponent);
    f->unit[0] = ldexp(1, -unit / 2);
    f->unit[1] = ldexp(1, -unit - -unit / 2);
    for (int k = 0; k < 3; k++)
        f->toward[k] = to[k] / length;
}

/* --- keys and distances: d^2 = D^2 + 2 D key, where d is the distance and D = |p - c| --- */

double ebpo_far_limit(const ebpo_far *f, double distance)
{
    if (!(distance < INFINITY) || !isfinite(f->distance_in_units) || !(f->distance < INFINITY) ||
        f->distance < 0x1p-1000)
        return INFINITY;
    /* (d / D)^2 = 1 + 2 key / distance_in_units; the second term of the sum covers rounding */
    double ratio = distance / f->distance;
    return ((ratio - 1) * (ratio + 1) / 2 + (ratio * ratio + 1) * 0x1p-47) * f->distance_in_units;
}

/* Returns the distance for a key, enlarged by a relative `share` (negative: reduced). */
static double distance_of(const ebpo_far *f, double key, double share)
{
    if (key == INFINITY)
        return INFINITY;
    double square =
        1 + (isfinite(f->distance_in_units) ? 2 * key / f->distance_in_units : 0) + share;
    return square > 0 ? f->distance * sqrt(square) * (1 + share) : 0;
}

/* Bounds are enlarged by this value, because the relative rounding error of denormal numbers is
 * larger. */
static const double denormal_error = 0x1p-1070;

double ebpo_far_lower(const ebpo_far *f, double key)
{
    /* The true distance may be finite although its computation in doubles overflows. */
    double distance = distance_of(f, key, -0x1p-40) - denormal_error;
    return key == INFINITY ? INFINITY : fmin(fmax(distance, 0), 0x1p1023);
}
double ebpo_far_upper(const ebpo_far *f, double key)
{
    return distance_of(f, key, 0x1p-40) + denormal_error;
}

/* --- positions --- */

/* Converts a coordinate of the model to a coordinate of y. */
static double y_on_axis(const ebpo_far *f, double x, int axis)
{
    return (x - f->centre[axis]) * f->unit[0] * f->unit[1];
}

/* Returns the y at which h y^2 - u y has its minimum. */
static double apex_of_square(double half, double toward)
{
    return half > 0 ? toward / (2 * half) : toward > 0 ? INFINITY : -INFINITY;
}

/* Returns the minimum of h y^2 - u y for y in low .. high. `at`: the result of apex_of_square. */
static inline double least_between(double half, double toward, double at, double low, double high)
{
    double y = at < low ? low : at > high ? high : at;
    return (half * y - toward) * y;
}

/* Returns the key of the point y. */
static double key_of(const ebpo_far *f, const double y[3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += (f->half * y[k] - f->toward[k]) * y[k];
    return sum;
}

/* Returns a bound of the error of the key of a point with coordinates y up to `greatest`. */
static double margin_of(const ebpo_far *f, double greatest)
{
    return key_error * greatest * (1 + f->half * greatest) + 0x1p-1000;
}

/* --- cells and envelopes --- */

/* A cell in coordinates y. */
typedef struct placed_cell {
    double low[3], size[3];
    double greatest; /* greatest absolute coordinate of the cell */
} placed_cell;

static placed_cell place_cell(const ebpo_far *f, const ebpo_box *box, ebpo_cell cell)
{
    placed_cell out = { .greatest = 0 };
    for (int k = 0; k < 3; k++) {
        out.low[k] = y_on_axis(f, ebpo_cell_face(box, k, cell.level, cell.at[k]), k);
        out.size[k] = box->size[k] * f->unit[0] * f->unit[1] / (double)(1u << cell.level);
        out.greatest = fmax(out.greatest, fabs(out.low[k]) + out.size[k]);
    }
    return out;
}

double ebpo_far_cell_end(const ebpo_far *f, const ebpo_box *box, ebpo_cell cell)
{
    placed_cell c = place_cell(f, box, cell);
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        double low = c.low[k] - list_margin * c.size[k],
               high = c.low[k] + (1 + list_margin) * c.size[k];
        sum += fmax((f->half * low - f->toward[k]) * low, (f->half * high - f->toward[k]) * high);
    }
    return sum + margin_of(f, 2 * c.greatest);
}

/* Returns a lower bound of the key in the part of the cell where gradient . y <= beyond. In this
 * part, share * (gradient . y - beyond) is at most 0 for every share >= 0. So the minimum over the
 * whole cell of the key plus this term is a lower bound. */
static double cut_bound(const ebpo_far *f, const placed_cell *c, const double gradient[3],
                        double beyond, double share)
{
    double sum = -share * beyond, size = share * fabs(beyond);
    for (int k = 0; k < 3; k++) {
        double low = c->low[k], high = c->low[k] + c->size[k], tilt = share * gradient[k];
        double toward = f->toward[k] - tilt;
        sum += least_between(f->half, toward, apex_of_square(f->half, toward), low, high);
        size += (fabs(f->toward[k]) + fabs(tilt)) * (fabs(low) + fabs(high)) +
                share * fabs(gradient[k] * low);
    }
    double bound = sum - size * key_error - margin_of(f, c->greatest);
    return isnan(bound) ? -INFINITY : bound;
}

double ebpo_far_envelope(const ebpo_far *f, const ebpo_box *box, ebpo_cell cell,
                         const uint32_t *codes, uint32_t count, double enough)
{
    static const double none[3];
    placed_cell c = place_cell(f, box, cell);
    double best = cut_bound(f, &c, none, 0, 0);
    for (uint32_t i = 0; i < count && !(best > enough); i++) {
        int32_t n[3], d;
        double gradient[3], beyond;
        if (!ebpo_plane_code_decode(codes[i], n, &d))
            continue;
        beyond = d / 4096.0;
        for (int k = 0; k < 3; k++) {
            gradient[k] = c.size[k] > 0 ? n[k] / c.size[k] : 0;
            beyond += gradient[k] * c.low[k];
        }
        /* The bound is a concave function of the share, and its slope changes only at these values.
         */
        for (int k = 0; k < 3; k++) {
            double share = f->toward[k] / gradient[k];
            if (c.size[k] > 0 && share > 0 && isfinite(share))
                best = fmax(best, cut_bound(f, &c, gradient, beyond, share));
        }
    }
    return best;
}

/* --- the hierarchy over faces --- */

ebpo_far_frame ebpo_far_frame_of(const ebpo_far *f, const double centre[3], double scale,
                                 double largest)
{
    ebpo_far_frame g = { .ratio = f->unit[0] / scale * f->unit[1] };
    double greatest = g.ratio * largest;
    for (int k = 0; k < 3; k++) {
        g.offset[k] = y_on_axis(f, centre[k], k);
        greatest = fmax(greatest, fabs(g.offset[k]) + g.ratio * largest);
    }
    g.margin = margin_of(f, 2 * greatest);
    return g;
}

void ebpo_far_boxes(const ebpo_far *f, const ebpo_far_frame *g, const ebpo_bound *b,
                    double lower[8])
{
    for (int lane = 0; lane < b->count; lane++)
        lower[lane] = -g->margin;
    for (int k = 0; k < 3; k++) {
        double origin = g->offset[k] + g->ratio * (double)b->origin[k],
               step = g->ratio * (double)b->step[k], at = apex_of_square(f->half, f->toward[k]);
        for (int lane = 0; lane < b->count; lane++)
            lower[lane] += least_between(f->half, f->toward[k], at, origin + step * b->low[k][lane],
                                         origin + step * b->high[k][lane]);
    }
}

/* Let x be a point of the child, m the middle of the child's box, a the axis of the cylinder, and
 * N(v) = sqrt(v . v - (v . a)^2). Then |p - x|^2 >= |p - m|^2 - 2 (p - m) . (x - m) and, by Cauchy
 * and Schwarz, (p - m) . (x - m) <= ((p - m) . a) ((x - m) . a) + N(p - m) N(x - m). See
 * docs/develop/bounds.md. */
double ebpo_far_cylinder(const ebpo_far *f, const ebpo_far_frame *g, const ebpo_bound *b,
                         const ebpo_bound_cylinder *cylinder, int lane)
{
    ebpo_child_cylinder s = ebpo_bound_cylinder_of(cylinder, lane);
    double y[3], along = 0, square = 0;
    for (int k = 0; k < 3; k++) {
        ebpo_bound_sides side = ebpo_bound_side(b, lane, k);
        y[k] = g->offset[k] + g->ratio * ((side.low + side.high) / 2);
        double to = f->toward[k] - 2 * f->half * y[k];
        along += to * s.axis[k];
        square += to * to;
    }
    double aside = sqrt(fmax(square - along * along, 0) + 0x1p-46 * (1 + square));
    double ahead = fmax(along * s.from, along * s.to);
    return key_of(f, y) - (ahead + aside * s.radius) * g->ratio - g->margin;
}

/* --- faces --- */

/* |y|^2 >= 2 z . y - |z|^2 for every z. The right side is linear in y. So if the right side
 * replaces |y|^2 in the key, the minimum over the face is at a corner. Here z is the corner with
 * the least key. */
ebpo_far_keys ebpo_far_face(const ebpo_far *f, const double triangle[3][3])
{
    double y[3][3], key[3], greatest = 0;
    int best = 0;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            y[i][k] = y_on_axis(f, triangle[i][k], k);
            greatest = fmax(greatest, fabs(y[i][k]));
        }
        key[i] = key_of(f, (const double *)y[i]);
        best = key[i] < key[best] ? i : best;
    }
    double margin = margin_of(f, greatest), low = key[best];
    for (int i = 0; i < 3; i++) {
        double square = 0;
        for (int k = 0; k < 3; k++)
            square += (y[i][k] - y[best][k]) * (y[i][k] - y[best][k]);
        low = fmin(low, key[i] - f->half * square);
    }
    return (ebpo_far_keys){ low - margin, key[best] + margin };
}
