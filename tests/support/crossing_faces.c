#include "crossing_faces.h"

#include <gmp.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Finds intersecting faces. A uniform grid gives the candidates. Orientations are computed in
 * doubles where a bound on the rounding error allows it, else in integers of GMP. */

static void *make(uint64_t count, size_t size)
{
    void *at = calloc(count ? count : 1, size);
    if (!at) {
        fprintf(stderr, "crossing_faces: not enough memory\n");
        exit(2);
    }
    return at;
}

/* --- signs --- */

static int sign_of(double x) { return (x > 0) - (x < 0); }

/* Sets z to x * 2^149, which is an integer. */
static void set_whole(mpz_t z, float x)
{
    int exponent;
    double part = frexp(x, &exponent); /* x = part * 2^exponent, part of 24 bits */
    mpz_set_d(z, ldexp(part, 24));
    exponent += 149 - 24;
    if (exponent >= 0)
        mpz_mul_2exp(z, z, (unsigned)exponent);
    else
        mpz_tdiv_q_2exp(z, z, (unsigned)-exponent); /* exact: drops only zeros */
}

static int exact_orient3(const float *const p[4])
{
    mpz_t e[3][3], origin, sum, term;
    mpz_inits(origin, sum, term, NULL);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            mpz_init(e[i][k]);
            set_whole(e[i][k], p[i][k]);
            set_whole(origin, p[3][k]);
            mpz_sub(e[i][k], e[i][k], origin);
        }
    for (int k = 0; k < 3; k++) {
        int l = (k + 1) % 3, m = (k + 2) % 3;
        mpz_mul(term, e[1][l], e[2][m]);
        mpz_submul(term, e[1][m], e[2][l]);
        mpz_addmul(sum, term, e[0][k]);
    }
    int sign = mpz_sgn(sum);
    for (int i = 0; i < 9; i++)
        mpz_clear(e[i / 3][i % 3]);
    mpz_clears(origin, sum, term, NULL);
    return sign;
}

/* Returns the sign of the volume of the tetrahedron a, b, c, d. */
static int orient3(const float *a, const float *b, const float *c, const float *d)
{
    double e[3][3], sum = 0, size = 0;
    const float *const p[4] = { a, b, c, d };
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            e[i][k] = (double)p[i][k] - d[k];
    for (int k = 0; k < 3; k++) {
        int l = (k + 1) % 3, m = (k + 2) % 3;
        double s = e[1][l] * e[2][m], t = e[1][m] * e[2][l];
        sum += e[0][k] * (s - t);
        size += fabs(e[0][k]) * (fabs(s) + fabs(t));
    }
    /* Eight roundings at most in each summand; the last term covers values too small for relative
     * rounding. */
    return fabs(sum) > 1e-14 * size + 1e-300 ? sign_of(sum) : exact_orient3(p);
}

/* Returns the sign of the area of a triangle in the plane of axes k and l. */
static int orient2(const float *a, const float *b, const float *c, int k, int l)
{
    float flat[4][3] = {
        { a[k], a[l], 0 }, { b[k], b[l], 0 }, { c[k], c[l], 0 }, { c[k], c[l], 1 }
    };
    return -orient3(flat[0], flat[1], flat[2], flat[3]);
}

/* --- intersecting faces --- */

typedef const float *triangle[3];

/* Returns an axis for the projection of the triangle; -1: it has no area. */
static int view_of(const triangle t)
{
    for (int k = 0; k < 3; k++)
        if (orient2(t[0], t[1], t[2], (k + 1) % 3, (k + 2) % 3) != 0)
            return k;
    return -1;
}

static bool flat_segments_intersect(const float *p, const float *q, const float *r, const float *s,
                                    int k, int l)
{
    int a = orient2(p, q, r, k, l), b = orient2(p, q, s, k, l), c = orient2(r, s, p, k, l),
        d = orient2(r, s, q, k, l);
    if (a || b || c || d)
        return a * b <= 0 && c * d <= 0;
    const int axes[2] = { k, l }; /* all on one line: do the intervals overlap along both axes? */
    for (int i = 0; i < 2; i++) {
        int n = axes[i];
        if (fmaxf(p[n], q[n]) < fminf(r[n], s[n]) || fmaxf(r[n], s[n]) < fminf(p[n], q[n]))
            return false;
    }
    return true;
}

/* Tests a segment in the plane of the triangle. */
static bool flat_segment_intersects(const float *p, const float *q, const triangle t)
{
    int view = view_of(t), k = (view + 1) % 3, l = (view + 2) % 3;
    int turn = orient2(t[0], t[1], t[2], k, l);
    bool within = true;
    for (int i = 0; i < 3; i++) {
        if (flat_segments_intersect(p, q, t[i], t[(i + 1) % 3], k, l))
            return true;
        within = within && orient2(t[i], t[(i + 1) % 3], p, k, l) == turn;
    }
    return within;
}

/* Tests a closed segment and a closed triangle. */
static bool segment_intersects(const float *p, const float *q, const triangle t)
{
    int above = orient3(t[0], t[1], t[2], p), below = orient3(t[0], t[1], t[2], q);
    if (above == 0 && below == 0)
        return flat_segment_intersects(p, q, t);
    if (above * below > 0)
        return false;
    int some = 0;
    for (int i = 0; i < 3;
         i++) { /* the line intersects the triangle if it passes all edges on one side */
        int side = orient3(p, q, t[i], t[(i + 1) % 3]);
        if (side * some < 0)
            return false;
        some = side ? side : some;
    }
    return true;
}

/* Returns true if faces f and g have a common point besides shared corners and edges. */
static bool have_common_point(const face_model *m, uint64_t f, uint64_t g)
{
    triangle a, b;
    int shared = 0, at_a[3], at_b[3];
    for (int i = 0; i < 3; i++) {
        a[i] = m->xyz[m->corners[f][i]];
        b[i] = m->xyz[m->corners[g][i]];
    }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            if (m->corners[f][i] == m->corners[g][j] && shared < 3) {
                at_a[shared] = i;
                at_b[shared++] = j;
            }
    if (shared == 0) {
        for (int i = 0; i < 3; i++)
            if (segment_intersects(a[i], a[(i + 1) % 3], b) ||
                segment_intersects(b[i], b[(i + 1) % 3], a))
                return true;
        return false;
    }
    if (shared == 1) { /* the intersection is convex and contains the shared corner, so it reaches
                        * an edge opposite to that corner */
        int i = at_a[0], j = at_b[0];
        return segment_intersects(a[(i + 1) % 3], a[(i + 2) % 3], b) ||
               segment_intersects(b[(j + 1) % 3], b[(j + 2) % 3], a);
    }
    if (shared > 2)
        return true;
    /* The faces share an edge: they overlap if they are in one plane, on the same side of the edge.
     */
    const float *p = a[at_a[0]], *q = a[at_a[1]], *r = a[3 - at_a[0] - at_a[1]],
                *s = b[3 - at_b[0] - at_b[1]];
    if (orient3(p, q, r, s) != 0)
        return false;
    int view = view_of(a), k = (view + 1) % 3, l = (view + 2) % 3;
    return orient2(p, q, r, k, l) == orient2(p, q, s, k, l);
}

/* --- the grid --- */

typedef struct grid {
    double low[3], cell;
    int64_t cells[3];
} grid;

typedef struct entry {
    uint64_t cell;
    uint32_t face;
} entry;

static void box_of(const face_model *m, uint64_t f, float low[3], float high[3])
{
    for (int k = 0; k < 3; k++) {
        float x = m->xyz[m->corners[f][0]][k], y = m->xyz[m->corners[f][1]][k],
              z = m->xyz[m->corners[f][2]][k];
        low[k] = fminf(x, fminf(y, z));
        high[k] = fmaxf(x, fmaxf(y, z));
    }
}

static int64_t cell_along(const grid *g, int k, double x)
{
    int64_t i = (int64_t)((x - g->low[k]) / g->cell);
    return i < 0 ? 0 : i >= g->cells[k] ? g->cells[k] - 1 : i;
}

static uint64_t cell_at(const grid *g, const int64_t i[3])
{
    return (uint64_t)((i[2] * g->cells[1] + i[1]) * g->cells[0] + i[0]);
}

/* Makes a grid with cells of twice the mean extent of a face. */
static grid make_grid(const face_model *m)
{
    grid g = { .low = { INFINITY, INFINITY, INFINITY } };
    double high[3] = { -INFINITY, -INFINITY, -INFINITY }, sum = 0, longest = 0;
    for (uint64_t f = 0; f < m->faces; f++) {
        float a[3], b[3], extent = 0;
        box_of(m, f, a, b);
        for (int k = 0; k < 3; k++) {
            g.low[k] = fmin(g.low[k], a[k]);
            high[k] = fmax(high[k], b[k]);
            extent = fmaxf(extent, b[k] - a[k]);
        }
        sum += extent;
    }
    for (int k = 0; k < 3; k++)
        longest = fmax(longest, high[k] - g.low[k]);
    g.cell = fmax(fmax(2 * sum / (double)m->faces, longest / 1e6), 1e-30);
    for (int k = 0; k < 3; k++)
        g.cells[k] = (int64_t)((high[k] - g.low[k]) / g.cell) + 1;
    return g;
}

/* Writes the grid entries of a face to `to`, if it is not NULL; returns their number. */
static uint64_t enter(const face_model *m, const grid *g, uint64_t f, entry *to)
{
    float low[3], high[3];
    int64_t first[3], last[3], i[3];
    uint64_t count = 0;
    box_of(m, f, low, high);
    for (int k = 0; k < 3; k++) {
        first[k] = cell_along(g, k, low[k]);
        last[k] = cell_along(g, k, high[k]);
    }
    for (i[2] = first[2]; i[2] <= last[2]; i[2]++)
        for (i[1] = first[1]; i[1] <= last[1]; i[1]++)
            for (i[0] = first[0]; i[0] <= last[0]; i[0]++, count++)
                if (to)
                    to[count] = (entry){ cell_at(g, i), (uint32_t)f };
    return count;
}

static int by_cell(const void *x, const void *y)
{
    const entry *a = x, *b = y;
    if (a->cell != b->cell)
        return a->cell < b->cell ? -1 : 1;
    return (a->face > b->face) - (a->face < b->face);
}

/* Returns true if the boxes of two faces intersect, and `cell` is the cell in which the pair
 * counts: one of its common cells. */
static bool near(const face_model *m, const grid *g, uint64_t cell, uint64_t f, uint64_t h)
{
    float a[2][3], b[2][3];
    int64_t i[3];
    box_of(m, f, a[0], a[1]);
    box_of(m, h, b[0], b[1]);
    for (int k = 0; k < 3; k++) {
        float low = fmaxf(a[0][k], b[0][k]);
        if (low > fminf(a[1][k], b[1][k]))
            return false;
        i[k] = cell_along(g, k, low);
    }
    return cell_at(g, i) == cell;
}

uint64_t crossing_faces(const face_model *m, uint64_t first[2])
{
    grid g = make_grid(m);
    uint64_t count = 0, at = 0, found = 0;
    for (uint64_t f = 0; f < m->faces; f++)
        count += enter(m, &g, f, NULL);
    entry *entries = make(count, sizeof *entries);
    for (uint64_t f = 0; f < m->faces; f++)
        at += enter(m, &g, f, entries + at);
    qsort(entries, count, sizeof *entries, by_cell);
    for (uint64_t i = 0; i < count; i++)
        for (uint64_t j = i + 1; j < count && entries[j].cell == entries[i].cell; j++)
            if (near(m, &g, entries[i].cell, entries[i].face, entries[j].face) &&
                have_common_point(m, entries[i].face, entries[j].face) && !found++) {
                first[0] = entries[i].face;
                first[1] = entries[j].face;
            }
    free(entries);
    return found;
}

/* --- closed and a manifold --- */

typedef struct half_edge {
    uint32_t from, to, third;
} half_edge;

static int by_ends(const void *x, const void *y)
{
    const half_edge *a = x, *b = y;
    if (a->from != b->from)
        return a->from < b->from ? -1 : 1;
    return (a->to > b->to) - (a->to < b->to);
}

bool crossing_closed_manifold(const face_model *m)
{
    uint64_t count = 3 * m->faces;
    half_edge *all = make(count, sizeof *all);
    for (uint64_t f = 0; f < m->faces; f++)
        for (int k = 0; k < 3; k++)
            all[3 * f + (unsigned)k] = (half_edge){ m->corners[f][k], m->corners[f][(k + 1) % 3],
                                                    m->corners[f][(k + 2) % 3] };
    qsort(all, count, sizeof *all, by_ends);
    bool ok = true;
    for (uint64_t i = 0, end; ok && i < count; i = end) {
        uint64_t ring = 0;
        for (end = i + 1; end < count && all[end].from == all[i].from; end++)
            ok = ok && all[end].to != all[end - 1].to;
        for (const half_edge *e = &all[i]; ok && (ring == 0 || e != &all[i]); ring++) {
            half_edge back = { e->to, e->from, 0 }, next = { e->from, e->third, 0 };
            ok = bsearch(&back, all, count, sizeof *all, by_ends) != NULL;
            e = bsearch(&next, all, count, sizeof *all, by_ends);
            ok = ok && e && ring < end - i;
        }
        ok = ok && ring == end - i;
    }
    free(all);
    return ok;
}

uint64_t crossing_flat_faces(const face_model *m)
{
    uint64_t count = 0;
    for (uint64_t f = 0; f < m->faces; f++) {
        const uint32_t *c = m->corners[f];
        triangle t = { m->xyz[c[0]], m->xyz[c[1]], m->xyz[c[2]] };
        count += view_of(t) < 0;
    }
    return count;
}
