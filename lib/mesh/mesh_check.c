/* Checks a mesh. Examines faces, edges, vertices and positions in parallel, and reports whether the
 * mesh is a closed 2-manifold. Also reports findings (properties that are often defects) with their
 * locations. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "geometry/predicates.h"
#include "mesh/mesh_check_parts.h"
#include "mesh/mesh_parts.h"
#include "mesh/adjacency.h"

/* Adds a location to the worker's list. */
void ebpo_found_add(const ebpo_check *check, unsigned worker, ebpo_found found)
{
    ebpo_found_list *list = &check->found[worker];
    const ebpo_mesh *mesh = check->mesh;
    if (!ebpo_array_grow(mesh->workspace, &list->item, &list->capacity, list->count + 1,
                         sizeof *list->item)) {
        list->short_of_memory = true;
        return;
    }
    if (ebpo_found_is_edge(found.kind) &&
        ebpo_mesh_source_vertex(mesh, found.b) < ebpo_mesh_source_vertex(mesh, found.a)) {
        uint32_t a = found.a;
        found.a = found.b;
        found.b = a;
    }
    list->item[list->count++] = found;
}

enum { FACE_GRAIN = 1 << 14 }; /* number of faces of a block */

/* Results for one block of faces. */
typedef struct face_block {
    ebpo_sum area2, volume6; /* twice the area, six times the volume */
    ebpo_finding zero_area, index_repeated;
} face_block;

typedef struct face_pass {
    const ebpo_check *check;
    face_block *blocks;
    double centre[3]; /* apex of the tetrahedra whose volumes are added, in check->units */
} face_pass;

/* Returns the root of v (core/disjoint_sets.h) and halves the path to the root. Any thread may call
 * this function at any time, because parents only move towards the root. */
static uint32_t find_root(uint32_t *parents, uint32_t v)
{
    for (;;) {
        uint32_t parent = __atomic_load_n(&parents[v], __ATOMIC_RELAXED);
        if (parent == v)
            return v;
        uint32_t grand = __atomic_load_n(&parents[parent], __ATOMIC_RELAXED);
        if (grand != parent)
            __atomic_compare_exchange_n(&parents[v], &parent, grand, true, __ATOMIC_RELAXED,
                                        __ATOMIC_RELAXED);
        v = grand;
    }
}

/* Joins two trees: links the higher root to the lower root, which avoids cycles. The number of
 * roots does not depend on the order of the joins. */
static void join_trees(uint32_t *parents, uint32_t a, uint32_t b)
{
    for (;;) {
        a = find_root(parents, a);
        b = find_root(parents, b);
        if (a == b)
            return;
        if (a < b) {
            uint32_t t = a;
            a = b;
            b = t;
        }
        uint32_t expected = a;
        if (__atomic_compare_exchange_n(&parents[a], &expected, b, false, __ATOMIC_RELAXED,
                                        __ATOMIC_RELAXED))
            return;
    }
}

/* Returns true if ad - bc is certainly nonzero. This is certain if the rounded value exceeds 1e-15
 * times |ad| + |bc|, and nothing underflows or overflows. (The error bound is 3.33e-16 times this
 * sum: Shewchuk 1997.) */
static bool surely_nonzero(double a, double b, double c, double d)
{
    double permanent = fabs(a * d) + fabs(b * c);
    return permanent > 1e-280 && permanent < 1e300 && fabs(a * d - b * c) > 1e-15 * permanent;
}

/* Returns true if a face has no area. The result is exact: ebpo_zero_area decides when rounded
 * arithmetic finds no component of the normal that is certainly nonzero. */
static bool zero_area(const double a[3], const double b[3], const double c[3])
{
    double p[3] = { b[0] - a[0], b[1] - a[1], b[2] - a[2] };
    double q[3] = { c[0] - a[0], c[1] - a[1], c[2] - a[2] };
    if (surely_nonzero(p[0], p[1], q[0], q[1]) || surely_nonzero(p[1], p[2], q[1], q[2]) ||
        surely_nonzero(p[2], p[0], q[2], q[0]))
        return false;
    return ebpo_zero_area(a, b, c);
}

/* Returns the length of a cross product in the unit of areas. */
static double cross_length(const ebpo_units *u, const double cross[3])
{
    if (!u->scaled)
        return sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]);
    const int exponent[3] = { u->exponent[1] + u->exponent[2], u->exponent[2] + u->exponent[0],
                              u->exponent[0] + u->exponent[1] };
    return ebpo_scaled_length(cross, exponent, u->area);
}

static void measure_face(face_block *block, const ebpo_units *units, const double centre[3],
                         const double a[3], const double cross[3])
{
    ebpo_sum_add(&block->area2, cross_length(units, cross));
    ebpo_sum_add(&block->volume6, (a[0] - centre[0]) * cross[0] + (a[1] - centre[1]) * cross[1] +
                                      (a[2] - centre[2]) * cross[2]);
}

static void record_face(const ebpo_check *check, unsigned worker, ebpo_finding *finding,
                        ebpo_finding_kind kind, uint64_t face)
{
    ebpo_check_note(check, worker, finding, kind, ebpo_mesh_source_face(check->mesh, face),
                    (uint32_t)face, (uint32_t)face);
}

static ebpo_status check_faces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    (void)error;
    const face_pass *pass = context;
    const ebpo_mesh *mesh = pass->check->mesh;
    uint32_t *parents = pass->check->parents;
    face_block block = { .area2 = { .adds = 0 } };
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, f, begin, end) {
        const uint32_t *v = mesh->faces + 3 * f;
        join_trees(parents, v[0], v[1]);
        join_trees(parents, v[1], v[2]);
        if (ebpo_face_repeats_index(v)) {
            record_face(pass->check, worker, &block.index_repeated, EBPO_FOUND_INDEX_REPEATED_FACE,
                        f);
            record_face(pass->check, worker, &block.zero_area, EBPO_FOUND_ZERO_AREA_FACE, f);
            continue;
        }
        double a[3], b[3], c[3], cross[3];
        ebpo_check_position(pass->check, v[0], a);
        ebpo_check_position(pass->check, v[1], b);
        ebpo_check_position(pass->check, v[2], c);
        ebpo_face_cross(a, b, c, cross);
        measure_face(&block, &pass->check->units, pass->centre, a, cross);
        if (pass->check->units.scaled) { /* the exact test needs unscaled coordinates */
            ebpo_mesh_position(mesh, v[0], a);
            ebpo_mesh_position(mesh, v[1], b);
            ebpo_mesh_position(mesh, v[2], c);
        }
        if (zero_area(a, b, c))
            record_face(pass->check, worker, &block.zero_area, EBPO_FOUND_ZERO_AREA_FACE, f);
    }
    pass->blocks[begin / FACE_GRAIN] = block;
    return EBPO_OK;
}

ebpo_status ebpo_check_faces(ebpo_check *check, ebpo_error *error)
{
    ebpo_mesh_report *r = check->report;
    uint64_t count = check->mesh->face_count, blocks = (count + FACE_GRAIN - 1) / FACE_GRAIN;
    face_pass pass = { .check = check, .blocks = ebpo_alloc(blocks, sizeof *pass.blocks) };
    if (!pass.blocks)
        return ebpo_fail_memory(error, blocks * sizeof *pass.blocks);
    for (int k = 0; k < 3; k++)
        pass.centre[k] = ldexp(0.5 * r->min[k] + 0.5 * r->max[k], -check->units.exponent[k]);
    ebpo_status status = ebpo_parallel_for(check->threads, NULL, count, FACE_GRAIN, check_faces,
                                           &pass, &check->progress, "measuring faces", error);
    ebpo_sum area2 = { .adds = 0 }, volume6 = { .adds = 0 };
    for (uint64_t i = 0; status == EBPO_OK && i < blocks; i++) {
        ebpo_sum_merge(&area2, &pass.blocks[i].area2);
        ebpo_sum_merge(&volume6, &pass.blocks[i].volume6);
        ebpo_finding_merge(&r->zero_area_faces, &pass.blocks[i].zero_area);
        ebpo_finding_merge(&r->index_repeated_faces, &pass.blocks[i].index_repeated);
    }
    r->area = ldexp(ebpo_sum_value(&area2) / 2, check->units.area);
    r->volume = ldexp(ebpo_sum_value(&volume6) / 6, check->units.volume);
    free(pass.blocks);
    return status;
}

enum { STAR_GRAIN = 1 << 13 }; /* number of vertices of a block */

/* Results for the stars (faces at a vertex) of one block of vertices. */
typedef struct star_block {
    ebpo_finding boundary, nonmanifold, misoriented, unbalanced, bowtie, repeated_face;
    ebpo_sum length; /* sum of the lengths of edges */
    uint64_t edges, components;
} star_block;

/* Scratch memory of a thread. */
typedef struct scratch {
    ebpo_star star;
    uint32_t *fans; /* disjoint sets of the star's faces (parents); a fan is a set of faces joined
                       across edges */
    uint64_t fan_capacity;
    ebpo_same_faces same;    /* the star's faces, sorted by their vertices */
    ebpo_boundary *boundary; /* the boundary edges that the thread has found */
    unsigned worker;
} scratch;

typedef struct star_pass {
    ebpo_check *check;
    star_block *blocks;
    scratch *scratch; /* one for each worker */
} star_pass;

/* Returns the root of the fan that contains face i of the star, and shortens the path to this root.
 */
static uint32_t fan_root(uint32_t *fans, uint32_t i)
{
    while (fans[i] != i)
        i = fans[i] = fans[fans[i]];
    return i;
}

/* Joins the two faces of an edge into one fan; returns the number of joins, 0 or 1. A fan ends at
 * edges with one face or with more than two faces. */
static uint64_t join_fans(uint32_t *fans, const ebpo_link *links, uint64_t uses)
{
    if (uses != 2 || links[0].entry == EBPO_NO_INDEX || links[1].entry == EBPO_NO_INDEX)
        return 0;
    uint32_t a = fan_root(fans, links[0].entry), b = fan_root(fans, links[1].entry);
    fans[a] = b;
    return a != b;
}

/* Records the findings of an edge at v, if there are any. Returns false when out of memory. */
static bool classify_edge(const ebpo_check *check, star_block *block, const scratch *s, uint32_t v,
                          const ebpo_link *links, uint64_t uses)
{
    const ebpo_mesh *mesh = check->mesh;
    uint64_t out = 0;
    uint32_t neighbour = ebpo_link_neighbour(&links[0]);
    uint64_t face = UINT64_MAX; /* least source index of the edge's faces */
    for (uint64_t i = 0; i < uses; i++) {
        uint64_t source = ebpo_mesh_source_face(mesh, ebpo_link_face(&links[i]));
        out += links[i].out;
        face = source < face ? source : face;
    }
    block->edges++;
    if (uses > 2)
        ebpo_check_note(check, s->worker, &block->nonmanifold, EBPO_FOUND_NONMANIFOLD_EDGE, face, v,
                        neighbour);
    if (uses == 2 && out != 1)
        ebpo_check_note(check, s->worker, &block->misoriented, EBPO_FOUND_MISORIENTED_EDGE, face, v,
                        neighbour);
    if (2 * out != uses)
        ebpo_check_note(check, s->worker, &block->unbalanced, EBPO_FOUND_UNBALANCED_EDGE, face, v,
                        neighbour);
    if (uses != 1)
        return true;
    ebpo_check_note(check, s->worker, &block->boundary, EBPO_FOUND_BOUNDARY_EDGE, face, v,
                    neighbour);
    return ebpo_boundary_add(s->boundary, mesh, out ? v : neighbour, out ? neighbour : v,
                             ebpo_link_face(&links[0]));
}

static double edge_length(const ebpo_check *check, uint32_t a, uint32_t b)
{
    double p[3], q[3];
    ebpo_check_position(check, a, p);
    ebpo_check_position(check, b, q);
    double d[3] = { q[0] - p[0], q[1] - p[1], q[2] - p[2] };
    if (check->units.scaled)
        return ebpo_scaled_length(d, check->units.exponent, check->units.length);
    return sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

/* Checks the edges at vertex v. Returns false when out of memory. */
static bool check_edges(const ebpo_check *check, star_block *block, scratch *s, uint32_t v)
{
    const ebpo_star *star = &s->star;
    uint64_t fans = star->faces;
    if (!ebpo_array_grow_late(check->mesh->workspace, &s->fans, &s->fan_capacity, star->faces,
                              sizeof *s->fans))
        return false;
    for (uint64_t i = 0; i < star->faces; i++)
        s->fans[i] = (uint32_t)i;
    for (uint64_t begin = 0, end; begin < star->count; begin = end) {
        end = ebpo_star_run_end(star, begin);
        fans -= join_fans(s->fans, star->links + begin, end - begin);
        uint32_t neighbour = ebpo_link_neighbour(&star->links[begin]);
        if (neighbour < v) /* each edge is counted at its lower vertex */
            continue;
        ebpo_sum_add(&block->length, edge_length(check, v, neighbour));
        if (!classify_edge(check, block, s, v, star->links + begin, end - begin))
            return false;
    }
    if (fans > 1)
        ebpo_check_note(check, s->worker, &block->bowtie, EBPO_FOUND_BOWTIE_VERTEX,
                        ebpo_mesh_source_vertex(check->mesh, v), v, v);
    return true;
}

/* Finds repeated faces whose lowest vertex is v. Returns false when out of memory. */
static bool record_repeated_faces(const ebpo_check *check, star_block *block, scratch *s,
                                  uint32_t v)
{
    if (!ebpo_same_faces_gather(&s->same, &check->stars, check->mesh, v))
        return false;
    uint32_t first = 0; /* first face with these vertices */
    for (uint64_t i = 0; i < s->same.count; i++)
        if (i && ebpo_same_faces_repeats(&s->same, i))
            ebpo_check_note(check, s->worker, &block->repeated_face, EBPO_FOUND_REPEATED_FACE,
                            s->same.item[i].source, s->same.item[i].face, first);
        else
            first = s->same.item[i].face;
    return true;
}

static ebpo_status check_stars(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    star_pass *pass = context;
    const ebpo_check *check = pass->check;
    scratch *s = &pass->scratch[worker];
    star_block block = { .edges = 0 };
    EBPO_FOR_ITEMS_SCATTERED(check->mesh->workspace, v, begin, end) {
        uint32_t vertex = (uint32_t)v;
        uint64_t degree = ebpo_stars_degree(&check->stars, vertex);
        if (degree == 0)
            continue;
        block.components += check->parents[v] == v; /* one root for each component */
        if (!ebpo_star_gather(&s->star, &check->stars, check->mesh, vertex) ||
            !check_edges(check, &block, s, vertex) ||
            !record_repeated_faces(check, &block, s, vertex))
            return ebpo_workspace_fail(check->mesh->workspace, degree * 2 * sizeof *s->star.links,
                                       error);
    }
    pass->blocks[begin / STAR_GRAIN] = block;
    return EBPO_OK;
}

static void join_blocks(const ebpo_check *check, const star_block *blocks, uint64_t count)
{
    ebpo_mesh_report *r = check->report;
    ebpo_sum length = { .adds = 0 };
    for (uint64_t i = 0; i < count; i++) {
        const star_block *b = &blocks[i];
        ebpo_finding_merge(&r->boundary_edges, &b->boundary);
        ebpo_finding_merge(&r->nonmanifold_edges, &b->nonmanifold);
        ebpo_finding_merge(&r->misoriented_edges, &b->misoriented);
        ebpo_finding_merge(&r->unbalanced_edges, &b->unbalanced);
        ebpo_finding_merge(&r->bowtie_vertices, &b->bowtie);
        ebpo_finding_merge(&r->repeated_faces, &b->repeated_face);
        ebpo_sum_merge(&length, &b->length);
        r->edges += b->edges;
        r->components += b->components;
    }
    r->mean_edge =
        r->edges ? ldexp(ebpo_sum_value(&length) / (double)r->edges, check->units.length) : 0;
}

static void free_scratch(scratch *s, ebpo_workspace *workspace)
{
    ebpo_star_free(&s->star);
    ebpo_array_free(workspace, s->fans);
    ebpo_same_faces_free(&s->same);
}

ebpo_status ebpo_check_stars(ebpo_check *check, ebpo_error *error)
{
    uint64_t count = check->mesh->vertex_count, blocks = (count + STAR_GRAIN - 1) / STAR_GRAIN;
    star_pass pass = { .check = check,
                       .blocks = ebpo_alloc(blocks, sizeof *pass.blocks),
                       .scratch = ebpo_alloc_zero(check->threads, sizeof *pass.scratch) };
    ebpo_boundary *boundaries = ebpo_alloc_zero(check->threads, sizeof *boundaries);
    ebpo_status status = EBPO_OK;
    if (!pass.blocks || !pass.scratch || !boundaries) {
        status = ebpo_fail_memory(error, blocks * sizeof *pass.blocks);
        goto done;
    }
    for (unsigned t = 0; t < check->threads; t++)
        pass.scratch[t].boundary = &boundaries[t], pass.scratch[t].worker = t;
    status = ebpo_parallel_for(check->threads, NULL, count, STAR_GRAIN, check_stars, &pass,
                               &check->progress, "checking edges", error);
    if (status != EBPO_OK)
        goto done;
    join_blocks(check, pass.blocks, blocks);
    status = ebpo_boundary_join(&check->boundary, boundaries, check->threads, check->mesh, error);
done:
    for (unsigned t = 0; pass.scratch && t < check->threads; t++)
        free_scratch(&pass.scratch[t], check->mesh->workspace);
    for (unsigned t = 0; boundaries && t < check->threads; t++)
        ebpo_boundary_free(&boundaries[t]);
    free(boundaries);
    free(pass.scratch);
    free(pass.blocks);
    return status;
}

enum { VERTEX_GRAIN = 1 << 15 }; /* number of vertices of a block */

static ebpo_status check_coordinates(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                     ebpo_error *error)
{
    (void)worker;
    const ebpo_check *c = context;
    for (uint64_t v = begin; v < end; v++) {
        double p[3];
        ebpo_mesh_position(c->mesh, v, p);
        for (int k = 0; k < 3; k++)
            if (!isfinite(p[k]))
                return ebpo_fail_file(error, EBPO_E_FORMAT, ebpo_mesh_label(c->mesh),
                                      "vertex %llu has %c = %s; repair the coordinate or drop the "
                                      "vertex and its faces",
                                      (unsigned long long)ebpo_mesh_source_vertex(c->mesh, v),
                                      "xyz"[k],
                                      isnan(p[k]) ? "nan"
                                      : p[k] > 0  ? "inf"
                                                  : "-inf");
    }
    return EBPO_OK;
}

ebpo_status ebpo_check_coordinates(ebpo_check *check, ebpo_error *error)
{
    return ebpo_parallel_for(check->threads, check->mesh->workspace, check->mesh->vertex_count,
                             VERTEX_GRAIN, check_coordinates, check, &check->progress,
                             "checking coordinates", error);
}

/* Results for one block of vertices. */
typedef struct vertex_block {
    double min[3], max[3]; /* box of the vertices that faces use */
    uint64_t referenced;   /* number of these vertices */
    ebpo_finding unreferenced;
} vertex_block;

typedef struct vertex_pass {
    const ebpo_check *check;
    vertex_block *blocks;
} vertex_pass;

static ebpo_status check_vertices(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                  ebpo_error *error)
{
    (void)error;
    const vertex_pass *pass = context;
    vertex_block b = { .min = { INFINITY, INFINITY, INFINITY },
                       .max = { -INFINITY, -INFINITY, -INFINITY } };
    for (uint64_t v = begin; v < end; v++) {
        if (ebpo_stars_degree(&pass->check->stars, (uint32_t)v) == 0) {
            ebpo_check_note(pass->check, worker, &b.unreferenced, EBPO_FOUND_UNREFERENCED_VERTEX,
                            ebpo_mesh_source_vertex(pass->check->mesh, v), (uint32_t)v,
                            (uint32_t)v);
            continue;
        }
        double p[3];
        ebpo_mesh_position(pass->check->mesh, v, p);
        b.referenced++;
        for (int k = 0; k < 3; k++) {
            b.min[k] = p[k] < b.min[k] ? p[k] : b.min[k];
            b.max[k] = p[k] > b.max[k] ? p[k] : b.max[k];
        }
    }
    pass->blocks[begin / VERTEX_GRAIN] = b;
    return EBPO_OK;
}

/* Chooses units so that squares and cubes of coordinates stay in the range of doubles. */
static ebpo_units choose_units(const ebpo_mesh_report *r)
{
    ebpo_units u = { .scaled = false };
    for (int k = 0; k < 3; k++) {
        frexp(fmax(fabs(r->min[k]), fabs(r->max[k])), &u.exponent[k]); /* 0 for 0 */
        u.scaled |= ebpo_exponent_is_far(u.exponent[k]);
    }
    if (!u.scaled)
        return (ebpo_units){ .scaled = false };
    int x = u.exponent[0], y = u.exponent[1], z = u.exponent[2], least = x < y ? x : y;
    u.length = x > y ? x : y;
    u.length = z > u.length ? z : u.length;
    u.volume = x + y + z;
    u.area = u.volume - (z < least ? z : least);
    return u;
}

ebpo_status ebpo_check_vertices(ebpo_check *check, ebpo_error *error)
{
    ebpo_mesh_report *r = check->report;
    uint64_t count = check->mesh->vertex_count, blocks = (count + VERTEX_GRAIN - 1) / VERTEX_GRAIN;
    vertex_pass pass = { check, ebpo_alloc(blocks, sizeof *pass.blocks) };
    if (!pass.blocks)
        return ebpo_fail_memory(error, blocks * sizeof *pass.blocks);
    ebpo_status status =
        ebpo_parallel_for(check->threads, check->mesh->workspace, count, VERTEX_GRAIN,
                          check_vertices, &pass, &check->progress, "checking vertices", error);
    for (uint64_t i = 0; status == EBPO_OK && i < blocks; i++) {
        const vertex_block *b = &pass.blocks[i];
        for (int k = 0; k < 3; k++) {
            r->min[k] = i == 0 || b->min[k] < r->min[k] ? b->min[k] : r->min[k];
            r->max[k] = i == 0 || b->max[k] > r->max[k] ? b->max[k] : r->max[k];
        }
        ebpo_finding_merge(&r->unreferenced_vertices, &b->unreferenced);
        check->referenced += b->referenced;
    }
    check->units = choose_units(r);
    free(pass.blocks);
    return status;
}

/* A range of vertices that are sorted along the Morton curve. Vertices at one position are
 * adjacent. */
typedef struct curve_run {
    const ebpo_mesh *mesh;
    uint64_t at, end; /* the remaining vertices of the range: indices at .. end - 1 */
} curve_run;

/* Compares the next vertices of two runs along the curve, in the order in which the mesh is
 * arranged. Returns less than 0 if the vertex of `a` comes first, 0 for equal positions. */
static int compare_runs(const curve_run *a, const curve_run *b)
{
    const uint64_t *key = a->mesh->arrangement->key;
    if (a->at == a->end || b->at == b->end)
        return a->at == a->end ? 1 : -1;
    if (key[a->at] != key[b->at])
        return key[a->at] < key[b->at] ? -1 : 1;
    double p[3], q[3];
    ebpo_mesh_position(a->mesh, a->at, p);
    ebpo_mesh_position(b->mesh, b->at, q);
    for (int k = 0; k < 3; k++)
        if (p[k] != q[k])
            return p[k] < q[k] ? -1 : 1;
    return 0;
}

static void record_repeated(const ebpo_check *check, uint32_t v)
{
    ebpo_check_note(check, 0, &check->report->repeated_positions, EBPO_FOUND_REPEATED_POSITION,
                    ebpo_mesh_source_vertex(check->mesh, v), v, v);
}

/* Skips the vertices at a run's next position, and records all of them except the vertex with the
 * lowest source index. *lowest: this vertex; EBPO_NO_INDEX before the first call. */
static void skip_position(const ebpo_check *check, curve_run *r, uint32_t *lowest)
{
    double first[3], p[3];
    ebpo_mesh_position(r->mesh, r->at, first);
    do {
        uint32_t v = (uint32_t)r->at++, later = v;
        if (*lowest == EBPO_NO_INDEX) {
            *lowest = v;
        } else {
            if (ebpo_mesh_source_vertex(r->mesh, v) < ebpo_mesh_source_vertex(r->mesh, *lowest))
                later = *lowest, *lowest = v;
            record_repeated(check, later);
        }
        if (r->at < r->end)
            ebpo_mesh_position(r->mesh, r->at, p);
    } while (r->at < r->end && p[0] == first[0] && p[1] == first[1] && p[2] == first[2]);
}

/* Finds repeated positions in an arranged mesh, whose vertices are sorted along the Morton curve.
 * Either all vertices form one run (`grouped`), or the used vertices form a run and the unused
 * vertices form another run. */
static void compare_along_curve(const ebpo_check *check)
{
    const ebpo_mesh *mesh = check->mesh;
    uint64_t first =
        mesh->arrangement->grouped ? mesh->vertex_count : mesh->arrangement->referenced;
    curve_run a = { mesh, 0, first }, b = { mesh, first, mesh->vertex_count };
    for (uint64_t steps = 0; a.at < a.end || b.at < b.end; steps++) {
        uint32_t lowest = EBPO_NO_INDEX;
        int order = compare_runs(&a, &b);
        if (order <= 0)
            skip_position(check, &a, &lowest);
        if (order >= 0)
            skip_position(check, &b, &lowest);
        if (steps % EBPO_ITEMS_IN_ORDER == 0)
            ebpo_release_pages(mesh->workspace);
    }
}

/* Finds repeated positions in any mesh. */
static ebpo_status compare_all(const ebpo_check *check, ebpo_error *error)
{
    const ebpo_mesh *mesh = check->mesh;
    uint64_t count = mesh->vertex_count;
    ebpo_positions positions;
    ebpo_status status =
        ebpo_positions_build(&positions, mesh, check->threads, &check->progress, error);
    if (status != EBPO_OK)
        return status;
    /* least source index at each position, stored at the position's first vertex */
    uint32_t *lowest =
        positions.repeated ? ebpo_array_alloc(mesh->workspace, count, sizeof *lowest) : NULL;
    if (positions.repeated && !lowest)
        status = ebpo_workspace_fail(mesh->workspace, count * sizeof *lowest, error);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, v, 0, lowest ? count : 0) {
        uint32_t first = ebpo_positions_first(&positions, (uint32_t)v),
                 source = (uint32_t)ebpo_mesh_source_vertex(mesh, v);
        if (first == v || source < lowest[first])
            lowest[first] = source;
    }
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, v, 0, lowest ? count : 0) {
        uint64_t source = ebpo_mesh_source_vertex(mesh, v);
        if (lowest[ebpo_positions_first(&positions, (uint32_t)v)] != source)
            record_repeated(check, (uint32_t)v);
    }
    ebpo_array_free(mesh->workspace, lowest);
    ebpo_positions_free(&positions);
    return status;
}

ebpo_status ebpo_check_positions(ebpo_check *check, ebpo_error *error)
{
    const struct ebpo_arrangement *order = check->mesh->arrangement;
    if (!order || (!order->grouped && !order->key))
        return compare_all(check, error);
    compare_along_curve(check);
    return EBPO_OK;
}

/* Completes the report: decides whether the mesh is a closed 2-manifold (EBP 2017, section 3.1),
 * and computes its genus by Euler's formula. */
static void complete_report(ebpo_check *c)
{
    ebpo_mesh_report *r = c->report;
    r->balanced = r->unbalanced_edges.count == 0;
    r->manifold = r->balanced && r->nonmanifold_edges.count == 0 && r->bowtie_vertices.count == 0 &&
                  r->index_repeated_faces.count == 0;
    if (!r->balanced)
        r->volume = 0;
    if (r->manifold) {
        int64_t characteristic =
            (int64_t)c->referenced - (int64_t)r->edges + (int64_t)c->mesh->face_count;
        r->genus_known = true;
        r->genus = (int64_t)r->components - characteristic / 2;
    }
}

/* Counts the boundary loops (holes). */
static ebpo_status boundary_loops(ebpo_check *c, ebpo_error *error)
{
    ebpo_loops loops;
    if (c->boundary.count == 0)
        return EBPO_OK;
    ebpo_status status =
        ebpo_boundary_loops(&loops, &c->boundary, &c->stars, c->mesh, c->threads, error);
    if (status != EBPO_OK)
        return status;
    c->report->boundary_loops = loops.count;
    ebpo_loops_free(&loops);
    return EBPO_OK;
}

static ebpo_status check_run(ebpo_check *c, ebpo_error *error)
{
    uint64_t count = c->mesh->vertex_count;
    ebpo_status status = ebpo_check_coordinates(c, error);
    if (status == EBPO_OK)
        status = ebpo_stars_build(&c->stars, c->mesh, c->threads, &c->progress, error);
    if (status == EBPO_OK)
        status = ebpo_check_vertices(c, error);
    if (status != EBPO_OK)
        return status;
    c->parents = ebpo_array_alloc(c->mesh->workspace, count, sizeof *c->parents);
    if (!c->parents)
        return ebpo_workspace_fail(c->mesh->workspace, count * sizeof *c->parents, error);
    EBPO_FOR_ITEMS(c->mesh->workspace, v, 0, count)
        c->parents[v] = (uint32_t)v;
    status = ebpo_check_faces(c, error);
    if (status == EBPO_OK)
        status = ebpo_check_stars(c, error);
    if (status == EBPO_OK)
        status = boundary_loops(c, error);
    ebpo_array_free(c->mesh->workspace, c->parents);
    c->parents = NULL;
    ebpo_stars_free(&c->stars); /* the table of positions needs the memory */
    if (status == EBPO_OK)
        status = ebpo_check_positions(c, error);
    if (status == EBPO_OK)
        complete_report(c);
    return status;
}

ebpo_status ebpo_check_run(ebpo_check *check, ebpo_error *error)
{
    const ebpo_mesh *mesh = check->mesh;
    memset(check->report, 0, sizeof *check->report);
    ebpo_status status = ebpo_mesh_check_shape(mesh, error);
    if (status != EBPO_OK)
        return status;
    if (mesh->face_count == 0)
        return ebpo_fail_file(error, EBPO_E_FORMAT, ebpo_mesh_label(mesh),
                              "%llu vertices but no faces; give a triangle mesh, not a point cloud",
                              (unsigned long long)mesh->vertex_count);
    status = check_run(check, error);
    ebpo_stars_free(&check->stars);
    ebpo_boundary_free(&check->boundary);
    if (status != EBPO_OK)
        memset(check->report, 0, sizeof *check->report);
    return status;
}

ebpo_status ebpo_mesh_check(const ebpo_mesh *mesh, unsigned threads, ebpo_progress progress,
                            ebpo_mesh_report *report, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_check check = {
        .mesh = mesh, .threads = ebpo_thread_count(threads), .progress = progress, .report = report
    };
    return ebpo_check_run(&check, error);
}
