#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/workspace.h"
#include "mesh/mesh_check_parts.h"
#include "mesh/same_faces.h"

enum { STAR_GRAIN = 1 << 13 };

typedef struct star_block {
    ebpo_finding boundary, nonmanifold, misoriented, unbalanced, bowtie, repeated_face;
    ebpo_sum length;
    uint64_t edges, components;
} star_block;

typedef struct scratch {
    ebpo_star star;
    uint32_t *fans; /* union-find over the star's faces */
    uint64_t fan_capacity;
    ebpo_same_faces same;
    ebpo_boundary *boundary;
    unsigned worker;
} scratch;

typedef struct star_pass {
    ebpo_check *check;
    star_block *blocks;
    scratch *scratch; /* one for each worker */
} star_pass;

static uint32_t fan_root(uint32_t *fans, uint32_t i)
{
    while (fans[i] != i)
        i = fans[i] = fans[fans[i]];
    return i;
}

/* The faces of an edge that is used twice belong to one fan; returns how many fans that joined.
 * Where more faces meet, a fan ends. */
static uint64_t join_fans(uint32_t *fans, const ebpo_link *links, uint64_t uses)
{
    if (uses != 2 || links[0].entry == EBPO_NO_INDEX || links[1].entry == EBPO_NO_INDEX)
        return 0;
    uint32_t a = fan_root(fans, links[0].entry), b = fan_root(fans, links[1].entry);
    fans[a] = b;
    return a != b;
}

static bool classify_edge(const ebpo_check *check, star_block *block, const scratch *s, uint32_t v,
                          const ebpo_link *links, uint64_t uses)
{
    const ebpo_mesh *mesh = check->mesh;
    uint64_t out = 0;
    uint32_t neighbour = ebpo_link_neighbour(&links[0]);
    uint64_t face = UINT64_MAX; /* the lowest */
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
        if (neighbour < v) /* the edge is counted at its lower end */
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

static bool check_repeated(const ebpo_check *check, star_block *block, scratch *s, uint32_t v)
{
    if (!ebpo_same_faces_gather(&s->same, &check->stars, check->mesh, v))
        return false;
    uint32_t first = 0; /* of the same vertices */
    for (uint64_t i = 0; i < s->same.count; i++)
        if (i && ebpo_same_faces_repeats(&s->same, i))
            ebpo_check_note(check, s->worker, &block->repeated_face, EBPO_FOUND_REPEATED_FACE,
                            s->same.item[i].source, s->same.item[i].face, first);
        else
            first = s->same.item[i].face;
    return true;
}

static ebpo_status stars(void *context, uint64_t begin, uint64_t end, unsigned worker,
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
        block.components += check->parents[v] == v;
        if (!ebpo_star_gather(&s->star, &check->stars, check->mesh, vertex) ||
            !check_edges(check, &block, s, vertex) || !check_repeated(check, &block, s, vertex))
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
    status = ebpo_parallel_for(check->threads, NULL, count, STAR_GRAIN, stars, &pass,
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
