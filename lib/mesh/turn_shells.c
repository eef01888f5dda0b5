/* Closed components look outwards, or inwards where they bound a cavity. */
#include "geom/strict_fp.h"

#include <ebpo/repair.h>
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

/* A component is within another one if these vertices are: the least and the greatest along each
 * axis. */
enum { SAMPLES = 6, GRAIN = 64 };

typedef struct shell {
    double sample[SAMPLES][3];
    double min[3], max[3];
    uint32_t component;
    uint32_t depth; /* closed components that it is within */
} shell;

typedef struct probe {
    double at[3];
    uint32_t shell; /* among those that may be within the host */
    int32_t winding;
} probe;

typedef struct nesting {
    ebpo_components *components;
    shell *shells; /* closed, with a volume; by the least coordinate along `axis` */
    uint64_t count;
    int axis;
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

static int compare_shells(const void *x, const void *y, void *axis)
{
    const shell *a = x, *b = y;
    int k = *(const int *)axis;
    if (a->min[k] != b->min[k])
        return a->min[k] < b->min[k] ? -1 : 1;
    return a->component < b->component ? -1 : 1;
}

static int compare_probes(const void *x, const void *y)
{
    const probe *a = x, *b = y;
    return (a->at[1] > b->at[1]) - (a->at[1] < b->at[1]);
}

/* Along it boxes overlap least, as a share of all of it. */
static int best_axis(const nesting *n)
{
    double least = 0;
    int best = 0;
    for (int k = 0; k < 3; k++) {
        double low = n->shells[0].min[k], high = n->shells[0].max[k], sum = 0;
        for (uint64_t i = 0; i < n->count; i++) {
            low = n->shells[i].min[k] < low ? n->shells[i].min[k] : low;
            high = n->shells[i].max[k] > high ? n->shells[i].max[k] : high;
            sum += n->shells[i].max[k] / 2 - n->shells[i].min[k] / 2;
        }
        double share = high > low ? sum / (high / 2 - low / 2) : (double)n->count;
        if (k == 0 || share < least)
            best = k, least = share;
    }
    return best;
}

static uint64_t first_from(const nesting *n, double x)
{
    uint64_t low = 0, high = n->count;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (n->shells[middle].min[n->axis] < x)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static bool box_within(const shell *inner, const shell *outer)
{
    for (int k = 0; k < 3; k++)
        if (inner->min[k] < outer->min[k] || inner->max[k] > outer->max[k])
            return false;
    return true;
}

/* Probes of all that may be within the host; NULL with a count of 0: nothing is. */
static bool make_probes(const nesting *n, uint64_t host, probe **probes, uint64_t *count)
{
    const shell *h = &n->shells[host];
    uint64_t capacity = 0;
    for (uint64_t i = first_from(n, h->min[n->axis]);
         i < n->count && n->shells[i].min[n->axis] <= h->max[n->axis]; i++) {
        if (i == host || !box_within(&n->shells[i], h))
            continue;
        if (!ebpo_grow(probes, &capacity, *count + SAMPLES, sizeof **probes))
            return false;
        for (int d = 0; d < SAMPLES; d++) {
            probe *p = &(*probes)[(*count)++];
            *p = (probe){ .shell = (uint32_t)i };
            memcpy(p->at, n->shells[i].sample[d], sizeof p->at);
        }
    }
    if (*count)
        qsort(*probes, *count, sizeof **probes, compare_probes);
    return true;
}

static uint64_t first_probe(const probe *probes, uint64_t count, double y)
{
    uint64_t low = 0, high = count;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (probes[middle].at[1] < y)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* What segments from the probes along x to the host's end cross. */
static void cross_host(const nesting *n, const shell *host, probe *probes, uint64_t count)
{
    const ebpo_components *c = n->components;
    EBPO_FOR_ITEMS_SCATTERED(c->mesh->workspace, i, c->faces.begin[host->component],
                             c->faces.begin[host->component + (uint64_t)1]) {
        double t[3][3];
        for (uint64_t k = 0; k < 3; k++)
            ebpo_mesh_position(c->mesh, c->mesh->faces[3 * (uint64_t)c->faces.of[i] + k], t[k]);
        double low = t[0][1] < t[1][1] ? t[0][1] : t[1][1];
        double high = t[0][1] > t[1][1] ? t[0][1] : t[1][1];
        low = t[2][1] < low ? t[2][1] : low;
        high = t[2][1] > high ? t[2][1] : high;
        for (uint64_t p = first_probe(probes, count, low); p < count && probes[p].at[1] <= high;
             p++)
            probes[p].winding +=
                ebpo_axis_crossing(probes[p].at, host->max[0], 0, t[0], t[1], t[2]);
    }
}

static int by_shell(const void *x, const void *y)
{
    const probe *a = x, *b = y;
    return (a->shell > b->shell) - (a->shell < b->shell);
}

static ebpo_status find_inner(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    nesting *n = context;
    (void)worker;
    for (uint64_t host = begin; host < end; host++) {
        probe *probes = NULL;
        uint64_t count = 0;
        if (!make_probes(n, host, &probes, &count)) {
            free(probes);
            return ebpo_fail_memory(error, (count + SAMPLES) * sizeof *probes);
        }
        if (count) {
            cross_host(n, &n->shells[host], probes, count);
            qsort(probes, count, sizeof *probes, by_shell);
        }
        for (uint64_t i = 0; i < count; i += SAMPLES) {
            bool within = true;
            for (uint64_t d = 0; d < SAMPLES; d++)
                within &= probes[i + d].winding != 0;
            if (within)
                __atomic_fetch_add(&n->shells[probes[i].shell].depth, 1, __ATOMIC_RELAXED);
        }
        free(probes);
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

static ebpo_status nest(nesting *n, ebpo_error *error)
{
    ebpo_status status = list_shells(n, error);
    if (status != EBPO_OK || n->count < 2)
        return status;
    status =
        ebpo_parallel_for(n->threads, NULL, n->count, GRAIN, sample_shells, n, NULL, "", error);
    if (status != EBPO_OK)
        return status;
    n->axis = best_axis(n);
    qsort_r(n->shells, n->count, sizeof *n->shells, compare_shells, &n->axis);
    return ebpo_parallel_for(n->threads, NULL, n->count, 1, find_inner, n, NULL, "", error);
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
