/* Arrays: their shape, held to what the format fixes, and where their chunks are. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "hdf5_read/chunk_index.h"
#include "hdf5_read/head_types.h"

enum {
    COLS_MOST = 160,
    FILTER_DEFLATE = 1,
    FILTER_SHUFFLE = 2,
    FILTER_FLETCHER = 3,
    FILTER_ZSTD = 32015
};

/* Number of filters; shuffle must have been set for our elements. -1 when it is not. */
static int list_filters(const ebpo_head_filters *f, unsigned element_size)
{
    if (f->count > EBPO_HEAD_FILTERS)
        return -1;
    for (unsigned i = 0; i < f->count; i++)
        if (f->filter[i].id == FILTER_SHUFFLE &&
            (f->filter[i].values != 1 || f->filter[i].first != element_size))
            return -1;
    return (int)f->count;
}

/* Shuffled elements of one byte are what they were: h5repack shuffles all arrays alike. */
static bool find_pipeline(const ebpo_head_filters *f, unsigned element_size,
                          ebpo_pipeline *pipeline)
{
    static const struct {
        ebpo_pipeline pipeline;
        int count;
        unsigned ids[2];
        bool shuffled;
    } known[] = {
        { EBPO_PIPELINE_ZSTD, 1, { FILTER_ZSTD }, true },
        { EBPO_PIPELINE_DEFLATE, 2, { FILTER_DEFLATE, FILTER_FLETCHER }, true },
        { EBPO_PIPELINE_CHECKSUM, 1, { FILTER_FLETCHER }, false },
        { EBPO_PIPELINE_BARE, 0, { 0 }, false },
    };
    int count = list_filters(f, element_size);
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        bool first = count > 0 && f->filter[0].id == FILTER_SHUFFLE;
        int shuffles = known[i].shuffled && (element_size > 1 || first);
        if (count != known[i].count + shuffles || (shuffles && !first))
            continue;
        bool same = true;
        for (int k = 0; k < known[i].count; k++)
            same = same && f->filter[shuffles + k].id == known[i].ids[k];
        if (same) {
            *pipeline = known[i].pipeline;
            return true;
        }
    }
    return false;
}

/* Chunks of 4 GiB and more are none of HDF5's. */
static bool rows_fit(const ebpo_shape *shape, ebpo_head_rows rule, uint64_t rows)
{
    uint64_t full = ebpo_full_chunk_rows(shape->rows, shape->cols, shape->element_size);
    if (rule == EBPO_HEAD_ROWS_ALL)
        return rows == shape->rows && rows <= UINT32_MAX / ebpo_shape_row_bytes(shape);
    bool power = rows && !(rows & (rows - 1));
    return rows == full || (rule == EBPO_HEAD_ROWS_POWER && power && rows < full);
}

/* The one message of a type; NULL, with *wrong saying why if it is not merely absent. */
static const ebpo_head_message *find_one(const ebpo_head_header *h, uint8_t type,
                                         ebpo_head_refusal *wrong)
{
    enum { SHARED = 2 };
    const ebpo_head_message *found = NULL;
    for (uint64_t i = 0; i < h->count; i++) {
        if (h->message[i].type != type)
            continue;
        if (found)
            *wrong = (ebpo_head_refusal){ "its description says something twice", false };
        if (h->message[i].flags & SHARED)
            *wrong = (ebpo_head_refusal){ "its description is shared with another object", true };
        found = &h->message[i];
    }
    return wrong->what ? NULL : found;
}

static ebpo_head_refusal refused(const char *what) { return (ebpo_head_refusal){ what, false }; }

/* Not damaged, but rewritten by another program. */
static ebpo_head_refusal foreign(const char *what) { return (ebpo_head_refusal){ what, true }; }

static ebpo_head_refusal read_shape(const ebpo_head_header *h, ebpo_shape *shape)
{
    ebpo_head_refusal wrong = { NULL, false };
    const ebpo_head_message *type_message = find_one(h, EBPO_M_DATATYPE, &wrong),
                            *space_message = find_one(h, EBPO_M_DATASPACE, &wrong);
    if (!type_message || !space_message)
        return wrong;
    ebpo_head_type type = ebpo_head_read_type(ebpo_head_message_cursor(h, type_message));
    ebpo_head_space space = ebpo_head_read_space(ebpo_head_message_cursor(h, space_message));
    bool grows = space.rank <= 2 && !space.fixed;
    if (type.class == EBPO_CLASS_OTHER_INTEGER || grows)
        return foreign(grows ? "the array does not have fixed dimensions"
                             : "the array is not of little-endian integers");
    if (type.class != EBPO_CLASS_INTEGER ||
        (type.size != 1 && type.size != 2 && type.size != 4 && type.size != 8))
        return refused("the array is not of little-endian integers");
    if (space.rank < 1 || space.rank > 2 || !space.fixed || space.size[0] == 0 ||
        (space.rank == 2 && (space.size[1] == 0 || space.size[1] > COLS_MOST)))
        return refused("the array does not have one or two fixed dimensions");
    shape->element_size = (uint8_t)type.size;
    shape->is_signed = type.is_signed;
    shape->rows = space.size[0];
    shape->cols = space.rank == 2 ? (uint32_t)space.size[1] : 0;
    return wrong;
}

static ebpo_head_refusal read_storage(const ebpo_head_header *h, ebpo_head_rows rule,
                                      ebpo_shape *shape, ebpo_head_layout *layout)
{
    ebpo_head_refusal wrong = { NULL, false };
    ebpo_head_filters filters = { .count = 0 };
    const ebpo_head_message *external = find_one(h, EBPO_M_EXTERNAL, &wrong),
                            *layout_message = find_one(h, EBPO_M_LAYOUT, &wrong),
                            *filter_message = find_one(h, EBPO_M_PIPELINE, &wrong);
    if (external)
        return refused("the array's values lie in another file (external storage), which is never "
                       "looked for");
    if (!layout_message)
        return wrong;
    wrong.what =
        ebpo_head_read_layout(ebpo_head_message_cursor(h, layout_message), layout, &wrong.foreign);
    if (wrong.what)
        return wrong;
    bool whole = layout->rank == (shape->cols ? 2 : 1) &&
                 layout->chunk[layout->rank] == shape->element_size &&
                 (!shape->cols || layout->chunk[1] == shape->cols);
    if (!whole || !rows_fit(shape, rule, layout->chunk[0]))
        return foreign("the array's chunks do not have the size that the format fixes");
    shape->chunk_rows = (uint32_t)layout->chunk[0];
    if (filter_message)
        filters = ebpo_head_read_filters(ebpo_head_message_cursor(h, filter_message));
    if (!find_pipeline(&filters, shape->element_size, &shape->pipeline))
        return foreign("the array's filters are none of the format's");
    return wrong;
}

/* A chunk takes some bytes, so a file cannot hold more of them than its size allows. */
static ebpo_status find_chunks(ebpo_head *head, const char *path, const ebpo_shape *shape,
                               const ebpo_head_layout *layout, ebpo_chunk_place **places,
                               uint64_t *stored, ebpo_error *error)
{
    enum { CHUNK_MIN = 4 };
    char place[160];
    ebpo_head_chunks t = { .layout = layout,
                           .filtered = shape->pipeline != EBPO_PIPELINE_BARE,
                           .count = ebpo_shape_chunks(shape),
                           .whole = shape->chunk_rows * ebpo_shape_row_bytes(shape) };
    t.bound = ebpo_chunk_bound((size_t)t.whole);
    if (t.count > 1 && t.count > head->file_bytes / CHUNK_MIN)
        return ebpo_fail_at(error, EBPO_E_FORMAT, head->shown, path, -1,
                            "the array has more chunks than the file can hold");
    t.place = *places = ebpo_alloc(t.count, sizeof **places);
    if (!t.place)
        return ebpo_fail_memory(error, t.count * sizeof **places);
    const char *wrong = ebpo_head_read_chunks(head->state, &t);
    *stored = t.stored;
    if (!wrong)
        return EBPO_OK;
    snprintf(place, sizeof place, "%s: chunk %" PRIu64, path, t.at);
    head->state->refusal = (ebpo_head_refusal){ NULL, false };
    return ebpo_head_fail(head, t.at == UINT64_MAX ? path : place, wrong, error);
}

static ebpo_status read_array(ebpo_head *head, const char *path, uint64_t most, ebpo_head_rows rows,
                              ebpo_shape *shape, char *coding, ebpo_chunk_place **chunks,
                              uint64_t *stored_bytes, ebpo_error *error)
{
    ebpo_head_object object;
    ebpo_head_layout layout = { .rank = 0 };
    ebpo_head_kind kind = ebpo_head_find(head->state, path, &object);
    if (kind != EBPO_HEAD_ARRAY && head->state->refusal.what)
        return ebpo_head_fail(head, path, "the array's description is damaged", error);
    if (kind != EBPO_HEAD_ARRAY)
        return ebpo_head_fail(head, path,
                              kind == EBPO_HEAD_ABSENT
                                  ? "the array is missing; get a fresh copy of the file"
                                  : "this is not an array; get a fresh copy of the file",
                              error);
    const ebpo_head_header *h = ebpo_head_header_at(head->state, object);
    head->state->refusal = read_shape(h, shape);
    if (!head->state->refusal.what)
        head->state->refusal = read_storage(h, rows, shape, &layout);
    if (head->state->refusal.what)
        return ebpo_head_fail(head, path, "", error);
    ebpo_status status = EBPO_OK;
    if (coding)
        status =
            ebpo_head_get_text(head, object, path, "coding", coding, EBPO_HEAD_CODING_BYTES, error);
    if (status == EBPO_E_ABSENT)
        status = ebpo_fail_at(error, EBPO_E_FORMAT, head->shown, path, -1,
                              "attribute coding is missing; get a fresh copy of the file");
    if (status == EBPO_OK && ebpo_shape_chunks(shape) <= most)
        status = find_chunks(head, path, shape, &layout, chunks, stored_bytes, error);
    return status;
}

ebpo_status ebpo_head_read_array(ebpo_head *head, const char *path, uint64_t most,
                                 ebpo_head_rows rows, ebpo_shape *shape,
                                 char coding[EBPO_HEAD_CODING_BYTES], ebpo_chunk_place **chunks,
                                 uint64_t *stored_bytes, ebpo_error *error)
{
    *chunks = NULL;
    *stored_bytes = 0;
    ebpo_status status =
        read_array(head, path, most, rows, shape, coding, chunks, stored_bytes, error);
    if (status != EBPO_OK) {
        free(*chunks);
        *chunks = NULL;
    }
    return status;
}
