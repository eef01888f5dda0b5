/* Finds the boundary edges of a mesh, which only one face uses, and the closed chains (loops) that
 * these edges form: the borders of holes. Threads collect edges, which are then joined into one
 * list and sorted by their first vertex. A fan is a set of faces at one vertex that are joined
 * across edges. If several loops pass one vertex, the fans at this vertex decide which departing
 * edge continues an arriving edge. Loops begin at their least vertex and follow the source's order,
 * so the result depends neither on threads nor on the order of the faces. */
#include "mesh/boundary.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/sort.h"
#include "core/workspace.h"

#define NONE UINT64_MAX

bool ebpo_boundary_add(ebpo_boundary *boundary, const ebpo_mesh *mesh, uint32_t from, uint32_t to,
                       uint32_t face)
{
    boundary->workspace = mesh->workspace;
    if (!ebpo_array_grow(mesh->workspace, &boundary->edges, &boundary->capacity,
                         boundary->count + 1, sizeof *boundary->edges))
        return false;
    boundary->edges[boundary->count++] =
        (ebpo_boundary_edge){ .key = (uint64_t)from << 32 | ebpo_mesh_source_vertex(mesh, to),
                              .from = from,
                              .to = to,
                              .face = face };
    return true;
}

ebpo_status ebpo_boundary_join(ebpo_boundary *boundary, ebpo_boundary *lists, unsigned count,
                               const ebpo_mesh *mesh, ebpo_error *error)
{
    uint64_t total = 0;
    for (unsigned i = 0; i < count; i++)
        total += lists[i].count;
    boundary->workspace = mesh->workspace;
    if (total && !ebpo_array_grow(mesh->workspace, &boundary->edges, &boundary->capacity, total,
                                  sizeof *boundary->edges))
        return ebpo_workspace_fail(mesh->workspace, total * sizeof *boundary->edges, error);
    for (unsigned i = 0; i < count; i++) {
        EBPO_FOR_ITEMS(mesh->workspace, k, 0, lists[i].count)
            boundary->edges[boundary->count++] = lists[i].edges[k];
        ebpo_boundary_free(&lists[i]);
    }
    return EBPO_OK;
}

void ebpo_boundary_free(ebpo_boundary *boundary)
{
    ebpo_array_free(boundary->workspace, boundary->edges);
    *boundary = (ebpo_boundary){ .edges = NULL };
}

void ebpo_loops_free(ebpo_loops *loops)
{
    ebpo_array_free(loops->workspace, loops->first);
    ebpo_array_free(loops->workspace, loops->vertex);
    ebpo_array_free(loops->workspace, loops->start);
    *loops = (ebpo_loops){ .count = 0 };
}

/* An edge, sorted by the vertex at which it arrives. */
typedef struct arrival {
    uint64_t key;  /* to << 32 | source index of `from` */
    uint64_t edge; /* index in chaining.edges */
} arrival;

typedef struct chaining {
    ebpo_boundary_edge *edges; /* sorted by key */
    uint64_t count;
    arrival *arrivals;       /* sorted by key */
    uint64_t *next;          /* [edges] edge that continues each edge; NONE when there is none */
    uint8_t *continued;      /* true if the edge continues another edge */
    uint8_t *walked;         /* true if a walk has visited the edge */
    uint32_t *path_position; /* [vertex_count] position on the path, or EBPO_NO_INDEX */
    uint32_t *path;          /* vertices of the current walk that are in no loop yet */
    uint64_t path_length;
    uint64_t start; /* key of the current walk, for ebpo_loops.start */
    uint64_t steps; /* steps of all walks */
    const ebpo_stars *stars;
    const ebpo_mesh *mesh;
    unsigned threads;
    ebpo_star star;
    ebpo_loops *out;
} chaining;

/* --- sorting: functions of ebpo_sort for the boundary edges and for the arrivals --- */

static ebpo_status make_edges(void *context, uint64_t begin, uint64_t end, void *records,
                              ebpo_error *error)
{
    const chaining *c = context;
    (void)error;
    memcpy(records, c->edges + begin, (size_t)(end - begin) * sizeof *c->edges);
    return EBPO_OK;
}

/* Compares edges with equal keys, as the sort requires. Boundary edges have no equal keys, so the
 * result is never used. */
static int compare_edges(const void *a, const void *b)
{
    const ebpo_boundary_edge *x = a, *y = b;
    return (x->face > y->face) - (x->face < y->face);
}

static void store_edges(void *context, uint64_t place, const void *records, uint64_t count)
{
    chaining *c = context;
    memcpy(c->edges + place, records, (size_t)count * sizeof *c->edges);
}

static ebpo_status make_arrivals(void *context, uint64_t begin, uint64_t end, void *records,
                                 ebpo_error *error)
{
    const chaining *c = context;
    (void)error;
    for (uint64_t e = begin; e < end; e++)
        ((arrival *)records)[e - begin] = (arrival){
            (uint64_t)c->edges[e].to << 32 | ebpo_mesh_source_vertex(c->mesh, c->edges[e].from), e
        };
    return EBPO_OK;
}

static int compare_arrivals(const void *a, const void *b)
{
    const arrival *x = a, *y = b;
    return (x->edge > y->edge) - (x->edge < y->edge);
}

static void store_arrivals(void *context, uint64_t place, const void *records, uint64_t count)
{
    chaining *c = context;
    memcpy(c->arrivals + place, records, (size_t)count * sizeof *c->arrivals);
}

static const ebpo_progress silent = { NULL, NULL };

/* Returns the shift of the keys (vertex << 32) for the sort: the leading bits that remain give at
 * most EBPO_SORT_BINS bins. */
static unsigned leading_shift(const ebpo_mesh *mesh)
{
    unsigned shift = 32;
    while (mesh->vertex_count >> (shift - 32) >= EBPO_SORT_BINS)
        shift++;
    return shift;
}

static ebpo_status sort_all(chaining *c, ebpo_error *error)
{
    ebpo_sort sort = { .workspace = c->mesh->workspace,
                       .threads = c->threads,
                       .progress = &silent,
                       .stage = "",
                       .count = c->count,
                       .record = sizeof *c->edges,
                       .shift = leading_shift(c->mesh),
                       .context = c,
                       .make = make_edges,
                       .compare = compare_edges,
                       .take = store_edges };
    ebpo_status status = ebpo_sort_run(&sort, error);
    sort.record = sizeof *c->arrivals;
    sort.make = make_arrivals;
    sort.compare = compare_arrivals;
    sort.take = store_arrivals;
    return status == EBPO_OK ? ebpo_sort_run(&sort, error) : status;
}

/* --- chaining of edges --- */

/* Releases pages. Call this function often, because each step may access distant parts of ten
 * arrays. */
static void release_pages(const chaining *c, uint64_t steps)
{
    enum { OFTEN = 32 };
    if (steps % OFTEN == 0)
        ebpo_release_pages(c->mesh->workspace);
}

/* Makes `next` the edge that continues `edge`. */
static void connect_edges(chaining *c, uint64_t edge, uint64_t next)
{
    c->next[edge] = next;
    c->continued[next] = 1;
}

/* Returns the corner of `face` that follows the vertex. */
static uint32_t next_corner(const chaining *c, uint32_t vertex, uint32_t face)
{
    const uint32_t *v = c->mesh->faces + 3 * (uint64_t)face;
    return v[0] == vertex ? v[1] : v[1] == vertex ? v[2] : v[0];
}

/* Returns how many faces use the edge whose run of links begins at `run`, at most 3: very many
 * faces can share one edge, which all walks around a vertex may meet. */
static unsigned count_uses(const ebpo_star *star, uint64_t run)
{
    unsigned uses = 1;
    while (uses < 3 && run + uses < star->count &&
           ebpo_link_neighbour(&star->links[run + uses]) == ebpo_link_neighbour(&star->links[run]))
        uses++;
    return uses;
}

/* Walks around `vertex`, whose faces are in c->star, from the face of an arriving edge across edges
 * that are used twice. Returns the other vertex of the boundary edge that ends the fan, or
 * EBPO_NO_INDEX if the fan ends at another edge. */
static uint32_t fan_end(const chaining *c, uint32_t vertex, uint32_t face)
{
    for (uint64_t steps = 0; steps <= c->star.faces; steps++) {
        uint32_t neighbour = next_corner(c, vertex, face);
        uint64_t run = ebpo_star_find(&c->star, neighbour);
        if (run == c->star.count)
            return EBPO_NO_INDEX;
        unsigned uses = count_uses(&c->star, run);
        if (uses == 1)
            return neighbour;
        const ebpo_link *links = &c->star.links[run];
        if (uses != 2 || links[0].out == links[1].out)
            return EBPO_NO_INDEX;
        face = ebpo_link_face(&links[links[0].out ? 1 : 0]);
    }
    return EBPO_NO_INDEX;
}

/* Returns the edge to `neighbour` (a source index) in the sorted range [begin, end), or NONE. */
static uint64_t find_departure(const chaining *c, uint64_t begin, uint64_t end, uint64_t neighbour)
{
    while (begin < end) {
        uint64_t middle = begin + (end - begin) / 2;
        uint64_t to = (uint32_t)c->edges[middle].key;
        if (to == neighbour)
            return middle;
        if (to < neighbour)
            begin = middle + 1;
        else
            end = middle;
    }
    return NONE;
}

/* Connects the edges at one vertex: c->arrivals[a .. b) with c->edges[d .. e), which depart. Edges
 * at the two ends of one fan are connected first, then the remaining edges in ascending order.
 * Returns false when out of memory. */
static bool connect_vertex(chaining *c, uint32_t vertex, uint64_t a, uint64_t b, uint64_t d,
                           uint64_t e)
{
    if (b - a > 1 || e - d > 1) {
        if (!ebpo_star_gather(&c->star, c->stars, c->mesh, vertex))
            return false;
        for (uint64_t i = a; i < b; i++) {
            uint64_t edge = c->arrivals[i].edge;
            uint32_t neighbour = fan_end(c, vertex, c->edges[edge].face);
            uint64_t next =
                neighbour == EBPO_NO_INDEX
                    ? NONE
                    : find_departure(c, d, e, ebpo_mesh_source_vertex(c->mesh, neighbour));
            if (next != NONE && !c->continued[next])
                connect_edges(c, edge, next);
        }
    }
    for (uint64_t i = a; i < b; i++) {
        if (c->next[c->arrivals[i].edge] != NONE)
            continue;
        while (d < e && c->continued[d])
            d++;
        if (d == e)
            break;
        connect_edges(c, c->arrivals[i].edge, d);
    }
    return true;
}

/* Connects the edges at all vertices. Returns false when out of memory. */
static bool connect_all(chaining *c)
{
    uint64_t a = 0, d = 0, visits = 0;
    while (a < c->count) {
        uint64_t b = a;
        uint32_t vertex = (uint32_t)(c->arrivals[a].key >> 32);
        while (b < c->count && c->arrivals[b].key >> 32 == vertex)
            b++;
        while (d < c->count && c->edges[d].from < vertex)
            d++;
        uint64_t e = d;
        while (e < c->count && c->edges[e].from == vertex)
            e++;
        release_pages(c, visits++);
        if (!connect_vertex(c, vertex, a, b, d, e))
            return false;
        a = b;
        d = e;
    }
    return true;
}

/* --- loops --- */

/* Removes the vertices of the path from `position` on, and adds them as a loop. */
static void emit_loop(chaining *c, uint64_t position)
{
    ebpo_loops *out = c->out;
    uint64_t at = out->first[out->count];
    for (uint64_t i = position; i < c->path_length; i++) {
        out->vertex[at++] = c->path[i];
        c->path_position[c->path[i]] = EBPO_NO_INDEX;
    }
    out->start[out->count++] = c->start;
    out->first[out->count] = at;
    c->path_length = position;
}

/* Adds a vertex to the path. If the vertex is already in the path, the part of the path from this
 * vertex on is a loop, which is removed first. */
static void visit_vertex(chaining *c, uint32_t vertex)
{
    if (c->path_position[vertex] != EBPO_NO_INDEX)
        emit_loop(c, c->path_position[vertex]);
    c->path_position[vertex] = (uint32_t)c->path_length;
    c->path[c->path_length++] = vertex;
}

/* Returns the key of an edge in the order of the source: source indices from << 32 | to. */
static uint64_t source_key(const chaining *c, uint64_t edge)
{
    return ebpo_mesh_source_vertex(c->mesh, c->edges[edge].from) << 32 |
           (uint32_t)c->edges[edge].key;
}

/* Returns the edge of a closed chain that is first in the source; the walk of the chain begins with
 * this edge. Chains share no edges, so the order in which chains are walked does not matter. */
static uint64_t first_of_cycle(chaining *c, uint64_t edge)
{
    uint64_t first = edge, key = source_key(c, edge);
    for (uint64_t e = c->next[edge]; e != edge; e = c->next[e]) {
        uint64_t e_key = source_key(c, e);
        first = e_key < key ? e : first;
        key = e_key < key ? e_key : key;
        release_pages(c, ++c->steps);
    }
    return first;
}

/* Walks a chain from an edge on, and adds its loops. */
static void walk_chain(chaining *c, uint64_t edge)
{
    c->path_length = 0;
    c->start = source_key(c, edge);
    visit_vertex(c, c->edges[edge].from);
    while (edge != NONE && !c->walked[edge]) {
        c->walked[edge] = 1;
        visit_vertex(c, c->edges[edge].to);
        edge = c->next[edge];
        release_pages(c, ++c->steps);
    }
    if (c->path_length > 1)
        c->out->open_chains++;
    for (uint64_t i = 0; i < c->path_length; i++)
        c->path_position[c->path[i]] = EBPO_NO_INDEX;
}

static bool allocate_arrays(chaining *c)
{
    ebpo_workspace *w = c->mesh->workspace;
    uint64_t n = c->count, vertices = c->mesh->vertex_count;
    c->arrivals = ebpo_array_alloc(w, n, sizeof *c->arrivals);
    c->next = ebpo_array_alloc(w, n, sizeof *c->next);
    c->continued = ebpo_array_zero(w, n, 1);
    c->walked = ebpo_array_zero(w, n, 1);
    c->path_position = ebpo_array_alloc(w, vertices, sizeof *c->path_position);
    c->path = ebpo_array_alloc(w, n + 1, sizeof *c->path);
    c->out->first = ebpo_array_zero(w, n / 3 + 2, sizeof *c->out->first);
    c->out->vertex = ebpo_array_alloc(w, n, sizeof *c->out->vertex);
    c->out->start = ebpo_array_alloc(w, n / 3 + 1, sizeof *c->out->start);
    if (!c->arrivals || !c->next || !c->continued || !c->walked || !c->path_position || !c->path ||
        !c->out->first || !c->out->vertex || !c->out->start)
        return false;
    ebpo_array_fill(w, c->next, 0xff, n * sizeof *c->next);
    ebpo_array_fill(w, c->path_position, 0xff, vertices * sizeof *c->path_position);
    return true;
}

static ebpo_status chain_edges(chaining *c, ebpo_error *error)
{
    ebpo_workspace *w = c->mesh->workspace;
    if (!allocate_arrays(c))
        return ebpo_workspace_fail(
            w,
            c->count * 56 /* approximate bytes of the arrays for each edge */ +
                c->mesh->vertex_count * sizeof *c->path_position,
            error);
    ebpo_status status = sort_all(c, error);
    if (status != EBPO_OK)
        return status;
    if (!connect_all(c))
        return ebpo_fail_memory(error, c->star.capacity * 2 * sizeof *c->star.links);
    EBPO_FOR_ITEMS(w, e, 0, c->count) {
        if (!c->continued[e]) /* the first edge of a chain that is not closed */
            walk_chain(c, e);
    }
    c->out->on_paths = c->out->count;
    EBPO_FOR_ITEMS(w, e, 0, c->count) {
        if (!c->walked[e])
            walk_chain(c, first_of_cycle(c, e));
    }
    return EBPO_OK;
}

ebpo_status ebpo_boundary_loops(ebpo_loops *out, ebpo_boundary *boundary, const ebpo_stars *stars,
                                const ebpo_mesh *mesh, unsigned threads, ebpo_error *error)
{
    *out = (ebpo_loops){ .workspace = mesh->workspace };
    chaining c = { .edges = boundary->edges,
                   .count = boundary->count,
                   .stars = stars,
                   .mesh = mesh,
                   .threads = threads,
                   .out = out };
    ebpo_status status = chain_edges(&c, error);
    ebpo_star_free(&c.star);
    ebpo_array_free(mesh->workspace, c.arrivals);
    ebpo_array_free(mesh->workspace, c.next);
    ebpo_array_free(mesh->workspace, c.continued);
    ebpo_array_free(mesh->workspace, c.walked);
    ebpo_array_free(mesh->workspace, c.path_position);
    ebpo_array_free(mesh->workspace, c.path);
    if (status != EBPO_OK)
        ebpo_loops_free(out);
    return status;
}

/* --- the source's order --- */

typedef struct rank {
    uint64_t key;       /* ebpo_loops.start */
    uint32_t number;    /* index of the loop */
    uint32_t triangles; /* number of triangles that close the loop */
} rank;

typedef struct ranking {
    const ebpo_loops *loops;
    uint64_t begin; /* index of the first loop to sort */
    rank *sorted;   /* the loops from `begin` on, in the source's order */
} ranking;

static ebpo_status make_ranks(void *context, uint64_t begin, uint64_t end, void *records,
                              ebpo_error *error)
{
    const ranking *r = context;
    (void)error;
    for (uint64_t i = begin; i < end; i++) {
        uint64_t number = r->begin + i;
        ((rank *)records)[i - begin] =
            (rank){ r->loops->start[number], (uint32_t)number,
                    (uint32_t)(r->loops->first[number + 1] - r->loops->first[number] - 2) };
    }
    return EBPO_OK;
}

/* Compares loops with equal keys (from one walk) by the order in which they were found. */
static int compare_ranks(const void *a, const void *b)
{
    const rank *x = a, *y = b;
    return (x->number > y->number) - (x->number < y->number);
}

static void store_ranks(void *context, uint64_t place, const void *records, uint64_t count)
{
    ranking *r = context;
    memcpy(r->sorted + place, records, (size_t)count * sizeof *r->sorted);
}

ebpo_status ebpo_loops_rank(uint64_t **triangles, const ebpo_loops *loops, const ebpo_mesh *mesh,
                            unsigned threads, ebpo_error *error)
{
    ranking r = { .loops = loops,
                  .sorted = ebpo_array_alloc(mesh->workspace, loops->count, sizeof *r.sorted) };
    uint64_t *triangles_before =
                 ebpo_array_alloc(mesh->workspace, loops->count, sizeof *triangles_before),
             sum = 0;
    ebpo_status status = r.sorted && triangles_before
                             ? EBPO_OK
                             : ebpo_workspace_fail(mesh->workspace, loops->count * 24, error);
    for (int part = 0; part < 2 && status == EBPO_OK; part++) {
        uint64_t count = part ? loops->count - loops->on_paths : loops->on_paths;
        r.begin = part ? loops->on_paths : 0;
        ebpo_sort sort = { .workspace = mesh->workspace,
                           .threads = threads,
                           .progress = &silent,
                           .stage = "",
                           .count = count,
                           .record = sizeof *r.sorted,
                           .shift = leading_shift(mesh),
                           .context = &r,
                           .make = make_ranks,
                           .compare = compare_ranks,
                           .take = store_ranks };
        status = ebpo_sort_run(&sort, error);
        EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, status == EBPO_OK ? count : 0) {
            triangles_before[r.sorted[i].number] = sum;
            sum += r.sorted[i].triangles;
        }
    }
    ebpo_array_free(mesh->workspace, r.sorted);
    if (status != EBPO_OK)
        ebpo_array_free(mesh->workspace, triangles_before);
    else
        *triangles = triangles_before;
    return status;
}
