#include "geom/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/fp_env.h"
#include "mesh/boundary.h"
#include "mesh/mesh.h"
#include "mesh/stars.h"
#include "mesh/triangulate.h"

/* Vertices with more faces than this are not searched for existing edges: it keeps the work linear. */
enum { SEARCHED_DEGREE = 4096 };

typedef struct filling {
    ebpo_mesh *mesh;
    ebpo_stars stars;
    ebpo_boundary boundary;
    ebpo_loops loops;
    double (*point)[3];
    uint32_t (*triangles)[3];
    uint8_t *taken;  /* [EBPO_OPTIMAL_CHAIN^2] */
    uint32_t *place; /* [vertex_count] place in the loop at hand, or EBPO_NO_INDEX */
    uint32_t *faces; /* the new ones */
    uint64_t added;
} filling;

static bool collect_boundary(filling *f)
{
    ebpo_star star = { .links = NULL };
    bool ok = true;
    for (uint64_t v = 0; v < f->mesh->vertex_count && ok; v++) {
        ok = ebpo_star_gather(&star, &f->stars, f->mesh, (uint32_t)v);
        for (uint64_t begin = 0, end; ok && begin < star.count; begin = end) {
            const ebpo_link *link = &star.links[begin];
            uint32_t lower = (uint32_t)v, higher = ebpo_link_neighbour(link);
            end = ebpo_star_run_end(&star, begin);
            if (end - begin == 1 && higher > lower)
                ok = ebpo_boundary_add(&f->boundary, (ebpo_boundary_edge){ link->out ? lower : higher,
                                       link->out ? higher : lower, ebpo_link_face(link) });
        }
    }
    ebpo_star_free(&star);
    return ok;
}

/* Marks pairs of loop vertices between which the mesh has an edge. */
static void mark_taken(filling *f, const uint32_t *loop, uint32_t n)
{
    memset(f->taken, 0, (size_t)n * n);
    for (uint32_t i = 0; i < n; i++)
        f->place[loop[i]] = i;
    for (uint32_t i = 0; i < n; i++) {
        uint64_t begin = f->stars.first[loop[i]], end = f->stars.first[loop[i] + (uint64_t)1];
        for (uint64_t e = begin; e < end && end - begin <= SEARCHED_DEGREE; e++)
            for (int k = 0; k < 3; k++) {
                uint32_t j = f->place[f->mesh->faces[3 * (uint64_t)f->stars.face[e] + (unsigned)k]];
                if (j != EBPO_NO_INDEX)
                    f->taken[(size_t)i * n + j] = f->taken[(size_t)j * n + i] = 1;
            }
    }
    for (uint32_t i = 0; i < n; i++)
        f->place[loop[i]] = EBPO_NO_INDEX;
}

static bool fill_loop(filling *f, const uint32_t *loop, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++)
        ebpo_mesh_position(f->mesh, loop[i], f->point[i]);
    bool search = n > 3 && n <= EBPO_OPTIMAL_CHAIN;
    if (search)
        mark_taken(f, loop, n);
    ebpo_chain chain = { .n = n, .point = (const double (*)[3])f->point, .taken = search ? f->taken : NULL };
    if (!ebpo_triangulate_chain(&chain, f->triangles))
        return false;
    for (uint32_t t = 0; t < n - 2; t++) { /* against the chain, as the faces beside it run along it */
        uint32_t *face = f->faces + 3 * f->added++;
        for (int k = 0; k < 3; k++)
            face[k] = loop[f->triangles[t][2 - k]];
    }
    return true;
}

static bool allocate(filling *f)
{
    uint64_t longest = 0, total = f->loops.first[f->loops.count];
    for (uint64_t i = 0; i < f->loops.count; i++) {
        uint64_t n = f->loops.first[i + 1] - f->loops.first[i];
        longest = n > longest ? n : longest;
    }
    f->point = ebpo_alloc(longest, sizeof *f->point);
    f->triangles = ebpo_alloc(longest, sizeof *f->triangles);
    f->taken = ebpo_alloc(EBPO_OPTIMAL_CHAIN, EBPO_OPTIMAL_CHAIN);
    f->place = ebpo_alloc(f->mesh->vertex_count, sizeof *f->place);
    f->faces = ebpo_alloc(total, 3 * sizeof *f->faces);
    if (!f->point || !f->triangles || !f->taken || !f->place || !f->faces)
        return false;
    memset(f->place, 0xff, f->mesh->vertex_count * sizeof *f->place);
    return true;
}

static ebpo_status append_faces(filling *f, ebpo_error *error)
{
    ebpo_mesh *mesh = f->mesh;
    uint64_t count = mesh->face_count + f->added;
    if (count > UINT32_MAX - 1)
        return ebpo_fail(error, EBPO_E_LIMIT, "%s: %llu faces with the filled holes, but 2^32 - 2 is the limit; "
                         "split the mesh", ebpo_mesh_label(mesh), (unsigned long long)count);
    uint32_t *faces = ebpo_realloc(mesh->faces, count, 3 * sizeof *faces);
    if (!faces)
        return ebpo_fail_memory(error, count * 3 * sizeof *faces);
    memcpy(faces + 3 * mesh->face_count, f->faces, f->added * 3 * sizeof *faces);
    mesh->faces = faces;
    mesh->face_count = count;
    return EBPO_OK;
}

static ebpo_status run(filling *f, ebpo_error *error)
{
    ebpo_status status = ebpo_stars_build(&f->stars, f->mesh, 0, NULL, error);
    if (status != EBPO_OK)
        return status;
    if (!collect_boundary(f))
        return ebpo_fail_memory(error, f->boundary.count * sizeof *f->boundary.edges);
    if (f->boundary.count == 0)
        return EBPO_OK;
    status = ebpo_boundary_loops(&f->loops, &f->boundary, &f->stars, f->mesh, error);
    if (status != EBPO_OK)
        return status;
    if (!allocate(f))
        return ebpo_fail_memory(error, f->boundary.count * 48 + f->mesh->vertex_count * 4);
    for (uint64_t i = 0; i < f->loops.count; i++)
        if (!fill_loop(f, f->loops.vertex + f->loops.first[i], (uint32_t)(f->loops.first[i + 1] - f->loops.first[i])))
            return ebpo_fail_memory(error, f->boundary.count * 48);
    return append_faces(f, error);
}

ebpo_status ebpo_mesh_fill_holes(ebpo_mesh *mesh, ebpo_mend_record *record, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    filling f = { .mesh = mesh };
    ebpo_status status = ebpo_mesh_check_shape(mesh, error);
    if (status != EBPO_OK)
        return status;
    status = run(&f, error);
    if (status == EBPO_OK && record) {
        record->fill_holes = true;
        record->filled_holes += f.loops.count;
        record->added_faces += f.added;
        record->unfilled_holes += f.loops.open_chains;
    }
    ebpo_stars_free(&f.stars);
    ebpo_boundary_free(&f.boundary);
    ebpo_loops_free(&f.loops);
    free(f.point);
    free(f.triangles);
    free(f.taken);
    free(f.place);
    free(f.faces);
    return status;
}
