/* Finds the closed components of a mesh and computes their volumes. Finds the component around each
 * cavity (a closed component of negative volume). */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/sort.h"
#include "geometry/predicates.h"
#include "mesh/component_parts.h"
#include "mesh/adjacency.h"
#include "mesh/mesh_parts.h"
#include "mesh/sum.h"

/* Numbers of vertices and of components for each call of a thread's function. */
enum { VERTEX_GRAIN = 1 << 13, COMPONENT_GRAIN = 64 };

typedef struct measuring {
    ebpo_components *components;
    ebpo_mesh_frame frame; /* frame for volumes */
    ebpo_stars stars;
    ebpo_star *star;         /* one for each thread */
    ebpo_edge_faces *around; /* one for each thread */
} measuring;

/* ---- edges ---- */

/* Returns true if an edge is used equally often in both directions. */
static bool uses_balance(const ebpo_link *links, uint64_t uses)
{
    uint64_t out = 0;
    for (uint64_t i = 0; i < uses; i++)
        out += links[i].out;
    return 2 * out == uses;
}

static void set_open(ebpo_components *c, uint32_t component)
{
    __atomic_store_n(&c->list[component].open, true, __ATOMIC_RELAXED);
}

/* Visits an edge whose faces may belong to several components. Marks as open the components that do
 * not use the edge equally often in both directions. Returns false when out of memory. */
static bool visit_edge(ebpo_components *c, const ebpo_link *links, uint64_t uses,
                       ebpo_edge_faces *e)
{
    e->count = 0;
    for (uint64_t i = 0; i < uses; i++) {
        uint32_t face = ebpo_link_face(&links[i]);
        if (!ebpo_edge_faces_add(e, face, links[i].out, (uint64_t)c->of_face[face] << 1))
            return false;
    }
    ebpo_edge_faces_sort(e);
    for (uint64_t i = 0, next; i < e->count; i = next) {
        int64_t sum = 0;
        for (next = i; next < e->count && e->face[next].patch == e->face[i].patch; next++)
            sum += e->face[next].out ? 1 : -1;
        if (sum)
            set_open(c, (uint32_t)(e->face[i].patch >> 1));
    }
    return true;
}

static ebpo_status visit_vertices(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                  ebpo_error *error)
{
    measuring *m = context;
    ebpo_components *c = m->components;
    ebpo_star *star = &m->star[worker];
    EBPO_FOR_ITEMS_SCATTERED(c->mesh->workspace, v, begin, end) {
        if (!ebpo_star_gather(star, &m->stars, c->mesh, (uint32_t)v))
            return ebpo_workspace_fail(c->mesh->workspace, star->capacity * 2 * sizeof *star->links,
                                       error);
        for (uint64_t i = 0, next; i < star->count; i = next) {
            next = ebpo_star_run_end(star, i);
            const ebpo_link *links = star->links + i;
            if (ebpo_link_neighbour(links) <= v)
                continue;
            if (c->of_face && next - i > 2) {
                if (!visit_edge(c, links, next - i, &m->around[worker]))
                    return ebpo_fail_memory(error, (next - i) * sizeof(ebpo_edge_face));
            } else if (!uses_balance(links, next - i))
                set_open(c, c->of_face ? c->of_face[ebpo_link_face(links)] : c->number[v]);
        }
    }
    return EBPO_OK;
}

/* Marks the components that are open. */
static ebpo_status inspect_edges(measuring *m, unsigned threads, const ebpo_progress *progress,
                                 ebpo_error *error)
{
    const ebpo_mesh *mesh = m->components->mesh;
    ebpo_status status = ebpo_stars_build(&m->stars, mesh, threads, progress, error);
    m->star = ebpo_alloc_zero(threads, sizeof *m->star);
    m->around = ebpo_alloc_zero(threads, sizeof *m->around);
    if (status == EBPO_OK && (!m->star || !m->around))
        status = ebpo_fail_memory(error, threads * sizeof *m->star);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(threads, NULL, mesh->vertex_count, VERTEX_GRAIN, visit_vertices,
                                   m, progress, "components", error);
    for (unsigned t = 0; m->star && t < threads; t++)
        ebpo_star_free(&m->star[t]);
    for (unsigned t = 0; m->around && t < threads; t++)
        free(m->around[t].face);
    free(m->around);
    free(m->star);
    ebpo_stars_free(&m->stars);
    return status;
}

/* ---- volumes ---- */

/* Returns six times the volume of the tetrahedron between a face and the apex `base`, in the frame.
 * Extends the component's box by the face. */
static double volume_term(const measuring *m, ebpo_found_component *c, uint64_t face,
                          const double base[3])
{
    const ebpo_mesh *mesh = m->components->mesh;
    double t[3][3], cross[3];
    for (uint64_t k = 0; k < 3; k++) {
        uint32_t v = mesh->faces[3 * face + k];
        ebpo_mesh_position(mesh, v, t[k]);
        for (int i = 0; i < 3; i++) {
            c->min[i] = t[k][i] < c->min[i] ? t[k][i] : c->min[i];
            c->max[i] = t[k][i] > c->max[i] ? t[k][i] : c->max[i];
        }
        if (m->frame.scaled)
            ebpo_frame_position(&m->frame, mesh, v, t[k]);
    }
    ebpo_face_cross(t[0], t[1], t[2], cross);
    return (t[0][0] - base[0]) * cross[0] + (t[0][1] - base[1]) * cross[1] +
           (t[0][2] - base[2]) * cross[2];
}

/* Computes the volumes and boxes of components. The summation is exact, so the order of the terms
 * does not matter. */
static ebpo_status sum_volumes(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    measuring *m = context;
    ebpo_components *c = m->components;
    (void)worker, (void)error;
    for (uint64_t n = begin; n < end; n++) {
        ebpo_found_component *component = &c->list[n];
        ebpo_sum sum = { .adds = 0 };
        double base[3], greatest = 0;
        ebpo_frame_position(&m->frame, c->mesh, c->mesh->faces[3 * (uint64_t)component->face],
                            base);
        for (int k = 0; k < 3; k++)
            component->min[k] = INFINITY, component->max[k] = -INFINITY;
        EBPO_FOR_ITEMS_SCATTERED(c->mesh->workspace, i, c->faces.begin[n], c->faces.begin[n + 1]) {
            double term = volume_term(m, component, c->faces.members[i], base);
            greatest = fmax(greatest, fabs(term));
            ebpo_sum_add(&sum, term);
        }
        component->volume = component->open ? 0 : ebpo_sum_value(&sum) / 6;
        if (c->of_face && ebpo_volume_is_noise(component->volume,
                                               c->faces.begin[n + 1] - c->faces.begin[n], greatest))
            component->volume = 0;
    }
    return EBPO_OK;
}

ebpo_status ebpo_components_measure(ebpo_components *c, unsigned threads,
                                    const ebpo_progress *progress, ebpo_error *error)
{
    measuring m = { .components = c, .frame = ebpo_mesh_frame_of(c->mesh) };
    threads = ebpo_thread_count(threads);
    ebpo_status status = inspect_edges(&m, threads, progress, error);
    return status == EBPO_OK ? ebpo_parallel_for(threads, NULL, c->count, COMPONENT_GRAIN,
                                                 sum_volumes, &m, progress, "components", error)
                             : status;
}

/* --- the closed component around a cavity --- */

/* A closed component of negative volume. Its host is the smallest closed component of positive
 * volume whose winding number at the cavity's point `at` is not 0. */
typedef struct cavity {
    double at[3];       /* first vertex of the cavity's first face */
    int64_t winding;    /* minus the winding number of the current host at `at` */
    uint32_t component; /* index of the cavity in the list of components */
    bool placed;        /* true: the host is known */
} cavity;

typedef struct placing {
    const ebpo_components *components;
    cavity *cavities; /* sorted by at[1] */
    uint64_t count;
    uint32_t *hosts; /* closed components of positive volume, smallest first */
    uint64_t host_count;
} placing;

/* Compares cavities by y, then by component. */
static int compare_cavities(const void *x, const void *y)
{
    const cavity *a = x, *b = y;
    if (a->at[1] != b->at[1])
        return a->at[1] < b->at[1] ? -1 : 1;
    return a->component < b->component ? -1 : 1;
}

/* Compares hosts by volume, then by component. */
static int compare_hosts(const void *x, const void *y, void *list)
{
    uint32_t a = *(const uint32_t *)x, b = *(const uint32_t *)y;
    const ebpo_found_component *l = list;
    if (l[a].volume != l[b].volume)
        return l[a].volume < l[b].volume ? -1 : 1;
    return a < b ? -1 : 1;
}

/* Lists and sorts the closed components of negative volume (cavities) and of positive volume
 * (hosts). */
static void list_cavities_and_hosts(placing *p)
{
    const ebpo_components *c = p->components;
    for (uint64_t i = 0; i < c->count; i++) {
        const ebpo_found_component *m = &c->list[i];
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

/* Returns the first cavity whose y coordinate is at least y. */
static uint64_t first_from_y(const placing *p, double y)
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

/* Adds the crossings with a face of the host to `winding` of the cavities without a host. The
 * crossings are those of a segment along x from the cavity's point to the greatest x of the host's
 * box, where the winding number is 0. */
static void cross_face(placing *p, const ebpo_found_component *host, uint64_t face)
{
    const ebpo_mesh *mesh = p->components->mesh;
    double t[3][3], low, high;
    for (uint64_t k = 0; k < 3; k++)
        ebpo_mesh_position(mesh, mesh->faces[3 * face + k], t[k]);
    low = t[0][1] < t[1][1] ? t[0][1] : t[1][1];
    high = t[0][1] > t[1][1] ? t[0][1] : t[1][1];
    low = t[2][1] < low ? t[2][1] : low;
    high = t[2][1] > high ? t[2][1] : high;
    for (uint64_t i = first_from_y(p, low); i < p->count && p->cavities[i].at[1] <= high; i++)
        if (!p->cavities[i].placed)
            p->cavities[i].winding +=
                ebpo_axis_crossing(p->cavities[i].at, host->max[0], 0, t[0], t[1], t[2]);
}

/* Returns true if a cavity without a host may be in this host. */
static bool any_within(const placing *p, const ebpo_found_component *host)
{
    for (uint64_t i = first_from_y(p, host->min[1]);
         i < p->count && p->cavities[i].at[1] <= host->max[1]; i++) {
        const double *x = p->cavities[i].at;
        if (!p->cavities[i].placed && x[0] >= host->min[0] && x[0] <= host->max[0] &&
            x[2] >= host->min[2] && x[2] <= host->max[2])
            return true;
    }
    return false;
}

/* Places the cavities without a host that are inside this closed component. */
static void fill_host(placing *p, uint32_t number)
{
    const ebpo_components *c = p->components;
    const ebpo_found_component *host = &c->list[number];
    if (!any_within(p, host))
        return;
    EBPO_FOR_ITEMS_SCATTERED(c->mesh->workspace, i, c->faces.begin[number],
                             c->faces.begin[number + (uint64_t)1])
        cross_face(p, host, c->faces.members[i]);
    for (uint64_t i = first_from_y(p, host->min[1]);
         i < p->count && p->cavities[i].at[1] <= host->max[1]; i++) {
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
        list_cavities_and_hosts(&p);
    else
        status = ebpo_workspace_fail(workspace, c->count * sizeof *p.cavities, error);
    for (uint64_t i = 0; i < p.host_count && p.count; i++) /* smallest volume first */
        fill_host(&p, p.hosts[i]);
    ebpo_array_free(workspace, p.cavities);
    ebpo_array_free(workspace, p.hosts);
    return status;
}
