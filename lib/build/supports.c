#include "geom/strict_fp.h"

#include "build/supports.h"

#include <stdlib.h>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include "base/alloc.h"
#include "geom/plane_code.h"

enum { FEW_VERTICES = 192 };

typedef ebpo_pair pair;
#ifndef __SSE2__
typedef int64_t pair_mask __attribute__((vector_size(16)));
#endif

static bool add_point(ebpo_supports *s, double x, double y, double z, double slack)
{
    if (!ebpo_grow(&s->point, &s->capacity, s->count / 2 + 1, sizeof *s->point))
        return false;
    pair *p = s->point[s->count / 2];
    double values[4] = { x, y, z, EBPO_NORMAL_NORM * slack };
    for (int k = 0; k < 4; k++) /* the second of two is a copy until it comes */
        p[k] = s->count % 2 ? (pair){ p[k][0], values[k] } : (pair){ values[k], values[k] };
    s->count++;
    return true;
}

static bool add_vertices(ebpo_supports *s, uint64_t begin, uint64_t end)
{
    const ebpo_builder *b = s->b;
    double corner[3], size[3];
    for (int k = 0; k < 3; k++) {
        corner[k] = ebpo_wall(&b->box, k, s->cell.level, s->cell.at[k]);
        size[k] = b->box.size[k] / (double)(1u << s->cell.level);
    }
    for (uint64_t i = begin; i < end; i++) {
        const double *p = b->position[i];
        /* Two roundings of values up to 1, far below the slack that ebpo_plane_code_offset adds. */
        if (!add_point(s, (p[0] - corner[0]) / size[0], (p[1] - corner[1]) / size[1], (p[2] - corner[2]) / size[2], 0))
            return false;
    }
    return true;
}

static bool add_crossings(ebpo_supports *s, const ebpo_branch *branch, const ebpo_build_detail *d)
{
    for (uint64_t i = d->cross_begin; i < d->cross_end; i++) {
        ebpo_triangle face;
        double points[9][3], slack;
        ebpo_build_triangle(s->b, branch->crossing[i], &face);
        int count = ebpo_clip_triangle(&s->b->box, s->cell, &face, points, &slack);
        for (int p = 0; p < count; p++)
            if (!add_point(s, points[p][0], points[p][1], points[p][2], slack))
                return false;
    }
    return true;
}

bool ebpo_supports_gather(ebpo_supports *s, const ebpo_builder *b, const ebpo_branch *branch, const ebpo_build_detail *detail,
                          ebpo_cell cell, int32_t winding)
{
    uint64_t begin, end;
    ebpo_build_vertex_range(b, cell, &begin, &end);
    s->b = b;
    s->cell = cell;
    s->count = 0;
    bool few = end - begin <= FEW_VERTICES;
    s->begin = few ? 0 : begin;
    s->end = few ? 0 : end;
    /* Corners first: they reach far and show soonest which directions are hopeless. */
    unsigned corners = ebpo_inside_corners(b, winding, detail->delta);
    for (int i = 0; i < 8; i++)
        if (corners >> i & 1 && !add_point(s, i & 1, i >> 1 & 1, i >> 2 & 1, 0))
            return false;
    return (!few || add_vertices(s, begin, end)) && add_crossings(s, branch, detail);
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

/* Points come in twos of a coordinate, so that one instruction serves both; the greatest of them does not depend on the order. */
static pair values_of(const pair p[4], pair nx, pair ny, pair nz)
{
    return nx * p[0] + ny * p[1] + nz * p[2] + p[3];
}

enum { STRETCH = 16 };

/* Which of the points in a stretch has the value `best`. */
static void locate(const ebpo_supports *s, uint64_t stretch, const double n[3], double best, double where[3])
{
    pair nx = { n[0], n[0] }, ny = { n[1], n[1] }, nz = { n[2], n[2] };
    uint64_t twos = (s->count + 1) / 2, end = twos - stretch < STRETCH ? twos : stretch + STRETCH;
    for (uint64_t i = stretch; i < end; i++) {
        pair value = values_of(s->point[i], nx, ny, nz);
        for (int lane = 0; lane < 2; lane++)
            if (value[lane] == best) {
                for (int k = 0; k < 3; k++)
                    where[k] = s->point[i][k][lane];
                return;
            }
    }
}

static double among_points(const ebpo_supports *s, const double n[3], double enough, double where[3])
{
    pair nx = { n[0], n[0] }, ny = { n[1], n[1] }, nz = { n[2], n[2] };
    double support = -1e300;
    uint64_t twos = (s->count + 1) / 2, stretch = 0;
    for (uint64_t first = 0; first < twos && support < enough; first += STRETCH) {
        uint64_t i = first, end = twos - i < STRETCH ? twos : i + STRETCH;
        pair best = { support, support }, other = best;
        for (; i + 1 < end; i += 2) { /* two chains of comparisons side by side */
            best = greater(values_of(s->point[i], nx, ny, nz), best);
            other = greater(values_of(s->point[i + 1], nx, ny, nz), other);
        }
        if (i < end)
            best = greater(values_of(s->point[i], nx, ny, nz), best);
        best = greater(best, other);
        double here = best[0] > best[1] ? best[0] : best[1];
        if (here > support)
            support = here, stretch = first;
    }
    if (twos)
        locate(s, stretch, n, support, where);
    return support;
}

double ebpo_supports_find(const ebpo_supports *s, const int32_t normal[3], double enough, double where[3])
{
    double n[3] = { normal[0], normal[1], normal[2] };
    double support = among_points(s, n, enough, where);
    if (s->begin >= s->end || support >= enough)
        return support;
    uint64_t at;
    support = ebpo_bounds_support(s->b, s->cell, n, s->begin, s->end, support, &at);
    if (at != EBPO_NO_VERTEX)
        for (int k = 0; k < 3; k++)
            where[k] = (s->b->position[at][k] - ebpo_wall(&s->b->box, k, s->cell.level, s->cell.at[k])) /
                       (s->b->box.size[k] / (double)(1u << s->cell.level));
    return support;
}

void ebpo_supports_free(ebpo_supports *s)
{
    free(s->point);
    s->point = NULL;
    s->capacity = s->count = 0;
}
