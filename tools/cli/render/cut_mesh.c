#include "cli/render/cut_mesh.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct mesh_builder {
    ebpo_mesh mesh;
    bool filling; /* false: add_node only counts vertices and faces; true: it fills the arrays */
} mesh_builder;

static bool add_node(void *user, const ebpo_view_node *v)
{
    mesh_builder *m = user;
    const ebpo_stream_node *n = &v->node;
    uint32_t first = (uint32_t)m->mesh.vertex_count;
    if (m->filling && n->vertex_count)
        memcpy(m->mesh.xyz64 + 3 * m->mesh.vertex_count, n->vertices,
               n->vertex_count * sizeof *n->vertices);
    m->mesh.vertex_count += n->vertex_count;
    for (uint32_t p = 0; p < n->polygon_count; p++)
        for (uint32_t i = n->polygon_first[p] + 1; i + 1 < n->polygon_first[p + 1]; i++) {
            uint64_t at = 3 * m->mesh.face_count++;
            if (m->filling) {
                uint32_t *face = m->mesh.faces + at;
                face[0] = first + n->corners[n->polygon_first[p]];
                face[1] = first + n->corners[i];
                face[2] = first + n->corners[i + 1];
            }
        }
    return true;
}

ebpo_status cut_mesh_write(ebpo_view_stream *stream, const char *path, ebpo_error *error)
{
    mesh_builder m = { .filling = false };
    ebpo_view_stream_cut(stream, add_node, &m);
    uint64_t vertices = m.mesh.vertex_count, faces = m.mesh.face_count;
    if (vertices > UINT32_MAX - 1 || faces > UINT32_MAX - 1) {
        snprintf(error->message, sizeof error->message,
                 "%s: the cut has %" PRIu64 " vertices and %" PRIu64
                 " faces, more than a mesh can have; give a budget or --pixels",
                 path, vertices, faces);
        return error->status = EBPO_E_LIMIT;
    }
    m.mesh.xyz64 = calloc(vertices ? vertices : 1, 3 * sizeof *m.mesh.xyz64);
    m.mesh.faces = calloc(faces ? faces : 1, 3 * sizeof *m.mesh.faces);
    ebpo_status status = EBPO_OK;
    if (m.mesh.xyz64 && m.mesh.faces) {
        m.mesh.vertex_count = m.mesh.face_count = 0;
        m.filling = true;
        ebpo_view_stream_cut(stream, add_node, &m);
        status = ebpo_mesh_write_ply(&m.mesh, path, error);
    } else {
        snprintf(error->message, sizeof error->message,
                 "%s: not enough memory for the cut's %" PRIu64 " faces; give a budget or --pixels",
                 path, faces);
        status = error->status = EBPO_E_MEMORY;
    }
    free(m.mesh.xyz64);
    free(m.mesh.faces);
    return status;
}
