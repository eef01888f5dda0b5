/* Reads the descriptions of arrays: checks their shapes against the format, and finds their chunks.
 * HDF5 has several kinds of chunk index. This file reads three of them: a single chunk, an implicit
 * index, and a fixed array with pages. Each chunk must be within the file, and not larger than its
 * filters can make it. Source: HDF5 File Format Specification 3.0, sections IV.A.2.i and VII;
 * format-spec/hdf5-messages.md. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "hdf5_read/head_parts.h"

/* --- how an array is stored, and the table of its chunks --- */

typedef enum ebpo_head_index {
    EBPO_INDEX_SINGLE = 1, /* one chunk */
    EBPO_INDEX_IMPLICIT,   /* consecutive chunks without filters, which need no table */
    EBPO_INDEX_FIXED       /* a table of fixed size */
} ebpo_head_index;

/* How an array is stored, as its layout message states. */
typedef struct ebpo_head_layout {
    unsigned rank;     /* number of dimensions of the chunks */
    uint64_t chunk[3]; /* size of a chunk; the last number is the size of an element */
    ebpo_head_index index;
    unsigned page_bits;    /* FIXED: a page has 2^page_bits chunks */
    bool single_filtered;  /* SINGLE: the chunk has filters, and the next two members are set */
    uint64_t single_bytes; /* stored size of the chunk */
    uint32_t single_mask;  /* a bit for each filter that was not applied to the chunk */
    /* address of the chunk (SINGLE), of the first chunk (IMPLICIT) or of the table (FIXED);
     * EBPO_NO_ADDRESS: nothing was written */
    uint64_t address;
} ebpo_head_layout;

/* The chunks of an array, while they are located. Members marked "out" are results. */
typedef struct ebpo_head_chunks {
    const ebpo_head_layout *layout;
    bool filtered; /* the array has filters */
    /* count: number of chunks. whole: bytes of a chunk before its filters are applied. bound:
     * greatest size of a chunk after the filters */
    uint64_t count, whole, bound;
    uint64_t end;                   /* end of the file, in bytes */
    ebpo_chunk_location *locations; /* out: `count` offsets and sizes */
    uint64_t stored;                /* out: bytes of all chunks */
    uint64_t
        at; /* out: index of the invalid chunk; UINT64_MAX: the error is not in a single chunk */
} ebpo_head_chunks;

static const char missing[] = "the chunk is missing",
                  cut[] = "the object's header ends within a message",
                  contradicts[] = "the array's index contradicts its shape or its filters",
                  no_index[] = "no chunk index at the expected offset",
                  damaged[] = "the array's chunk index is damaged: the checksum differs",
                  beyond[] = "the array's chunk index is beyond the end of the file";

/* Reads the rest of a layout message of version 4 for an array in chunks, beginning with the flags.
 * Returns the same as read_layout. */
static const char *read_chunked(ebpo_head_cursor *c, ebpo_head_layout *l, bool *foreign)
{
    enum { SINGLE_FILTERED = 2 };
    unsigned flags = ebpo_cursor_u8(c), rank = ebpo_cursor_u8(c), bytes = ebpo_cursor_u8(c);
    if (c->cut)
        return cut;
    if (rank < 2 || rank > 3 || bytes < 1 || bytes > 8 || flags & ~(unsigned)SINGLE_FILTERED)
        return "the array's chunks do not have the size that the format requires";
    l->rank = rank - 1;
    for (unsigned i = 0; i < rank; i++)
        l->chunk[i] = ebpo_cursor_uint(c, bytes);
    unsigned index = ebpo_cursor_u8(c);
    l->single_filtered = index == EBPO_INDEX_SINGLE && flags & SINGLE_FILTERED;
    if (l->single_filtered) {
        l->single_bytes = ebpo_cursor_u64(c);
        l->single_mask = ebpo_cursor_u32(c);
    }
    if (index == EBPO_INDEX_FIXED)
        l->page_bits = ebpo_cursor_u8(c);
    if (index < EBPO_INDEX_SINGLE || index > EBPO_INDEX_FIXED) {
        *foreign = true;
        return "the array's chunks have an index for arrays that grow";
    }
    l->index = (ebpo_head_index)index;
    l->address = ebpo_cursor_u64(c);
    return c->cut ? cut : NULL;
}

/* Reads a layout message. Returns an error text, or NULL. On an error, *foreign is true if the
 * layout is valid, but only libhdf5 can read it. */
static const char *read_layout(ebpo_head_cursor c, ebpo_head_layout *l, bool *foreign)
{
    enum { CHUNKED = 2, VIRTUAL = 3 };
    unsigned version = ebpo_cursor_u8(&c), kind = ebpo_cursor_u8(&c);
    *l = (ebpo_head_layout){ .address = EBPO_NO_ADDRESS };
    *foreign = version < 3 || version > 4;
    if (version < 3 || version > 4)
        return "the array's layout has an unknown version";
    if (kind == VIRTUAL)
        return "the array is virtual: its values are in other arrays, which are never read";
    *foreign = kind != CHUNKED || version == 3;
    if (kind != CHUNKED)
        return "the array is not stored in chunks";
    if (version == 4)
        return read_chunked(&c, l, foreign);
    return "the array's chunks are listed in a tree without checksums";
}

/* Checks and stores the offset and size of chunk i. `mask`: a bit for each filter that was not
 * applied to the chunk. Like the functions read_... and check_... below, returns an error text or
 * NULL. */
static const char *store_offset(ebpo_head_chunks *t, uint64_t i, uint64_t address, uint64_t bytes,
                                uint32_t mask)
{
    t->at = i;
    if (address == EBPO_NO_ADDRESS || bytes == 0)
        return missing;
    if (mask != 0)
        return "the chunk was stored without its filters";
    if (bytes > t->bound)
        return "the chunk is larger than its filters allow";
    if (address > t->end || bytes > t->end - address)
        return "the chunk is beyond the end of the file";
    t->locations[i] = (ebpo_chunk_location){ address, (uint32_t)bytes, 0 };
    t->stored += bytes;
    t->at = UINT64_MAX;
    return t->stored > t->end ? "the array's chunks have more bytes than the file" : NULL;
}

static const char *read_single(ebpo_head_chunks *t)
{
    const ebpo_head_layout *l = t->layout;
    if (t->count != 1)
        return contradicts;
    if (l->address == EBPO_NO_ADDRESS) {
        t->at = 0;
        return missing;
    }
    if (t->filtered != l->single_filtered)
        return contradicts;
    return store_offset(t, 0, l->address, t->filtered ? l->single_bytes : t->whole, l->single_mask);
}

static const char *read_implicit(ebpo_head_chunks *t)
{
    const ebpo_head_layout *l = t->layout;
    const char *wrong = t->filtered ? contradicts : NULL;
    for (uint64_t i = 0; i < t->count && !wrong; i++) {
        uint64_t begin = EBPO_NO_ADDRESS; /* keeps this value if the sum exceeds 64 bits */
        if (l->address != EBPO_NO_ADDRESS && (__builtin_mul_overflow(i, t->whole, &begin) ||
                                              __builtin_add_overflow(begin, l->address, &begin)))
            begin = EBPO_NO_ADDRESS;
        wrong = store_offset(t, i, begin, t->whole, 0);
    }
    return wrong;
}

/* A fixed array: a header, then one block of pages. */
typedef struct fixed_array {
    uint64_t data;       /* address of the block */
    unsigned entry;      /* bytes of the entry of a chunk */
    unsigned size_bytes; /* bytes of the chunk's size in an entry; 0: entries have no size */
} fixed_array;

/* Reads the header of a fixed array. */
static const char *read_fixed_header(ebpo_head_state *s, const ebpo_head_chunks *t, fixed_array *f)
{
    enum { BYTES = 28, PAGE_BITS_MAX = 16, PLAIN_ENTRY = 8, FILTERED_MORE = 12 };
    const ebpo_head_layout *l = t->layout;
    const uint8_t *block = ebpo_head_bytes_at(&s->bytes, l->address, BYTES);
    if (!block)
        return beyond;
    if (memcmp(block, "FAHD", 4) != 0 || block[4] != 0)
        return no_index;
    if (!ebpo_head_sound(block, BYTES))
        return damaged;
    ebpo_head_note_range(s, l->address, BYTES);
    ebpo_head_cursor c = { block + 5, block + BYTES, false };
    unsigned client = ebpo_cursor_u8(&c), page_bits;
    f->entry = ebpo_cursor_u8(&c);
    page_bits = ebpo_cursor_u8(&c);
    uint64_t entries = ebpo_cursor_u64(&c);
    f->data = ebpo_cursor_u64(&c);
    f->size_bytes = t->filtered ? f->entry - FILTERED_MORE : 0;
    bool fits =
        t->filtered ? f->entry > FILTERED_MORE && f->size_bytes <= 8 : f->entry == PLAIN_ENTRY;
    return client == (unsigned)t->filtered && fits && entries == t->count &&
                   page_bits == l->page_bits && page_bits >= 1 && page_bits <= PAGE_BITS_MAX
               ? NULL
               : contradicts;
}

/* Reads the entries of `count` chunks from chunk `first` on. The entries follow `before` other
 * bytes, which begin at the address `at`. The checksum after the entries also covers these bytes.
 */
static const char *read_entries(ebpo_head_state *s, ebpo_head_chunks *t, const fixed_array *f,
                                uint64_t at, uint64_t before, uint64_t first, uint64_t count)
{
    uint64_t size = before + count * f->entry + 4;
    const uint8_t *block = ebpo_head_bytes_at(&s->bytes, at, size);
    if (!block)
        return beyond;
    if (!ebpo_head_sound(block, size))
        return damaged;
    ebpo_head_note_range(s, at, size);
    ebpo_head_cursor c = { block + before, block + size, false };
    const char *wrong = NULL;
    for (uint64_t i = 0; i < count && !wrong; i++) {
        uint64_t address = ebpo_cursor_u64(&c);
        uint64_t bytes = t->filtered ? ebpo_cursor_uint(&c, f->size_bytes) : t->whole;
        uint32_t mask = t->filtered ? ebpo_cursor_u32(&c) : 0;
        wrong = store_offset(t, first + i, address, bytes, mask);
    }
    return wrong;
}

/* Checks that all pages of a fixed array were written. The block has a bit for each page, which is
 * set if the page was written. `prefix`: size of the block up to the end of these bits. */
static const char *check_pages(ebpo_head_state *s, ebpo_head_chunks *t, const fixed_array *f,
                               uint64_t prefix, uint64_t pages)
{
    const uint8_t *block = ebpo_head_bytes_at(&s->bytes, f->data, prefix + 4);
    if (!block)
        return beyond;
    if (!ebpo_head_sound(block, prefix + 4))
        return damaged;
    ebpo_head_note_range(s, f->data, prefix + 4);
    for (uint64_t page = 0; page < pages; page++)
        if (!(block[14 + page / 8] >> (7 - page % 8) & 1)) {
            t->at = page << t->layout->page_bits;
            return missing;
        }
    return NULL;
}

static const char *read_fixed(ebpo_head_state *s, ebpo_head_chunks *t)
{
    enum { PREFIX = 14 }; /* bytes of the block before the bits of the pages */
    fixed_array f = { EBPO_NO_ADDRESS, 0, 0 };
    const char *wrong = NULL;
    if (t->layout->address != EBPO_NO_ADDRESS)
        wrong = read_fixed_header(s, t, &f);
    if (wrong)
        return wrong;
    if (f.data == EBPO_NO_ADDRESS) {
        t->at = 0;
        return missing;
    }
    const uint8_t *block = ebpo_head_bytes_at(&s->bytes, f.data, PREFIX);
    if (!block)
        return beyond;
    if (memcmp(block, "FADB", 4) != 0 || block[4] != 0 || block[5] != (unsigned)t->filtered ||
        ebpo_load64(block + 6) != t->layout->address)
        return no_index;
    uint64_t page = UINT64_C(1) << t->layout->page_bits;
    if (t->count <= page)
        return read_entries(s, t, &f, f.data, PREFIX, 0, t->count);
    uint64_t pages = (t->count - 1) / page + 1, prefix = PREFIX + (pages + 7) / 8;
    wrong = check_pages(s, t, &f, prefix, pages);
    uint64_t at = f.data + prefix + 4;
    for (uint64_t first = 0; first < t->count && !wrong; first += page) {
        uint64_t in_page = t->count - first < page ? t->count - first : page;
        wrong = read_entries(s, t, &f, at, 0, first, in_page);
        at += in_page * f.entry + 4;
    }
    return wrong;
}

/* Reads the locations of all chunks in one pass. Returns an error text, or NULL. */
static const char *read_chunk_table(ebpo_head_state *s, ebpo_head_chunks *t)
{
    t->stored = 0;
    t->at = UINT64_MAX;
    switch (t->layout->index) {
    case EBPO_INDEX_SINGLE: return read_single(t);
    case EBPO_INDEX_IMPLICIT: return read_implicit(t);
    case EBPO_INDEX_FIXED: return read_fixed(s, t);
    }
    return no_index;
}

/* --- the array --- */

enum { COLS_MAX = 160 }; /* maximum number of columns of an array */

/* Finds the pipeline of these filters. Returns false if the format does not allow them. The
 * parameter of the filter shuffle must be element_size. */
static bool find_pipeline(const ebpo_head_filters *f, unsigned element_size,
                          ebpo_pipeline *pipeline)
{
    unsigned ids[EBPO_HEAD_FILTERS];
    if (f->count > EBPO_HEAD_FILTERS)
        return false;
    for (unsigned i = 0; i < f->count; i++) {
        ids[i] = f->filter[i].id;
        if (ids[i] == EBPO_FILTER_SHUFFLE &&
            (f->filter[i].values != 1 || f->filter[i].first != element_size))
            return false;
    }
    return ebpo_pipeline_of_filters(ids, (int)f->count, element_size, pipeline);
}

/* Returns true if the rule allows chunks with `rows` rows. HDF5 has no chunks of 4 GiB and more. */
static bool rows_fit(const ebpo_shape *shape, ebpo_head_rows rule, uint64_t rows)
{
    uint64_t full = ebpo_full_chunk_rows(shape->rows, shape->cols, shape->element_size);
    if (rule == EBPO_HEAD_ROWS_ALL)
        return rows == shape->rows && rows <= UINT32_MAX / ebpo_shape_row_bytes(shape);
    bool power = rows && !(rows & (rows - 1));
    return rows == full || (rule == EBPO_HEAD_ROWS_POWER && power && rows < full);
}

/* Returns the only message of a type, or NULL. Sets *wrong if the message occurs twice or is shared
 * (stored in another object). If there is no such message, does not set *wrong. */
static const ebpo_head_message *find_one(const ebpo_head_header *h, uint8_t type,
                                         ebpo_head_refusal *wrong)
{
    enum { SHARED = 2 };
    const ebpo_head_message *found = NULL;
    for (uint64_t i = 0; i < h->count; i++) {
        if (h->message[i].type != type)
            continue;
        if (found)
            *wrong = (ebpo_head_refusal){ "the object's header has a duplicate message", false };
        if (h->message[i].flags & SHARED)
            *wrong = (ebpo_head_refusal){ "a message of the object's header is in another object",
                                          true };
        found = &h->message[i];
    }
    return wrong->what ? NULL : found;
}

/* Returns the refusal of a damaged or disallowed array. */
static ebpo_head_refusal refuse_array(const char *what)
{
    return (ebpo_head_refusal){ what, false };
}

/* Returns the refusal of an array that is not damaged, but was rewritten by another program. */
static ebpo_head_refusal fail_foreign(const char *what)
{
    return (ebpo_head_refusal){ what, true };
}

/* Reads the type and the dimensions of an array. On success, the member `what` of the result is
 * NULL. */
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
        return fail_foreign(grows ? "the array does not have fixed dimensions"
                                  : "the array is not of little-endian integers");
    if (type.class != EBPO_CLASS_INTEGER ||
        (type.size != 1 && type.size != 2 && type.size != 4 && type.size != 8))
        return refuse_array("the array is not of little-endian integers");
    if (space.rank < 1 || space.rank > 2 || !space.fixed || space.size[0] == 0 ||
        (space.rank == 2 && (space.size[1] == 0 || space.size[1] > COLS_MAX)))
        return refuse_array("the array does not have one or two fixed dimensions");
    shape->element_size = (uint8_t)type.size;
    shape->is_signed = type.is_signed;
    shape->rows = space.size[0];
    shape->cols = space.rank == 2 ? (uint32_t)space.size[1] : 0;
    return wrong;
}

/* Reads the layout and the filters. Sets shape->chunk_rows and shape->pipeline. On success, the
 * member `what` of the result is NULL. */
static ebpo_head_refusal read_storage(const ebpo_head_header *h, ebpo_head_rows rule,
                                      ebpo_shape *shape, ebpo_head_layout *layout)
{
    ebpo_head_refusal wrong = { NULL, false };
    ebpo_head_filters filters = { .count = 0 };
    const ebpo_head_message *external = find_one(h, EBPO_M_EXTERNAL, &wrong),
                            *layout_message = find_one(h, EBPO_M_LAYOUT, &wrong),
                            *filter_message = find_one(h, EBPO_M_PIPELINE, &wrong);
    if (external)
        return refuse_array(
            "the array's values are in another file (external storage), which is never read");
    if (!layout_message)
        return wrong;
    wrong.what = read_layout(ebpo_head_message_cursor(h, layout_message), layout, &wrong.foreign);
    if (wrong.what)
        return wrong;
    bool whole = layout->rank == (shape->cols ? 2 : 1) &&
                 layout->chunk[layout->rank] == shape->element_size &&
                 (!shape->cols || layout->chunk[1] == shape->cols);
    if (!whole || !rows_fit(shape, rule, layout->chunk[0]))
        return fail_foreign("the array's chunks do not have the size that the format requires");
    shape->chunk_rows = (uint32_t)layout->chunk[0];
    if (filter_message)
        filters = ebpo_head_read_filters(ebpo_head_message_cursor(h, filter_message));
    if (!find_pipeline(&filters, shape->element_size, &shape->pipeline))
        return fail_foreign("the array's filters are not supported by the format");
    return wrong;
}

/* Finds the chunks. A chunk takes at least CHUNK_MIN bytes, so the file's size bounds the number of
 * chunks. */
static ebpo_status find_chunks(ebpo_head *head, const char *path, const ebpo_shape *shape,
                               const ebpo_head_layout *layout, ebpo_chunk_location **locations,
                               uint64_t *stored, ebpo_error *error)
{
    enum { CHUNK_MIN = 4 };
    char chunk_path[160];
    ebpo_head_chunks t = { .layout = layout,
                           .filtered = shape->pipeline != EBPO_PIPELINE_BARE,
                           .count = ebpo_shape_chunks(shape),
                           .whole = shape->chunk_rows * ebpo_shape_row_bytes(shape),
                           .end = head->end };
    t.bound = ebpo_chunk_bound((size_t)t.whole);
    if (t.count > 1 && t.count > head->end / CHUNK_MIN)
        return ebpo_fail_at(error, EBPO_E_FORMAT, head->shown, path, -1,
                            "the array has more chunks than the file can hold");
    t.locations = *locations = ebpo_alloc(t.count, sizeof **locations);
    if (!t.locations)
        return ebpo_fail_memory(error, t.count * sizeof **locations);
    const char *wrong = read_chunk_table(head->state, &t);
    *stored = t.stored;
    if (!wrong)
        return EBPO_OK;
    snprintf(chunk_path, sizeof chunk_path, "%s: chunk %" PRIu64, path, t.at);
    head->state->refusal = (ebpo_head_refusal){ NULL, false };
    return ebpo_head_fail(head, t.at == UINT64_MAX ? path : chunk_path, wrong, error);
}

static ebpo_status read_array(ebpo_head *head, const char *path, uint64_t most, ebpo_head_rows rows,
                              ebpo_shape *shape, char *coding, ebpo_chunk_location **chunks,
                              uint64_t *stored_bytes, ebpo_error *error)
{
    ebpo_head_object object;
    ebpo_head_layout layout = { .rank = 0 };
    ebpo_head_kind kind = ebpo_head_find(head->state, path, &object);
    if (kind != EBPO_HEAD_ARRAY && head->state->refusal.what)
        return ebpo_head_fail(head, path, "the array's header is damaged", error);
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
                                 char coding[EBPO_HEAD_CODING_BYTES], ebpo_chunk_location **chunks,
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
