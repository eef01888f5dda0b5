/* Which closed component a cavity is in. */
#include "core/strict_fp.h"

#include <stdlib.h>

#include "core/workspace.h"
#include "core/error.h"
#include "core/sort.h"
#include "geometry/predicates.h"
#include "mesh/component_parts.h"

/* A closed component of negative volume, seen as the first vertex of its first face. */
typedef struct cavity {
    double at[3];
    int64_t winding; /* of the host that is looked at */
    uint32_t component;
    bool placed;
} cavity;

typedef struct placing {
    const ebpo_components *components;
    cavity *cavities; /* by at[1] */
    uint64_t count;
    uint32_t *hosts; /* by volume */
    uint64_t host_count;
} placing;

static int compare_cavities(const void *x, const void *y)
{
    const cavity *a = x, *b = y;
    if (a->at[1] != b->at[1])
        return a->at[1] < b->at[1] ? -1 : 1;
    return a->component < b->component ? -1 : 1;
}

static int compare_hosts(const void *x, const void *y, void *list)
{
    uint32_t a = *(const uint32_t *)x, b = *(const uint32_t *)y;
    const mesh_component *l = list;
    if (l[a].volume != l[b].volume)
        return l[a].volume < l[b].volume ? -1 : 1;
    return a < b ? -1 : 1;
}

static void list_both(placing *p)
{
    const ebpo_components *c = p->components;
    for (uint64_t i = 0; i < c->count; i++) {
        const mesh_component *m = &c->list[i];
        if (!m->open && m->volume > 0)
            p->hosts[p->host_count++] = (uint32_t)i;
        if (m->open || !(m->volume < 0))
            continue;
        cavity *v = &p->cavities[p->count++];
        *v = (cavity){ .component = (uint32_t)i };
        ebpo_mesh_position(c->mesh, c->mesh->faces[3 * (uint64_t)m->face], v->at);
    }
    qsort(p->cavities, p->count, sizeof *p->cavities, compare_cavities);
    ebpo_sort_with(p->hosts, p->host_count, sizeof *p->hosts, compare_hosts, c->list);
}

/* The first cavity at y or beyond. */
static uint64_t from_y(const placing *p, double y)
{
    uint64_t low = 0, high = p->count;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (p->cavities[middle].at[1] < y)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* What segments from the cavities along x to the host's end cross. */
static void cross_face(placing *p, const mesh_component *host, uint64_t face)
{
    const ebpo_mesh *mesh = p->components->mesh;
    double t[3][3], low, high;
    for (uint64_t k = 0; k < 3; k++)
        ebpo_mesh_position(mesh, mesh->faces[3 * face + k], t[k]);
    low = t[0][1] < t[1][1] ? t[0][1] : t[1][1];
    high = t[0][1] > t[1][1] ? t[0][1] : t[1][1];
    low = t[2][1] < low ? t[2][1] : low;
    high = t[2][1] > high ? t[2][1] : high;
    for (uint64_t i = from_y(p, low); i < p->count && p->cavities[i].at[1] <= high; i++)
        if (!p->cavities[i].placed)
            p->cavities[i].winding +=
                ebpo_axis_crossing(p->cavities[i].at, host->max[0], 0, t[0], t[1], t[2]);
}

/* A cavity that may be in the host and is in none yet. */
static bool any_within(const placing *p, const mesh_component *host)
{
    for (uint64_t i = from_y(p, host->min[1]); i < p->count && p->cavities[i].at[1] <= host->max[1];
         i++) {
        const double *x = p->cavities[i].at;
        if (!p->cavities[i].placed && x[0] >= host->min[0] && x[0] <= host->max[0] &&
            x[2] >= host->min[2] && x[2] <= host->max[2])
            return true;
    }
    return false;
}

static void fill_host(placing *p, uint32_t number)
{
    const ebpo_components *c = p->components;
    const mesh_component *host = &c->list[number];
    if (!any_within(p, host))
        return;
    EBPO_FOR_ITEMS_SCATTERED(c->mesh->workspace, i, c->faces.begin[number],
                             c->faces.begin[number + (uint64_t)1])
        cross_face(p, host, c->faces.of[i]);
    for (uint64_t i = from_y(p, host->min[1]); i < p->count && p->cavities[i].at[1] <= host->max[1];
         i++) {
        cavity *v = &p->cavities[i];
        if (!v->placed && v->winding != 0) {
            v->placed = true;
            c->list[v->component].host = number;
        }
        v->winding = 0;
    }
}

ebpo_status ebpo_cavities_place(const ebpo_components *c, ebpo_error *error)
{
    placing p = { .components = c };
    ebpo_workspace *workspace = c->mesh->workspace;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < c->count; i++)
        c->list[i].host = (uint32_t)i;
    p.cavities = ebpo_array_alloc(workspace, c->count, sizeof *p.cavities);
    p.hosts = ebpo_array_alloc(workspace, c->count, sizeof *p.hosts);
    if (p.cavities && p.hosts)
        list_both(&p);
    else
        status = ebpo_workspace_fail(workspace, c->count * sizeof *p.cavities, error);
    for (uint64_t i = 0; i < p.host_count && p.count; i++) /* the least volume first */
        fill_host(&p, p.hosts[i]);
    ebpo_array_free(workspace, p.cavities);
    ebpo_array_free(workspace, p.hosts);
    return status;
}
