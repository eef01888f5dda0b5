/* Writes simplified surfaces, and faces, as GLB: 16-bit positions and 8-bit normals
 * (KHR_mesh_quantization), compressed (EXT_meshopt_compression). */
#ifndef EBPO_DERIVE_GLTF_SURFACE_H
#define EBPO_DERIVE_GLTF_SURFACE_H

#include <stdio.h>

#include <ebpo/file.h>

/* A surface to write. */
typedef struct ebpo_gltf_surface {
    uint64_t vertex_count, triangle_count;
    const uint32_t *triangles; /* [triangle_count][3] vertex indices */
    const double *xyz;         /* [vertex_count][3] positions, in the model's unit */
    const float *normals;      /* [vertex_count][3], of length 1 */
    const uint8_t *colours;    /* [vertex_count][colour_bytes] sRGB; NULL: none */
    unsigned colour_bytes;     /* 3, or 4 with opacity */
    double origin[3];          /* point that becomes (0, 0, 0) */
    /* Positions are stored as points of a grid. step: distance between neighbouring points on each
     * axis; 0: positions are stored as floats, without a grid. grid: one point of the grid */
    double step[3], grid[3];
    bool rotates; /* the file's y is the surface's z, as in 3D Tiles */
    const char *name;
} ebpo_gltf_surface;

/* Facts of a written surface. */
typedef struct ebpo_gltf_written {
    uint64_t vertices; /* number of vertices that triangles use */
    uint64_t bytes;
    double change;         /* greatest distance by which rounding moved a vertex */
    double min[3], max[3]; /* bounds of the vertices, relative to the origin */
} ebpo_gltf_written;

/* Writes a GLB file; the caller checks the stream for errors. The steps of the grid are doubled
 * until all positions fit into 16 bits. `path`: for messages. Returns EBPO_E_LIMIT (a coordinate
 * or a step of the grid beyond float32, a file of 4 GiB) or EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_gltf_surface_write(FILE *file, const char *path,
                                                  const ebpo_gltf_surface *surface,
                                                  ebpo_gltf_written *out, ebpo_error *error);

#endif
