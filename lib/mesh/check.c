#include "geom/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/fp_env.h"
#include "base/parallel.h"
#include "mesh/check_parts.h"
#include "mesh/positions.h"

enum { VERTEX_GRAIN = 1 << 15 };

static ebpo_status coordinates(void *context, uint64_t begin, uint64_t end, unsigned worker, ebpo_error *error)
{
    (void)worker;
    const ebpo_check *c = context;
    for (uint64_t v = begin; v < end; v++) {
        double p[3];
        ebpo_mesh_position(c->mesh, v, p);
        for (int k = 0; k < 3; k++)
            if (!isfinite(p[k]))
                return ebpo_fail(error, EBPO_E_FORMAT, "%s: vertex %llu has %c = %s; repair the coordinate or drop the "
                                 "vertex and its faces", ebpo_mesh_label(c->mesh), (unsigned long long)v, "xyz"[k],
                                 isnan(p[k]) ? "nan" : p[k] > 0 ? "inf" : "-inf");
    }
    return EBPO_OK;
}

ebpo_status ebpo_check_coordinates(ebpo_check *check, ebpo_error *error)
{
    return ebpo_parallel_for(check->threads, check->mesh->vertex_count, VERTEX_GRAIN, coordinates, check,
                             &check->progress, "checking coordinates", error);
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

static ebpo_status vertices(void *context, uint64_t begin, uint64_t end, unsigned worker, ebpo_error *error)
{
    (void)worker, (void)error;
    const vertex_pass *pass = context;
    vertex_block b = { .min = { INFINITY, INFINITY, INFINITY }, .max = { -INFINITY, -INFINITY, -INFINITY } };
    for (uint64_t v = begin; v < end; v++) {
        if (ebpo_stars_degree(&pass->check->stars, (uint32_t)v) == 0) {
            ebpo_finding_add(&b.unreferenced, v);
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

/* Squares and cubes of what lies between these are far from overflow and underflow. */
enum { EXPONENT_MAX = 256 };

static ebpo_units choose_units(const ebpo_mesh_report *r)
{
    ebpo_units u = { .scaled = false };
    for (int k = 0; k < 3; k++) {
        frexp(fmax(fabs(r->min[k]), fabs(r->max[k])), &u.exponent[k]); /* 0 for 0 */
        u.scaled |= u.exponent[k] > EXPONENT_MAX || u.exponent[k] < -EXPONENT_MAX;
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
    ebpo_status status = ebpo_parallel_for(check->threads, count, VERTEX_GRAIN, vertices, &pass, &check->progress,
                                           "measuring the box", error);
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

ebpo_status ebpo_check_positions(ebpo_check *check, ebpo_error *error)
{
    ebpo_positions positions;
    ebpo_finding *finding = &check->report->repeated_positions;
    ebpo_status status = ebpo_positions_build(&positions, check->mesh, check->threads, &check->progress, error);
    if (status != EBPO_OK)
        return status;
    for (uint64_t v = 0; finding->count < positions.repeated && finding->count < EBPO_FINDING_PLACES; v++)
        if (ebpo_positions_first(&positions, (uint32_t)v) != v)
            ebpo_finding_add(finding, v);
    finding->count = positions.repeated;
    ebpo_positions_free(&positions);
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
        int64_t characteristic = (int64_t)c->referenced - (int64_t)r->edges + (int64_t)c->mesh->face_count;
        r->genus_known = true;
        r->genus = (int64_t)r->components - characteristic / 2;
    }
}

static ebpo_status boundary_loops(ebpo_check *c, ebpo_error *error)
{
    ebpo_loops loops;
    if (c->boundary.count == 0)
        return EBPO_OK;
    ebpo_status status = ebpo_boundary_loops(&loops, &c->boundary, &c->stars, c->mesh, error);
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
    c->parents = ebpo_alloc(count, sizeof *c->parents);
    if (!c->parents)
        return ebpo_fail_memory(error, count * sizeof *c->parents);
    for (uint64_t v = 0; v < count; v++)
        c->parents[v] = (uint32_t)v;
    status = ebpo_check_faces(c, error);
    if (status == EBPO_OK)
        status = ebpo_check_stars(c, error);
    if (status == EBPO_OK)
        status = boundary_loops(c, error);
    free(c->parents);
    c->parents = NULL;
    ebpo_stars_free(&c->stars); /* makes room for the table of positions */
    if (status == EBPO_OK)
        status = ebpo_check_positions(c, error);
    if (status == EBPO_OK)
        conclude(c);
    return status;
}

ebpo_status ebpo_mesh_check(ebpo_mesh_report *report, const ebpo_mesh *mesh, unsigned threads, ebpo_progress progress,
                            ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    memset(report, 0, sizeof *report);
    ebpo_status status = ebpo_mesh_check_shape(mesh, error);
    if (status != EBPO_OK)
        return status;
    if (mesh->face_count == 0)
        return ebpo_fail(error, EBPO_E_FORMAT, "%s: %llu vertices but no faces; give a triangle mesh, not a point cloud",
                         ebpo_mesh_label(mesh), (unsigned long long)mesh->vertex_count);
    ebpo_check check = { .mesh = mesh, .threads = ebpo_thread_count(threads), .progress = progress, .report = report };
    status = run(&check, error);
    ebpo_stars_free(&check.stars);
    ebpo_boundary_free(&check.boundary);
    if (status != EBPO_OK)
        memset(report, 0, sizeof *report);
    return status;
}
