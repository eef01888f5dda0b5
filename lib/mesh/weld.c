#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/fp_env.h"
#include "mesh/mesh.h"
#include "mesh/positions.h"

static ebpo_status check_indices(const ebpo_mesh *mesh, ebpo_error *error)
{
    for (uint64_t i = 0; i < 3 * mesh->face_count; i++)
        if (mesh->faces[i] >= mesh->vertex_count)
            return ebpo_fail(error, EBPO_E_FORMAT, "%s: face %llu names vertex %lu, but there are %llu vertices; "
                             "repair the file or drop the face", ebpo_mesh_label(mesh), (unsigned long long)(i / 3),
                             (unsigned long)mesh->faces[i], (unsigned long long)mesh->vertex_count);
    return EBPO_OK;
}

/* New number of each vertex; those that stay keep their order. */
static uint64_t number_vertices(const ebpo_positions *positions, uint64_t count, uint32_t *map)
{
    uint64_t kept = 0;
    for (uint64_t v = 0; v < count; v++) {
        uint32_t first = ebpo_positions_first(positions, (uint32_t)v);
        map[v] = first == v ? (uint32_t)kept++ : map[first];
    }
    return kept;
}

static void move_vertices(ebpo_mesh *mesh, const uint32_t *map, uint64_t kept)
{
    size_t size = 3 * (mesh->xyz32 ? sizeof *mesh->xyz32 : sizeof *mesh->xyz64);
    char *base = mesh->xyz32 ? (char *)mesh->xyz32 : (char *)mesh->xyz64;
    uint64_t next = 0;
    for (uint64_t v = 0; v < mesh->vertex_count; v++)
        if (map[v] == next) { /* a vertex that stays; later ones of its group have a lower number */
            if (v != next)
                memcpy(base + next * size, base + v * size, size);
            next++;
        }
    mesh->vertex_count = kept;
    void *smaller = ebpo_realloc(base, 3 * kept, size / 3);
    if (smaller && mesh->xyz32)
        mesh->xyz32 = smaller;
    else if (smaller)
        mesh->xyz64 = smaller;
}

ebpo_status ebpo_mesh_weld(ebpo_mesh *mesh, ebpo_mend_record *record, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_positions positions = { .mesh = NULL };
    uint32_t *map = NULL;
    uint64_t removed = 0;
    ebpo_status status = ebpo_mesh_check_shape(mesh, error);
    if (status != EBPO_OK)
        return status;
    status = check_indices(mesh, error);
    if (status == EBPO_OK)
        status = ebpo_positions_build(&positions, mesh, 0, NULL, error);
    if (status != EBPO_OK)
        goto done;
    removed = positions.repeated;
    if (removed == 0)
        goto done;
    map = ebpo_alloc(mesh->vertex_count, sizeof *map);
    if (!map) {
        status = ebpo_fail_memory(error, mesh->vertex_count * sizeof *map);
        goto done;
    }
    uint64_t kept = number_vertices(&positions, mesh->vertex_count, map);
    for (uint64_t i = 0; i < 3 * mesh->face_count; i++)
        mesh->faces[i] = map[mesh->faces[i]];
    move_vertices(mesh, map, kept);
done:
    free(map);
    ebpo_positions_free(&positions);
    if (status == EBPO_OK && record) {
        record->weld = true;
        record->welded_vertices += removed;
    }
    return status;
}
