#include "mesh/boundary.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"

#define NONE UINT64_MAX

bool ebpo_boundary_add(ebpo_boundary *boundary, ebpo_boundary_edge edge)
{
    if (!ebpo_grow(&boundary->edges, &boundary->capacity, boundary->count + 1, sizeof *boundary->edges))
        return false;
    boundary->edges[boundary->count++] = edge;
    return true;
}

void ebpo_boundary_free(ebpo_boundary *boundary)
{
    free(boundary->edges);
    *boundary = (ebpo_boundary){ .edges = NULL };
}

void ebpo_loops_free(ebpo_loops *loops)
{
    free(loops->first);
    free(loops->vertex);
    *loops = (ebpo_loops){ .count = 0 };
}

typedef struct arrival {
    uint32_t to;
    uint64_t edge;
} arrival;

typedef struct chaining {
    const ebpo_boundary_edge *edges; /* sorted by from, to */
    uint64_t count;
    arrival *arrivals;               /* sorted by to, edge */
    uint64_t *next;                  /* of each edge; NONE when nothing continues it */
    uint8_t *continued;              /* the edge is some edge's next */
    uint8_t *walked;
    uint32_t *place;                 /* [vertex_count] place on the path, or EBPO_NO_INDEX */
    uint32_t *path;
    uint64_t path_length;
    const ebpo_stars *stars;
    const ebpo_mesh *mesh;
    ebpo_star star;
    ebpo_loops *out;
} chaining;

static int compare_edges(const void *a, const void *b)
{
    const ebpo_boundary_edge *x = a, *y = b;
    if (x->from != y->from)
        return x->from < y->from ? -1 : 1;
    return x->to < y->to ? -1 : x->to > y->to;
}

static int compare_arrivals(const void *a, const void *b)
{
    const arrival *x = a, *y = b;
    if (x->to != y->to)
        return x->to < y->to ? -1 : 1;
    return x->edge < y->edge ? -1 : x->edge > y->edge;
}

static void connect(chaining *c, uint64_t edge, uint64_t next)
{
    c->next[edge] = next;
    c->continued[next] = 1;
}

/* The neighbour to which `face` leaves the vertex at hand. */
static uint32_t leaves_to(const chaining *c, uint32_t vertex, uint32_t face)
{
    const uint32_t *v = c->mesh->faces + 3 * (uint64_t)face;
    return v[0] == vertex ? v[1] : v[1] == vertex ? v[2] : v[0];
}

/* Walks around c->star from the face of an arriving edge, over edges used twice, to the neighbour at which the fan ends. */
static uint32_t fan_end(const chaining *c, uint32_t vertex, uint32_t face)
{
    for (uint64_t steps = 0; steps <= c->star.faces; steps++) {
        uint32_t neighbour = leaves_to(c, vertex, face);
        uint64_t run = ebpo_star_find(&c->star, neighbour);
        if (run == c->star.count)
            return EBPO_NO_INDEX;
        uint64_t uses = ebpo_star_run_end(&c->star, run) - run;
        if (uses == 1)
            return neighbour;
        const ebpo_link *links = &c->star.links[run];
        if (uses != 2 || links[0].out == links[1].out)
            return EBPO_NO_INDEX;
        face = ebpo_link_face(&links[links[0].out ? 1 : 0]);
    }
    return EBPO_NO_INDEX;
}

/* The edge that leaves for `neighbour` among the sorted [begin, end); NONE when there is none. */
static uint64_t departure(const chaining *c, uint64_t begin, uint64_t end, uint32_t neighbour)
{
    while (begin < end) {
        uint64_t middle = begin + (end - begin) / 2;
        if (c->edges[middle].to == neighbour)
            return middle;
        if (c->edges[middle].to < neighbour)
            begin = middle + 1;
        else
            end = middle;
    }
    return NONE;
}

/* Arrivals [a, b) and departures [d, e) at one vertex: by fans first, what is left in ascending order. */
static bool connect_vertex(chaining *c, uint32_t vertex, uint64_t a, uint64_t b, uint64_t d, uint64_t e)
{
    if (b - a > 1 || e - d > 1) {
        if (!ebpo_star_gather(&c->star, c->stars, c->mesh, vertex))
            return false;
        for (uint64_t i = a; i < b; i++) {
            uint64_t edge = c->arrivals[i].edge;
            uint32_t neighbour = fan_end(c, vertex, c->edges[edge].face);
            uint64_t next = neighbour == EBPO_NO_INDEX ? NONE : departure(c, d, e, neighbour);
            if (next != NONE && !c->continued[next])
                connect(c, edge, next);
        }
    }
    for (uint64_t i = a; i < b; i++) {
        if (c->next[c->arrivals[i].edge] != NONE)
            continue;
        while (d < e && c->continued[d])
            d++;
        if (d == e)
            break;
        connect(c, c->arrivals[i].edge, d);
    }
    return true;
}

static bool connect_all(chaining *c)
{
    uint64_t a = 0, d = 0;
    while (a < c->count) {
        uint32_t vertex = c->arrivals[a].to;
        uint64_t b = a;
        while (b < c->count && c->arrivals[b].to == vertex)
            b++;
        while (d < c->count && c->edges[d].from < vertex)
            d++;
        uint64_t e = d;
        while (e < c->count && c->edges[e].from == vertex)
            e++;
        if (!connect_vertex(c, vertex, a, b, d, e))
            return false;
        a = b;
        d = e;
    }
    return true;
}

/* Takes the path back to `place` off as a loop. */
static void emit_loop(chaining *c, uint64_t place)
{
    ebpo_loops *out = c->out;
    uint64_t at = out->first[out->count];
    for (uint64_t i = place; i < c->path_length; i++) {
        out->vertex[at++] = c->path[i];
        c->place[c->path[i]] = EBPO_NO_INDEX;
    }
    out->first[++out->count] = at;
    c->path_length = place;
}

static void visit(chaining *c, uint32_t vertex)
{
    if (c->place[vertex] != EBPO_NO_INDEX)
        emit_loop(c, c->place[vertex]);
    c->place[vertex] = (uint32_t)c->path_length;
    c->path[c->path_length++] = vertex;
}

static void walk(chaining *c, uint64_t edge)
{
    c->path_length = 0;
    visit(c, c->edges[edge].from);
    while (edge != NONE && !c->walked[edge]) {
        c->walked[edge] = 1;
        visit(c, c->edges[edge].to);
        edge = c->next[edge];
    }
    if (c->path_length > 1)
        c->out->open_chains++;
    for (uint64_t i = 0; i < c->path_length; i++)
        c->place[c->path[i]] = EBPO_NO_INDEX;
}

static bool allocate(chaining *c)
{
    uint64_t n = c->count, vertices = c->mesh->vertex_count;
    c->arrivals = ebpo_alloc(n, sizeof *c->arrivals);
    c->next = ebpo_alloc(n, sizeof *c->next);
    c->continued = ebpo_alloc_zero(n, 1);
    c->walked = ebpo_alloc_zero(n, 1);
    c->place = ebpo_alloc(vertices, sizeof *c->place);
    c->path = ebpo_alloc(n + 1, sizeof *c->path);
    c->out->first = ebpo_alloc_zero(n / 3 + 2, sizeof *c->out->first);
    c->out->vertex = ebpo_alloc(n, sizeof *c->out->vertex);
    if (!c->arrivals || !c->next || !c->continued || !c->walked || !c->place || !c->path || !c->out->first ||
        !c->out->vertex)
        return false;
    memset(c->next, 0xff, n * sizeof *c->next);
    memset(c->place, 0xff, vertices * sizeof *c->place);
    for (uint64_t i = 0; i < n; i++)
        c->arrivals[i] = (arrival){ c->edges[i].to, i };
    qsort(c->arrivals, n, sizeof *c->arrivals, compare_arrivals);
    return true;
}

ebpo_status ebpo_boundary_loops(ebpo_loops *out, ebpo_boundary *boundary, const ebpo_stars *stars,
                                const ebpo_mesh *mesh, ebpo_error *error)
{
    *out = (ebpo_loops){ .count = 0 };
    chaining c = { .edges = boundary->edges, .count = boundary->count, .stars = stars, .mesh = mesh, .out = out };
    ebpo_status status = EBPO_OK;
    if (boundary->count)
        qsort(boundary->edges, boundary->count, sizeof *boundary->edges, compare_edges);
    if (!allocate(&c) || !connect_all(&c)) {
        status = ebpo_fail_memory(error, boundary->count * 48 + mesh->vertex_count * sizeof *c.place);
        goto done;
    }
    for (uint64_t e = 0; e < c.count; e++)
        if (!c.continued[e])
            walk(&c, e);
    for (uint64_t e = 0; e < c.count; e++)
        if (!c.walked[e])
            walk(&c, e);
done:
    ebpo_star_free(&c.star);
    free(c.arrivals);
    free(c.next);
    free(c.continued);
    free(c.walked);
    free(c.place);
    free(c.path);
    if (status != EBPO_OK)
        ebpo_loops_free(out);
    return status;
}
