/* The headers of objects: blocks with checksums, in them messages. */
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/sums.h"
#include "hdf5_read/head_state.h"
#include "hdf5_read/lookup3.h"

enum {
    /* of one header: far above what is written, far below what hurts */
    BLOCKS_MOST = 256,
    BLOCK_BYTES_MOST = 1 << 20,
    HEADER_BYTES_MOST = 4 << 20,
    MESSAGES_MOST = 8192
};

static const char *const damaged_block = "its header lies beyond the end of the file";

bool ebpo_head_sound(const uint8_t *block, uint64_t size)
{
    /* not even computed where it would not be compared: that was most of a fuzzer's time */
    return size >= 4 &&
           (!EBPO_SUMS_COMPARED || !ebpo_sum_differs(ebpo_load32(block + size - 4),
                                                     ebpo_lookup3(block, (size_t)size - 4)));
}

static bool note_memory(ebpo_head_state *s, uint64_t bytes)
{
    s->bytes.status = ebpo_fail_memory(&s->bytes.error, bytes);
    return false;
}

/* Whether what a group or an array lists stands in its header, not in B-trees and heaps. */
static bool is_compact(ebpo_head_state *s, ebpo_head_cursor c, bool links)
{
    unsigned version = ebpo_cursor_u8(&c), flags = ebpo_cursor_u8(&c);
    if (version != 0)
        return ebpo_refuse(s, "its links or attributes are stored in an unknown way");
    if (flags & 1)
        ebpo_cursor_take(&c, links ? 8 : 2);
    if (ebpo_cursor_u64(&c) != EBPO_NO_ADDRESS && !c.cut)
        return ebpo_refuse_foreign(s, links ? "a group's links are stored outside of its header"
                                            : "attributes are stored outside of their header");
    return !c.cut || ebpo_refuse(s, "its description is cut short");
}

static bool add_message(ebpo_head_state *s, ebpo_head_header *h, const ebpo_head_message *m)
{
    enum { FAILS_IF_UNKNOWN = 0x80, LAST_KNOWN = 0x18 };
    if (m->type > LAST_KNOWN && m->flags & FAILS_IF_UNKNOWN)
        return ebpo_refuse(s, "its header has a message that nobody knows");
    if (h->count == MESSAGES_MOST)
        return ebpo_refuse(s, "its header has too many messages");
    if (!ebpo_grow(&h->message, &h->capacity, h->count + 1, sizeof *h->message))
        return note_memory(s, (h->count + 1) * sizeof *h->message);
    h->message[h->count++] = *m;
    return true;
}

/* One block's messages, `from` its place in the header's bytes; `gap`: bytes of creation order. */
static bool list_messages(ebpo_head_state *s, ebpo_head_header *h, uint64_t from, unsigned gap)
{
    ebpo_head_cursor c = { h->bytes + from, h->bytes + h->byte_count, false };
    while (ebpo_cursor_left(&c) >= 4 + gap) {
        ebpo_head_message m = { .type = ebpo_cursor_u8(&c) };
        m.size = ebpo_cursor_u16(&c);
        m.flags = ebpo_cursor_u8(&c);
        ebpo_cursor_take(&c, gap);
        m.offset = (uint32_t)(c.at - h->bytes);
        if (!ebpo_cursor_take(&c, m.size) && m.size)
            return ebpo_refuse(s, "its description is cut short");
        if (!add_message(s, h, &m))
            return false;
    }
    return true;
}

/* Takes a block over: `before` bytes in front of its messages, four of checksum behind. */
static bool take_block(ebpo_head_state *s, ebpo_head_header *h, uint64_t at, uint64_t before,
                       uint64_t size, unsigned gap)
{
    if (size > BLOCK_BYTES_MOST || h->byte_count + size > HEADER_BYTES_MOST)
        return ebpo_refuse(s, "its header is too large");
    const uint8_t *block = ebpo_head_bytes_at(&s->bytes, at, before + size + 4);
    if (!block)
        return ebpo_refuse(s, damaged_block);
    if (!ebpo_head_sound(block, before + size + 4))
        return ebpo_refuse(s, "its header's checksum differs");
    ebpo_head_note_range(s, at, before + size + 4);
    uint64_t from = h->byte_count;
    if (!ebpo_grow(&h->bytes, &h->byte_capacity, from + size + 1, 1))
        return note_memory(s, size);
    memcpy(h->bytes + from, block + before, (size_t)size);
    h->byte_count += size;
    return list_messages(s, h, from, gap);
}

static bool read_first_block(ebpo_head_state *s, ebpo_head_header *h, unsigned *gap)
{
    enum { PREFIX_MOST = 34 };
    uint64_t end = s->bytes.input->source.size, at = h->address;
    uint64_t size = at < end && end - at < PREFIX_MOST ? end - at : PREFIX_MOST;
    const uint8_t *prefix = ebpo_head_bytes_at(&s->bytes, at, size);
    if (!prefix)
        return ebpo_refuse(s, damaged_block);
    if (size >= 4 && prefix[0] == 1 && prefix[1] == 0)
        return ebpo_refuse_foreign(s, "an object's header is of version 1, without a checksum");
    ebpo_head_cursor c = { prefix, prefix + size, false };
    const uint8_t *name = ebpo_cursor_take(&c, 4);
    if (!name || memcmp(name, "OHDR", 4) != 0 || ebpo_cursor_u8(&c) != 2)
        return ebpo_refuse(s, "there is no header where one is expected");
    unsigned flags = ebpo_cursor_u8(&c);
    if (flags & 0xc0)
        return ebpo_refuse(s, "its header has unknown flags");
    ebpo_cursor_take(&c, (flags & 0x20 ? 16 : 0) + (flags & 0x10 ? 4 : 0));
    uint64_t bytes = ebpo_cursor_uint(&c, 1u << (flags & 3));
    if (c.cut)
        return ebpo_refuse(s, damaged_block);
    *gap = flags & 4 ? 2 : 0;
    return take_block(s, h, at, (uint64_t)(c.at - prefix), bytes, *gap);
}

static bool read_continuation(ebpo_head_state *s, ebpo_head_header *h, uint64_t message,
                              unsigned gap)
{
    ebpo_head_cursor c = ebpo_head_message_cursor(h, &h->message[message]);
    uint64_t at = ebpo_cursor_u64(&c), size = ebpo_cursor_u64(&c);
    if (c.cut || size < 8 || size > BLOCK_BYTES_MOST)
        return ebpo_refuse(s, "its header goes on nowhere");
    const uint8_t *block = ebpo_head_bytes_at(&s->bytes, at, size);
    if (!block)
        return ebpo_refuse(s, damaged_block);
    if (memcmp(block, "OCHK", 4) != 0)
        return ebpo_refuse(s, "its header goes on nowhere");
    return take_block(s, h, at, 4, size - 8, gap);
}

static bool read_blocks(ebpo_head_state *s, ebpo_head_header *h)
{
    unsigned gap = 0, blocks = 1;
    if (!read_first_block(s, h, &gap))
        return false;
    for (uint64_t i = 0; i < h->count; i++) {
        if (h->message[i].type != EBPO_M_CONTINUATION)
            continue;
        if (++blocks > BLOCKS_MOST)
            return ebpo_refuse(s, "its header has too many pieces");
        if (!read_continuation(s, h, i, gap))
            return false;
    }
    return true;
}

static bool find_kind(ebpo_head_state *s, ebpo_head_header *h)
{
    unsigned array = 0;
    h->kind = EBPO_HEAD_OTHER;
    for (uint64_t i = 0; i < h->count; i++) {
        const ebpo_head_message *m = &h->message[i];
        ebpo_head_cursor c = ebpo_head_message_cursor(h, m);
        switch (m->type) {
        case EBPO_M_SYMBOL_TABLE:
            return ebpo_refuse_foreign(s, "a group's links are stored as before HDF5 1.8");
        case EBPO_M_LINK_INFO:
        case EBPO_M_ATTRIBUTE_INFO:
            if (!is_compact(s, c, m->type == EBPO_M_LINK_INFO))
                return false;
            if (m->type == EBPO_M_LINK_INFO)
                h->kind = EBPO_HEAD_GROUP;
            break;
        case EBPO_M_GROUP_INFO: h->kind = EBPO_HEAD_GROUP; break;
        case EBPO_M_DATASPACE: array |= 1; break;
        case EBPO_M_DATATYPE: array |= 2; break;
        case EBPO_M_LAYOUT: array |= 4; break;
        default: break; /* times, comments, counts: nothing that changes what is read */
        }
    }
    if (h->kind == EBPO_HEAD_OTHER && array == 7)
        h->kind = EBPO_HEAD_ARRAY;
    return true;
}

/* The slot that has been idle for longest, emptied; its memory is used again. */
static ebpo_head_header *free_slot(ebpo_head_state *s)
{
    ebpo_head_header *h = &s->slot[0];
    for (int i = 1; i < EBPO_HEAD_SLOTS; i++)
        if (s->slot[i].used < h->used)
            h = &s->slot[i];
    h->used = h->byte_count = h->count = 0;
    return h;
}

const ebpo_head_header *ebpo_head_header_at(ebpo_head_state *s, uint64_t address)
{
    for (int i = 0; i < EBPO_HEAD_SLOTS; i++)
        if (s->slot[i].used && s->slot[i].address == address) {
            s->slot[i].used = ++s->clock;
            return &s->slot[i];
        }
    ebpo_head_header *h = free_slot(s);
    h->address = address;
    if (!read_blocks(s, h) || !find_kind(s, h))
        return NULL;
    h->used = ++s->clock;
    return h;
}

void ebpo_head_headers_free(ebpo_head_state *s)
{
    for (int i = 0; i < EBPO_HEAD_SLOTS; i++) {
        free(s->slot[i].bytes);
        free(s->slot[i].message);
    }
}
