/* Reads the colours of faces from a file's attributes. If vertices have colours, the corners of a
 * face have the colours of its vertices. If only faces have colours, or if faces have colours and
 * all vertices have the same colour, the corners have the colour of the face. The ranges of values
 * that the file states show if all vertices have the same colour, so no values are read to find
 * out. Source: format-spec/attributes.md. */
#include "format/face_colours.h"

#include <string.h>

#include "core/error.h"
#include "format/file_in.h"
#include "format/pick_rows.h"

/* Returns true if the file states, by the ranges of values, that each of the three columns has only
 * one value. */
static bool is_constant(const ebpo_file *file, const ebpo_attributes *arrays,
                        const ebpo_colour_column *column)
{
    for (int k = 0; k < 3; k++) {
        const ebpo_attribute_in *in = &file->attributes.head[column[k].of - arrays->array];
        if (!in->has_range || in->range[0] != in->range[1])
            return false;
    }
    return true;
}

ebpo_status ebpo_face_colours_find(const ebpo_file *file, ebpo_face_colours *out, ebpo_error *error)
{
    uint8_t none;
    ebpo_colour_column of_faces[EBPO_COLOUR_CHANNELS];
    out->arrays = ebpo_attributes_make(NULL);
    out->element = NULL;
    for (uint64_t n = 0; out->arrays && n < file->attributes.count; n++) {
        ebpo_attribute *a = ebpo_attributes_add(out->arrays, &file->attributes.head[n].head);
        if (!a) {
            for (uint64_t i = 0; i < n; i++)
                out->arrays->array[i].values = NULL;
            return ebpo_fail_memory(error, sizeof *a);
        }
        a->values = &none; /* not NULL, because ebpo_colour_columns skips arrays without values */
    }
    if (!out->arrays)
        return ebpo_fail_memory(error, sizeof(ebpo_attribute));
    if (ebpo_colour_columns(out->arrays, "vertex", out->column))
        out->element = "vertex";
    if (ebpo_colour_columns(out->arrays, "face", of_faces) &&
        (!out->element || is_constant(file, out->arrays, out->column))) {
        out->element = "face";
        memcpy(out->column, of_faces, sizeof of_faces);
    }
    for (uint64_t n = 0; n < out->arrays->count; n++) {
        ebpo_attribute *a = &out->arrays->array[n];
        a->values = NULL;
        if (!out->element ||
            (out->column[0].of != a && out->column[1].of != a && out->column[2].of != a))
            *a->element = 0;
    }
    return EBPO_OK;
}

void ebpo_face_colours_free(ebpo_face_colours *colours)
{
    ebpo_attributes_free(colours->arrays);
    colours->arrays = NULL;
}

ebpo_status ebpo_face_colours_read(ebpo_face_colours *colours, ebpo_chunks *chunks,
                                   const uint32_t *faces, const uint32_t *vertices, uint64_t count,
                                   uint8_t *out, ebpo_error *error)
{
    bool by_face = *colours->element == 'f';
    ebpo_status status =
        ebpo_pick_attributes(chunks, colours->arrays, colours->element, by_face ? faces : vertices,
                             by_face ? count : 3 * count, 1, error);
    for (uint64_t i = 0; i < 3 * count && status == EBPO_OK; i++)
        for (int k = 0; k < 3; k++)
            out[3 * i + (unsigned)k] = ebpo_colour_byte(&colours->column[k], by_face ? i / 3 : i);
    return status;
}
