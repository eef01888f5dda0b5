#include "core/strict_fp.h"

#include "geometry/chain.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/workspace.h"

static double triangle_area(const ebpo_chain *c, uint32_t i, uint32_t j, uint32_t k)
{
    double n[3];
    ebpo_face_cross(c->point[i], c->point[j], c->point[k], n);
    return 0.5 * sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
}

/* More than the area of any triangulation: what an edge that exists already costs. */
static double penalty(const ebpo_chain *c)
{
    double length = 0;
    for (uint32_t i = 0; i < c->n; i++) {
        const double *p = c->point[i], *q = c->point[(i + 1) % c->n];
        length += fabs(q[0] - p[0]) + fabs(q[1] - p[1]) + fabs(q[2] - p[2]);
    }
    return length * length * c->n;
}

/* ---- least area, by dynamic programming over sub-chains i .. j ---- */

static void fill_tables(const ebpo_chain *c, double *cost, uint16_t *apex)
{
    uint64_t n = c->n;
    double extra = penalty(c);
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

/* ---- long chains: the smallest ear first, those that bend outward last ---- */

typedef struct ear {
    double area;
    uint32_t tip;
    uint32_t version; /* of the tip when this was computed; an older one is stale */
    bool reflex;
} ear;

typedef struct cutting {
    const ebpo_chain *chain;
    uint32_t *before, *after, *version;
    double normal[3]; /* area vector of the whole chain */
    ear *heap;        /* least first */
    uint64_t count;
} cutting;

static bool cut_sooner(const ear *a, const ear *b)
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
    ear e = { .area = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]),
              .tip = tip,
              .version = ++c->version[tip],
              .reflex = n[0] * c->normal[0] + n[1] * c->normal[1] + n[2] * c->normal[2] < 0 };
    uint64_t i = c->count++;
    for (; i > 0 && cut_sooner(&e, &c->heap[(i - 1) / 2]); i = (i - 1) / 2)
        c->heap[i] = c->heap[(i - 1) / 2];
    c->heap[i] = e;
}

static ear pop_ear(cutting *c)
{
    ear top = c->heap[0], last = c->heap[--c->count];
    uint64_t i = 0;
    for (uint64_t child; (child = 2 * i + 1) < c->count; i = child) {
        if (child + 1 < c->count && cut_sooner(&c->heap[child + 1], &c->heap[child]))
            child++;
        if (!cut_sooner(&c->heap[child], &last))
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

static bool cut_ears(const ebpo_chain *chain, uint32_t (*triangles)[3])
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
        ear e = pop_ear(&c);
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

bool ebpo_triangulate_chain(const ebpo_chain *chain, uint32_t (*triangles)[3])
{
    return chain->n <= chain->optimal ? least_area(chain, triangles) : cut_ears(chain, triangles);
}
