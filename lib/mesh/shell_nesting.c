/* Computes the nesting of closed shells and turns each shell outwards, or inwards if it bounds a
 * cavity. Six vertices, the samples, represent a shell (shell_nesting.h). A host is a shell that
 * may contain other shells; its probes are the samples of the shells whose boxes are within the
 * host's box. For most hosts, each face is tested against the probes near the face. A host with
 * many probes for its number of faces is crowded. For all crowded hosts together, rays from the
 * samples of all shells are tested against a tree of the hosts' faces. Decisions are exact
 * (geometry/predicates.h), so the result does not depend on threads. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/repair.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/workspace.h"
#include "geometry/predicates.h"
#include "mesh/shell_nesting.h"

/* State of one thread. */
typedef struct seeker {
    /* probes of the current host. The value of a probe is the sum of the crossings with the host on
     * a segment from the probe to a point outside. This sum is minus the host's winding number at
     * the probe */
    ebpo_box_tree probes;
    struct probing *all;
    const ebpo_shell *host;  /* current host */
    const double (*face)[3]; /* [3] corners of the current face of the host */
} seeker;

typedef struct probing {
    ebpo_nesting *n;
    seeker *seeker; /* one for each worker */
} probing;

/* Returns true if the host may hold shells of a node of the tree of shells. */
static bool near_host(void *user, const ebpo_box_node *node)
{
    return ebpo_shell_may_hold(((const seeker *)user)->host, node);
}

/* Adds the samples of a shell to the probes. Returns false when out of memory. */
static bool add_probes(seeker *w, uint32_t number)
{
    const ebpo_shell *shell = &w->all->n->shells[number];
    for (int d = 0; d < EBPO_SHELL_SAMPLES; d++) {
        ebpo_tree_point *p = ebpo_box_tree_add(&w->probes);
        if (!p)
            return false;
        *p = (ebpo_tree_point){ .number = number };
        memcpy(p->at, shell->sample[d], sizeof p->at);
    }
    return true;
}

/* Adds the probes of the shells whose box is within the host's box. Returns false when out of
 * memory. */
static bool list_inner(void *user, ebpo_tree_point *points, uint64_t count)
{
    seeker *w = user;
    for (uint64_t i = 0; i < count; i++) {
        const ebpo_shell *shell = &w->all->n->shells[points[i].number];
        if (shell != w->host && ebpo_shell_box_within(shell, w->host) &&
            !add_probes(w, points[i].number))
            return false;
    }
    return true;
}

/* Returns true if, in the y-z plane, a line along the edge from t[0] to t[1] separates the box from
 * the triangle. Never true by mistake: ROUNDING and TINY bound the rounding errors and underflows,
 * and NaN separates nothing. */
static bool edge_separates(const double *const t[3], const ebpo_point_box *box)
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

/* Returns false only if no ray in direction +x from a point of the box intersects the triangle. */
static bool face_may_intersect_rays(const double t[3][3], const ebpo_point_box *box)
{
    bool ahead = false;
    for (int i = 0; i < 3; i++)
        ahead |= t[i][0] >= box->min[0];
    if (!ahead)
        return false;
    for (int k = 1; k < 3; k++) {
        double low = fmin(fmin(t[0][k], t[1][k]), t[2][k]),
               high = fmax(fmax(t[0][k], t[1][k]), t[2][k]);
        if (low > box->max[k] || high < box->min[k])
            return false;
    }
    for (int i = 0; i < 3; i++) {
        const double *const turned[3] = { t[i], t[(i + 1) % 3], t[(i + 2) % 3] };
        if (edge_separates(turned, box))
            return false;
    }
    return true;
}

/* Returns true if the current face may intersect the segments from probes of a node. */
static bool near_face(void *user, const ebpo_box_node *node)
{
    return face_may_intersect_rays(((const seeker *)user)->face, node->points);
}

/* Adds to the values of probes the crossings with a face. A segment leads from each probe along x
 * to the greatest x of the host's box. */
static bool cross_face(void *user, ebpo_tree_point *points, uint64_t count)
{
    seeker *w = user;
    for (uint64_t i = 0; i < count; i++)
        points[i].value += ebpo_axis_crossing(points[i].at, w->host->max[0], 0, w->face[0],
                                              w->face[1], w->face[2]);
    return true;
}

/* Computes the values of all probes of the host. */
static void cross_host(seeker *w)
{
    const ebpo_components *c = w->all->n->components;
    EBPO_FOR_ITEMS_SCATTERED(c->mesh->workspace, i, c->faces.begin[w->host->component],
                             c->faces.begin[w->host->component + (uint64_t)1]) {
        double t[3][3];
        ebpo_face_corners(c->mesh, c->faces.members[i], t);
        w->face = (const double(*)[3])t;
        (void)ebpo_box_tree_walk(&w->probes, near_face, cross_face, w);
    }
}

static int by_number(const void *x, const void *y)
{
    const ebpo_tree_point *a = x, *b = y;
    return (a->number > b->number) - (a->number < b->number);
}

/* Adds 1 to the depth of each shell whose samples are all within the host, and adds the host's
 * winding number at a sample to shell.around. */
static void count_inner(const seeker *w)
{
    const ebpo_tree_point *p = w->probes.point;
    qsort(w->probes.point, w->probes.count, sizeof *p, by_number);
    for (uint64_t i = 0; i < w->probes.count; i += EBPO_SHELL_SAMPLES) {
        bool within = true;
        for (uint64_t d = 0; d < EBPO_SHELL_SAMPLES; d++)
            within &= p[i + d].value != 0;
        if (!within)
            continue;
        ebpo_shell *inner = &w->all->n->shells[p[i].number];
        __atomic_fetch_add(&inner->depth, 1, __ATOMIC_RELAXED);
        __atomic_fetch_sub(&inner->around, p[i].value, __ATOMIC_RELAXED);
    }
}

/* Finds the shells within each host of the range. */
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
            !ebpo_box_tree_build(&w->probes, NULL, NULL))
            return ebpo_workspace_fail(w->probes.workspace,
                                       (w->probes.count + EBPO_SHELL_SAMPLES) *
                                           sizeof(ebpo_tree_point),
                                       error);
        if (w->probes.count == 0)
            continue;
        cross_host(w);
        count_inner(w);
    }
    return EBPO_OK;
}

/* Tests each face of the hosts that are not crowded against the samples near the face, and adds the
 * results to the depths. */
static ebpo_status probe_shells(ebpo_nesting *n, ebpo_error *error)
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
        ebpo_box_tree_free(&all.seeker[t].probes);
    free(all.seeker);
    return status;
}

/* --- rays along x from the samples of all shells, through one tree of the crowded hosts' faces ---
 */

enum { SHELL_RAYS_GRAIN = 16 }; /* number of shells for each call of a thread's function */

/* Crossings of one host by the rays of the current shell. */
typedef struct tally {
    /* for each sample, the sum of the crossings: minus the host's winding number at the sample */
    int32_t winding[EBPO_SHELL_SAMPLES];
    uint32_t shell; /* index of the shell, plus one; if not the current shell, the tally is old */
} tally;

typedef struct casting {
    ebpo_nesting *n;
    uint32_t *host; /* indices of the crowded shells */
    uint64_t host_count;
    /* faces of the crowded shells; number: index of the face; value: index of the face's shell in
     * `host` */
    ebpo_box_tree faces;
    struct caster *caster;
} casting;

/* State of one thread. */
typedef struct caster {
    const casting *all;
    tally *tallies;   /* [host_count] */
    int32_t *crossed; /* [crossed_count] hosts that the shell's rays cross */
    uint64_t crossed_count;
    uint32_t shell;    /* current shell */
    int sample;        /* index of the current sample */
    ebpo_point_box at; /* the current sample, as a box of zero extent */
} caster;

/* Returns true if the ray from the current sample may intersect faces of a node. */
static bool on_ray(void *user, const ebpo_box_node *node)
{
    const caster *w = user;
    const double *at = w->at.min;
    const ebpo_point_box *box = node->filled;
    return at[0] <= box->max[0] && at[1] >= box->min[1] && at[1] <= box->max[1] &&
           at[2] >= box->min[2] && at[2] <= box->max[2];
}

/* Returns the tally of a host for the current shell. */
static tally *tally_of(caster *w, int32_t host)
{
    tally *t = &w->tallies[host];
    if (t->shell != w->shell + 1) {
        *t = (tally){ .shell = w->shell + 1 };
        w->crossed[w->crossed_count++] = host;
    }
    return t;
}

/* Adds the crossings of the current ray with some faces. Returns true, so that the walk goes on. */
static bool cross_faces(void *user, ebpo_tree_point *points, uint64_t count)
{
    caster *w = user;
    const ebpo_nesting *n = w->all->n;
    for (uint64_t i = 0; i < count; i++) {
        double t[3][3];
        if (w->all->host[points[i].value] == w->shell)
            continue;
        ebpo_face_corners(n->components->mesh, points[i].number, t);
        if (!face_may_intersect_rays((const double(*)[3])t, &w->at))
            continue;
        int crossing = ebpo_axis_crossing(w->at.min, INFINITY, 0, t[0], t[1], t[2]);
        if (crossing != 0)
            tally_of(w, points[i].value)->winding[w->sample] += crossing;
    }
    return true;
}

/* Counts the hosts that contain all samples so far. *around: the sum of the crossings with these
 * hosts by the ray from the first sample. */
static uint32_t count_hosts(const caster *w, int32_t *around)
{
    uint32_t count = 0;
    *around = 0;
    for (uint64_t i = 0; i < w->crossed_count; i++) {
        bool within = true;
        for (int d = 0; d <= w->sample; d++)
            within &= w->tallies[w->crossed[i]].winding[d] != 0;
        count += within;
        *around += within ? w->tallies[w->crossed[i]].winding[0] : 0;
    }
    return count;
}

/* Tests the samples of each shell, until no host contains all samples so far. The samples are the
 * extreme points of the shell. So if a host contains all samples, the shell's box is within the
 * host's box. */
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
        w->crossed_count = 0;
        for (w->sample = 0; hosts && w->sample < EBPO_SHELL_SAMPLES; w->sample++) {
            const double *at = all->n->shells[i].sample[w->sample];
            memcpy(w->at.min, at, sizeof w->at.min);
            memcpy(w->at.max, at, sizeof w->at.max);
            (void)ebpo_box_tree_walk(&all->faces, on_ray, cross_faces, w);
            hosts = count_hosts(w, &around);
        }
        all->n->shells[i].depth += hosts;
        all->n->shells[i].around -= around;
    }
    return EBPO_OK;
}

static ebpo_status add_faces(casting *all, uint64_t host, ebpo_error *error)
{
    const ebpo_components *c = all->n->components;
    uint64_t component = all->n->shells[all->host[host]].component;
    EBPO_FOR_ITEMS_SCATTERED(c->mesh->workspace, i, c->faces.begin[component],
                             c->faces.begin[component + 1]) {
        if (!ebpo_face_add(&all->faces, c->mesh, c->faces.members[i], (int32_t)host))
            return ebpo_workspace_fail(c->mesh->workspace,
                                       (all->faces.count + 1) * sizeof(ebpo_tree_point), error);
    }
    return EBPO_OK;
}

static ebpo_status build_face_tree(casting *all, ebpo_error *error)
{
    const ebpo_mesh *mesh = all->n->components->mesh;
    ebpo_status status = EBPO_OK;
    for (uint64_t h = 0; h < all->host_count && status == EBPO_OK; h++)
        status = add_faces(all, h, error);
    if (status != EBPO_OK || ebpo_box_tree_build(&all->faces, ebpo_face_box, mesh))
        return status;
    return ebpo_workspace_fail(mesh->workspace, 2 * all->faces.count * sizeof(ebpo_point_box),
                               error);
}

static ebpo_status make_casters(casting *all, ebpo_error *error)
{
    ebpo_workspace *workspace = all->n->components->mesh->workspace;
    all->caster = ebpo_alloc_zero(all->n->threads, sizeof *all->caster);
    if (!all->caster)
        return ebpo_fail_memory(error, all->n->threads * sizeof *all->caster);
    for (unsigned t = 0; t < all->n->threads; t++) {
        caster *w = &all->caster[t];
        w->all = all;
        w->tallies = ebpo_array_alloc(workspace, all->host_count, sizeof *w->tallies);
        w->crossed = ebpo_array_alloc(workspace, all->host_count, sizeof *w->crossed);
        if (!w->tallies || !w->crossed)
            return ebpo_workspace_fail(workspace, all->host_count * sizeof *w->tallies, error);
        memset(w->tallies, 0, all->host_count * sizeof *w->tallies);
    }
    return EBPO_OK;
}

static void free_casting(casting *all)
{
    ebpo_workspace *workspace = all->n->components->mesh->workspace;
    for (unsigned t = 0; all->caster && t < all->n->threads; t++) {
        ebpo_array_free(workspace, all->caster[t].tallies);
        ebpo_array_free(workspace, all->caster[t].crossed);
    }
    free(all->caster);
    ebpo_box_tree_free(&all->faces);
    ebpo_array_free(workspace, all->host);
}

/* Casts a ray from each sample through the tree of the crowded hosts' faces, and adds the results
 * to the depths. */
static ebpo_status cast_all_rays(ebpo_nesting *n, ebpo_error *error)
{
    ebpo_workspace *workspace = n->components->mesh->workspace;
    casting all = { .n = n, .faces = { .workspace = workspace } };
    all.host = ebpo_array_alloc(workspace, n->count, sizeof *all.host);
    if (!all.host)
        return ebpo_workspace_fail(workspace, n->count * sizeof *all.host, error);
    for (uint64_t i = 0; i < n->count; i++)
        if (n->shells[i].crowded)
            all.host[all.host_count++] = (uint32_t)i;
    ebpo_status status = EBPO_OK;
    if (all.host_count) {
        status = build_face_tree(&all, error);
        if (status == EBPO_OK)
            status = make_casters(&all, error);
        if (status == EBPO_OK)
            status = ebpo_parallel_for(n->threads, workspace, n->count, SHELL_RAYS_GRAIN, cast_rays,
                                       &all, NULL, "", error);
    }
    free_casting(&all);
    return status;
}

/* --- closed components, and the number of hosts that contain each component --- */

enum {
    CROWD = 8, /* a host is crowded if it has more than this number of probes for each face */
    SHELL_NESTING_GRAIN = 64 /* number of shells for each call of a thread's function */
};

/* ---- extreme points of each shell ---- */

/* Returns true if a comes before b in direction d, which is ascending (even d) or descending (odd
 * d) along the axis d / 2. If the coordinates along this axis are equal, compares all coordinates,
 * so that only equal positions are equal. */
static bool comes_before(const double a[3], const double b[3], int d)
{
    int axis = d / 2;
    if (a[axis] != b[axis])
        return d % 2 ? a[axis] > b[axis] : a[axis] < b[axis];
    for (int k = 0; k < 3; k++)
        if (a[k] != b[k])
            return a[k] < b[k];
    return false;
}

/* Computes the samples of each shell of the range. */
static ebpo_status sample_shells(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    ebpo_nesting *n = context;
    const ebpo_components *c = n->components;
    (void)worker, (void)error;
    for (uint64_t s = begin; s < end; s++) {
        ebpo_shell *shell = &n->shells[s];
        const ebpo_found_component *m = &c->list[shell->component];
        for (int d = 0; d < EBPO_SHELL_SAMPLES; d++)
            ebpo_mesh_position(c->mesh, c->mesh->faces[3 * (uint64_t)m->face], shell->sample[d]);
        memcpy(shell->min, m->min, sizeof shell->min);
        memcpy(shell->max, m->max, sizeof shell->max);
        EBPO_FOR_ITEMS_SCATTERED(c->mesh->workspace, i, c->faces.begin[shell->component],
                                 c->faces.begin[shell->component + (uint64_t)1]) {
            for (uint64_t k = 0; k < 3; k++) {
                double at[3];
                ebpo_mesh_position(c->mesh, c->mesh->faces[3 * (uint64_t)c->faces.members[i] + k],
                                   at);
                for (int d = 0; d < EBPO_SHELL_SAMPLES; d++)
                    if (comes_before(at, shell->sample[d], d))
                        memcpy(shell->sample[d], at, sizeof at);
            }
        }
    }
    return EBPO_OK;
}

/* ---- candidates for nesting ---- */

typedef struct crowd {
    const ebpo_nesting *n;
    const ebpo_shell *host;
    uint64_t inner; /* number of shells whose box is within the host's box, including the host */
} crowd;

/* Skips nodes outside the host's box. Counts all shells of a node that is completely within the
 * box, and does not visit the nodes below. */
static bool count_node(void *user, const ebpo_box_node *node)
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

/* Counts the shells of a leaf whose boxes are within the host's box. */
static bool count_shells(void *user, ebpo_tree_point *points, uint64_t count)
{
    crowd *c = user;
    for (uint64_t i = 0; i < count; i++)
        c->inner += ebpo_shell_box_within(&c->n->shells[points[i].number], c->host);
    return true;
}

/* Decides which hosts of the range are crowded. */
static ebpo_status find_crowded(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                ebpo_error *error)
{
    ebpo_nesting *n = context;
    const uint64_t *faces = n->components->faces.begin;
    (void)worker, (void)error;
    for (uint64_t i = begin; i < end; i++) {
        ebpo_shell *host = &n->shells[i];
        crowd c = { n, host, 0 };
        (void)ebpo_box_tree_walk(&n->tree, count_node, count_shells, &c);
        host->crowded = (c.inner - 1) * EBPO_SHELL_SAMPLES >
                        CROWD * (faces[host->component + (uint64_t)1] - faces[host->component]);
    }
    return EBPO_OK;
}

/* ---- main functions ---- */

/* Lists the closed components whose volume is neither 0 nor NaN. */
static ebpo_status list_shells(ebpo_nesting *n, ebpo_error *error)
{
    const ebpo_components *c = n->components;
    n->shells = ebpo_array_alloc(c->mesh->workspace, c->count, sizeof *n->shells);
    if (!n->shells)
        return ebpo_workspace_fail(c->mesh->workspace, c->count * sizeof *n->shells, error);
    for (uint64_t i = 0; i < c->count; i++)
        if (!c->list[i].open && (c->list[i].volume < 0 || c->list[i].volume > 0))
            n->shells[n->count++] = (ebpo_shell){ .component = (uint32_t)i };
    return EBPO_OK;
}

static void box_of_shell(const void *user, const ebpo_tree_point *p, ebpo_point_box *out)
{
    const ebpo_shell *shell = &((const ebpo_nesting *)user)->shells[p->number];
    memcpy(out->min, shell->min, sizeof out->min);
    memcpy(out->max, shell->max, sizeof out->max);
}

static ebpo_status make_tree(ebpo_nesting *n, ebpo_error *error)
{
    ebpo_workspace *workspace = n->components->mesh->workspace;
    n->tree.workspace = workspace;
    for (uint64_t i = 0; i < n->count; i++) {
        ebpo_tree_point *p = ebpo_box_tree_add(&n->tree);
        if (!p)
            return ebpo_workspace_fail(workspace, n->count * sizeof *p, error);
        *p = (ebpo_tree_point){ .number = (uint32_t)i };
        memcpy(p->at, n->shells[i].sample[0], sizeof p->at);
    }
    return ebpo_box_tree_build(&n->tree, box_of_shell, n)
               ? EBPO_OK
               : ebpo_workspace_fail(workspace, 2 * n->count * sizeof(ebpo_point_box), error);
}

static ebpo_status find_nesting(ebpo_nesting *n, ebpo_error *error)
{
    ebpo_status status = list_shells(n, error);
    if (status != EBPO_OK || n->count < 2)
        return status;
    status = ebpo_parallel_for(n->threads, NULL, n->count, SHELL_NESTING_GRAIN, sample_shells, n,
                               NULL, "", error);
    if (status == EBPO_OK)
        status = make_tree(n, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(n->threads, NULL, n->count, SHELL_NESTING_GRAIN, find_crowded, n,
                                   NULL, "", error);
    if (status == EBPO_OK)
        status = probe_shells(n, error);
    return status == EBPO_OK ? cast_all_rays(n, error) : status;
}

ebpo_status ebpo_nesting_find(ebpo_nesting *n, const ebpo_mesh *mesh, uint32_t *closed,
                              unsigned threads, const ebpo_progress *progress, ebpo_error *error)
{
    n->threads = ebpo_thread_count(threads);
    ebpo_status status =
        ebpo_components_find(mesh, closed, threads, progress, &n->components, error);
    return status == EBPO_OK ? find_nesting(n, error) : status;
}

void ebpo_nesting_free(ebpo_nesting *n, const ebpo_mesh *mesh)
{
    ebpo_box_tree_free(&n->tree);
    ebpo_array_free(mesh->workspace, n->shells);
    ebpo_components_free(n->components);
}

/* --- turning shells --- */

/* Reverses the faces of a component. Returns the number of faces. */
static uint64_t turn_shell(const ebpo_components *c, uint32_t component)
{
    uint64_t begin = c->faces.begin[component], end = c->faces.begin[component + (uint64_t)1];
    EBPO_FOR_ITEMS_SCATTERED(c->mesh->workspace, i, begin, end)
        ebpo_face_turn(c->mesh->faces + 3 * (uint64_t)c->faces.members[i]);
    return end - begin;
}

ebpo_status ebpo_mesh_turn_shells(ebpo_mesh *mesh, uint32_t *closed, ebpo_repair_record *record,
                                  ebpo_error *error)
{
    ebpo_nesting n = { .components = NULL };
    uint64_t turned = 0;
    if (mesh->face_count == 0)
        return EBPO_OK;
    ebpo_status status = ebpo_nesting_find(&n, mesh, closed, 0, NULL, error);
    for (uint64_t i = 0; i < n.count && status == EBPO_OK; i++)
        if (ebpo_shell_faces_inwards(&n, &n.shells[i]) != ebpo_shell_is_cavity(&n.shells[i]))
            turned += turn_shell(n.components, n.shells[i].component);
    ebpo_nesting_free(&n, mesh);
    if (record)
        record->flipped_faces += turned;
    return status;
}
