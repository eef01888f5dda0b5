/* The samples of what may be within a host, in a tree, and each of its faces against it. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/parallel.h"
#include "geometry/predicates.h"
#include "mesh/shell_probes.h"

/* Of one thread: what may be within the host that it looks at. */
typedef struct seeker {
    point_tree probes; /* SHELL_SAMPLES of each of these shells; values are winding numbers */
    struct probing *all;
    const shell *host;
    const double (*face)[3];
} seeker;

typedef struct probing {
    nesting *n;
    seeker *seeker; /* one for each worker */
} probing;

static bool near_host(void *user, const box_node *node)
{
    return ebpo_shell_may_hold(((const seeker *)user)->host, node);
}

static bool add_probes(seeker *w, uint32_t number)
{
    const shell *one = &w->all->n->shells[number];
    for (int d = 0; d < SHELL_SAMPLES; d++) {
        mesh_point *p = ebpo_point_tree_add(&w->probes);
        if (!p)
            return false;
        *p = (mesh_point){ .number = number };
        memcpy(p->at, one->sample[d], sizeof p->at);
    }
    return true;
}

static bool list_inner(void *user, mesh_point *points, uint64_t count)
{
    seeker *w = user;
    for (uint64_t i = 0; i < count; i++) {
        const shell *one = &w->all->n->shells[points[i].number];
        if (one != w->host && ebpo_shell_box_within(one, w->host) &&
            !add_probes(w, points[i].number))
            return false;
    }
    return true;
}

/* Whether a line along the edge from t[0] to t[1], in the plane of y and z, separates the box from
 * the triangle. Certain: errors of rounding are bounded, and what is not a number separates
 * nothing. */
static bool separates(const double *const t[3], const point_box *box)
{
    static const double ROUNDING = 0x1p-49, TINY = 0x1p-1000;
    const double *a = t[0], e[2] = { a[2] - t[1][2], t[1][1] - a[1] };
    double low = 0, high = 0, size = 0, least = 0, most = 0;
    for (int k = 0; k < 2; k++) {
        double x = e[k] * (box->min[k + 1] - a[k + 1]), y = e[k] * (box->max[k + 1] - a[k + 1]);
        low += x < y ? x : y;
        high += x < y ? y : x;
        size += fabs(x) + fabs(y);
    }
    for (int i = 1; i < 3; i++) {
        double x = e[0] * (t[i][1] - a[1]), y = e[1] * (t[i][2] - a[2]);
        least = x + y < least ? x + y : least;
        most = x + y > most ? x + y : most;
        size += fabs(x) + fabs(y);
    }
    double error = size * ROUNDING + TINY;
    return low > most + error || high < least - error;
}

bool ebpo_face_may_meet_lines(const double t[3][3], const point_box *box)
{
    bool before = false;
    for (int i = 0; i < 3; i++)
        before |= t[i][0] >= box->min[0];
    if (!before)
        return false;
    for (int k = 1; k < 3; k++) {
        double low = fmin(fmin(t[0][k], t[1][k]), t[2][k]),
               high = fmax(fmax(t[0][k], t[1][k]), t[2][k]);
        if (low > box->max[k] || high < box->min[k])
            return false;
    }
    for (int i = 0; i < 3; i++) {
        const double *const turned[3] = { t[i], t[(i + 1) % 3], t[(i + 2) % 3] };
        if (separates(turned, box))
            return false;
    }
    return true;
}

static bool near_face(void *user, const point_box *box)
{
    return ebpo_face_may_meet_lines(((const seeker *)user)->face, box);
}

/* What segments from the probes along x to the host's end cross. */
static bool cross_face(void *user, mesh_point *points, uint64_t count)
{
    seeker *w = user;
    for (uint64_t i = 0; i < count; i++)
        points[i].value += ebpo_axis_crossing(points[i].at, w->host->max[0], 0, w->face[0],
                                              w->face[1], w->face[2]);
    return true;
}

static void cross_host(seeker *w)
{
    const ebpo_components *c = w->all->n->components;
    EBPO_FOR_ITEMS_SCATTERED(c->mesh->workspace, i, c->faces.begin[w->host->component],
                             c->faces.begin[w->host->component + (uint64_t)1]) {
        double t[3][3];
        ebpo_face_corners(c->mesh, c->faces.of[i], t);
        w->face = (const double(*)[3])t;
        (void)ebpo_point_tree_walk(&w->probes, near_face, cross_face, w);
    }
}

static int by_number(const void *x, const void *y)
{
    const mesh_point *a = x, *b = y;
    return (a->number > b->number) - (a->number < b->number);
}

static void count_inner(const seeker *w)
{
    const mesh_point *p = w->probes.point;
    qsort(w->probes.point, w->probes.count, sizeof *p, by_number);
    for (uint64_t i = 0; i < w->probes.count; i += SHELL_SAMPLES) {
        bool within = true;
        for (uint64_t d = 0; d < SHELL_SAMPLES; d++)
            within &= p[i + d].value != 0;
        if (!within)
            continue;
        shell *inner = &w->all->n->shells[p[i].number];
        __atomic_fetch_add(&inner->depth, 1, __ATOMIC_RELAXED);
        __atomic_fetch_sub(&inner->around, p[i].value, __ATOMIC_RELAXED); /* it ends outside */
    }
}

static ebpo_status find_inner(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    const probing *all = context;
    seeker *w = &all->seeker[worker];
    for (uint64_t host = begin; host < end; host++) {
        w->host = &all->n->shells[host];
        if (w->host->crowded)
            continue;
        w->probes.count = 0;
        if (!ebpo_box_tree_walk(&all->n->tree, near_host, list_inner, w) ||
            !ebpo_point_tree_build(&w->probes))
            return ebpo_workspace_fail(w->probes.workspace,
                                       (w->probes.count + SHELL_SAMPLES) * sizeof(mesh_point),
                                       error);
        if (w->probes.count == 0)
            continue;
        cross_host(w);
        count_inner(w);
    }
    return EBPO_OK;
}

ebpo_status ebpo_nesting_probe(nesting *n, ebpo_error *error)
{
    ebpo_workspace *workspace = n->components->mesh->workspace;
    probing all = { n, ebpo_alloc_zero(n->threads, sizeof *all.seeker) };
    if (!all.seeker)
        return ebpo_fail_memory(error, n->threads * sizeof *all.seeker);
    for (unsigned t = 0; t < n->threads; t++)
        all.seeker[t] = (seeker){ .probes = { .workspace = workspace }, .all = &all };
    ebpo_status status =
        ebpo_parallel_for(n->threads, workspace, n->count, 1, find_inner, &all, NULL, "", error);
    for (unsigned t = 0; t < n->threads; t++)
        ebpo_point_tree_free(&all.seeker[t].probes);
    free(all.seeker);
    return status;
}
