#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "core/workspace.h"
#include "mesh/mesh_frame.h"
#include "mesh/mesh_check_parts.h"
#include "mesh/positions.h"

enum { VERTEX_GRAIN = 1 << 15 };

static ebpo_status coordinates(void *context, uint64_t begin, uint64_t end, unsigned worker,
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
                             VERTEX_GRAIN, coordinates, check, &check->progress,
                             "checking coordinates", error);
}

typedef struct vertex_block {
    double min[3], max[3];
    uint64_t referenced;
    ebpo_finding unreferenced;
} vertex_block;

typedef struct vertex_pass {
    const ebpo_check *check;
    vertex_block *blocks;
} vertex_pass;

static ebpo_status vertices(void *context, uint64_t begin, uint64_t end, unsigned worker,
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
        ebpo_parallel_for(check->threads, check->mesh->workspace, count, VERTEX_GRAIN, vertices,
                          &pass, &check->progress, "checking vertices", error);
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

/* Vertices along the curve, at one position one behind the other. */
typedef struct curve_run {
    const ebpo_mesh *mesh;
    uint64_t at, end;
} curve_run;

/* Which one's next vertex comes first along the curve, as arranging has it: less than 0 for `a`, 0
 * when they are at one position. */
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

static void note_repeated(const ebpo_check *check, uint32_t v)
{
    ebpo_check_note(check, 0, &check->report->repeated_positions, EBPO_FOUND_REPEATED_POSITION,
                    ebpo_mesh_source_vertex(check->mesh, v), v, v);
}

/* Steps over the vertices of a run's next position. All but the one that the source has first
 * repeat that one. */
static void take_position(const ebpo_check *check, curve_run *r, uint32_t *lowest)
{
    double here[3], p[3];
    ebpo_mesh_position(r->mesh, r->at, here);
    do {
        uint32_t v = (uint32_t)r->at++, later = v;
        if (*lowest == EBPO_NO_INDEX) {
            *lowest = v;
        } else {
            if (ebpo_mesh_source_vertex(r->mesh, v) < ebpo_mesh_source_vertex(r->mesh, *lowest))
                later = *lowest, *lowest = v;
            note_repeated(check, later);
        }
        if (r->at < r->end)
            ebpo_mesh_position(r->mesh, r->at, p);
    } while (r->at < r->end && p[0] == here[0] && p[1] == here[1] && p[2] == here[2]);
}

/* Of an arranged mesh: those that faces name, and the others, are a run each, or all are one. */
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
            take_position(check, &a, &lowest);
        if (order >= 0)
            take_position(check, &b, &lowest);
        if (steps % EBPO_ITEMS_IN_ORDER == 0)
            ebpo_release_pages(mesh->workspace);
    }
}

/* Of any mesh: by a table of positions. */
static ebpo_status compare_all(const ebpo_check *check, ebpo_error *error)
{
    const ebpo_mesh *mesh = check->mesh;
    uint64_t count = mesh->vertex_count;
    ebpo_positions positions;
    ebpo_status status =
        ebpo_positions_build(&positions, mesh, check->threads, &check->progress, error);
    if (status != EBPO_OK)
        return status;
    /* of each first one's position */
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
            note_repeated(check, (uint32_t)v);
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

/* Source: EBP 2017, section 3.1, for what a closed 2-manifold is; Euler's formula for the genus. */
static void conclude(ebpo_check *c)
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

static ebpo_status run(ebpo_check *c, ebpo_error *error)
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
    ebpo_stars_free(&c->stars); /* frees memory for the table of positions */
    if (status == EBPO_OK)
        status = ebpo_check_positions(c, error);
    if (status == EBPO_OK)
        conclude(c);
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
    status = run(check, error);
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
