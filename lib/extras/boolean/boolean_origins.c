/* Adds the origins of faces as attributes of the mesh. Faces have the numbers of the operand's
 * source if its file has maps, otherwise those of the file, as in all queries. */
#include "core/strict_fp.h"

#include "extras/boolean/boolean_origins.h"

#include <stdlib.h>
#include <string.h>

#include "core/error.h"
#include "mesh/attributes.h"

static uint8_t *add_array(ebpo_mesh *mesh, const char *name, ebpo_attribute_type type)
{
    ebpo_attribute like = { .element = "face", .type = type, .columns = 1 };
    like.list = EBPO_ATTRIBUTE_NO_LIST;
    like.rows = mesh->face_count;
    memcpy(like.names, name, strlen(name) + 1);
    ebpo_attribute *a = ebpo_attributes_add(mesh->attributes, &like);
    return a && ebpo_attribute_reserve(NULL, a, like.rows, 0) ? a->values : NULL;
}

/* Sets the attributes of the faces that come from one operand. */
static ebpo_status note_operand(const ebpo_face_list *faces, uint32_t operand,
                                const uint32_t *origin, uint64_t count, uint8_t *of, uint8_t *face,
                                ebpo_error *error)
{
    const ebpo_model *model = faces->boolean->solid[operand].model;
    uint32_t first = faces->first[operand], end = faces->first[operand + 1];
    ebpo_maps maps = { 0 };
    ebpo_error cause = EBPO_ERROR_INIT;
    ebpo_status status = ebpo_file_read_maps(model->file, NULL, &maps, &cause);
    if (status != EBPO_OK && status != EBPO_E_ABSENT)
        return ebpo_fail_operand(model, operand, &cause, error);
    for (uint64_t i = 0; i < count; i++) {
        uint32_t number = origin[i] - first;
        if (origin[i] < first || origin[i] >= end)
            continue;
        if (maps.face_source)
            number = maps.face_source[number];
        of[i] = (uint8_t)operand;
        memcpy(face + sizeof number * i, &number, sizeof number);
    }
    ebpo_maps_free(&maps);
    return EBPO_OK;
}

ebpo_status ebpo_boolean_origins(const ebpo_face_list *faces, const uint32_t *origin,
                                 ebpo_mesh *mesh, ebpo_error *error)
{
    uint64_t count = mesh->face_count;
    ebpo_status status = ebpo_mesh_need_attributes(mesh, error);
    if (status != EBPO_OK || count == 0)
        return status;
    uint8_t *of = add_array(mesh, "operand", EBPO_ATTRIBUTE_UINT8);
    uint8_t *face = add_array(mesh, "operand_face", EBPO_ATTRIBUTE_UINT32);
    if (!of || !face)
        return ebpo_fail_memory(error, 5 * count);
    for (uint32_t i = 0; i < faces->boolean->count && status == EBPO_OK; i++)
        if (faces->same[i])
            status = note_operand(faces, i, origin, count, of, face, error);
    return status;
}
