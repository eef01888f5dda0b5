/* Fuzz target: any bytes as a PLY file. A resulting mesh must be valid: consistent counts, arrays
 * and indices. */
#include "fuzz_support.h"

#include <ebpo/mesh.h>
#include <math.h>

#include "mesh/ply.h"

static bool is_vertex(const ebpo_mesh *mesh, uint64_t v, const double p[3])
{
    bool same = v < mesh->vertex_count;
    for (uint64_t k = 0; k < 3 && same; k++) {
        double q = mesh->xyz32 ? (double)mesh->xyz32[3 * v + k] : mesh->xyz64[3 * v + k];
        same = p[k] == q || (isnan(p[k]) && isnan(q));
    }
    return same;
}

/* Reads only the vertices: they exist whenever the mesh does, with the same numbers; but rows with
 * more values than the header states, which a mesh reports as not read, are refused. */
static void read_points(const ebpo_mesh *mesh, const uint8_t *data, size_t size)
{
    double *xyz;
    uint64_t count;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status = ebpo_points_parse_ply(data, size, "fuzz.ply", &xyz, &count, &error);
    if (status != EBPO_OK && ((mesh->face_count && !ebpo_mesh_ignored(mesh)) || xyz || count ||
                              error.status != status || !error.message[0]))
        abort();
    uint64_t kept = 0;
    for (uint64_t i = 0; mesh->face_count && i < count; i++) { /* none when it was refused */
        if (is_vertex(mesh, kept, xyz + 3 * i))
            kept++;
        else if (isfinite(xyz[3 * i]) && isfinite(xyz[3 * i + 1]) && isfinite(xyz[3 * i + 2]))
            abort(); /* only others are omitted */
    }
    if (status == EBPO_OK && mesh->face_count && kept != mesh->vertex_count)
        abort();
    free(xyz);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status =
        ebpo_ply_parse_memory(&mesh, data, size, "fuzz.ply", NULL, 0, NULL, &error);
    if (status != EBPO_OK &&
        (error.status != status || !error.message[0] || mesh.faces || mesh.xyz32 || mesh.xyz64))
        abort();
    if (status == EBPO_OK && (!mesh.face_count || !mesh.xyz32 == !mesh.xyz64))
        abort();
    for (uint64_t i = 0; i < 3 * mesh.face_count; i++)
        if (mesh.faces[i] >= mesh.vertex_count)
            abort();
    read_points(&mesh, data, size);
    ebpo_mesh_free(&mesh);
    return 0;
}
