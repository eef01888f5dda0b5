/* Joins vertices that are within a distance of each other. Vertices are visited
 * in ascending order of x, y and z. A vertex stays if no earlier vertex that stays is within the
 * distance. Every other vertex is replaced by the nearest vertex that stays. A grid of cells finds
 * neighbours, and exact arithmetic decides close comparisons. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "core/workspace.h"
#include "core/error.h"
#include "core/hash.h"
#include "core/parallel.h"
#include "core/sort.h"
#include "geometry/predicates.h"
#include "mesh/mesh_parts.h"

enum {
    GRAIN = 1 << 12, /* number of vertices for each call of a thread's function */
    KEY_SHIFT = 20   /* number of lower bits of a sort key; the higher bits give the bin */
};

/* The edge of a grid cell is twice the distance. Indices of cells are below 2^49, so that rounding
 * moves a vertex by at most an eighth of a cell. Hence vertices within the distance of each other
 * are within REACH = 0.5 + 2 / 8 cells of each other along each axis. */
static const double REACH = 0.75, MAX_CELLS = 0x1p49, LEAST_DISTANCE = 0x1p-1000;

/* Two squared distances are compared by rounded arithmetic if their relative difference exceeds
 * this value, otherwise by exact arithmetic. */
static const double DOUBT = 1e-14;

typedef struct grouping {
    const ebpo_mesh *mesh;
    double distance;
    double min[3];   /* least coordinates of all vertices */
    double extent;   /* half of the longest side of the box around all vertices */
    uint32_t *order; /* [vertex_count] vertices, ascending by x, then y, then z */
    uint32_t *map;   /* [vertex_count] vertex that replaces each vertex */
    /* [mask + 1] head of the list of the vertices that stay, in cells with the same hash */
    uint32_t *slots;
    uint32_t *chain; /* [vertex_count] next vertex of this list */
    uint64_t mask;
    /* [threads] largest distance of a vertex from the vertex that replaces it */
    double *moved;
} grouping;

/* ---- positions, ascending ---- */

typedef struct position {
    uint64_t key; /* ascending with x */
    double at[3];
    uint32_t vertex;
} position;

static ebpo_status make_positions(void *context, uint64_t begin, uint64_t end, void *records,
                                  ebpo_error *error)
{
    const grouping *g = context;
    position *out = records;
    (void)error;
    for (uint64_t v = begin; v < end; v++, out++) {
        memset(out, 0, sizeof *out);
        ebpo_mesh_position(g->mesh, v, out->at);
        double share = (0.5 * out->at[0] - 0.5 * g->min[0]) / g->extent;
        out->key = (uint64_t)(share * (double)(EBPO_SORT_BINS - 1) * (1 << KEY_SHIFT));
        out->vertex = (uint32_t)v;
    }
    return EBPO_OK;
}

static int compare_positions(const void *x, const void *y)
{
    const position *a = x, *b = y;
    for (int k = 0; k < 3; k++)
        if (a->at[k] != b->at[k])
            return a->at[k] < b->at[k] ? -1 : 1;
    return a->vertex < b->vertex ? -1 : a->vertex > b->vertex;
}

static void store_positions(void *context, uint64_t first, const void *records, uint64_t count)
{
    grouping *g = context;
    const position *p = records;
    for (uint64_t i = 0; i < count; i++)
        g->order[first + i] = p[i].vertex;
}

static ebpo_status sort_positions(grouping *g, ebpo_error *error)
{
    const ebpo_sort sort = { .workspace = g->mesh->workspace,
                             .threads = ebpo_thread_count(0),
                             .stage = "",
                             .count = g->mesh->vertex_count,
                             .record = sizeof(position),
                             .shift = KEY_SHIFT,
                             .context = g,
                             .make = make_positions,
                             .compare = compare_positions,
                             .take = store_positions };
    return ebpo_sort_run(&sort, error);
}

/* ---- exact distances ---- */

static double squared_distance(const double p[3], const double q[3])
{
    double d[3] = { p[0] - q[0], p[1] - q[1], p[2] - q[2] };
    return d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
}

/* Returns the distance of p and q. Scales the difference where its square could overflow or
 * underflow. */
static double distance_between(const double p[3], const double q[3])
{
    double square = squared_distance(p, q), most = 0, sum = 0;
    if (square > 0x1p-900 && square < 0x1p900)
        return sqrt(square);
    for (int k = 0; k < 3; k++)
        most = fmax(most, fabs(p[k] - q[k]));
    for (int k = 0; k < 3 && most > 0; k++)
        sum += (p[k] - q[k]) / most * ((p[k] - q[k]) / most);
    return most * sqrt(sum);
}

/* Returns true if rounded squared distances can be compared. */
static bool is_certain(double a, double b)
{
    return a > 0x1p-900 && b > 0x1p-900 && a < 0x1p900 && b < 0x1p900 &&
           fabs(a - b) > DOUBT * (a + b);
}

/* Appends products whose sum is sign * |p - q|^2. Returns the number of products. */
static int put_distance(double (*factor)[2], double sign, const double p[3], const double q[3])
{
    int n = 0;
    for (int k = 0; k < 3; k++) {
        const double products[4][2] = {
            { p[k], p[k] }, { q[k], q[k] }, { p[k], -q[k] }, { p[k], -q[k] }
        };
        for (int i = 0; i < 4; i++, n++) {
            factor[n][0] = sign * products[i][0];
            factor[n][1] = products[i][1];
        }
    }
    return n;
}

/* Returns true if the distance of p and q is at most `distance`. */
static bool is_within(const double p[3], const double q[3], double distance)
{
    double square = squared_distance(p, q), limit = distance * distance, factor[13][2];
    if (is_certain(square, limit))
        return square < limit;
    int n = put_distance(factor, 1, p, q);
    factor[n][0] = -distance;
    factor[n][1] = distance;
    return ebpo_sign_of_products(factor[0], n + 1) <= 0;
}

/* Returns true if a is nearer to p than b. At equal distances, returns true if a comes first in the
 * order of x, y and z. */
static bool is_nearer(const double p[3], const double a[3], const double b[3])
{
    double to_a = squared_distance(p, a), to_b = squared_distance(p, b), factor[24][2];
    if (is_certain(to_a, to_b))
        return to_a < to_b;
    int n = put_distance(factor, 1, p, a);
    n += put_distance(factor + n, -1, p, b);
    int sign = ebpo_sign_of_products(factor[0], n);
    for (int k = 0; k < 3 && sign == 0; k++)
        sign = a[k] < b[k] ? -1 : a[k] > b[k];
    return sign < 0;
}

/* ---- the grid ---- */

/* Returns a coordinate in cells of the grid. */
static double cell_of(const grouping *g, double x, int axis)
{
    return (0.5 * x - 0.5 * g->min[axis]) / g->distance;
}

static uint64_t slot_of(const grouping *g, const int64_t cell[3])
{
    const uint64_t key[3] = { (uint64_t)cell[0], (uint64_t)cell[1], (uint64_t)cell[2] };
    return ebpo_hash_three(key) & g->mask;
}

/* Records that vertex v at p stays, and adds it to the grid. */
static void keep_vertex(grouping *g, uint32_t v, const double p[3])
{
    int64_t cell[3];
    for (int k = 0; k < 3; k++)
        cell[k] = (int64_t)floor(cell_of(g, p[k], k));
    uint64_t slot = slot_of(g, cell);
    g->map[v] = v;
    g->chain[v] = g->slots[slot];
    g->slots[slot] = v;
}

/* Returns a vertex that stays and is within the distance from p: the nearest such vertex, or any if
 * `nearest` is false. Returns EBPO_NO_INDEX if there is none. */
static uint32_t find_staying(const grouping *g, const double p[3], bool nearest)
{
    int64_t low[3], high[3], c[3];
    uint32_t best = EBPO_NO_INDEX;
    double q[3], best_at[3] = { 0 };
    for (int k = 0; k < 3; k++) {
        double at = cell_of(g, p[k], k);
        low[k] = (int64_t)floor(at - REACH);
        high[k] = (int64_t)floor(at + REACH);
    }
    for (c[0] = low[0]; c[0] <= high[0]; c[0]++)
        for (c[1] = low[1]; c[1] <= high[1]; c[1]++)
            for (c[2] = low[2]; c[2] <= high[2]; c[2]++)
                for (uint32_t v = g->slots[slot_of(g, c)]; v != EBPO_NO_INDEX; v = g->chain[v]) {
                    ebpo_mesh_position(g->mesh, v, q);
                    if (!is_within(p, q, g->distance) ||
                        (best != EBPO_NO_INDEX && !is_nearer(p, q, best_at)))
                        continue;
                    best = v;
                    memcpy(best_at, q, sizeof q);
                    if (!nearest)
                        return best;
                }
    return best;
}

static ebpo_status choose_nearest(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                  ebpo_error *error)
{
    grouping *g = context;
    double p[3], q[3];
    (void)error;
    EBPO_FOR_ITEMS_SCATTERED(g->mesh->workspace, v, begin, end) {
        if (g->map[v] != EBPO_NO_INDEX)
            continue;
        ebpo_mesh_position(g->mesh, v, p);
        g->map[v] = find_staying(g, p, true);
        ebpo_mesh_position(g->mesh, g->map[v], q);
        g->moved[worker] = fmax(g->moved[worker], distance_between(p, q));
    }
    return EBPO_OK;
}

/* ---- main functions ---- */

static ebpo_status check_distance(grouping *g, ebpo_error *error)
{
    const ebpo_mesh *mesh = g->mesh;
    double max[3] = { 0 }, p[3];
    if (!(g->distance > 0) || !isfinite(g->distance))
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, ebpo_mesh_label(mesh),
                              "the weld distance must be above 0 and finite, not %g", g->distance);
    EBPO_FOR_ITEMS(mesh->workspace, v, 0, mesh->vertex_count) {
        ebpo_mesh_position(mesh, v, p);
        for (int k = 0; k < 3; k++) {
            if (!isfinite(p[k]))
                return ebpo_fail_file(error, EBPO_E_FORMAT, ebpo_mesh_label(mesh),
                                      "vertex %llu has a non-finite coordinate; repair the file",
                                      (unsigned long long)ebpo_mesh_source_vertex(mesh, v));
            g->min[k] = v == 0 || p[k] < g->min[k] ? p[k] : g->min[k];
            max[k] = v == 0 || p[k] > max[k] ? p[k] : max[k];
        }
    }
    for (int k = 0; k < 3; k++)
        g->extent = fmax(g->extent, 0.5 * max[k] - 0.5 * g->min[k]);
    if (0.5 * g->distance >= g->extent)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, ebpo_mesh_label(mesh),
                              "a weld distance of %g is not less than the model's longest side, "
                              "%g; give a smaller distance, in the model's unit",
                              g->distance, 2 * g->extent);
    if (g->distance < LEAST_DISTANCE || g->extent / g->distance > MAX_CELLS)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, ebpo_mesh_label(mesh),
                              "a weld distance of %g is too small beside coordinates of size %g; "
                              "weld vertices of equal positions only",
                              g->distance, 2 * g->extent);
    return EBPO_OK;
}

/* Numbers the vertices that stay, in ascending order, and maps each vertex to the number of the
 * vertex that replaces it. Returns how many vertices stay. */
static uint64_t number_staying(grouping *g, uint32_t *from)
{
    ebpo_workspace *workspace = g->mesh->workspace;
    uint64_t kept = 0, count = g->mesh->vertex_count;
    EBPO_FOR_ITEMS(workspace, v, 0, count) {
        if (g->map[v] != v)
            continue;
        from[kept] = (uint32_t)v;
        g->chain[v] = (uint32_t)kept++;
    }
    EBPO_FOR_ITEMS_SCATTERED(workspace, v, 0, count)
        g->map[v] = g->chain[g->map[v]];
    return kept;
}

static ebpo_status group_vertices(grouping *g, uint32_t *from, uint64_t *kept, double *moved,
                                  ebpo_error *error)
{
    const ebpo_mesh *mesh = g->mesh;
    ebpo_workspace *workspace = mesh->workspace;
    unsigned threads = ebpo_thread_count(0);
    uint64_t slots = ebpo_hash_slots(mesh->vertex_count);
    ebpo_status status = check_distance(g, error);
    if (status != EBPO_OK)
        return status;
    g->order = ebpo_array_alloc(workspace, mesh->vertex_count, sizeof *g->order);
    g->chain = ebpo_array_alloc(workspace, mesh->vertex_count, sizeof *g->chain);
    g->slots = ebpo_array_alloc(workspace, slots, sizeof *g->slots);
    g->moved = ebpo_array_zero(NULL, threads, sizeof *g->moved);
    g->mask = slots - 1;
    if (!g->order || !g->chain || !g->slots || !g->moved)
        return ebpo_workspace_fail(workspace, slots * sizeof *g->slots, error);
    status = sort_positions(g, error);
    if (status != EBPO_OK)
        return status;
    ebpo_array_fill(workspace, g->slots, 0xff, slots * sizeof *g->slots);
    ebpo_array_fill(workspace, g->map, 0xff, mesh->vertex_count * sizeof *g->map);
    EBPO_FOR_ITEMS_SCATTERED(workspace, i, 0, mesh->vertex_count) {
        double p[3];
        ebpo_mesh_position(mesh, g->order[i], p);
        if (find_staying(g, p, false) == EBPO_NO_INDEX)
            keep_vertex(g, g->order[i], p);
    }
    status = ebpo_parallel_for(threads, NULL, mesh->vertex_count, GRAIN, choose_nearest, g, NULL,
                               "", error);
    if (status != EBPO_OK)
        return status;
    for (unsigned t = 0; t < threads; t++)
        *moved = fmax(*moved, g->moved[t]);
    *kept = number_staying(g, from);
    return EBPO_OK;
}

ebpo_status ebpo_weld_group_within(const ebpo_mesh *mesh, double distance, uint32_t *map,
                                   uint32_t *from, uint64_t *kept, double *moved, ebpo_error *error)
{
    grouping g = { .mesh = mesh, .distance = distance, .map = map };
    ebpo_status status = group_vertices(&g, from, kept, moved, error);
    ebpo_array_free(mesh->workspace, g.order);
    ebpo_array_free(mesh->workspace, g.chain);
    ebpo_array_free(mesh->workspace, g.slots);
    ebpo_array_free(NULL, g.moved);
    return status;
}
