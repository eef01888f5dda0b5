/* Rays along x from the samples of all shells through one tree of the crowded hosts' faces: of each
 * host what a ray crosses of it is its winding number at the sample. */
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
#include "mesh/shell_rays.h"

enum { GRAIN = 16 };

/* What the rays of the shell that is looked at cross of one host. */
typedef struct tally {
    int32_t winding[SHELL_SAMPLES];
    uint32_t shell; /* whose rays these are, and one more */
} tally;

typedef struct casting {
    nesting *n;
    uint32_t *host; /* the crowded ones, numbers of shells */
    uint64_t host_count;
    box_tree faces; /* number: the face; value: its place in `host` */
    struct caster *caster;
} casting;

/* Of one thread. */
typedef struct caster {
    const casting *all;
    tally *of;     /* [host_count] */
    int32_t *seen; /* [host_count] which of these the shell's rays have met */
    uint64_t seen_count;
    uint32_t shell;
    int sample;
    point_box at; /* that sample: a box without extent */
} caster;

static bool on_ray(void *user, const box_node *node)
{
    const caster *w = user;
    const double *at = w->at.min;
    const point_box *box = node->filled;
    return at[0] <= box->max[0] && at[1] >= box->min[1] && at[1] <= box->max[1] &&
           at[2] >= box->min[2] && at[2] <= box->max[2];
}

static tally *tally_of(caster *w, int32_t host)
{
    tally *t = &w->of[host];
    if (t->shell != w->shell + 1) {
        *t = (tally){ .shell = w->shell + 1 };
        w->seen[w->seen_count++] = host;
    }
    return t;
}

static bool cross_faces(void *user, mesh_point *points, uint64_t count)
{
    caster *w = user;
    const nesting *n = w->all->n;
    for (uint64_t i = 0; i < count; i++) {
        double t[3][3];
        if (w->all->host[points[i].value] == w->shell)
            continue;
        ebpo_face_corners(n->components->mesh, points[i].number, t);
        if (!ebpo_face_may_meet_lines((const double(*)[3])t, &w->at))
            continue;
        int crossing = ebpo_axis_crossing(w->at.min, INFINITY, 0, t[0], t[1], t[2]);
        if (crossing != 0)
            tally_of(w, points[i].value)->winding[w->sample] += crossing;
    }
    return true;
}

/* Counts the hosts that all samples up to now are within, and adds up their winding numbers. */
static uint32_t count_hosts(const caster *w, int32_t *around)
{
    uint32_t count = 0;
    *around = 0;
    for (uint64_t i = 0; i < w->seen_count; i++) {
        bool within = true;
        for (int d = 0; d <= w->sample; d++)
            within &= w->of[w->seen[i]].winding[d] != 0;
        count += within;
        *around += within ? w->of[w->seen[i]].winding[0] : 0;
    }
    return count;
}

/* The samples are the ends of the shell's box: where all are within a host, so is the box within
 * the host's. */
static ebpo_status cast_rays(void *context, uint64_t begin, uint64_t end, unsigned worker,
                             ebpo_error *error)
{
    const casting *all = context;
    caster *w = &all->caster[worker];
    (void)error;
    for (uint64_t i = begin; i < end; i++) {
        uint32_t hosts = 1;
        int32_t around = 0;
        w->shell = (uint32_t)i;
        w->seen_count = 0;
        for (w->sample = 0; hosts && w->sample < SHELL_SAMPLES; w->sample++) {
            const double *at = all->n->shells[i].sample[w->sample];
            memcpy(w->at.min, at, sizeof w->at.min);
            memcpy(w->at.max, at, sizeof w->at.max);
            (void)ebpo_box_tree_walk(&all->faces, on_ray, cross_faces, w);
            hosts = count_hosts(w, &around);
        }
        all->n->shells[i].depth += hosts;
        all->n->shells[i].around -= around; /* rays end outside */
    }
    return EBPO_OK;
}

static ebpo_status add_faces(casting *all, uint64_t host, ebpo_error *error)
{
    const ebpo_components *c = all->n->components;
    uint64_t component = all->n->shells[all->host[host]].component;
    EBPO_FOR_ITEMS_SCATTERED(c->mesh->workspace, i, c->faces.begin[component],
                             c->faces.begin[component + 1]) {
        if (!ebpo_face_add(&all->faces, c->mesh, c->faces.of[i], (int32_t)host))
            return ebpo_workspace_fail(c->mesh->workspace,
                                       (all->faces.points.count + 1) * sizeof(mesh_point), error);
    }
    return EBPO_OK;
}

static ebpo_status plant(casting *all, ebpo_error *error)
{
    const ebpo_mesh *mesh = all->n->components->mesh;
    ebpo_status status = EBPO_OK;
    for (uint64_t h = 0; h < all->host_count && status == EBPO_OK; h++)
        status = add_faces(all, h, error);
    if (status != EBPO_OK || ebpo_box_tree_build(&all->faces, ebpo_face_box, mesh))
        return status;
    return ebpo_workspace_fail(mesh->workspace, 2 * all->faces.points.count * sizeof(point_box),
                               error);
}

static ebpo_status hire(casting *all, ebpo_error *error)
{
    ebpo_workspace *workspace = all->n->components->mesh->workspace;
    all->caster = ebpo_alloc_zero(all->n->threads, sizeof *all->caster);
    if (!all->caster)
        return ebpo_fail_memory(error, all->n->threads * sizeof *all->caster);
    for (unsigned t = 0; t < all->n->threads; t++) {
        caster *w = &all->caster[t];
        w->all = all;
        w->of = ebpo_array_alloc(workspace, all->host_count, sizeof *w->of);
        w->seen = ebpo_array_alloc(workspace, all->host_count, sizeof *w->seen);
        if (!w->of || !w->seen)
            return ebpo_workspace_fail(workspace, all->host_count * sizeof *w->of, error);
        memset(w->of, 0, all->host_count * sizeof *w->of);
    }
    return EBPO_OK;
}

static void free_casting(casting *all)
{
    ebpo_workspace *workspace = all->n->components->mesh->workspace;
    for (unsigned t = 0; all->caster && t < all->n->threads; t++) {
        ebpo_array_free(workspace, all->caster[t].of);
        ebpo_array_free(workspace, all->caster[t].seen);
    }
    free(all->caster);
    ebpo_box_tree_free(&all->faces);
    ebpo_array_free(workspace, all->host);
}

ebpo_status ebpo_nesting_cast(nesting *n, ebpo_error *error)
{
    ebpo_workspace *workspace = n->components->mesh->workspace;
    casting all = { .n = n, .faces = { .points = { .workspace = workspace } } };
    all.host = ebpo_array_alloc(workspace, n->count, sizeof *all.host);
    if (!all.host)
        return ebpo_workspace_fail(workspace, n->count * sizeof *all.host, error);
    for (uint64_t i = 0; i < n->count; i++)
        if (n->shells[i].crowded)
            all.host[all.host_count++] = (uint32_t)i;
    ebpo_status status = EBPO_OK;
    if (all.host_count) {
        status = plant(&all, error);
        if (status == EBPO_OK)
            status = hire(&all, error);
        if (status == EBPO_OK)
            status = ebpo_parallel_for(n->threads, workspace, n->count, GRAIN, cast_rays, &all,
                                       NULL, "", error);
    }
    free_casting(&all);
    return status;
}
