/* Writing a mesh as a binary little-endian PLY file. */
#include "geom/strict_fp.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/endian.h"
#include "base/error.h"
#include "base/arrays.h"
#include "io/publish.h"
#include <ebpo/mesh.h>

enum { BUFFER = 1 << 16, FACE_BYTES = 13 };

static ebpo_status check(const ebpo_mesh *mesh, ebpo_error *error)
{
    if (mesh->vertex_count > UINT32_MAX - 1 || mesh->face_count > UINT32_MAX - 1)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "the mesh to write has %" PRIu64 " vertices and %" PRIu64
                         " faces, but 2^32 - 2 of each is the limit; split it",
                         mesh->vertex_count, mesh->face_count);
    if ((mesh->vertex_count && !mesh->xyz32 == !mesh->xyz64) || (mesh->face_count && !mesh->faces))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the mesh to write has counts without arrays, or positions of both kinds");
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, 3 * mesh->face_count)
        if (mesh->faces[i] >= mesh->vertex_count)
            return ebpo_fail(error, EBPO_E_ARGUMENT,
                             "face %" PRIu64 " of the mesh to write names vertex %" PRIu32
                             ", but there are %" PRIu64 " vertices",
                             i / 3, mesh->faces[i], mesh->vertex_count);
    return EBPO_OK;
}

static void write_header(FILE *f, const ebpo_mesh *mesh)
{
    const char *type = mesh->xyz64 ? "double" : "float";
    fprintf(f, "ply\nformat binary_little_endian 1.0\nelement vertex %" PRIu64 "\n",
            mesh->vertex_count);
    fprintf(f, "property %s x\nproperty %s y\nproperty %s z\n", type, type, type);
    fprintf(f, "element face %" PRIu64 "\nproperty list uchar %s vertex_indices\nend_header\n",
            mesh->face_count, mesh->vertex_count < UINT64_C(1) << 31 ? "int" : "uint");
}

static bool write_vertices(FILE *f, const ebpo_mesh *mesh, uint8_t *buffer)
{
    size_t width = mesh->xyz64 ? 8 : 4;
    const uint8_t *from = mesh->xyz64 ? (const uint8_t *)mesh->xyz64 : (const uint8_t *)mesh->xyz32;
    uint64_t values = 3 * mesh->vertex_count;
    const size_t piece = BUFFER / width;
    EBPO_FOR_PIECES(mesh->workspace, done, values, piece) {
        size_t n = values - done < piece ? (size_t)(values - done) : piece;
        for (size_t i = 0; i < n; i++) {
            uint32_t narrow;
            uint64_t wide;
            if (width == 4) {
                memcpy(&narrow, from + (done + i) * 4, 4);
                ebpo_store32(buffer + 4 * i, narrow);
            } else {
                memcpy(&wide, from + (done + i) * 8, 8);
                ebpo_store64(buffer + 8 * i, wide);
            }
        }
        if (fwrite(buffer, width, n, f) != n)
            return false;
    }
    return true;
}

static bool write_faces(FILE *f, const ebpo_mesh *mesh, uint8_t *buffer)
{
    const uint64_t piece = BUFFER / FACE_BYTES;
    EBPO_FOR_PIECES(mesh->workspace, done, mesh->face_count, piece) {
        size_t n = (size_t)(mesh->face_count - done < piece ? mesh->face_count - done : piece);
        for (size_t i = 0; i < n; i++) {
            uint8_t *at = buffer + FACE_BYTES * i;
            at[0] = 3;
            for (int k = 0; k < 3; k++)
                ebpo_store32(at + 1 + 4 * k, mesh->faces[3 * (done + i) + (uint64_t)k]);
        }
        if (fwrite(buffer, FACE_BYTES, n, f) != n)
            return false;
    }
    return true;
}

ebpo_status ebpo_mesh_write_ply(const ebpo_mesh *mesh, const char *path, ebpo_error *error)
{
    ebpo_publish out = EBPO_PUBLISH_INIT;
    uint8_t *buffer = NULL;
    FILE *f;
    ebpo_status status = check(mesh, error);
    if (status == EBPO_OK)
        status = ebpo_publish_begin(&out, path, error);
    if (status != EBPO_OK)
        goto done;
    buffer = ebpo_alloc(BUFFER, 1);
    f = ebpo_publish_stream(&out);
    if (!buffer || !f) {
        status = ebpo_fail_memory(error, BUFFER);
        goto done;
    }
    write_header(f, mesh);
    if (ferror(f) || !write_vertices(f, mesh, buffer) || !write_faces(f, mesh, buffer)) {
        status = ebpo_fail_errno(error, path, "could not be written");
        goto done;
    }
    status = ebpo_publish_commit(&out, error);
done:
    ebpo_publish_abort(&out);
    free(buffer);
    return status;
}
