#include "cli/render/level_normals.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Copies the normal of each polygon to all triangles of the polygon. */
static void spread_normals(const ebpo_lod_nodes *nodes, const float *of_polygon, float *of_triangle)
{
    for (uint64_t i = 0; i < nodes->polygon_count; i++, of_polygon += 3)
        for (unsigned n = nodes->corners[i]; n > 2; n--, of_triangle += 3)
            memcpy(of_triangle, of_polygon, 3 * sizeof *of_polygon);
}

ebpo_status level_normals(const ebpo_info *info, const ebpo_mesh *mesh, const ebpo_lod_nodes *nodes,
                          float **out, ebpo_error *error)
{
    float *of_polygon = malloc((nodes->polygon_count + 1) * 3 * sizeof *of_polygon);
    *out = malloc((mesh->face_count + 1) * 3 * sizeof **out);
    ebpo_status status = EBPO_OK;
    if (of_polygon && *out) {
        status = ebpo_lod_normals(info, mesh, nodes, of_polygon, error);
    } else {
        snprintf(error->message, sizeof error->message,
                 "not enough memory to draw %llu triangles; choose a coarser level",
                 (unsigned long long)mesh->face_count);
        status = error->status = EBPO_E_MEMORY;
    }
    if (status == EBPO_OK) {
        spread_normals(nodes, of_polygon, *out);
    } else {
        free(*out);
        *out = NULL;
    }
    free(of_polygon);
    return status;
}
