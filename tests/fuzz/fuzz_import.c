/* SPDX-License-Identifier: MIT
 * Any bytes as an OBJ, STL or OFF file, and as a material library. A resulting mesh is valid.
 *
 * Input: a byte for the format, the file. */
#include "fuzz_support.h"

#include <ebpo/mesh.h>

#include "mesh/import.h"
#include "mesh/textures.h"

static void check(const ebpo_mesh *mesh)
{
    fuzz_must(mesh->face_count && !mesh->xyz32 != !mesh->xyz64);
    for (uint64_t i = 0; i < 3 * mesh->face_count; i++)
        fuzz_must(mesh->faces[i] < mesh->vertex_count);
}

static void take_library(void *user, const char *rest, size_t size)
{
    *(size_t *)user += size && rest[size - 1];
}

static void names(const uint8_t *data, size_t size)
{
    ebpo_texture_names of = { .count = 0 };
    size_t libraries = 0;
    ebpo_texture_names_of_mtl(&of, data, size);
    ebpo_texture_names_of_ply(&of, (const char *)data, size);
    ebpo_obj_libraries(data, size, take_library, &libraries);
    for (uint64_t i = 0; i < of.count; i++)
        fuzz_must(of.name[i].name && *of.name[i].name);
    ebpo_texture_names_free(&of);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char *const endings[] = { "fuzz.obj", "fuzz.stl", "fuzz.off" };
    ebpo_mesh mesh;
    ebpo_import_runs runs = { 0 };
    ebpo_error error = EBPO_ERROR_INIT;
    if (size < 1)
        return 0;
    uint8_t what = *data++;
    const char *name = endings[what % 3];
    uint8_t *file = fuzz_copy(data, --size);
    ebpo_import_job job = { .data = file, .size = size, .name = name, .attributes = what & 16 };
    const ebpo_import_format *format;
    if (what & 4)
        names(file, size);
    else if (what & 8) {
        job.runs = &runs;
        job.attributes = true;
        if (ebpo_import_memory(&mesh, &ebpo_import_obj, &job, &error) == EBPO_OK) {
            check(&mesh);
            ebpo_import_runs_free(&runs);
            ebpo_mesh_free(&mesh);
        }
    } else if ((format = ebpo_import_recognise(file, size, name)) && format != &ebpo_import_ply) {
        ebpo_status status = ebpo_import_memory(&mesh, format, &job, &error);
        fuzz_must(status == EBPO_OK || (error.status == status && error.message[0]));
        if (status == EBPO_OK) {
            check(&mesh);
            ebpo_mesh_free(&mesh);
        }
    }
    free(file);
    return 0;
}
