/* Planes of a gray node: its solid's support in each candidate direction, then a selection. The support is that of the extreme points of solid ∩ cell:
 * mesh vertices in the cell, points where faces cross its boundary, corners that lie inside. */
#include "geom/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include "base/alloc.h"
#include "base/error.h"
#include "build/builder.h"
#include "geom/plane_code.h"

enum { FEW_VERTICES = 192, TOP_LEVELS = 4, CANDIDATES_BELOW = 48 };

typedef double pair __attribute__((vector_size(16)));
#ifndef __SSE2__
typedef int64_t pair_mask __attribute__((vector_size(16)));
#endif

struct ebpo_envelope_scratch {
    pair (*point)[4]; /* two points: cell coordinates, and what rounding may add to a support */
    uint64_t count, capacity; /* points; twos */
    ebpo_candidate candidates[EBPO_PLANES_CANDIDATES];
    double normal[EBPO_PLANES_CANDIDATES][3];
};

ebpo_status ebpo_scratch_make(ebpo_envelope_scratch **out, ebpo_error *error)
{
    *out = ebpo_alloc_zero(1, sizeof **out);
    return *out ? EBPO_OK : ebpo_fail_memory(error, sizeof **out);
}

void ebpo_scratch_free(ebpo_envelope_scratch *scratch)
{
    if (scratch)
        free(scratch->point);
    free(scratch);
}

double ebpo_cell_volume(const ebpo_builder *b, int level)
{
    double v = 1;
    for (int k = 0; k < 3; k++)
        v *= b->box.size[k] / (double)(1u << level);
    return v;
}

unsigned ebpo_inside_corners(const ebpo_builder *b, int32_t winding, const int32_t delta[8])
{
    unsigned mask = 0;
    if (b->solid)
        for (int i = 0; i < 8; i++)
            if (ebpo_rule_inside(b->options->rule, winding + delta[i]))
                mask |= 1u << i;
    return mask;
}

static bool add_point(ebpo_envelope_scratch *scratch, double x, double y, double z, double slack)
{
    if (!ebpo_grow(&scratch->point, &scratch->capacity, scratch->count / 2 + 1, sizeof *scratch->point))
        return false;
    pair *p = scratch->point[scratch->count / 2];
    double values[4] = { x, y, z, EBPO_NORMAL_NORM * slack };
    for (int k = 0; k < 4; k++) /* the second of two is a copy until it comes */
        p[k] = scratch->count % 2 ? (pair){ p[k][0], values[k] } : (pair){ values[k], values[k] };
    scratch->count++;
    return true;
}

static bool add_vertices(const ebpo_builder *b, ebpo_envelope_scratch *scratch, ebpo_cell cell, uint64_t begin, uint64_t end)
{
    double corner[3], size[3];
    for (int k = 0; k < 3; k++) {
        corner[k] = ebpo_wall(&b->box, k, cell.level, cell.at[k]);
        size[k] = b->box.size[k] / (double)(1u << cell.level);
    }
    for (uint64_t i = begin; i < end; i++) {
        const double *p = b->position[i];
        /* Two roundings of values up to 1, far below the slack that ebpo_plane_code_offset adds. */
        if (!add_point(scratch, (p[0] - corner[0]) / size[0], (p[1] - corner[1]) / size[1], (p[2] - corner[2]) / size[2], 0))
            return false;
    }
    return true;
}

static bool add_crossings(const ebpo_builder *b, ebpo_envelope_scratch *scratch, const ebpo_branch *s,
                          const ebpo_build_detail *d, ebpo_cell cell)
{
    for (uint64_t i = d->cross_begin; i < d->cross_end; i++) {
        ebpo_triangle face;
        double points[9][3], slack;
        ebpo_build_triangle(b, s->crossing[i], &face);
        int count = ebpo_clip_triangle(&b->box, cell, &face, points, &slack);
        for (int p = 0; p < count; p++)
            if (!add_point(scratch, points[p][0], points[p][1], points[p][2], slack))
                return false;
    }
    return true;
}

static pair greater(pair a, pair b)
{
#ifdef __SSE2__
    return _mm_max_pd(a, b);
#else
    pair_mask m = a > b;
    return (pair)(((pair_mask)a & m) | ((pair_mask)b & ~m));
#endif
}

/* Raises *support by the points, until it reaches `enough`. Points come in twos of a coordinate, so that one instruction serves both; the greatest
 * of them does not depend on the order. */
static void raise_support(const ebpo_envelope_scratch *scratch, const double n[3], double enough, double *support)
{
    enum { STRETCH = 16 };
    pair nx = { n[0], n[0] }, ny = { n[1], n[1] }, nz = { n[2], n[2] }, best = { *support, *support };
    uint64_t twos = (scratch->count + 1) / 2, i = 0;
    while (i < twos && *support < enough) {
        uint64_t end = twos - i < STRETCH ? twos : i + STRETCH;
        pair other = best;
        for (; i + 1 < end; i += 2) { /* two chains of comparisons side by side */
            const pair *p = scratch->point[i], *q = scratch->point[i + 1];
            best = greater(nx * p[0] + ny * p[1] + nz * p[2] + p[3], best);
            other = greater(nx * q[0] + ny * q[1] + nz * q[2] + q[3], other);
        }
        if (i < end) {
            const pair *p = scratch->point[i++];
            best = greater(nx * p[0] + ny * p[1] + nz * p[2] + p[3], best);
        }
        best = greater(best, other);
        *support = best[0] > best[1] ? best[0] : best[1];
    }
}

/* A support from which on a plane cannot remove epsilon: a cap of height h of a body of width H and volume V has at most V (1 - (1 - h/H)^3) <= 3 V h / H. */
static double hopeless(const ebpo_polytope *envelope, double volume, const double n[3], double epsilon)
{
    double most = -1e300, least = 1e300;
    for (int i = 0; i < envelope->vertex_count; i++) {
        const double *v = envelope->vertex[i];
        double e = n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
        most = e > most ? e : most;
        least = e < least ? e : least;
    }
    return most - (most - least) * epsilon / (3 * volume);
}

/* Supports of all candidates, over the points and the vertices [begin, end). Those that cannot gain epsilon are dropped as soon as that shows. */
static int find_supports(const ebpo_builder *b, ebpo_envelope_scratch *scratch, ebpo_cell cell, int count, uint64_t begin,
                         uint64_t end, const ebpo_polytope *envelope, double epsilon)
{
    double volume = ebpo_polytope_volume(envelope);
    int kept = 0;
    for (int j = 0; j < count && volume > 0; j++) {
        ebpo_candidate c = scratch->candidates[j];
        int32_t v[3], d;
        ebpo_plane_code_decode(c.normal, v, &d);
        double n[3] = { v[0], v[1], v[2] }, enough = hopeless(envelope, volume, n, epsilon);
        raise_support(scratch, n, enough, &c.support);
        if (begin < end && c.support < enough)
            c.support = ebpo_bounds_support(b, cell, n, begin, end, c.support);
        if (c.support < enough)
            scratch->candidates[kept++] = c;
    }
    return kept;
}

/* Top levels are nearly free of bytes, and a needle that fills a thousandth of its cell deserves planes all the same. */
static double top_share(const ebpo_polytope *envelope)
{
    return 0.1 * sqrt(fmax(0, ebpo_polytope_volume(envelope)));
}

int ebpo_gray_planes(const ebpo_builder *b, ebpo_envelope_scratch *scratch, const ebpo_branch *s,
                     const ebpo_build_detail *detail, ebpo_cell cell, int32_t winding, ebpo_polytope *envelope,
                     uint32_t codes[EBPO_PLANES_MAX])
{
    bool top = cell.level <= TOP_LEVELS;
    int count = ebpo_build_candidates(b, s, detail, top ? EBPO_PLANES_CANDIDATES : CANDIDATES_BELOW, scratch->candidates);
    uint64_t begin, end;
    ebpo_build_vertex_range(b, cell, &begin, &end);
    scratch->count = 0;
    bool few = end - begin <= FEW_VERTICES;
    /* Corners first: they reach far and show soonest which directions are hopeless. */
    unsigned corners = ebpo_inside_corners(b, winding, detail->delta);
    for (int i = 0; i < 8; i++)
        if (corners >> i & 1 && !add_point(scratch, i & 1, i >> 1 & 1, i >> 2 & 1, 0))
            return -1;
    if (few && !add_vertices(b, scratch, cell, begin, end))
        return -1;
    if (!add_crossings(b, scratch, s, detail, cell))
        return -1;
    double epsilon = b->options->epsilon * (top ? top_share(envelope) : 1);
    count = find_supports(b, scratch, cell, count, few ? 0 : begin, few ? 0 : end, envelope, epsilon);
    return ebpo_select_greedy(envelope, scratch->candidates, count, epsilon, EBPO_PLANES_MAX, codes);
}
