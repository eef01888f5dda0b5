/* Closes the holes of a surface's mesh by caps: triangles over the points of the border's loops.
 * The caps get separate vertices, because the file stores positions of the border, not indices of
 * vertices. Source: format-spec/border.md. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include <ebpo/export.h>

#include "core/error.h"
#include "core/workspace.h"
#include "format/border_loops.h"
#include "format/file_in.h"
#include "geometry/cap_triangles.h"

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
    uint32_t m = (uint32_t)ebpo_cap_middle(i, j);
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

/* Writes the points of the border and the caps after the vertices and faces of `mesh`. */
static void write_caps(ebpo_mesh *out, const ebpo_mesh *mesh, const ebpo_border_loops *loops)
{
    uint64_t vertices = mesh->vertex_count;
    uint32_t *to = out->faces + 3 * mesh->face_count, first = (uint32_t)vertices;
    EBPO_FOR_ITEMS(out->workspace, i, 0, 3 * loops->point_count)
        if (out->xyz32)
            out->xyz32[3 * vertices + i] = (float)loops->point[i]; /* exact */
        else
            out->xyz64[3 * vertices + i] = loops->point[i];
    EBPO_FOR_ITEMS(out->workspace, i, 0, loops->loop_count) {
        uint32_t points = loops->loop[2 * i];
        to = write_stretch(to, first, 0, points - 1, loops->loop[2 * i + 1]);
        first += points;
        ebpo_release_pages(out->workspace);
    }
}

/* Makes a mesh of the vertices and faces of `mesh` and of the caps. */
static ebpo_status join_caps(ebpo_mesh *out, const ebpo_mesh *mesh, const ebpo_border_loops *loops,
                             const ebpo_file *file, ebpo_error *error)
{
    const char *name = file->in.shown;
    ebpo_workspace *w = mesh->workspace;
    uint64_t vertices = mesh->vertex_count, faces = mesh->face_count, caps = count_caps(loops);
    *out = (ebpo_mesh){ .workspace = w };
    if (caps > 3 * file->info.face_count + loops->point_count) /* large weights in a small file */
        return ebpo_fail_file(error, EBPO_E_LIMIT, name,
                              "has more caps than edges of faces and points of the border "
                              "together");
    if (vertices + loops->point_count > UINT32_MAX - 1 || faces + caps > UINT32_MAX - 1)
        return ebpo_fail_file(error, EBPO_E_LIMIT, name,
                              "with its caps, the mesh has more than 2^32 - 2 vertices or faces");
    out->vertex_count = vertices + loops->point_count;
    out->face_count = faces + caps;
    bool doubles = mesh->xyz64 || (!mesh->xyz32 && file->info.double_coordinates);
    size_t size = 3 * (doubles ? sizeof(double) : sizeof(float));
    void *points = ebpo_array_alloc(w, out->vertex_count, size);
    out->faces = ebpo_array_alloc(w, out->face_count, 3 * sizeof *out->faces);
    out->xyz64 = doubles ? points : NULL;
    out->xyz32 = doubles ? NULL : points;
    if (!points || !out->faces) {
        ebpo_mesh_free(out);
        return ebpo_workspace_fail(
            w, out->vertex_count * size + out->face_count * 3 * sizeof *out->faces, error);
    }
    if (vertices)
        ebpo_array_copy(w, points, doubles ? (const void *)mesh->xyz64 : mesh->xyz32,
                        vertices * size);
    if (faces)
        ebpo_array_copy(w, out->faces, mesh->faces, faces * 3 * sizeof *out->faces);
    write_caps(out, mesh, loops);
    return EBPO_OK;
}

ebpo_status ebpo_mesh_add_caps(ebpo_mesh *mesh, const ebpo_file *file, ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    ebpo_border_loops loops;
    ebpo_mesh joined;
    if (!(info->parts & EBPO_PART_BORDER))
        return ebpo_fail_file(
            error, EBPO_E_ABSENT, file->in.shown,
            "has no border, so it has no caps; for a surface with holes, 'ebpo repack' "
            "adds the border");
    if (info->pruned)
        return ebpo_fail_file(error, EBPO_E_ABSENT, file->in.shown,
                              "is a subset, whose mesh the caps do not close; use the original "
                              "file");
    ebpo_status status = ebpo_border_read(file, &loops, error);
    if (status != EBPO_OK)
        return status;
    status = join_caps(&joined, mesh, &loops, file, error);
    ebpo_border_loops_free(&loops);
    if (status != EBPO_OK)
        return status;
    ebpo_mesh_free(mesh);
    *mesh = joined;
    return EBPO_OK;
}
