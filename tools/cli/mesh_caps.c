#include "cli/mesh_caps.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static ebpo_status fail_caps(ebpo_error *error, ebpo_status status, const char *path,
                             const char *text)
{
    snprintf(error->message, sizeof error->message, "%s: %s", path, text);
    return error->status = status;
}

/* Returns the number of triangles of all caps. */
static uint64_t count_caps(const ebpo_border_loops *loops)
{
    uint64_t count = 0;
    for (uint64_t i = 0; i < loops->loop_count; i++)
        count += (uint64_t)loops->loop[2 * i + 1] * (loops->loop[2 * i] - 2);
    return count;
}

/* Writes the triangles of the stretch [i, j] of a loop, each `weight` times. `first`: vertex of the
 * loop's first point. Returns the end of the written triangles. Recursive, at most 32 deep. */
static uint32_t *write_stretch(uint32_t *to, uint32_t first, uint32_t i, uint32_t j,
                               uint32_t weight)
{
    uint32_t m = i + (j - i) / 2;
    if (j - i < 2)
        return to;
    for (uint32_t k = 0; k < weight; k++) {
        *to++ = first + j;
        *to++ = first + m;
        *to++ = first + i;
    }
    to = write_stretch(to, first, i, m, weight);
    return write_stretch(to, first, m, j, weight);
}

/* Makes a mesh of the vertices and faces of `mesh` and of the caps. */
static ebpo_status join_caps(ebpo_mesh *out, const ebpo_mesh *mesh, const ebpo_border_loops *loops,
                             const char *path, ebpo_error *error)
{
    uint64_t vertices = mesh->vertex_count, faces = mesh->face_count, caps = count_caps(loops);
    memset(out, 0, sizeof *out);
    if (caps > 3 * faces + loops->point_count) /* large weights in a small file */
        return fail_caps(error, EBPO_E_LIMIT, path,
                         "has more caps than edges of faces and points of the border together");
    if (vertices + loops->point_count > UINT32_MAX - 1 || faces + caps > UINT32_MAX - 1)
        return fail_caps(error, EBPO_E_LIMIT, path,
                         "with its caps, the mesh has more than 2^32 - 2 vertices or faces");
    out->vertex_count = vertices + loops->point_count;
    out->face_count = faces + caps;
    out->faces = malloc(3 * out->face_count * sizeof *out->faces + 1);
    if (mesh->xyz32)
        out->xyz32 = malloc(3 * out->vertex_count * sizeof *out->xyz32 + 1);
    else
        out->xyz64 = malloc(3 * out->vertex_count * sizeof *out->xyz64 + 1);
    if (!out->faces || (!out->xyz32 && !out->xyz64)) {
        ebpo_mesh_free(out);
        return fail_caps(error, EBPO_E_MEMORY, path,
                         "not enough memory for the mesh with its caps");
    }
    if (mesh->xyz32)
        memcpy(out->xyz32, mesh->xyz32, 3 * vertices * sizeof *out->xyz32);
    else
        memcpy(out->xyz64, mesh->xyz64, 3 * vertices * sizeof *out->xyz64);
    for (uint64_t i = 0; i < 3 * loops->point_count; i++)
        if (mesh->xyz32)
            out->xyz32[3 * vertices + i] = (float)loops->point[i]; /* exact */
        else
            out->xyz64[3 * vertices + i] = loops->point[i];
    memcpy(out->faces, mesh->faces, 3 * faces * sizeof *out->faces);
    uint32_t *to = out->faces + 3 * faces, first = (uint32_t)vertices;
    for (uint64_t i = 0; i < loops->loop_count; i++) {
        uint32_t points = loops->loop[2 * i];
        to = write_stretch(to, first, 0, points - 1, loops->loop[2 * i + 1]);
        first += points;
    }
    return EBPO_OK;
}

ebpo_status mesh_caps_add(ebpo_mesh *mesh, const ebpo_file *file, const char *path,
                          unsigned threads, ebpo_error *error)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_tree tree;
    ebpo_mesh joined;
    if (!(ebpo_file_info(file)->parts & EBPO_PART_BORDER))
        return fail_caps(
            error, EBPO_E_ABSENT, path,
            "has no border, so it has no caps; for a surface with holes, 'ebpo repack' "
            "adds the border");
    if (ebpo_file_info(file)->pruned)
        return fail_caps(error, EBPO_E_ABSENT, path,
                         "is a subset, whose mesh the caps do not close; use the original file");
    read.threads = threads;
    ebpo_status status = ebpo_file_read_tree(file, &read, &tree, error);
    if (status != EBPO_OK)
        return status;
    status = join_caps(&joined, mesh, &tree.border, path, error);
    ebpo_tree_free(&tree);
    if (status != EBPO_OK)
        return status;
    ebpo_mesh_free(mesh);
    *mesh = joined;
    return EBPO_OK;
}
