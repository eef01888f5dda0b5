/* Finds the border of a mesh: the edges that faces do not use equally often in both directions, and
 * closed loops that these edges form.
 *
 * An edge that faces use n times from a to b and m times from b to a has weight n - m (n > m). At
 * each vertex, the edges of one face arrive as often as they leave. So at each vertex, the weights
 * of the edges that arrive and the weights of the edges that leave have equal sums. These sums are
 * equal in any mesh, also in a non-manifold or twisted mesh, and with neighbouring faces of
 * opposite orientation. A walk along edges of positive weight can therefore continue until it
 * returns to one of its vertices. The part of the walk from this vertex on is a simple loop. This
 * loop is cut off. The weight of the loop is the least weight of its edges, and is subtracted from
 * the weight of every edge of the loop. So at least one edge of the loop has the weight 0
 * afterwards, and the walks come to an end.
 *
 * Walks begin at the least remaining edge and follow the least remaining edge at each vertex, in
 * the source's order. So the result depends neither on threads nor on the order of the mesh. */
#include "mesh/border.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/sort.h"
#include "core/workspace.h"
#include "mesh/adjacency.h"

enum { VERTEX_GRAIN = 1 << 13 };

typedef struct border_edge {
    uint64_t key; /* source indices: from << 32 | to */
    uint32_t from, to;
    uint32_t weight; /* remaining weight, after the weights of loops that were cut off */
    uint32_t spare;  /* always 0: the sort copies whole records */
} border_edge;

/* The edges that one thread has found. */
typedef struct edge_list {
    border_edge *edge;
    uint64_t count, capacity;
    ebpo_star star; /* scratch memory: the faces at one vertex */
} edge_list;

typedef struct tracing {
    const ebpo_mesh *mesh;
    ebpo_stars stars;
    edge_list *lists; /* [threads] */
    unsigned threads;
    border_edge *edge; /* sorted by key */
    uint64_t count;
    /* The edges that leave a vertex are contiguous. The index of the first of these edges stands
     * for the vertex in the following arrays. */
    uint64_t *start; /* [count] for each edge, the vertex at which the edge ends */
    uint64_t *next;  /* [count] for each vertex, the first edge whose weight may still exceed 0 */
    uint64_t *place; /* [count] for each vertex, position on the path plus 1; 0: not on the path */
    uint64_t *path;  /* [length] edges of the current walk that are in no loop yet */
    uint64_t length;
    uint64_t steps; /* steps of all walks */
    ebpo_border *out;
} tracing;

/* --- unbalanced edges --- */

static bool add_edge(const ebpo_mesh *mesh, edge_list *list, uint32_t from, uint32_t to,
                     uint64_t weight)
{
    if (!ebpo_array_grow(mesh->workspace, &list->edge, &list->capacity, list->count + 1,
                         sizeof *list->edge))
        return false;
    list->edge[list->count++] = (border_edge){ .key = ebpo_mesh_source_vertex(mesh, from) << 32 |
                                                      ebpo_mesh_source_vertex(mesh, to),
                                               .from = from,
                                               .to = to,
                                               .weight = (uint32_t)weight };
    return true;
}

/* Collects the unbalanced edges whose lower vertex is in the range. */
static ebpo_status collect_edges(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    tracing *t = context;
    edge_list *list = &t->lists[worker];
    EBPO_FOR_ITEMS_SCATTERED(t->mesh->workspace, v, begin, end) {
        bool ok = ebpo_star_gather(&list->star, &t->stars, t->mesh, (uint32_t)v);
        for (uint64_t i = 0, next; ok && i < list->star.count; i = next) {
            uint32_t lower = (uint32_t)v, higher = ebpo_link_neighbour(&list->star.links[i]);
            uint64_t out = 0;
            next = ebpo_star_run_end(&list->star, i);
            for (uint64_t k = i; k < next; k++)
                out += list->star.links[k].out;
            uint64_t in = next - i - out;
            if (higher > lower && out != in)
                ok = out > in ? add_edge(t->mesh, list, lower, higher, out - in)
                              : add_edge(t->mesh, list, higher, lower, in - out);
        }
        if (!ok)
            return ebpo_workspace_fail(t->mesh->workspace, list->count * sizeof *list->edge, error);
    }
    return EBPO_OK;
}

/* Joins the lists of the threads, in any order, and frees them. */
static ebpo_status join_lists(tracing *t, ebpo_error *error)
{
    for (unsigned i = 0; i < t->threads; i++)
        t->count += t->lists[i].count;
    t->edge = ebpo_array_alloc(t->mesh->workspace, t->count, sizeof *t->edge);
    if (!t->edge)
        return ebpo_workspace_fail(t->mesh->workspace, t->count * sizeof *t->edge, error);
    uint64_t at = 0;
    for (unsigned i = 0; i < t->threads; i++) {
        edge_list *list = &t->lists[i];
        if (list->count)
            ebpo_array_copy(t->mesh->workspace, t->edge + at, list->edge,
                            list->count * sizeof *list->edge);
        at += list->count;
        ebpo_array_free(t->mesh->workspace, list->edge);
        list->edge = NULL;
    }
    return EBPO_OK;
}

static ebpo_status make_edges(void *context, uint64_t begin, uint64_t end, void *records,
                              ebpo_error *error)
{
    const tracing *t = context;
    (void)error;
    memcpy(records, t->edge + begin, (size_t)(end - begin) * sizeof *t->edge);
    return EBPO_OK;
}

/* Compares edges with equal keys, as the sort requires. Each pair of vertices is one edge, so there
 * are no equal keys, and the result is never used. */
static int compare_edges(const void *a, const void *b)
{
    const border_edge *x = a, *y = b;
    return (x->to > y->to) - (x->to < y->to);
}

static void take_edges(void *context, uint64_t place, const void *records, uint64_t count)
{
    tracing *t = context;
    memcpy(t->edge + place, records, (size_t)count * sizeof *t->edge);
}

static ebpo_status sort_edges(tracing *t, ebpo_error *error)
{
    static const ebpo_progress silent = { NULL, NULL };
    ebpo_sort sort = { .workspace = t->mesh->workspace,
                       .threads = t->threads,
                       .progress = &silent,
                       .stage = "",
                       .count = t->count,
                       .record = sizeof *t->edge,
                       .shift = 32,
                       .context = t,
                       .make = make_edges,
                       .compare = compare_edges,
                       .take = take_edges };
    while (ebpo_mesh_whole_vertices(t->mesh) >> (sort.shift - 32) >= EBPO_SORT_BINS)
        sort.shift++;
    return ebpo_sort_run(&sort, error);
}

/* --- loops --- */

/* Returns the first edge that leaves a vertex. vertex: source index. */
static uint64_t find_start(const tracing *t, uint64_t vertex)
{
    uint64_t low = 0, high = t->count;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (t->edge[middle].key >> 32 < vertex)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static ebpo_status prepare_walks(tracing *t, ebpo_error *error)
{
    ebpo_workspace *w = t->mesh->workspace;
    t->start = ebpo_array_alloc(w, t->count, sizeof *t->start);
    t->next = ebpo_array_alloc(w, t->count, sizeof *t->next);
    t->place = ebpo_array_zero(w, t->count, sizeof *t->place);
    t->path = ebpo_array_alloc(w, t->count + 1, sizeof *t->path);
    if (!t->start || !t->next || !t->place || !t->path)
        return ebpo_workspace_fail(w, t->count * 4 * sizeof *t->path, error);
    EBPO_FOR_ITEMS_SCATTERED(w, e, 0, t->count) {
        t->start[e] = find_start(t, (uint32_t)t->edge[e].key);
        t->next[e] = e;
    }
    return EBPO_OK;
}

/* Moves the end of the path, from position `from` on, to the loops. The weight of the loop is the
 * least weight of its edges. Returns false when out of memory. */
static bool cut_loop(tracing *t, uint64_t from)
{
    ebpo_border *b = t->out;
    ebpo_workspace *w = t->mesh->workspace;
    uint64_t edges = t->length - from, end = b->first[b->loop_count];
    uint32_t weight = UINT32_MAX;
    if (!ebpo_array_grow(w, &b->first, &b->loop_capacity, b->loop_count + 2, sizeof *b->first) ||
        !ebpo_array_grow(w, &b->weight, &b->weight_capacity, b->loop_count + 1,
                         sizeof *b->weight) ||
        !ebpo_array_grow(w, &b->vertex, &b->vertex_capacity, end + edges, sizeof *b->vertex))
        return false;
    for (uint64_t i = from; i < t->length; i++)
        if (t->edge[t->path[i]].weight < weight)
            weight = t->edge[t->path[i]].weight;
    for (uint64_t i = from; i < t->length; i++) {
        border_edge *edge = &t->edge[t->path[i]];
        edge->weight -= weight;
        b->vertex[end++] = edge->from;
        t->place[t->start[t->path[i]]] = 0;
    }
    b->weight[b->loop_count++] = weight;
    b->first[b->loop_count] = end;
    t->length = from;
    return true;
}

/* Walks from a vertex, and cuts off loops, until all edges that leave this vertex have the weight
 * 0. Returns false when out of memory. */
static bool walk_from(tracing *t, uint64_t vertex)
{
    uint64_t at = vertex;
    t->length = 0;
    for (;;) {
        uint64_t *next = &t->next[at];
        while (*next < t->count && t->edge[*next].from == t->edge[at].from &&
               t->edge[*next].weight == 0)
            ++*next;
        if (*next == t->count || t->edge[*next].from != t->edge[at].from)
            /* only possible at the walk's first vertex, because all other vertices are balanced */
            return true;
        if (++t->steps % EBPO_ITEMS_SCATTERED == 0)
            ebpo_release_pages(t->mesh->workspace);
        t->path[t->length++] = *next;
        at = t->start[*next];
        assert(at < t->count);
        uint64_t place = at == vertex ? 1 : t->place[at];
        if (place == 0)
            t->place[at] = t->length + 1;
        else if (!cut_loop(t, place - 1))
            return false;
        else if (at != vertex)
            t->place[at] = place; /* this vertex stays on the path */
    }
}

static ebpo_status trace_loops(tracing *t, ebpo_error *error)
{
    ebpo_status status = join_lists(t, error);
    t->out->edge_count = t->count;
    if (status != EBPO_OK || t->count == 0)
        return status;
    status = sort_edges(t, error);
    if (status == EBPO_OK)
        status = prepare_walks(t, error);
    if (status != EBPO_OK)
        return status;
    t->out->first = ebpo_array_zero(t->mesh->workspace, 2, sizeof *t->out->first);
    t->out->loop_capacity = 2;
    bool ok = t->out->first != NULL;
    for (uint64_t e = 0; e < t->count && ok; e++)
        if (e == 0 || t->edge[e].from != t->edge[e - 1].from)
            ok = walk_from(t, e);
    return ok ? EBPO_OK
              : ebpo_workspace_fail(t->mesh->workspace,
                                    t->out->vertex_capacity * sizeof *t->out->vertex, error);
}

static void free_tracing(tracing *t)
{
    ebpo_workspace *w = t->mesh->workspace;
    for (unsigned i = 0; t->lists && i < t->threads; i++) {
        ebpo_star_free(&t->lists[i].star);
        ebpo_array_free(w, t->lists[i].edge);
    }
    free(t->lists);
    ebpo_stars_free(&t->stars);
    ebpo_array_free(w, t->edge);
    ebpo_array_free(w, t->start);
    ebpo_array_free(w, t->next);
    ebpo_array_free(w, t->place);
    ebpo_array_free(w, t->path);
}

ebpo_status ebpo_border_find(ebpo_border *out, const ebpo_mesh *mesh, unsigned threads,
                             ebpo_error *error)
{
    *out = (ebpo_border){ .workspace = mesh->workspace };
    tracing t = { .mesh = mesh, .threads = ebpo_thread_count(threads), .out = out };
    t.lists = ebpo_alloc_zero(t.threads, sizeof *t.lists);
    ebpo_status status = t.lists ? ebpo_stars_build(&t.stars, mesh, t.threads, NULL, error)
                                 : ebpo_fail_memory(error, t.threads * sizeof *t.lists);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(t.threads, NULL, mesh->vertex_count, VERTEX_GRAIN, collect_edges,
                                   &t, NULL, "", error);
    ebpo_stars_free(&t.stars);
    if (status == EBPO_OK)
        status = trace_loops(&t, error);
    free_tracing(&t);
    if (status != EBPO_OK)
        ebpo_border_free(out);
    return status;
}

void ebpo_border_free(ebpo_border *border)
{
    ebpo_array_free(border->workspace, border->first);
    ebpo_array_free(border->workspace, border->vertex);
    ebpo_array_free(border->workspace, border->weight);
    *border = (ebpo_border){ .loop_count = 0 };
}
