/* Closed components look outwards, or inwards where they bound a cavity. */
#include "geom/strict_fp.h"

#include <ebpo/repair.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/arrays.h"
#include "base/error.h"
#include "base/fp_env.h"
#include "base/parallel.h"
#include "base/sized.h"
#include "geom/predicates.h"
#include "mesh/component_parts.h"
#include "mesh/point_tree.h"

/* A component is within another one if these vertices are: the least and the greatest along each
 * axis. */
enum { SAMPLES = 6, GRAIN = 64 };

typedef struct shell {
    double sample[SAMPLES][3];
    double min[3], max[3];
    uint32_t component;
    uint32_t depth; /* closed components that it is within */
} shell;

/* Of one thread: what may be within the host that it looks at. */
typedef struct seeker {
    point_tree probes; /* SAMPLES of each of these shells; values are winding numbers */
    struct nesting *n;
    const shell *host;
    const double (*face)[3];
} seeker;

typedef struct nesting {
    ebpo_components *components;
    shell *shells; /* closed, with a volume */
    uint64_t count;
    point_tree tree; /* a vertex of each shell */
    seeker *seeker;  /* one for each worker */
    unsigned threads;
} nesting;

/* ---- what is known of each ---- */

/* Whether a comes before b along direction d: by that coordinate, then by all of them, so that only
 * vertices at one position are equal. */
static bool before(const double a[3], const double b[3], int d)
{
    int axis = d / 2;
    if (a[axis] != b[axis])
        return d % 2 ? a[axis] > b[axis] : a[axis] < b[axis];
    for (int k = 0; k < 3; k++)
        if (a[k] != b[k])
            return a[k] < b[k];
    return false;
}

static ebpo_status sample_shells(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    nesting *n = context;
    const ebpo_components *c = n->components;
    (void)worker, (void)error;
    for (uint64_t s = begin; s < end; s++) {
        shell *one = &n->shells[s];
        const mesh_component *m = &c->list[one->component];
        for (int d = 0; d < SAMPLES; d++)
            ebpo_mesh_position(c->mesh, c->mesh->faces[3 * (uint64_t)m->face], one->sample[d]);
        memcpy(one->min, m->min, sizeof one->min);
        memcpy(one->max, m->max, sizeof one->max);
        EBPO_FOR_ITEMS_SCATTERED(c->mesh->workspace, i, c->faces.begin[one->component],
                                 c->faces.begin[one->component + (uint64_t)1]) {
            for (uint64_t k = 0; k < 3; k++) {
                double at[3];
                ebpo_mesh_position(c->mesh, c->mesh->faces[3 * (uint64_t)c->faces.of[i] + k], at);
                for (int d = 0; d < SAMPLES; d++)
                    if (before(at, one->sample[d], d))
                        memcpy(one->sample[d], at, sizeof at);
            }
        }
    }
    return EBPO_OK;
}

/* ---- which are within which ---- */

static bool box_within(const shell *inner, const shell *outer)
{
    for (int k = 0; k < 3; k++)
        if (inner->min[k] < outer->min[k] || inner->max[k] > outer->max[k])
            return false;
    return true;
}

static bool near_host(void *user, const point_box *box)
{
    const shell *h = ((const seeker *)user)->host;
    for (int k = 0; k < 3; k++)
        if (box->min[k] > h->max[k] || box->max[k] < h->min[k])
            return false;
    return true;
}

static bool add_probes(seeker *w, uint32_t number)
{
    const shell *one = &w->n->shells[number];
    for (int d = 0; d < SAMPLES; d++) {
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
        const shell *one = &w->n->shells[points[i].number];
        if (one != w->host && box_within(one, w->host) && !add_probes(w, points[i].number))
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

/* Probes that a line along x may lead through the face from. */
static bool near_face(void *user, const point_box *box)
{
    const double(*t)[3] = ((const seeker *)user)->face;
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
    const ebpo_components *c = w->n->components;
    EBPO_FOR_ITEMS_SCATTERED(c->mesh->workspace, i, c->faces.begin[w->host->component],
                             c->faces.begin[w->host->component + (uint64_t)1]) {
        double t[3][3];
        for (uint64_t k = 0; k < 3; k++)
            ebpo_mesh_position(c->mesh, c->mesh->faces[3 * (uint64_t)c->faces.of[i] + k], t[k]);
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
    for (uint64_t i = 0; i < w->probes.count; i += SAMPLES) {
        bool within = true;
        for (uint64_t d = 0; d < SAMPLES; d++)
            within &= p[i + d].value != 0;
        if (within)
            __atomic_fetch_add(&w->n->shells[p[i].number].depth, 1, __ATOMIC_RELAXED);
    }
}

static ebpo_status find_inner(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    nesting *n = context;
    seeker *w = &n->seeker[worker];
    for (uint64_t host = begin; host < end; host++) {
        w->host = &n->shells[host];
        w->probes.count = 0;
        if (!ebpo_point_tree_walk(&n->tree, near_host, list_inner, w) ||
            !ebpo_point_tree_build(&w->probes))
            return ebpo_workspace_fail(w->probes.workspace,
                                       (w->probes.count + SAMPLES) * sizeof(mesh_point), error);
        if (w->probes.count == 0)
            continue;
        cross_host(w);
        count_inner(w);
    }
    return EBPO_OK;
}

/* ---- what is to be turned ---- */

static bool looks_inwards(const nesting *n, const shell *one)
{
    return n->components->list[one->component].volume < 0;
}

static bool is_cavity(const shell *one) { return one->depth % 2 != 0; }

static uint64_t turn_shell(const ebpo_components *c, uint32_t component)
{
    uint64_t begin = c->faces.begin[component], end = c->faces.begin[component + (uint64_t)1];
    EBPO_FOR_ITEMS_SCATTERED(c->mesh->workspace, i, begin, end)
        ebpo_face_turn(c->mesh->faces + 3 * (uint64_t)c->faces.of[i]);
    return end - begin;
}

static ebpo_status list_shells(nesting *n, ebpo_error *error)
{
    const ebpo_components *c = n->components;
    n->shells = ebpo_array_alloc(c->mesh->workspace, c->count, sizeof *n->shells);
    if (!n->shells)
        return ebpo_workspace_fail(c->mesh->workspace, c->count * sizeof *n->shells, error);
    for (uint64_t i = 0; i < c->count; i++)
        if (!c->list[i].open && (c->list[i].volume < 0 || c->list[i].volume > 0))
            n->shells[n->count++] = (shell){ .component = (uint32_t)i };
    return EBPO_OK;
}

static ebpo_status make_tree(nesting *n, ebpo_error *error)
{
    ebpo_workspace *workspace = n->components->mesh->workspace;
    n->tree.workspace = workspace;
    n->seeker = ebpo_alloc_zero(n->threads, sizeof *n->seeker);
    if (!n->seeker)
        return ebpo_fail_memory(error, n->threads * sizeof *n->seeker);
    for (unsigned t = 0; t < n->threads; t++)
        n->seeker[t] = (seeker){ .probes = { .workspace = workspace }, .n = n };
    for (uint64_t i = 0; i < n->count; i++) {
        mesh_point *p = ebpo_point_tree_add(&n->tree);
        if (!p)
            return ebpo_workspace_fail(workspace, n->count * sizeof *p, error);
        *p = (mesh_point){ .number = (uint32_t)i };
        memcpy(p->at, n->shells[i].sample[0], sizeof p->at);
    }
    return ebpo_point_tree_build(&n->tree)
               ? EBPO_OK
               : ebpo_workspace_fail(workspace, n->count * sizeof(point_box), error);
}

static ebpo_status nest(nesting *n, ebpo_error *error)
{
    ebpo_status status = list_shells(n, error);
    if (status != EBPO_OK || n->count < 2)
        return status;
    status =
        ebpo_parallel_for(n->threads, NULL, n->count, GRAIN, sample_shells, n, NULL, "", error);
    if (status != EBPO_OK)
        return status;
    status = make_tree(n, error);
    return status == EBPO_OK ? ebpo_parallel_for(n->threads, n->components->mesh->workspace,
                                                 n->count, 1, find_inner, n, NULL, "", error)
                             : status;
}

static ebpo_status find_nesting(nesting *n, const ebpo_mesh *mesh, unsigned threads,
                                const ebpo_progress *progress, ebpo_error *error)
{
    n->threads = ebpo_thread_count(threads);
    ebpo_status status = ebpo_components_find(mesh, threads, progress, &n->components, error);
    return status == EBPO_OK ? nest(n, error) : status;
}

static void free_nesting(nesting *n, const ebpo_mesh *mesh)
{
    for (unsigned t = 0; n->seeker && t < n->threads; t++)
        ebpo_point_tree_free(&n->seeker[t].probes);
    free(n->seeker);
    ebpo_point_tree_free(&n->tree);
    ebpo_array_free(mesh->workspace, n->shells);
    ebpo_components_free(n->components);
}

ebpo_status ebpo_mesh_turn_closed(ebpo_mesh *mesh, ebpo_mend_record *record, ebpo_error *error)
{
    nesting n = { .components = NULL };
    uint64_t turned = 0;
    if (mesh->face_count == 0)
        return EBPO_OK;
    ebpo_status status = find_nesting(&n, mesh, 0, NULL, error);
    for (uint64_t i = 0; i < n.count && status == EBPO_OK; i++)
        if (looks_inwards(&n, &n.shells[i]) != is_cavity(&n.shells[i]))
            turned += turn_shell(n.components, n.shells[i].component);
    free_nesting(&n, mesh);
    if (record)
        record->flipped_faces += turned;
    return status;
}

ebpo_status ebpo_mesh_count_shells(const ebpo_mesh *mesh, unsigned threads, ebpo_progress progress,
                                   ebpo_shells *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    static const ebpo_shells nothing = EBPO_SHELLS_INIT;
    ebpo_shells made = EBPO_SHELLS_INIT;
    nesting n = { .components = NULL };
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_shells, out, error);
    if (status == EBPO_OK)
        status = find_nesting(&n, mesh, threads, &progress, error);
    for (uint64_t i = 0; i < n.count && status == EBPO_OK; i++) {
        bool inwards = looks_inwards(&n, &n.shells[i]), cavity = is_cavity(&n.shells[i]);
        made.inside_out += inwards && !cavity;
        made.cavities += inwards && cavity;
        made.nested += !inwards && cavity;
    }
    made.closed = n.count;
    free_nesting(&n, mesh);
    EBPO_GIVE(ebpo_shells, out, status == EBPO_OK ? &made : &nothing);
    return status;
}
