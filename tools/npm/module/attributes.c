/* Reads attributes of the source, samples of attributes, maps, and corners of faces, for the
 * WebAssembly module. */
#include <stdlib.h>
#include <string.h>

#include "core/error.h"
#include "format/pick_rows.h"
#include "format/reader.h"
#include "mesh/attributes.h"
#include "module.h"

/* Gets array n of the file's attributes. Result array 0: values in the type of the array and the
 * order of the file; empty if `values` is 0. Result array 1: if the rows are lists of different
 * lengths, the end of each list, doubles; otherwise empty. */
int EBPO_JS(ebpo_js_attribute)(ebpo_js_object *object, uint32_t n, int values)
{
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    ebpo_attribute_facts facts = EBPO_ATTRIBUTE_FACTS_INIT;
    ebpo_attribute_values out = { 0 };
    options.threads = 1;
    ebpo_js_clear(object);
    ebpo_status status =
        values ? ebpo_file_read_attribute(object->file, n, &options, &out, &object->error)
               : ebpo_file_attribute_ends(object->file, n, &options, &out, &object->error);
    if (status == EBPO_OK && ebpo_file_attribute(object->file, n, &facts) && out.values)
        status =
            ebpo_js_put(object, 0, out.values,
                        (size_t)out.count * ebpo_attribute_bytes((ebpo_attribute_type)facts.type));
    double *ends =
        status == EBPO_OK && out.ends ? ebpo_js_extend(object, 1, facts.rows, sizeof *ends) : NULL;
    if (status == EBPO_OK && out.ends && !ends)
        status = EBPO_E_MEMORY;
    for (uint64_t i = 0; ends && i < facts.rows; i++)
        ends[i] = (double)out.ends[i];
    ebpo_attribute_values_free(&out);
    return status;
}

/* Gets the source indices, uint32. Result array 0: of vertices. Result array 1: of faces. */
int EBPO_JS(ebpo_js_maps)(ebpo_js_object *object)
{
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    const ebpo_info *info = ebpo_file_info(object->file);
    ebpo_maps maps = { 0 };
    options.threads = 1;
    ebpo_js_clear(object);
    ebpo_status status = ebpo_file_read_maps(object->file, &options, &maps, &object->error);
    if (status == EBPO_OK)
        status = ebpo_js_put(object, 0, maps.vertex_source, (size_t)info->vertex_count * 4);
    if (status == EBPO_OK)
        status = ebpo_js_put(object, 1, maps.face_source, (size_t)info->face_count * 4);
    ebpo_maps_free(&maps);
    return status;
}

/* Makes the sampler of a query object, unless it exists. */
int EBPO_JS(ebpo_js_sampler)(ebpo_js_object *object, const char *names)
{
    return object->sampler
               ? EBPO_OK
               : ebpo_sampler_new(object->file, names, 1, &object->sampler, &object->error);
}

/* Samples attributes at points. Result array 0: the value of each attribute for each point,
 * doubles. `points`: [count][3]. `faces`: [count] index of the face of each point; below 0: no
 * face. */
int EBPO_JS(ebpo_js_sample)(ebpo_js_object *object, const double *points, const double *faces,
                            uint32_t count)
{
    uint64_t *indices = malloc((count + (size_t)1) * sizeof *indices);
    ebpo_js_clear(object);
    double *out =
        ebpo_js_extend(object, 0, (uint64_t)count * ebpo_sampler_columns(object->sampler), 8);
    ebpo_status status = indices && out ? EBPO_OK : EBPO_E_MEMORY;
    for (uint32_t i = 0; i < count && status == EBPO_OK; i++)
        indices[i] = faces[i] >= 0 ? (uint64_t)faces[i] : EBPO_NO_FACE;
    if (status == EBPO_OK)
        status = ebpo_sample(object->sampler, points, indices, count, out, &object->error);
    free(indices);
    return status;
}

/* Gets the corners of faces. Result array 0: [count][3][3] coordinates, floats or doubles as in the
 * file. `faces`: [count] indices of the faces in the file. */
int EBPO_JS(ebpo_js_corners)(ebpo_js_object *object, const double *faces, uint32_t count)
{
    enum { CORNERS, NUMBERS, ROWS, CACHE = 16 << 20 };
    const ebpo_info *info = ebpo_file_info(object->file);
    ebpo_js_clear(object);
    ebpo_status status = ebpo_js_need_mesh(object);
    if (status != EBPO_OK)
        return status;
    uint32_t *numbers = ebpo_js_extend(object, NUMBERS, count, sizeof *numbers);
    uint32_t *rows = ebpo_js_extend(object, ROWS, count, 3 * sizeof *rows);
    void *corners =
        ebpo_js_extend(object, CORNERS, 3 * (uint64_t)count, info->double_coordinates ? 24 : 12);
    if (!numbers || !rows || !corners)
        return EBPO_E_MEMORY;
    for (uint32_t i = 0; i < count; i++)
        if (faces[i] < (double)info->face_count)
            numbers[i] = (uint32_t)faces[i];
        else
            return ebpo_fail(&object->error, EBPO_E_ARGUMENT,
                             "the file has %llu faces, not a face %.0f",
                             (unsigned long long)info->face_count, faces[i]);
    if (!object->chunks)
        object->chunk_memory = CACHE;
    status = ebpo_js_need_chunks(object);
    if (status != EBPO_OK || !count)
        return status;
    ebpo_hints hints = EBPO_HINTS_INIT(object->chunks->file);
    ebpo_faces_hint(object->chunks, &hints, numbers, count, 0);
    ebpo_hint_all(&hints);
    status = ebpo_pick_rows(object->chunks, EBPO_A_FACES, numbers, count, 1, rows, &object->error);
    return status == EBPO_OK ? ebpo_pick_rows(object->chunks, EBPO_A_VERTICES, rows,
                                              3 * (uint64_t)count, 1, corners, &object->error)
                             : status;
}
