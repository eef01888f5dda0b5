/* Divides polygons in space, and closed chains of edges, into triangles. Each corner of a triangle
 * is a corner of the polygon or chain.
 *
 * A polygon is projected along the axis on which its normal is largest. A convex polygon becomes a
 * fan; every other polygon is cut ear by ear, with exact tests. Its projection is called the
 * outline. The ear at a corner is the triangle of this corner and its two neighbours. The ear may
 * be cut off if no other corner is in the way ("blocks" the ear). A corner is tested again only
 * when its neighbours have changed, or when the corner that blocked its ear was cut off. A tree of
 * boxes finds blocking corners. Because few ears are tested again and the tree makes tests fast, an
 * outline of n corners takes about n log n steps. An outline that crosses itself gets the triangles
 * of least area in space. A closed chain, which is the boundary of a hole, also gets the triangles
 * of least area. Sources: Meisters, "Polygons have ears", 1975; Barequet and Sharir, "Filling gaps
 * in the boundary of a polyhedron", 1995. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/base.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "geometry/polygon.h"
#include "geometry/predicates.h"

/* ==== chains ==== */

static double triangle_area(const ebpo_chain *c, uint32_t i, uint32_t j, uint32_t k)
{
    double n[3];
    ebpo_face_cross(c->point[i], c->point[j], c->point[k], n);
    return 0.5 * sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
}

/* Returns the extra cost of a chord that is an existing edge of the mesh. This cost is more than
 * the area of any triangulation. */
static double chain_penalty(const ebpo_chain *c)
{
    double length = 0;
    for (uint32_t i = 0; i < c->n; i++) {
        const double *p = c->point[i], *q = c->point[(i + 1) % c->n];
        length += fabs(q[0] - p[0]) + fabs(q[1] - p[1]) + fabs(q[2] - p[2]);
    }
    return length * length * c->n;
}

/* ---- least area, by dynamic programming over sub-chains i .. j ---- */

/* For each sub-chain from point i to point j, computes the least cost of its triangulation, and the
 * third corner of the triangle at the chord between i and j. The index of a sub-chain in both
 * tables is i * n + j. */
static void fill_tables(const ebpo_chain *c, double *cost, uint16_t *apex)
{
    uint64_t n = c->n;
    double extra = chain_penalty(c);
    for (uint64_t i = 0; i + 1 < n; i++)
        cost[i * n + i + 1] = 0;
    for (uint64_t span = 2; span < n; span++)
        for (uint64_t i = 0; i + span < n; i++) {
            uint64_t j = i + span, best_k = i + 1;
            double best = INFINITY;
            for (uint64_t k = i + 1; k < j; k++) {
                double sum = cost[i * n + k] + cost[k * n + j] +
                             triangle_area(c, (uint32_t)i, (uint32_t)k, (uint32_t)j);
                if (sum < best) {
                    best = sum;
                    best_k = k;
                }
            }
            bool chord = span < n - 1;
            cost[i * n + j] = best + (chord && c->taken && c->taken[i * n + j] ? extra : 0);
            apex[i * n + j] = (uint16_t)best_k;
        }
}

/* Writes the triangulation of least area. Returns false when memory is short. */
static bool least_area(const ebpo_chain *c, uint32_t (*triangles)[3])
{
    uint64_t n = c->n, written = 0, open = 0;
    double *cost = ebpo_alloc(n * n, sizeof *cost);
    uint16_t *apex = ebpo_alloc(n * n, sizeof *apex);
    uint32_t(*stack)[2] = ebpo_alloc(n, sizeof *stack);
    bool ok = cost && apex && stack;
    if (ok) {
        fill_tables(c, cost, apex);
        stack[open][0] = 0;
        stack[open++][1] = c->n - 1;
    }
    while (open) {
        uint32_t i = stack[--open][0], j = stack[open][1];
        if (j - i < 2)
            continue;
        uint32_t k = apex[i * n + j];
        triangles[written][0] = i, triangles[written][1] = k, triangles[written++][2] = j;
        stack[open][0] = i, stack[open++][1] = k;
        stack[open][0] = k, stack[open++][1] = j;
    }
    free(cost);
    free(apex);
    free(stack);
    return ok;
}

/* ---- long chains: cuts the smallest ears first, and ears that bend outward last ---- */

typedef struct chain_ear {
    double area;
    uint32_t tip; /* middle point of the ear */
    /* version of the tip when the ear was computed; the ear is outdated if the tip has a newer
     * version */
    uint32_t version;
    bool reflex; /* the ear bends outward */
} chain_ear;

typedef struct cutting {
    const ebpo_chain *chain;
    uint32_t *before, *after; /* [n] previous and next point of the remaining chain */
    uint32_t *version;        /* [n] number of changes of the ear at each point */
    double normal[3];         /* area vector of the chain */
    chain_ear *heap;          /* [count] ears, including outdated ears; the least ear is first */
    uint64_t count;
} cutting;

static bool comes_before(const chain_ear *a, const chain_ear *b)
{
    if (a->reflex != b->reflex)
        return b->reflex;
    if (a->area != b->area)
        return a->area < b->area;
    return a->tip < b->tip;
}

static void push_ear(cutting *c, uint32_t tip)
{
    double n[3];
    const double(*p)[3] = c->chain->point;
    ebpo_face_cross(p[c->before[tip]], p[tip], p[c->after[tip]], n);
    chain_ear e = { .area = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]),
                    .tip = tip,
                    .version = ++c->version[tip],
                    .reflex = n[0] * c->normal[0] + n[1] * c->normal[1] + n[2] * c->normal[2] < 0 };
    uint64_t i = c->count++;
    for (; i > 0 && comes_before(&e, &c->heap[(i - 1) / 2]); i = (i - 1) / 2)
        c->heap[i] = c->heap[(i - 1) / 2];
    c->heap[i] = e;
}

static chain_ear pop_ear(cutting *c)
{
    chain_ear top = c->heap[0], last = c->heap[--c->count];
    uint64_t i = 0;
    for (uint64_t child; (child = 2 * i + 1) < c->count; i = child) {
        if (child + 1 < c->count && comes_before(&c->heap[child + 1], &c->heap[child]))
            child++;
        if (!comes_before(&c->heap[child], &last))
            break;
        c->heap[i] = c->heap[child];
    }
    c->heap[i] = last;
    return top;
}

static void start_cutting(cutting *c)
{
    uint32_t n = c->chain->n;
    for (uint32_t i = 1; i + 1 < n; i++) {
        double cross[3];
        ebpo_face_cross(c->chain->point[0], c->chain->point[i], c->chain->point[i + 1], cross);
        for (int k = 0; k < 3; k++)
            c->normal[k] += cross[k];
    }
    for (uint32_t i = 0; i < n; i++) {
        c->before[i] = i ? i - 1 : n - 1;
        c->after[i] = i + 1 < n ? i + 1 : 0;
    }
    for (uint32_t i = 0; i < n; i++)
        push_ear(c, i);
}

/* Cuts a chain ear by ear. Returns false when memory is short. */
static bool cut_least_ears(const ebpo_chain *chain, uint32_t (*triangles)[3])
{
    uint64_t n = chain->n, written = 0;
    ebpo_workspace *w = chain->workspace;
    cutting c = { .chain = chain,
                  .before = ebpo_array_alloc(w, n, sizeof *c.before),
                  .after = ebpo_array_alloc(w, n, sizeof *c.after),
                  .version = ebpo_array_zero(w, n, sizeof *c.version),
                  .heap = ebpo_array_alloc(w, 3 * n, sizeof *c.heap) };
    bool ok = c.before && c.after && c.version && c.heap;
    if (ok)
        start_cutting(&c);
    while (ok && written < n - 2) {
        chain_ear e = pop_ear(&c);
        if (written % EBPO_ITEMS_SCATTERED == 0)
            ebpo_release_pages(w);
        if (e.version != c.version[e.tip])
            continue;
        uint32_t p = c.before[e.tip], q = c.after[e.tip];
        triangles[written][0] = p, triangles[written][1] = e.tip, triangles[written++][2] = q;
        c.version[e.tip]++;
        c.after[p] = q;
        c.before[q] = p;
        push_ear(&c, p);
        push_ear(&c, q);
    }
    ebpo_array_free(w, c.before);
    ebpo_array_free(w, c.after);
    ebpo_array_free(w, c.version);
    ebpo_array_free(w, c.heap);
    return ok;
}

static bool cut_chain(const ebpo_chain *chain, uint32_t (*triangles)[3])
{
    return chain->n <= chain->optimal ? least_area(chain, triangles)
                                      : cut_least_ears(chain, triangles);
}

/* Returns half of the difference between a point and the first point. The half cannot overflow. */
static double half_from_first(const ebpo_chain *c, uint64_t i, int k)
{
    return 0.5 * c->point[i][k] - 0.5 * c->point[0][k];
}

/* Returns a power of two that prevents squares of areas from overflow and underflow; 1 for most
 * chains. */
static double scale_of_chain(const ebpo_chain *c)
{
    enum { FAR = 200 };
    double most = 0;
    int exponent;
    EBPO_FOR_ITEMS(c->workspace, i, 0, c->n)
        for (int k = 0; k < 3; k++)
            most = fmax(most, fabs(half_from_first(c, i, k)));
    if (!isfinite(most))
        return 1;
    frexp(most, &exponent);
    return exponent > FAR || exponent < -FAR ? ldexp(1, exponent < -1000 ? 1000 : -exponent) : 1;
}

bool ebpo_triangulate_chain(const ebpo_chain *chain, uint32_t (*triangles)[3])
{
    double scale = scale_of_chain(chain);
    if (scale == 1)
        return cut_chain(chain, triangles);
    ebpo_chain scaled = *chain;
    double(*point)[3] = ebpo_array_alloc(chain->workspace, chain->n, sizeof *point);
    if (!point)
        return false;
    EBPO_FOR_ITEMS(chain->workspace, i, 0, chain->n)
        for (int k = 0; k < 3; k++)
            point[i][k] = scale * half_from_first(chain, i, k);
    scaled.point = (const double(*)[3])point;
    bool done = cut_chain(&scaled, triangles);
    ebpo_array_free(chain->workspace, point);
    return done;
}

/* ==== outlines in the plane, ear by ear ==== */

#define NONE UINT32_MAX

/* Decides which corners block an ear. */
typedef enum ear_rule {
    /* A corner blocks the ear if it is in the closed triangle, but not at the position of a corner
     * of the triangle. */
    EBPO_EARS_CLOSED,

    /* For outlines that touch themselves (slits, bridges to holes, pinched corners). A corner
     * blocks the ear if it is inside the triangle, or on the side of the triangle that would become
     * an edge of the outline. A corner on one of the two other sides blocks the ear if an edge of
     * the outline leads from this corner into the triangle. If no ear is left, spikes without area
     * are cut off. */
    EBPO_EARS_TOUCHING
} ear_rule;

typedef enum ears_result {
    EBPO_EARS_CUT, /* all corners were cut off: every triangle turns counter-clockwise or is flat */
    EBPO_EARS_STUCK, /* the outline crosses itself */
    EBPO_EARS_WORK   /* more steps than `limit` would be needed */
} ears_result;

enum {
    WORD = 64,
    LEVELS = 6,  /* levels of bits, enough for 2^32 corners */
    BLOCK = 8,   /* number of corners in a leaf of the tree */
    SCANNED = 64 /* outlines up to this length have no tree */
};

typedef struct box {
    double low[2], high[2];
} box;

typedef struct outline {
    const double (*at)[2]; /* [n] positions of the corners */
    bool touching;         /* the rule is EBPO_EARS_TOUCHING */
    uint32_t n, remaining; /* number of corners, and number of corners that are not cut off */
    uint64_t work;         /* number of steps */

    uint32_t *next,
        *previous; /* neighbours in the remaining outline; next is NONE if the corner is cut off */

    /* [LEVELS][words] Level 0 has a bit for each corner, which is set if the corner's ear must be
     * tested. Each further level has a bit for each word of the level below, which is set if this
     * word is not 0. */
    uint64_t *bits[LEVELS];
    uint64_t words[LEVELS];
    int levels;

    /* [n] each. blocker: for each corner, the corner that blocks its ear, or NONE. first_blocked:
     * for each corner x, the first corner whose ear x blocks, or NONE. next_blocked and
     * previous_blocked link this corner to the other corners whose ears x blocks. */
    uint32_t *blocker, *first_blocked, *next_blocked, *previous_blocked;

    /* [2 * leaves] A tree of boxes around runs of consecutive corners. The root has the index 1;
     * the children of box i have the indices 2 * i and 2 * i + 1. corners: number of corners in
     * each box that are not cut off */
    box *boxes;
    uint32_t *corners;
    uint32_t leaves; /* a power of two; 0: no tree */
} outline;

/* The tested ear, a triangle a b c whose tip is the corner b. */
typedef struct tested_ear {
    uint32_t corner[3];
    const double *at[3];
    double low[2], high[2];
    bool along_a, along_c; /* true: another edge runs from b's position towards a (or c) */
} tested_ear;

/* Returns 1 if the corners a, b, c turn counter-clockwise, -1 if clockwise, otherwise 0. */
static int turn_of_corners(const outline *o, uint32_t a, uint32_t b, uint32_t c)
{
    return ebpo_orient2d(o->at[a], o->at[b], o->at[c]);
}

static bool same_place(const double a[2], const double b[2])
{
    return a[0] == b[0] && a[1] == b[1];
}

/* ---- corners to be tested, in their order ---- */

static void set_bit(outline *o, uint64_t i)
{
    for (int l = 0; l < o->levels; l++, i /= WORD) {
        uint64_t *word = &o->bits[l][i / WORD], before = *word;
        *word |= UINT64_C(1) << i % WORD;
        if (before)
            return;
    }
}

static void clear_bit(outline *o, uint64_t i)
{
    for (int l = 0; l < o->levels; l++, i /= WORD) {
        uint64_t *word = &o->bits[l][i / WORD];
        *word &= ~(UINT64_C(1) << i % WORD);
        if (*word)
            return;
    }
}

/* Returns the lowest set bit of level 0 that is at least i, or NONE. */
static uint32_t find_bit(const outline *o, uint64_t i)
{
    for (int l = 0; l < o->levels && i / WORD < o->words[l]; l++, i = i / WORD + 1) {
        uint64_t word = o->bits[l][i / WORD] & ~UINT64_C(0) << i % WORD;
        if (!word)
            continue;
        i = i / WORD * WORD + (uint64_t)__builtin_ctzll(word);
        while (l-- > 0)
            i = i * WORD + (uint64_t)__builtin_ctzll(o->bits[l][i]);
        return (uint32_t)i;
    }
    return NONE;
}

/* ---- ears that a corner blocks ---- */

/* Removes the ear at b from the list of the corner that blocks it. */
static void unblock_ear(outline *o, uint32_t b)
{
    uint32_t x = o->blocker[b];
    if (x == NONE)
        return;
    uint32_t before = o->previous_blocked[b], after = o->next_blocked[b];
    *(before == NONE ? &o->first_blocked[x] : &o->next_blocked[before]) = after;
    if (after != NONE)
        o->previous_blocked[after] = before;
    o->blocker[b] = NONE;
}

/* Records that corner x blocks the ear at b. */
static void block_ear(outline *o, uint32_t b, uint32_t x)
{
    uint32_t after = o->first_blocked[x];
    o->blocker[b] = x;
    o->previous_blocked[b] = NONE;
    o->next_blocked[b] = after;
    o->first_blocked[x] = b;
    if (after != NONE)
        o->previous_blocked[after] = b;
}

/* Marks the ears that corner x blocks, so that they are tested again. Empties the list of these
 * ears. */
static void test_blocked_again(outline *o, uint32_t x)
{
    for (uint32_t b; (b = o->first_blocked[x]) != NONE; unblock_ear(o, b))
        set_bit(o, b);
}

/* ---- the tree ---- */

static void join_box(box *b, const double low[2], const double high[2])
{
    for (int k = 0; k < 2; k++) {
        b->low[k] = low[k] < b->low[k] ? low[k] : b->low[k];
        b->high[k] = high[k] > b->high[k] ? high[k] : b->high[k];
    }
}

static void build_tree(outline *o)
{
    for (uint32_t node = 1; node < 2 * o->leaves; node++)
        o->corners[node] = 0;
    for (uint32_t i = 0; i < o->n; i++) {
        uint32_t node = o->leaves + i / BLOCK;
        if (o->corners[node]++ == 0) {
            memcpy(o->boxes[node].low, o->at[i], sizeof o->boxes->low);
            memcpy(o->boxes[node].high, o->at[i], sizeof o->boxes->high);
        } else
            join_box(&o->boxes[node], o->at[i], o->at[i]);
    }
    for (uint32_t node = o->leaves - 1; node > 0; node--) {
        const box *right = &o->boxes[2 * node + 1];
        o->corners[node] = o->corners[2 * node] + o->corners[2 * node + 1];
        o->boxes[node] = o->boxes[2 * node];
        if (o->corners[2 * node + 1])
            join_box(&o->boxes[node], right->low, right->high);
    }
}

/* Returns false if no corner in the box can block the ear. */
static bool may_block(const outline *o, const tested_ear *e, const box *b)
{
    for (int k = 0; k < 2; k++)
        if (b->low[k] > e->high[k] || b->high[k] < e->low[k])
            return false;
    if (!o->touching && same_place(b->low, b->high))
        for (int k = 0; k < 3; k++)
            if (same_place(b->low, e->at[k]))
                return false;
    for (int k = 0; k < 3; k++) {
        const double *u = e->at[k], *v = e->at[(k + 1) % 3];
        const double farthest[2] = { v[1] < u[1] ? b->high[0] : b->low[0],
                                     v[0] > u[0] ? b->high[1] : b->low[1] };
        if (ebpo_orient2d(u, v, farthest) < 0)
            return false;
    }
    return true;
}

/* ---- corners that block an ear ---- */

/* Returns true if q is on the ray from b through a; b, a and q are collinear, a differs from b. */
static bool is_along(const double b[2], const double a[2], const double q[2])
{
    int k = a[0] == b[0];
    return a[k] > b[k] ? q[k] > b[k] : q[k] < b[k];
}

static void record_edges_along(const outline *o, tested_ear *e, uint32_t i)
{
    const uint32_t *c = e->corner;
    const uint32_t neighbours[2] = { o->next[i], o->previous[i] };
    for (int k = 0; k < 2; k++) {
        const double *q = o->at[neighbours[k]];
        e->along_a |=
            turn_of_corners(o, c[1], c[0], neighbours[k]) == 0 && is_along(e->at[1], e->at[0], q);
        e->along_c |=
            turn_of_corners(o, c[1], c[2], neighbours[k]) == 0 && is_along(e->at[1], e->at[2], q);
    }
}

/* Returns true if an edge enters the ear. The edge leads to corner `to` from a corner on the ear's
 * border. side[k] is 0 if this corner is on side k of the ear. */
static bool edge_enters(const outline *o, const tested_ear *e, const int side[3], uint32_t to)
{
    for (int k = 0; k < 3; k++)
        if (side[k] == 0 && turn_of_corners(o, e->corner[k], e->corner[(k + 1) % 3], to) <= 0)
            return false;
    return true;
}

/* Returns true if corner i blocks the ear. If corner i is at the position of the ear's corner b,
 * also records the edges that run along the ear. */
static bool corner_blocks(const outline *o, tested_ear *e, uint32_t i)
{
    const double *p = o->at[i];
    int side[3];
    if (p[0] < e->low[0] || p[0] > e->high[0] || p[1] < e->low[1] || p[1] > e->high[1] ||
        i == e->corner[0] || i == e->corner[1] || i == e->corner[2])
        return false;
    if (!o->touching &&
        (same_place(p, e->at[0]) || same_place(p, e->at[1]) || same_place(p, e->at[2])))
        return false;
    for (int k = 0; k < 3; k++)
        if ((side[k] = turn_of_corners(o, e->corner[k], e->corner[(k + 1) % 3], i)) < 0)
            return false;
    if (!o->touching || (side[0] > 0 && side[1] > 0))
        return true;
    if (side[0] == 0 && side[1] == 0)
        record_edges_along(o, e, i);
    return edge_enters(o, e, side, o->next[i]) || edge_enters(o, e, side, o->previous[i]);
}

static uint32_t blocker_in_leaf(outline *o, tested_ear *e, uint32_t leaf)
{
    uint32_t begin = leaf * BLOCK, end = o->n - begin < BLOCK ? o->n : begin + BLOCK;
    o->work += end - begin;
    for (uint32_t i = begin; i < end; i++)
        if (o->next[i] != NONE && corner_blocks(o, e, i))
            return i;
    return NONE;
}

static uint32_t blocker_in_tree(outline *o, tested_ear *e)
{
    uint32_t stack[64], open = 0;
    stack[open++] = 1;
    while (open) {
        uint32_t node = stack[--open], found;
        o->work++;
        if (!o->corners[node] || !may_block(o, e, &o->boxes[node]))
            continue;
        if (node < o->leaves) {
            stack[open++] = 2 * node + 1;
            stack[open++] = 2 * node;
        } else if ((found = blocker_in_leaf(o, e, node - o->leaves)) != NONE)
            return found;
    }
    return NONE;
}

/* Returns a corner that blocks the ear, or NONE. */
static uint32_t find_blocker(outline *o, tested_ear *e)
{
    if (o->leaves)
        return blocker_in_tree(o, e);
    o->work += o->remaining;
    for (uint32_t i = o->next[e->corner[2]]; i != e->corner[0]; i = o->next[i])
        if (corner_blocks(o, e, i))
            return i;
    return NONE;
}

static double least_of_3(double a, double b, double c)
{
    return a < b ? (a < c ? a : c) : (b < c ? b : c);
}

/* Returns the ear at b, before any test. */
static tested_ear ear_at(const outline *o, uint32_t b)
{
    tested_ear e = { .corner = { o->previous[b], b, o->next[b] } };
    for (int k = 0; k < 3; k++)
        e.at[k] = o->at[e.corner[k]];
    for (int k = 0; k < 2; k++) {
        e.low[k] = least_of_3(e.at[0][k], e.at[1][k], e.at[2][k]);
        e.high[k] = -least_of_3(-e.at[0][k], -e.at[1][k], -e.at[2][k]);
    }
    return e;
}

/* ---- ears outside the outline ---- */

/* Computes a point within the ear. Returns false if the rounded point is not within the ear. */
static bool point_within(const tested_ear *e, double out[2])
{
    for (int k = 0; k < 2; k++)
        out[k] = e->at[1][k] / 2 + (e->at[0][k] / 4 + e->at[2][k] / 4);
    for (int k = 0; k < 3; k++)
        if (ebpo_orient2d(e->at[k], e->at[(k + 1) % 3], out) <= 0)
            return false;
    return true;
}

/* Returns the winding number of the remaining outline around q, which is not on the outline. */
static int64_t winding_around(outline *o, uint32_t start, const double q[2])
{
    int64_t winding = 0;
    uint32_t i = start;
    o->work += o->remaining;
    do {
        const double *p = o->at[i], *r = o->at[o->next[i]];
        if (p[1] <= q[1] && r[1] > q[1])
            winding += ebpo_orient2d(p, r, q) > 0;
        else if (p[1] > q[1] && r[1] <= q[1])
            winding -= ebpo_orient2d(p, r, q) < 0;
        i = o->next[i];
    } while (i != start);
    return winding;
}

/* Returns true if the ear is outside the outline. This happens at bends of a passage without width,
 * in which two parts of the outline run along each other. */
static bool is_outside(outline *o, const tested_ear *e)
{
    double q[2];
    return e->along_a && e->along_c && point_within(e, q) &&
           winding_around(o, e->corner[1], q) <= 0;
}

/* Returns true if b is the tip of a spike without area, or at the position of a neighbour. */
static bool is_spike(const outline *o, uint32_t b)
{
    uint32_t a = o->previous[b], c = o->next[b];
    if (turn_of_corners(o, a, b, c) != 0)
        return false;
    return same_place(o->at[a], o->at[b]) || same_place(o->at[b], o->at[c]) ||
           is_along(o->at[b], o->at[a], o->at[c]);
}

/* Returns the first corner, from b on, that is the tip of a spike, or NONE. */
static uint32_t find_spike(outline *o, uint32_t b)
{
    for (uint32_t i = 0; i < o->remaining; i++, b = o->next[b]) {
        o->work++;
        if (is_spike(o, b))
            return b;
    }
    return NONE;
}

/* ---- cutting ---- */

/* Cuts off corner b, and writes its triangle. Marks the ears whose tests may now have other
 * results. */
static void cut_off(outline *o, uint32_t b, uint32_t triangle[3])
{
    uint32_t a = o->previous[b], c = o->next[b];
    triangle[0] = a;
    triangle[1] = b;
    triangle[2] = c;
    o->next[a] = c;
    o->previous[c] = a;
    o->next[b] = NONE;
    o->remaining--;
    unblock_ear(o, b);
    clear_bit(o, b);
    set_bit(o, a);
    set_bit(o, c);
    test_blocked_again(o, b);
    if (o->touching) { /* the edges at the neighbours have changed */
        test_blocked_again(o, a);
        test_blocked_again(o, c);
    }
    for (uint32_t node = o->leaves ? o->leaves + b / BLOCK : 0; node; node /= 2)
        o->corners[node]--;
}

/* Returns true if the ear at b may be cut off. If the result is false, the ear will be tested again
 * as soon as the result may be different. */
static bool is_ear(outline *o, uint32_t b)
{
    tested_ear e = ear_at(o, b);
    clear_bit(o, b);
    unblock_ear(o, b);
    if (ebpo_orient2d(e.at[0], e.at[1], e.at[2]) <= 0)
        return false;
    uint32_t x = find_blocker(o, &e);
    if (x != NONE)
        block_ear(o, b, x);
    return x == NONE && !is_outside(o, &e);
}

/* Walks around the outline and cuts off every ear. Skips one corner after each cut, so that no long
 * fans of thin triangles result. */
static ears_result cut_all(outline *o, uint32_t (*triangle)[3], uint64_t limit)
{
    uint32_t done = 0, b = 0;
    while (o->remaining > 3) {
        if (o->work++ > limit)
            return EBPO_EARS_WORK;
        uint32_t found = find_bit(o, b);
        if (found == NONE)
            found = find_bit(o, 0);
        if (found == NONE) {
            b = o->touching ? find_spike(o, b) : NONE;
            if (b == NONE)
                return EBPO_EARS_STUCK;
        } else if (b = found, !is_ear(o, b))
            continue;
        uint32_t c = o->next[b];
        cut_off(o, b, triangle[done++]);
        b = o->next[c];
    }
    if (turn_of_corners(o, o->previous[b], b, o->next[b]) < 0)
        return EBPO_EARS_STUCK;
    cut_off(o, b, triangle[done]);
    return EBPO_EARS_CUT;
}

/* ---- scratch ---- */

/* Returns the bytes of scratch memory for n corners. The memory must be aligned like memory from
 * malloc. Returns 0 if the number of bytes does not fit into 64 bits. */
static uint64_t ears_scratch_bytes(uint64_t n)
{
    /* Each corner needs six values of 32 bits, less than one byte of `bits`, and at most 4 / BLOCK
     * boxes of the tree, each with its count `corners`. */
    const uint64_t corner_bytes =
        6 * sizeof(uint32_t) + 4 * (sizeof(box) + sizeof(uint32_t)) / BLOCK + 1;
    uint64_t bytes;
    return ebpo_mul_ok(n + WORD, corner_bytes, &bytes) ? bytes : 0;
}

static void *place_array(char **at, uint64_t bytes)
{
    void *taken = *at;
    *at += bytes;
    return taken;
}

/* Divides the scratch memory into the arrays of the outline. */
static void place_arrays(outline *o, void *scratch)
{
    char *at = scratch;
    uint64_t words = o->n;
    if (o->n > SCANNED)
        for (o->leaves = 1; (uint64_t)o->leaves * BLOCK < o->n;)
            o->leaves *= 2;
    o->boxes = place_array(&at, 2 * (uint64_t)o->leaves * sizeof *o->boxes);
    do {
        words = (words + WORD - 1) / WORD;
        o->words[o->levels] = words;
        o->bits[o->levels++] = place_array(&at, words * sizeof **o->bits);
    } while (words > 1);
    uint32_t **arrays[] = { &o->next,          &o->previous,     &o->blocker,
                            &o->first_blocked, &o->next_blocked, &o->previous_blocked };
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        *arrays[i] = place_array(&at, o->n * sizeof **arrays[i]);
    o->corners = place_array(&at, 2 * (uint64_t)o->leaves * sizeof *o->corners);
}

/* Writes n - 2 triangles of corner indices. `at`: the n >= 4 corners of an outline that runs
 * counter-clockwise. The output is valid only if the result is EBPO_EARS_CUT. It depends only on
 * the corners. Any thread may call this function. */
static ears_result cut_outline(uint32_t (*triangle)[3], const double (*at)[2], uint32_t n,
                               ear_rule rule, uint64_t limit, void *scratch)
{
    outline o = { .at = at, .touching = rule == EBPO_EARS_TOUCHING, .n = n, .remaining = n };
    place_arrays(&o, scratch);
    for (int l = 0; l < o.levels; l++)
        memset(o.bits[l], 0, o.words[l] * sizeof **o.bits);
    for (uint32_t i = 0; i < n; i++) {
        o.next[i] = i + 1 < n ? i + 1 : 0;
        o.previous[i] = i ? i - 1 : n - 1;
        o.blocker[i] = o.first_blocked[i] = NONE;
        set_bit(&o, i);
    }
    if (o.leaves)
        build_tree(&o);
    return cut_all(&o, triangle, limit);
}

/* ==== polygons in space ==== */

/* Maximum number of steps for an outline that touches itself. If more steps are needed, the outline
 * is treated like an outline that crosses itself. This happens if thousands of corners are at one
 * position, because all these corners are compared with each other. */
#define TOUCHING_WORK (UINT64_C(1) << 28)

/* A polygon and its projection. */
typedef struct polygon {
    const double (*corner)[3];
    double (*flat)[2]; /* projected so that the polygon runs counter-clockwise */
    uint32_t n;        /* number of corners */
    double scale;      /* a power of two that prevents products of differences from overflow and
                        * underflow */
    bool projected;    /* `flat` is set; false: the polygon has no normal */
} polygon;

uint64_t ebpo_polygon_scratch_bytes(uint64_t n)
{
    uint64_t bytes, ears = ears_scratch_bytes(n);
    if (!ears || !ebpo_mul_ok(n, 2 * sizeof(double), &bytes) ||
        __builtin_add_overflow(bytes, ears, &bytes))
        return 0;
    return bytes;
}

static void make_fan(uint32_t (*triangle)[3], uint32_t n)
{
    for (uint32_t i = 0; i + 2 < n; i++) {
        triangle[i][0] = 0;
        triangle[i][1] = i + 1;
        triangle[i][2] = i + 2;
    }
}

/* Returns half of the difference between a corner and the first corner, multiplied by the scale.
 * The half cannot overflow. */
static double from_first(const polygon *p, uint32_t i, int k)
{
    return p->scale * (0.5 * p->corner[i][k] - 0.5 * p->corner[0][k]);
}

/* Returns false if a coordinate is not finite. */
static bool find_scale(polygon *p)
{
    enum { FAR = 400 };
    double most = 0;
    int exponent;
    p->scale = 1;
    for (uint32_t i = 0; i < p->n; i++)
        for (int k = 0; k < 3; k++) {
            if (!isfinite(p->corner[i][k]))
                return false;
            most = fmax(most, fabs(from_first(p, i, k)));
        }
    frexp(most, &exponent);
    if (exponent > FAR || exponent < -FAR)
        p->scale = ldexp(1, exponent < -1000 ? 1000 : -exponent);
    return true;
}

/* Computes the normal by Newell's sum. Component k is half of the area of the polygon's projection
 * along axis k. Coordinates are relative to the first corner, so that fewer digits are lost. */
static void newell_normal(const polygon *p, double normal[3])
{
    normal[0] = normal[1] = normal[2] = 0;
    for (uint32_t i = 1; i + 1 < p->n; i++) {
        double a[3], b[3];
        for (int k = 0; k < 3; k++) {
            a[k] = from_first(p, i, k);
            b[k] = from_first(p, i + 1, k);
        }
        normal[0] += a[1] * b[2] - a[2] * b[1];
        normal[1] += a[2] * b[0] - a[0] * b[2];
        normal[2] += a[0] * b[1] - a[1] * b[0];
    }
}

/* Returns false if the polygon has no normal. */
static bool project_polygon(polygon *p)
{
    double normal[3];
    newell_normal(p, normal);
    int axis = 0;
    for (int k = 1; k < 3; k++)
        if (fabs(normal[k]) > fabs(normal[axis]))
            axis = k;
    if (normal[axis] == 0)
        return false;
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    if (normal[axis] < 0) {
        int swap = u;
        u = v;
        v = swap;
    }
    for (uint32_t i = 0; i < p->n; i++) {
        p->flat[i][0] = p->corner[i][u];
        p->flat[i][1] = p->corner[i][v];
    }
    return true;
}

static int turn_of_projected(const polygon *p, uint32_t a, uint32_t b, uint32_t c)
{
    return ebpo_orient2d(p->flat[a], p->flat[b], p->flat[c]);
}

static bool is_ascending(const double a[2], const double b[2])
{
    return a[0] < b[0] || (a[0] == b[0] && a[1] < b[1]);
}

/* Classifies the polygon. A polygon with only left turns is convex if, in addition, the direction
 * of its edges along x changes only twice. (A pentagram also has only left turns, but is not
 * convex.) */
static ebpo_polygon_kind classify_polygon(const polygon *p)
{
    bool straight = false;
    uint32_t changes = 0;
    for (uint32_t i = 0; i < p->n; i++) {
        uint32_t j = i + 1 < p->n ? i + 1 : 0, k = j + 1 < p->n ? j + 1 : 0;
        int t = turn_of_projected(p, i, j, k);
        if (t < 0)
            return EBPO_POLYGON_CONCAVE;
        straight = straight || t == 0;
        changes += is_ascending(p->flat[i], p->flat[j]) != is_ascending(p->flat[j], p->flat[k]);
    }
    if (changes > 2)
        return EBPO_POLYGON_GUESSED;
    return straight ? EBPO_POLYGON_FLAT : EBPO_POLYGON_CONVEX;
}

/* ---- outlines that cross themselves ---- */

static bool has_area(const polygon *p, const uint32_t t[3])
{
    return !ebpo_zero_area(p->corner[t[0]], p->corner[t[1]], p->corner[t[2]]);
}

/* Classifies the polygon by its triangles of least area. If all these triangles turn
 * counter-clockwise, the outline does not cross itself. If no triangle has area, the polygon is
 * degenerate. */
static ebpo_polygon_kind kind_of_guess(const polygon *p, uint32_t (*triangle)[3])
{
    bool turned = !p->projected, empty = true;
    for (uint32_t i = 0; i + 2 < p->n; i++) {
        turned = turned || turn_of_projected(p, triangle[i][0], triangle[i][1], triangle[i][2]) < 0;
        empty = empty && !has_area(p, triangle[i]);
    }
    if (empty)
        make_fan(triangle, p->n);
    return empty ? EBPO_POLYGON_DEGENERATE : turned ? EBPO_POLYGON_GUESSED : EBPO_POLYGON_CONCAVE;
}

/* Computes the triangulation with the least area. Outlines of more than EBPO_POLYGON_OPTIMAL
 * corners are cut by the smallest ears instead. */
static ebpo_polygon_kind guess_triangles(const polygon *p, uint32_t (*triangle)[3])
{
    double(*point)[3] = ebpo_alloc(p->n, sizeof *point);
    for (uint32_t i = 0; point && i < p->n; i++)
        for (int k = 0; k < 3; k++)
            point[i][k] = from_first(p, i, k);
    const ebpo_chain chain = { .n = p->n,
                               .optimal = EBPO_POLYGON_OPTIMAL,
                               .point = (const double(*)[3])point };
    bool done = point && ebpo_triangulate_chain(&chain, triangle);
    free(point);
    return done ? kind_of_guess(p, triangle) : EBPO_POLYGON_NO_MEMORY;
}

/* ---- cutting a polygon ---- */

static ebpo_polygon_kind cut_polygon(const polygon *p, uint32_t (*triangle)[3], void *scratch)
{
    const double(*flat)[2] = (const double(*)[2])p->flat;
    ebpo_polygon_kind kind = classify_polygon(p);
    ears_result ears = EBPO_EARS_STUCK;
    if (kind == EBPO_POLYGON_CONVEX)
        return kind;
    if (kind != EBPO_POLYGON_GUESSED)
        ears = cut_outline(triangle, flat, p->n, EBPO_EARS_CLOSED, EBPO_POLYGON_WORK, scratch);
    if (ears != EBPO_EARS_STUCK)
        return ears == EBPO_EARS_CUT ? kind : EBPO_POLYGON_TOO_LARGE;
    ears = cut_outline(triangle, flat, p->n, EBPO_EARS_TOUCHING, TOUCHING_WORK, scratch);
    return ears == EBPO_EARS_CUT ? EBPO_POLYGON_CONCAVE : guess_triangles(p, triangle);
}

ebpo_polygon_kind ebpo_polygon_triangulate(uint32_t (*triangle)[3], const double (*corner)[3],
                                           uint32_t n, void *scratch)
{
    polygon p = { .corner = corner, .flat = scratch, .n = n };
    make_fan(triangle, n);
    if (n == 3)
        return EBPO_POLYGON_CONVEX;
    if (!find_scale(&p))
        return EBPO_POLYGON_DEGENERATE;
    p.projected = project_polygon(&p);
    return p.projected ? cut_polygon(&p, triangle, p.flat + n) : guess_triangles(&p, triangle);
}
