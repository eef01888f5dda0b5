#include "core/strict_fp.h"

#include "extras/collide/red_mesh.h"

#include <inttypes.h>
#include <string.h>

#include "core/error.h"

static ebpo_status mesh_vertex(void *user, uint64_t number, double out[3], ebpo_error *error)
{
    const ebpo_mesh *mesh = user;
    (void)error;
    for (unsigned k = 0; k < 3; k++)
        out[k] = mesh->xyz64 ? mesh->xyz64[3 * number + k] : (double)mesh->xyz32[3 * number + k];
    return EBPO_OK;
}

static ebpo_status mesh_face(void *user, uint64_t number, uint32_t out[3], ebpo_error *error)
{
    const ebpo_mesh *mesh = user;
    (void)error;
    memcpy(out, mesh->faces + 3 * number, 3 * sizeof *out);
    return EBPO_OK;
}

ebpo_red_source ebpo_red_source_of(const ebpo_mesh *mesh)
{
    return (ebpo_red_source){ mesh->vertex_count, mesh->face_count, (ebpo_mesh *)mesh, mesh_vertex,
                              mesh_face };
}

static ebpo_status print_vertices(FILE *f, const ebpo_red_mesh *p, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t v = 0; v < p->source.vertices && status == EBPO_OK; v++) {
        double x[3], out[3];
        status = p->source.vertex(p->source.user, v, x, error);
        if (status != EBPO_OK)
            break;
        memcpy(out, x, sizeof out);
        if (p->posing)
            ebpo_posing_apply(p->posing, x, out);
        fprintf(f, "%.17g %.17g %.17g\n", out[0], out[1], out[2]);
    }
    return status;
}

static ebpo_status print_faces(FILE *f, const ebpo_red_mesh *p, uint64_t first_vertex,
                               ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < p->source.faces && status == EBPO_OK; i++) {
        uint32_t v[3];
        bool red = p->red[i / 64] >> i % 64 & 1;
        status = p->source.face(p->source.user, i, v, error);
        if (status == EBPO_OK)
            fprintf(f, "3 %" PRIu64 " %" PRIu64 " %" PRIu64 " %s\n", first_vertex + v[0],
                    first_vertex + v[1], first_vertex + v[2], red ? "255 0 0" : p->colour);
    }
    return status;
}

ebpo_status ebpo_red_meshes_print(const ebpo_red_mesh *meshes, int count, ebpo_publish *target,
                                  ebpo_error *error)
{
    uint64_t vertices = 0, faces = 0;
    FILE *f = ebpo_publish_stream(target);
    if (!f)
        return ebpo_fail_memory(error, 4096);
    for (int i = 0; i < count; i++) {
        vertices += meshes[i].source.vertices;
        faces += meshes[i].source.faces;
    }
    if (vertices > UINT32_MAX)
        return ebpo_fail(error, EBPO_E_LIMIT, "more than 2^32 - 1 vertices in one PLY file");
    fprintf(f,
            "ply\nformat ascii 1.0\nelement vertex %" PRIu64 "\nproperty double x\n"
            "property double y\nproperty double z\nelement face %" PRIu64 "\n"
            "property list uchar uint vertex_indices\nproperty uchar red\nproperty uchar green\n"
            "property uchar blue\nend_header\n",
            vertices, faces);
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < count && status == EBPO_OK; i++)
        status = print_vertices(f, &meshes[i], error);
    vertices = 0;
    for (int i = 0; i < count && status == EBPO_OK; i++) {
        status = print_faces(f, &meshes[i], vertices, error);
        vertices += meshes[i].source.vertices;
    }
    if (status != EBPO_OK)
        return status;
    return ferror(f) ? ebpo_fail_file(error, EBPO_E_IO, target->shown, "cannot be written")
                     : EBPO_OK;
}
