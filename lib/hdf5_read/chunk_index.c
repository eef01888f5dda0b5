#include "hdf5_read/chunk_index.h"

#include <string.h>

static const char missing[] = "the chunk is missing", cut[] = "its description is cut short",
                  contradicts[] = "the array's index contradicts its shape or its filters",
                  no_index[] = "there is no chunk index where one is expected",
                  damaged[] = "the array's chunk index is damaged: the checksum differs",
                  beyond[] = "the array's chunk index lies beyond the end of the file";

static const char *read_chunked(ebpo_head_cursor *c, ebpo_head_layout *l, bool *foreign)
{
    enum { SINGLE_FILTERED = 2 };
    unsigned flags = ebpo_cursor_u8(c), rank = ebpo_cursor_u8(c), bytes = ebpo_cursor_u8(c);
    if (c->cut)
        return cut;
    if (rank < 2 || rank > 3 || bytes < 1 || bytes > 8 || flags & ~(unsigned)SINGLE_FILTERED)
        return "the array's chunks do not have the size that the format fixes";
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

const char *ebpo_head_read_layout(ebpo_head_cursor c, ebpo_head_layout *l, bool *foreign)
{
    enum { CHUNKED = 2, VIRTUAL = 3 };
    unsigned version = ebpo_cursor_u8(&c), kind = ebpo_cursor_u8(&c);
    *l = (ebpo_head_layout){ .address = EBPO_NO_ADDRESS };
    *foreign = version < 3 || version > 4;
    if (version < 3 || version > 4)
        return "the array's layout is of a version that is not known";
    if (kind == VIRTUAL)
        return "the array is virtual: its values lie in other arrays, which are never looked for";
    *foreign = kind != CHUNKED || version == 3;
    if (kind != CHUNKED)
        return "the array is not stored in chunks";
    if (version == 4)
        return read_chunked(&c, l, foreign);
    return "the array's chunks are listed in a tree without checksums";
}

/* Takes the next chunk's place over. */
static const char *take(ebpo_head_chunks *t, uint64_t i, uint64_t file_bytes, uint64_t address,
                        uint64_t bytes, uint32_t mask)
{
    t->at = i;
    if (address == EBPO_NO_ADDRESS || bytes == 0)
        return missing;
    if (mask != 0)
        return "the chunk was stored without its filters";
    if (bytes > t->bound)
        return "the chunk is larger than it can be";
    if (address > file_bytes || bytes > file_bytes - address)
        return "the chunk lies beyond the end of the file";
    t->place[i] = (ebpo_chunk_place){ address, (uint32_t)bytes };
    t->stored += bytes;
    t->at = UINT64_MAX;
    return t->stored > file_bytes ? "the array's chunks do not fit the file" : NULL;
}

static const char *read_single(ebpo_head_chunks *t, uint64_t file_bytes)
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
    return take(t, 0, file_bytes, l->address, t->filtered ? l->single_bytes : t->whole,
                l->single_mask);
}

static const char *read_implicit(ebpo_head_chunks *t, uint64_t file_bytes)
{
    const ebpo_head_layout *l = t->layout;
    const char *wrong = t->filtered ? contradicts : NULL;
    for (uint64_t i = 0; i < t->count && !wrong; i++) {
        uint64_t begin = EBPO_NO_ADDRESS; /* as this does not fit 64 bits, it is none */
        if (l->address != EBPO_NO_ADDRESS && (__builtin_mul_overflow(i, t->whole, &begin) ||
                                              __builtin_add_overflow(begin, l->address, &begin)))
            begin = EBPO_NO_ADDRESS;
        wrong = take(t, i, file_bytes, begin, t->whole, 0);
    }
    return wrong;
}

/* A fixed array: a header, then one block of pages. */
typedef struct fixed_array {
    uint64_t data; /* where the block is */
    unsigned entry, size_bytes;
} fixed_array;

static const char *read_fixed_header(ebpo_head_state *s, const ebpo_head_chunks *t, fixed_array *f)
{
    enum { BYTES = 28, PAGE_BITS_MOST = 16, PLAIN_ENTRY = 8, FILTERED_MORE = 12 };
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
                   page_bits == l->page_bits && page_bits >= 1 && page_bits <= PAGE_BITS_MOST
               ? NULL
               : contradicts;
}

/* `count` entries from chunk `first` on, with their checksum behind them; `before`: bytes that the
 * checksum counts, too. */
static const char *read_entries(ebpo_head_state *s, ebpo_head_chunks *t, const fixed_array *f,
                                uint64_t at, uint64_t before, uint64_t first, uint64_t count)
{
    uint64_t size = before + count * f->entry + 4, file_bytes = s->bytes.input->source.size;
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
        wrong = take(t, first + i, file_bytes, address, bytes, mask);
    }
    return wrong;
}

/* The bits that say which pages have been written. */
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
    enum { PREFIX = 14 };
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
        uint64_t here = t->count - first < page ? t->count - first : page;
        wrong = read_entries(s, t, &f, at, 0, first, here);
        at += here * f.entry + 4;
    }
    return wrong;
}

const char *ebpo_head_read_chunks(ebpo_head_state *s, ebpo_head_chunks *t)
{
    uint64_t file_bytes = s->bytes.input->source.size;
    t->stored = 0;
    t->at = UINT64_MAX;
    switch (t->layout->index) {
    case EBPO_INDEX_SINGLE: return read_single(t, file_bytes);
    case EBPO_INDEX_IMPLICIT: return read_implicit(t, file_bytes);
    case EBPO_INDEX_FIXED: return read_fixed(s, t);
    }
    return no_index;
}
