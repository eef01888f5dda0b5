/* Reading attributes: whole arrays, and whether they are what the checksum says. */
#include <stdlib.h>
#include <string.h>

#include "mesh/textures.h"
#include "core/alloc.h"
#include "core/arrays.h"
#include "core/error.h"
#include "core/sized.h"
#include "core/sums.h"
#include "hdf5_read/coding.h"
#include "format/content_checksum.h"
#include "format/schema.h"
#include "format/attribute_read.h"
#include "format/reader.h"

static bool floats_in(const ebpo_file *file, const ebpo_array_in *array)
{
    if (array->level == 0)
        return false;
    const ebpo_attribute_in *of = &file->attributes.head[(array->level - 1) / 2];
    bool ends = array->level % 2 && of->different;
    return !ends && ebpo_attribute_is_float(of->head.type);
}

void ebpo_attribute_decode(const ebpo_file *file, const ebpo_array_in *array, uint64_t rows,
                           const uint8_t *raw, void *values)
{
    unsigned size = array->shape.element_size;
    uint32_t cols = array->shape.cols ? array->shape.cols : 1;
    if (array->coding == ebpo_coding_columns)
        ebpo_columns_decode(raw, size, floats_in(file, array), rows, cols, values);
    else
        ebpo_integers_decode(raw, size, false, rows * cols, values, size);
}

typedef struct target {
    const ebpo_file *file;
    uint8_t *values;
} target;

static ebpo_status take_attribute_rows(void *context, const ebpo_array_in *array, uint64_t chunk, uint64_t row,
                        uint64_t rows, const uint8_t *bytes, ebpo_error *error)
{
    const target *t = context;
    (void)chunk, (void)error;
    ebpo_attribute_decode(t->file, array, rows, bytes,
                          t->values + row * ebpo_shape_row_bytes(&array->shape));
    return EBPO_OK;
}

/* Into new memory; NULL: the array is absent. */
static ebpo_status read_array(const ebpo_file *file, int number, const ebpo_read_options *read,
                              uint8_t **values, ebpo_error *error)
{
    const ebpo_array_in *array = &file->attributes.array[number];
    *values = NULL;
    if (!array->present)
        return EBPO_OK;
    uint64_t bytes = array->shape.rows * ebpo_shape_row_bytes(&array->shape);
    *values = ebpo_array_alloc(read->workspace, bytes, 1);
    if (!*values)
        return ebpo_workspace_fail(read->workspace, bytes, error);
    target t = { file, *values };
    return ebpo_reader_rows(file, array, read, take_attribute_rows, &t, error);
}

static ebpo_status check_ends(const ebpo_file *file, uint64_t n, const ebpo_attribute *a,
                              ebpo_workspace *workspace, ebpo_error *error)
{
    const ebpo_array_in *items = &file->attributes.array[ebpo_items_number(n)],
                        *ends = &file->attributes.array[ebpo_values_number(n)];
    uint64_t before = 0;
    bool good = true;
    EBPO_FOR_ITEMS(workspace, i, 0, a->rows) {
        good = good && a->ends[i] >= before;
        before = a->ends[i];
    }
    ebpo_check check = ebpo_reader_check(file, NULL);
    return good && before == (items->present ? items->shape.rows : 0)
               ? EBPO_OK
               : ebpo_check_fail(&check, -1, ends->path,
                                 "the lists do not end where their items do", error);
}

static ebpo_status read_parts(const ebpo_file *file, uint64_t n, const ebpo_read_options *read,
                              bool ends_only, ebpo_attribute *a, ebpo_error *error)
{
    uint8_t *values;
    if (ends_only && !file->attributes.head[n].different)
        return EBPO_OK;
    ebpo_status status = read_array(file, ebpo_values_number(n), read, &values, error);
    if (!file->attributes.head[n].different) {
        a->values = values;
        return status;
    }
    a->ends = (uint64_t *)(void *)values;
    if (status == EBPO_OK)
        status = check_ends(file, n, a, read->workspace, error);
    return status == EBPO_OK && !ends_only
               ? read_array(file, ebpo_items_number(n), read, &a->values, error)
               : status;
}

static ebpo_status read_one(const ebpo_file *file, uint64_t n, const ebpo_read_options *read,
                            ebpo_attribute *a, ebpo_error *error)
{
    return read_parts(file, n, read, false, a, error);
}

static ebpo_status read_header(const ebpo_file *file, ebpo_attributes *to, ebpo_error *error)
{
    const ebpo_array_in *array = &file->attributes.array[0];
    if (!array->present)
        return EBPO_OK;
    to->header_bytes = array->shape.rows;
    to->header = ebpo_alloc(to->header_bytes, 1);
    if (!to->header)
        return ebpo_fail_memory(error, to->header_bytes);
    target t = { file, (uint8_t *)to->header };
    ebpo_read_options read = ebpo_read_threads(1);
    return ebpo_reader_rows(file, array, &read, take_attribute_rows, &t, error);
}

ebpo_status ebpo_attributes_read_head(const ebpo_file *file, const ebpo_read_options *read,
                                      ebpo_attributes **out, ebpo_error *error)
{
    *out = NULL;
    if (!(file->info.parts & EBPO_PART_ATTRIBUTES))
        return EBPO_OK;
    ebpo_attributes *made = ebpo_attributes_make(read->workspace);
    ebpo_status status =
        made ? read_header(file, made, error) : ebpo_fail_memory(error, sizeof *made);
    for (uint64_t n = 0; n < file->attributes.count && status == EBPO_OK; n++)
        if (!ebpo_attributes_add(made, &file->attributes.head[n].head))
            status = ebpo_fail_memory(error, sizeof *made->array);
    if (status == EBPO_OK)
        *out = made;
    else
        ebpo_attributes_free(made);
    return status;
}

ebpo_status ebpo_attributes_read(const ebpo_file *file, const ebpo_read_options *read,
                                 ebpo_attributes **out, ebpo_error *error)
{
    ebpo_attributes *made;
    ebpo_status status = ebpo_attributes_read_head(file, read, &made, error);
    *out = NULL;
    for (uint64_t n = 0; made && n < made->count && status == EBPO_OK; n++)
        status = read_one(file, n, read, &made->array[n], error);
    if (status == EBPO_OK)
        *out = made;
    else
        ebpo_attributes_free(made);
    return status;
}

static ebpo_status fail_images(const ebpo_file *file, ebpo_error *error)
{
    return ebpo_fail_at(error, EBPO_E_FORMAT, file->in.shown, "/attributes", -1,
                        "an image is not what its digest says; get a fresh copy");
}

ebpo_status ebpo_attributes_read_textures(const ebpo_file *file, const ebpo_read_options *read,
                                          ebpo_attributes *to, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t n = 0; to && n < to->count && status == EBPO_OK; n++)
        if (ebpo_attribute_is_of_textures(&to->array[n]))
            status = read_one(file, n, read, &to->array[n], error);
    return status;
}

void ebpo_attribute_values_free(ebpo_attribute_values *values)
{
    if (!values)
        return;
    ebpo_array_free(values->workspace, values->values);
    ebpo_array_free(values->workspace, values->ends);
    memset(values, 0, sizeof *values);
}

static ebpo_status check_images(const ebpo_file *file, const ebpo_read_options *read,
                                ebpo_error *error)
{
    ebpo_attributes *all;
    ebpo_status status = ebpo_attributes_read_head(file, read, &all, error);
    if (status == EBPO_OK)
        status = ebpo_attributes_read_textures(file, read, all, error);
    if (status == EBPO_OK && !ebpo_textures_good(all))
        status = fail_images(file, error);
    ebpo_attributes_free(all);
    return status;
}

static ebpo_status read_public(const ebpo_file *file, unsigned n, const ebpo_read_options *options,
                               bool ends_only, ebpo_attribute_values *out, ebpo_error *error)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_read_options, &read, options, error);
    memset(out, 0, sizeof *out);
    if (status == EBPO_OK && n >= file->attributes.count)
        status = ebpo_fail_file(error, EBPO_E_ABSENT, file->in.shown,
                                "the file has no array of attributes number %u", n);
    if (status != EBPO_OK)
        return status;
    ebpo_attribute a = file->attributes.head[n].head;
    if (!ends_only && ebpo_attribute_is_of_textures(&a) &&
        strcmp(a.names, ebpo_texture_array_name(EBPO_TEXTURE_BYTES)) == 0)
        status = check_images(file, &read, error);
    if (status == EBPO_OK)
        status = read_parts(file, n, &read, ends_only, &a, error);
    *out = (ebpo_attribute_values){ a.values, a.ends, 0, read.workspace };
    if (status == EBPO_OK)
        out->count = ebpo_attribute_value_count(&a);
    else
        ebpo_attribute_values_free(out);
    return status;
}

ebpo_status ebpo_file_read_attribute(const ebpo_file *file, unsigned n,
                                     const ebpo_read_options *options, ebpo_attribute_values *out,
                                     ebpo_error *error)
{
    return read_public(file, n, options, false, out, error);
}

ebpo_status ebpo_file_attribute_ends(const ebpo_file *file, unsigned n,
                                     const ebpo_read_options *options, ebpo_attribute_values *out,
                                     ebpo_error *error)
{
    return read_public(file, n, options, true, out, error);
}

/* All of one array's values at a time would do, but whole parts are small beside the mesh. */
ebpo_status ebpo_attributes_check(const ebpo_file *file, const ebpo_read_options *read,
                                  ebpo_error *error)
{
    uint8_t digest[32];
    ebpo_attributes *all;
    ebpo_status status = ebpo_attributes_read(file, read, &all, error);
    if (status != EBPO_OK || !all)
        return status;
    status = ebpo_attributes_digest(all, digest, error);
    bool textures = ebpo_textures_good(all);
    ebpo_attributes_free(all);
    if (status == EBPO_OK && ebpo_digest_differs(file->attributes.sha256, digest))
        status = ebpo_fail_at(error, EBPO_E_FORMAT, file->in.shown, "/attributes", -1,
                              "the attributes are not what sha256 says: the file was changed; get "
                              "a fresh copy");
    if (status == EBPO_OK && !textures)
        status = fail_images(file, error);
    return status;
}
