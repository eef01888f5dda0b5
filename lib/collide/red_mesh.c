#include "geom/strict_fp.h"

#include "collide/red_mesh.h"

#include <inttypes.h>

#include "base/error.h"

static void print_vertices(FILE *f, const ebpo_red_mesh *p)
{
    const ebpo_mesh *mesh = p->mesh;
    for (uint64_t v = 0; v < mesh->vertex_count; v++) {
        double x[3], out[3];
        for (unsigned k = 0; k < 3; k++)
            x[k] = out[k] = mesh->xyz64 ? mesh->xyz64[3 * v + k] : (double)mesh->xyz32[3 * v + k];
        if (p->posing)
            ebpo_posing_apply(p->posing, x, out);
        fprintf(f, "%.17g %.17g %.17g\n", out[0], out[1], out[2]);
    }
}

static void print_faces(FILE *f, const ebpo_red_mesh *p, uint64_t first_vertex)
{
    const ebpo_mesh *mesh = p->mesh;
    for (uint64_t i = 0; i < mesh->face_count; i++) {
        const uint32_t *v = mesh->faces + 3 * i;
        bool red = p->red[i / 64] >> i % 64 & 1;
        fprintf(f, "3 %" PRIu64 " %" PRIu64 " %" PRIu64 " %s\n", first_vertex + v[0],
                first_vertex + v[1], first_vertex + v[2], red ? "255 0 0" : p->colour);
    }
}

ebpo_status ebpo_red_meshes_print(const ebpo_red_mesh *meshes, int count, ebpo_publish *target,
                                  ebpo_error *error)
{
    uint64_t vertices = 0, faces = 0;
    FILE *f = ebpo_publish_stream(target);
    if (!f)
        return ebpo_fail_memory(error, 4096);
    for (int i = 0; i < count; i++) {
        vertices += meshes[i].mesh->vertex_count;
        faces += meshes[i].mesh->face_count;
    }
    if (vertices > UINT32_MAX)
        return ebpo_fail(error, EBPO_E_LIMIT, "more than 2^32 - 1 vertices in one PLY file");
    fprintf(f,
            "ply\nformat ascii 1.0\nelement vertex %" PRIu64 "\nproperty double x\n"
            "property double y\nproperty double z\nelement face %" PRIu64 "\n"
            "property list uchar uint vertex_indices\nproperty uchar red\nproperty uchar green\n"
            "property uchar blue\nend_header\n",
            vertices, faces);
    for (int i = 0; i < count; i++)
        print_vertices(f, &meshes[i]);
    vertices = 0;
    for (int i = 0; i < count; i++) {
        print_faces(f, &meshes[i], vertices);
        vertices += meshes[i].mesh->vertex_count;
    }
    return ferror(f) ? ebpo_fail_file(error, EBPO_E_IO, target->shown, "cannot be written")
                     : EBPO_OK;
}
