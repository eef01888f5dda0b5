/* Closed components, what is known of each, and how many each is within. */
#include "core/strict_fp.h"

#include "mesh/shell_nesting.h"

#include <string.h>

#include "core/workspace.h"
#include "core/error.h"
#include "core/parallel.h"
#include "mesh/shell_probes.h"
#include "mesh/shell_rays.h"

/* A host is crowded with more than so many samples for each of its faces. */
enum { CROWD = 8, GRAIN = 64 };

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
        for (int d = 0; d < SHELL_SAMPLES; d++)
            ebpo_mesh_position(c->mesh, c->mesh->faces[3 * (uint64_t)m->face], one->sample[d]);
        memcpy(one->min, m->min, sizeof one->min);
        memcpy(one->max, m->max, sizeof one->max);
        EBPO_FOR_ITEMS_SCATTERED(c->mesh->workspace, i, c->faces.begin[one->component],
                                 c->faces.begin[one->component + (uint64_t)1]) {
            for (uint64_t k = 0; k < 3; k++) {
                double at[3];
                ebpo_mesh_position(c->mesh, c->mesh->faces[3 * (uint64_t)c->faces.of[i] + k], at);
                for (int d = 0; d < SHELL_SAMPLES; d++)
                    if (before(at, one->sample[d], d))
                        memcpy(one->sample[d], at, sizeof at);
            }
        }
    }
    return EBPO_OK;
}

/* ---- which may be within which ---- */

typedef struct crowd {
    const nesting *n;
    const shell *host;
    uint64_t inner; /* shells with a box within the host's, and the host */
} crowd;

/* What is within as a whole is counted, and not entered. */
static bool count_node(void *user, const box_node *node)
{
    crowd *c = user;
    bool within = true;
    if (!ebpo_shell_may_hold(c->host, node))
        return false;
    for (int k = 0; k < 3; k++)
        within &=
            node->filled->min[k] >= c->host->min[k] && node->filled->max[k] <= c->host->max[k];
    c->inner += within ? node->count : 0;
    return !within;
}

static bool count_shells(void *user, mesh_point *points, uint64_t count)
{
    crowd *c = user;
    for (uint64_t i = 0; i < count; i++)
        c->inner += ebpo_shell_box_within(&c->n->shells[points[i].number], c->host);
    return true;
}

static ebpo_status find_crowded(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                ebpo_error *error)
{
    nesting *n = context;
    const uint64_t *faces = n->components->faces.begin;
    (void)worker, (void)error;
    for (uint64_t i = begin; i < end; i++) {
        shell *host = &n->shells[i];
        crowd c = { n, host, 0 };
        (void)ebpo_box_tree_walk(&n->tree, count_node, count_shells, &c);
        host->crowded = (c.inner - 1) * SHELL_SAMPLES >
                        CROWD * (faces[host->component + (uint64_t)1] - faces[host->component]);
    }
    return EBPO_OK;
}

/* ---- all of it ---- */

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

static void box_of_shell(const void *user, const mesh_point *p, point_box *out)
{
    const shell *one = &((const nesting *)user)->shells[p->number];
    memcpy(out->min, one->min, sizeof out->min);
    memcpy(out->max, one->max, sizeof out->max);
}

static ebpo_status make_tree(nesting *n, ebpo_error *error)
{
    ebpo_workspace *workspace = n->components->mesh->workspace;
    n->tree.points.workspace = workspace;
    for (uint64_t i = 0; i < n->count; i++) {
        mesh_point *p = ebpo_point_tree_add(&n->tree.points);
        if (!p)
            return ebpo_workspace_fail(workspace, n->count * sizeof *p, error);
        *p = (mesh_point){ .number = (uint32_t)i };
        memcpy(p->at, n->shells[i].sample[0], sizeof p->at);
    }
    return ebpo_box_tree_build(&n->tree, box_of_shell, n)
               ? EBPO_OK
               : ebpo_workspace_fail(workspace, 2 * n->count * sizeof(point_box), error);
}

static ebpo_status nest(nesting *n, ebpo_error *error)
{
    ebpo_status status = list_shells(n, error);
    if (status != EBPO_OK || n->count < 2)
        return status;
    status =
        ebpo_parallel_for(n->threads, NULL, n->count, GRAIN, sample_shells, n, NULL, "", error);
    if (status == EBPO_OK)
        status = make_tree(n, error);
    if (status == EBPO_OK)
        status =
            ebpo_parallel_for(n->threads, NULL, n->count, GRAIN, find_crowded, n, NULL, "", error);
    if (status == EBPO_OK)
        status = ebpo_nesting_probe(n, error);
    return status == EBPO_OK ? ebpo_nesting_cast(n, error) : status;
}

ebpo_status ebpo_nesting_find(nesting *n, const ebpo_mesh *mesh, uint32_t *closed, unsigned threads,
                              const ebpo_progress *progress, ebpo_error *error)
{
    n->threads = ebpo_thread_count(threads);
    ebpo_status status =
        ebpo_components_find(mesh, closed, threads, progress, &n->components, error);
    return status == EBPO_OK ? nest(n, error) : status;
}

void ebpo_nesting_free(nesting *n, const ebpo_mesh *mesh)
{
    ebpo_box_tree_free(&n->tree);
    ebpo_array_free(mesh->workspace, n->shells);
    ebpo_components_free(n->components);
}
