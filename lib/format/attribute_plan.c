/* Attributes on their way into a file: what is checked, how they are coded, and their head. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/sha256.h"
#include "core/text.h"
#include "hdf5_read/coding.h"
#include "format/attribute_digest.h"
#include "format/schema.h"
#include "format/attribute_plan.h"
#include "format/chunk_rows.h"

/* --- checking --- */

static const char *check_rows(const ebpo_info *info, const ebpo_attributes *all, uint64_t i)
{
    const ebpo_attribute *a = &all->array[i];
    bool vertex = ebpo_attribute_is_of(a, "vertex"), face = ebpo_attribute_is_of(a, "face");
    if (a->rows == 0 ||
        ((vertex || face) && a->rows != (vertex ? info->vertex_count : info->face_count)))
        return "an array of attributes has not as many rows as the mesh";
    for (uint64_t k = 0; k < i; k++)
        if (strcmp(all->array[k].element, a->element) == 0 && all->array[k].rows != a->rows)
            return "two arrays of attributes of one element have different numbers of rows";
    if (!a->ends && !a->values)
        return "an array of attributes has no values";
    return NULL;
}

static const char *check_names(const ebpo_attribute *a)
{
    uint32_t words = 1;
    for (const char *s = a->names; *s; s++)
        words += *s == ' ';
    if (!a->element[0] || strchr(a->element, ' ') || !a->names[0] || !ebpo_text_ok(a->element) ||
        !ebpo_text_ok(a->names) || a->columns < 1 || a->columns > EBPO_ATTRIBUTE_COLUMNS ||
        words != (a->list == EBPO_ATTRIBUTE_NO_LIST ? a->columns : 1))
        return "an array of attributes has no name, or not one for each column";
    return NULL;
}

/* --- codings: what makes the smaller chunks of a few --- */

enum { SAMPLES = 8, SAMPLE_BYTES = 16384 };

static uint64_t sample_bytes(ebpo_chunk_coder *coder, const uint8_t *values, size_t size,
                             bool floats, uint64_t rows, uint32_t cols, bool columns)
{
    uint8_t raw[SAMPLE_BYTES], stored[2 * SAMPLE_BYTES];
    size_t bytes = 0;
    if (columns)
        ebpo_columns_encode(values, size, floats, rows, cols, raw);
    else
        ebpo_integers_encode(values, size, rows * cols, size, raw);
    return ebpo_chunk_encode(coder, EBPO_PIPELINE_ZSTD, 3, (uint8_t)size, raw, rows * cols * size,
                             stored, &bytes) == EBPO_OK
               ? bytes
               : 0;
}

static bool columns_are_less(ebpo_chunk_coder *coder, const uint8_t *values, size_t size,
                             bool floats, uint64_t rows, uint32_t cols)
{
    uint64_t row_bytes = size * cols, here = SAMPLE_BYTES / row_bytes, plain = 0, columns = 0;
    if (here > rows)
        here = rows;
    for (uint64_t i = 0; i < SAMPLES; i++) {
        const uint8_t *at = values + (rows - here) / SAMPLES * i * row_bytes;
        plain += sample_bytes(coder, at, size, floats, here, cols, false);
        columns += sample_bytes(coder, at, size, floats, here, cols, true);
    }
    return columns < plain;
}

static void choose_codings(ebpo_attribute_plan *to, const ebpo_attribute *a,
                           ebpo_chunk_coder *coder)
{
    bool floats = ebpo_attribute_is_float(a->type);
    unsigned bytes = ebpo_attribute_bytes(a->type);
    uint64_t count = ebpo_attribute_value_count(a);
    to->columns = a->ends || columns_are_less(coder, a->values, bytes, floats, a->rows, a->columns);
    to->items_columns =
        a->ends && count && columns_are_less(coder, a->values, bytes, floats, count, 1);
}

ebpo_status ebpo_attributes_plan(ebpo_plan *plan, const char *shown, ebpo_error *error)
{
    const ebpo_attributes *all = plan->attributes;
    if (!all)
        return EBPO_OK;
    plan->attribute = ebpo_alloc_zero(all->count, sizeof *plan->attribute);
    ebpo_chunk_coder *coder = ebpo_alloc_zero(1, sizeof *coder);
    const char *wrong = NULL;
    for (uint64_t i = 0; i < all->count && plan->attribute && coder && !wrong; i++) {
        ebpo_attribute_plan *to = &plan->attribute[i];
        wrong = check_rows(&plan->info, all, i);
        if (!wrong)
            wrong = check_names(&all->array[i]);
        if (wrong)
            break;
        choose_codings(to, &all->array[i], coder);
        to->has_range = !ebpo_attribute_is_of_textures(&all->array[i]) &&
                        ebpo_attribute_range(&all->array[i], all->workspace, to->range);
    }
    bool made = plan->attribute && coder;
    if (coder)
        ebpo_chunk_coder_clear(coder);
    free(coder);
    if (!made)
        return ebpo_fail_memory(error, all->count * sizeof *plan->attribute);
    if (wrong)
        return ebpo_fail_at(error, EBPO_E_ARGUMENT, shown, "/attributes", -1,
                            "%s; the tree was not written", wrong);
    return ebpo_attributes_digest(all, plan->attributes_sha256, error);
}

/* --- arrays --- */

uint64_t ebpo_attributes_planned(const ebpo_plan *plan)
{
    return plan->attributes ? 1 + 2 * plan->attributes->count : 0;
}

static void add_attribute_array(ebpo_plan *plan, int number, const void *values, uint64_t rows, uint32_t cols,
                unsigned size, ebpo_pipeline pipeline)
{
    ebpo_array_out *a = &plan->array[plan->count++];
    *a = (ebpo_array_out){ .id = EBPO_A_ATTRIBUTE,
                           .level = number,
                           .handle = -1,
                           .values = values,
                           .value_size = (uint8_t)size,
                           .rows_of = EBPO_A_ATTRIBUTE };
    ebpo_attribute_path(number, a->path);
    a->shape = (ebpo_shape){
        .rows = rows, .cols = cols, .element_size = (uint8_t)size, .pipeline = pipeline
    };
    a->shape.chunk_rows = ebpo_rows_of_chunk(&plan->info, EBPO_A_ATTRIBUTE, 0, rows, cols, size);
}

static void add_one(ebpo_plan *plan, uint64_t n, ebpo_pipeline pipeline)
{
    const ebpo_attribute *a = &plan->attributes->array[n];
    unsigned bytes = ebpo_attribute_bytes(a->type);
    uint64_t items = a->ends ? ebpo_attribute_value_count(a) : 0;
    bool flat = a->ends || (a->columns == 1 && a->list == EBPO_ATTRIBUTE_NO_LIST);
    if (a->ends)
        add_attribute_array(plan, ebpo_values_number(n), a->ends, a->rows, 0, sizeof *a->ends, pipeline);
    else
        add_attribute_array(plan, ebpo_values_number(n), a->values, a->rows, flat ? 0 : a->columns, bytes,
            pipeline);
    ebpo_array_out *made = &plan->array[plan->count - 1];
    made->columns = plan->attribute[n].columns;
    if (ebpo_attribute_is_of_mesh(a))
        made->rows_of = ebpo_attribute_is_of(a, "vertex") ? EBPO_A_VERTICES : EBPO_A_FACES;
    if (!items)
        return;
    add_attribute_array(plan, ebpo_items_number(n), a->values, items, 0, bytes, pipeline);
    plan->array[plan->count - 1].columns = plan->attribute[n].items_columns;
}

void ebpo_attributes_add_arrays(ebpo_plan *plan, ebpo_pipeline pipeline)
{
    const ebpo_attributes *all = plan->attributes;
    if (!all)
        return;
    if (all->header)
        add_attribute_array(plan, 0, all->header, all->header_bytes, 0, 1, pipeline);
    for (uint64_t i = 0; i < all->count; i++)
        add_one(plan, i, pipeline);
}

static bool floats_in(const ebpo_plan *plan, const ebpo_array_out *array)
{
    const ebpo_attribute *a = &plan->attributes->array[(array->level - 1) / 2];
    bool ends = array->level % 2 && a->ends;
    return !ends && ebpo_attribute_is_float(a->type);
}

void ebpo_attributes_encode(const ebpo_plan *plan, const ebpo_array_out *array, uint64_t row,
                            uint64_t rows, uint8_t *file)
{
    uint32_t cols = array->shape.cols ? array->shape.cols : 1;
    const uint8_t *values = array->values;
    values += row * cols * array->value_size;
    if (array->columns)
        ebpo_columns_encode(values, array->value_size, floats_in(plan, array), rows, cols, file);
    else
        ebpo_integers_encode(values, array->value_size, rows * cols, array->value_size, file);
}

/* --- heads --- */

ebpo_status ebpo_attributes_put_group(ebpo_h5_out *out, const ebpo_plan *plan, ebpo_error *error)
{
    unsigned links = 0;
    char hex[65];
    ebpo_h5_id id;
    if (!plan->attributes)
        return EBPO_OK;
    for (unsigned i = 0; i < plan->count; i++)
        links += plan->array[i].id == EBPO_A_ATTRIBUTE;
    ebpo_status status = ebpo_h5_make_group(out, "/attributes", links, &id, error);
    ebpo_sha256_hex(plan->attributes_sha256, hex);
    if (status == EBPO_OK)
        status = ebpo_h5_put_count(out, id, "arrays", plan->attributes->count, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_text(out, id, "sha256", hex, error);
    ebpo_h5_close_id(out, id);
    return status;
}

static ebpo_status put_list(ebpo_h5_out *out, ebpo_h5_id id, const ebpo_attribute *a,
                            ebpo_error *error)
{
    if (a->list == EBPO_ATTRIBUTE_NO_LIST)
        return EBPO_OK;
    ebpo_status status =
        ebpo_h5_put_text(out, id, "list", ebpo_attribute_type_name((ebpo_attribute_type)a->list),
                         error);
    return status == EBPO_OK ? ebpo_h5_put_count(out, id, "different", a->ends != NULL, error)
                             : status;
}

ebpo_status ebpo_attributes_put_array(ebpo_h5_out *out, const ebpo_plan *plan,
                                      const ebpo_array_out *array, ebpo_error *error)
{
    ebpo_status status =
        ebpo_h5_put_text(out, array->handle, "coding",
                         array->columns ? ebpo_coding_columns : ebpo_coding_plain, error);
    if (array->level % 2 == 0)
        return status;
    uint64_t n = (uint64_t)(array->level - 1) / 2;
    const ebpo_attribute *a = &plan->attributes->array[n];
    if (status == EBPO_OK)
        status = ebpo_h5_put_text(out, array->handle, "element", a->element, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_text(out, array->handle, "names", a->names, error);
    if (status == EBPO_OK)
        status =
            ebpo_h5_put_text(out, array->handle, "type", ebpo_attribute_type_name(a->type), error);
    if (status == EBPO_OK)
        status = put_list(out, array->handle, a, error);
    if (status == EBPO_OK && plan->attribute[n].has_range)
        status = ebpo_h5_put_real(out, array->handle, "range", plan->attribute[n].range, 2, error);
    return status;
}
