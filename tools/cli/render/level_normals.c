#include "cli/render/level_normals.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double LEAST_COSINE = 0.766; /* cosine of 40 degrees */

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

/* Computes the normal of a face, whose length is twice the face's area. The unit of length is
 * 2^exponent, so that products neither overflow nor underflow. */
static void area_normal(const ebpo_mesh *mesh, uint64_t face, int exponent, double out[3])
{
    const uint32_t *corner = mesh->faces + 3 * face;
    double p[3][3], u[3], v[3];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            uint64_t at = 3 * (uint64_t)corner[i] + (uint64_t)k;
            p[i][k] = mesh->xyz64 ? mesh->xyz64[at] : (double)mesh->xyz32[at];
        }
    for (int k = 0; k < 3; k++) {
        u[k] = ldexp(p[1][k] - p[0][k], -exponent);
        v[k] = ldexp(p[2][k] - p[0][k], -exponent);
    }
    for (int k = 0; k < 3; k++)
        out[k] = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
}

static double dot_product(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Sets the sums of the normals of faces, `sum`, to 0 at vertices of which a face deviates from the
 * mean by more than 40 degrees. `sharp`: [vertices] false. */
static void clear_sharp(const ebpo_mesh *mesh, int exponent, bool *sharp, double (*sum)[3])
{
    for (uint64_t i = 0; i < 3 * mesh->face_count; i++) {
        double n[3];
        const double *mean = sum[mesh->faces[i]];
        area_normal(mesh, i / 3, exponent, n);
        sharp[mesh->faces[i]] |=
            dot_product(n, mean) < LEAST_COSINE * sqrt(dot_product(n, n) * dot_product(mean, mean));
    }
    for (uint64_t v = 0; v < mesh->vertex_count; v++)
        for (int k = 0; k < 3 && sharp[v]; k++)
            sum[v][k] = 0;
}

ebpo_status mesh_normals(const ebpo_info *info, const ebpo_mesh *mesh, float **out,
                         ebpo_error *error)
{
    double(*sum)[3] = calloc(mesh->vertex_count + 1, sizeof *sum);
    bool *sharp = calloc(mesh->vertex_count + 1, sizeof *sharp);
    int exponent;
    *out = malloc((mesh->vertex_count + 1) * 3 * sizeof **out);
    if (sum && sharp && *out) {
        (void)frexp(fmax(info->box_size[0], fmax(info->box_size[1], info->box_size[2])), &exponent);
        for (uint64_t face = 0; face < mesh->face_count; face++) {
            double n[3];
            area_normal(mesh, face, exponent, n);
            for (int i = 0; i < 3; i++)
                for (int k = 0; k < 3; k++)
                    sum[mesh->faces[3 * face + (uint64_t)i]][k] += n[k];
        }
        clear_sharp(mesh, exponent, sharp, sum);
        for (uint64_t v = 0; v < mesh->vertex_count; v++) {
            double length = sqrt(dot_product(sum[v], sum[v]));
            for (int k = 0; k < 3; k++)
                (*out)[3 * v + (uint64_t)k] = length > 0 ? (float)(sum[v][k] / length) : 0;
        }
    } else {
        snprintf(error->message, sizeof error->message,
                 "not enough memory for the normals of %llu vertices",
                 (unsigned long long)mesh->vertex_count);
        error->status = EBPO_E_MEMORY;
        free(*out);
        *out = NULL;
    }
    free(sum);
    free(sharp);
    return *out ? EBPO_OK : error->status;
}
