/* SPDX-License-Identifier: MIT
 * Any bytes as two patches of a simplified surface, of the root and of a child: decoded, joined,
 * and written as GLB. The first bytes give the numbers of vertices and triangles, the octant of the
 * child, and whether there are colours; then come points, normals and colours, then the codes. */
#include "fuzz_support.h"

#include <ebpo/lod.h>
#include <math.h>
#include <stdio.h>

#include "derive/gltf_surface.h"
#include "derive/meshopt_codec.h"
#include "format/surface_patches.h"

enum { HEAD = 6 };

/* Takes the next bytes; zeros if there are too few. */
static void take_bytes(const uint8_t **data, size_t *size, size_t bytes, void *out)
{
    size_t n = bytes < *size ? bytes : *size;
    memset(out, 0, bytes);
    memcpy(out, *data, n);
    *data += n;
    *size -= n;
}

static void check_patch(const ebpo_patch *p)
{
    for (uint64_t i = 0; i < 3 * p->triangle_count; i++)
        fuzz_must(p->triangles[i] < p->vertex_count);
    for (uint64_t i = 0; i < 3 * p->vertex_count; i++)
        fuzz_must(isfinite(p->xyz[i]) && isfinite(p->normals[i]) && p->normals[i] <= 1.001f);
}

/* The encoders stay within their bounds. */
static void encode_patch(const ebpo_patch *p)
{
    uint8_t *triangles = fuzz_capacity(ebpo_meshopt_triangles_bound(p->triangle_count)),
            *points = fuzz_capacity(ebpo_meshopt_attributes_bound(p->vertex_count, 24));
    fuzz_must(ebpo_meshopt_triangles(p->triangles, p->triangle_count, triangles) <=
              ebpo_meshopt_triangles_bound(p->triangle_count));
    fuzz_must(ebpo_meshopt_attributes((const uint8_t *)p->xyz, p->vertex_count, 24, points) <=
              ebpo_meshopt_attributes_bound(p->vertex_count, 24));
    free(triangles);
    free(points);
}

static void write_mesh(const ebpo_surface_mesh *m)
{
    char *text = NULL;
    size_t bytes = 0;
    ebpo_gltf_surface s = { .vertex_count = m->mesh.vertex_count,
                            .triangle_count = m->mesh.face_count,
                            .triangles = m->mesh.faces,
                            .xyz = m->mesh.xyz64,
                            .normals = m->normals,
                            .colours = m->colours.vertex,
                            .colour_bytes = 4,
                            .step = { 0x1p-16, 0x1p-16, 0x1p-16 },
                            .name = "fuzzed" };
    ebpo_gltf_written written;
    FILE *f = m->mesh.face_count ? open_memstream(&text, &bytes) : NULL;
    if (!f)
        return;
    fuzz_must(ebpo_gltf_surface_write(f, "fuzzed", &s, &written, NULL) == EBPO_OK);
    fclose(f);
    fuzz_must(written.bytes == bytes);
    free(text);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size < HEAD)
        return 0;
    uint64_t vertices[2] = { 3u + data[0], 3u + data[1] }, count = vertices[0] + vertices[1],
             triangles[2] = { 1u + data[2], 1u + data[3] }, codes = 0;
    ebpo_info info = { .box_size = { 1, 2, 3 }, .level_count = 3 };
    unsigned octant = data[4] & 7;
    bool coloured = data[4] & 8;
    uint64_t share = data[5];
    data += HEAD;
    size -= HEAD;
    ebpo_surface s = { .patch_count = 2,
                       .triangle_count = triangles[0] + triangles[1],
                       .vertex_count = count,
                       .colour_count = coloured ? count : 0,
                       .patch = fuzz_capacity(2 * EBPO_PATCH_COLUMNS * sizeof *s.patch),
                       .point = fuzz_capacity(6 * count),
                       .normal = fuzz_capacity(2 * count),
                       .colour = coloured ? fuzz_capacity(3 * count) : NULL };
    take_bytes(&data, &size, 6 * count, s.point);
    take_bytes(&data, &size, 2 * count, s.normal);
    if (coloured)
        take_bytes(&data, &size, 3 * count, s.colour);
    s.code = fuzz_copy(data, size);
    s.code_bytes = size;
    for (uint64_t i = 0; i < 2; i++) {
        uint64_t bytes = i ? size - codes : share * size / 256,
                 row[EBPO_PATCH_COLUMNS] = { i ? 8 + octant : 1, 0,     1u << 20, triangles[i],
                                             vertices[i],        bytes, 5 };
        codes += bytes;
        memcpy(s.patch + EBPO_PATCH_COLUMNS * i, row, sizeof row);
    }
    ebpo_patch patch;
    ebpo_surface_mesh mesh;
    for (uint64_t i = 0; i < 2; i++)
        if (ebpo_surface_decode(&s, &info, i, &patch, NULL) == EBPO_OK) {
            check_patch(&patch);
            encode_patch(&patch);
            ebpo_patch_free(&patch);
        }
    if (ebpo_surface_join(&s, &info, (uint64_t[]){ 0, 1 }, 2, &mesh, NULL) == EBPO_OK) {
        for (uint64_t i = 0; i < 3 * mesh.mesh.face_count; i++)
            fuzz_must(mesh.mesh.faces[i] < mesh.mesh.vertex_count);
        write_mesh(&mesh);
        ebpo_surface_mesh_free(&mesh);
    }
    ebpo_surface_free(&s);
    return 0;
}
