/* Reads headers of HDF5 objects (groups and arrays), and attributes. A header consists of blocks
 * with checksums. The blocks contain messages, which describe types, dimensions, filters and
 * attributes. The most recently used headers stay in memory. Counts and sizes are bounded before
 * memory is allocated for them, and each checksum is compared. Functions that return false have
 * recorded the reason (ebpo_refuse). Source: HDF5 File Format Specification 3.0, section IV.A. */
#include "core/strict_fp.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/checksum.h"
#include "core/error.h"
#include "core/text.h"
#include "hdf5_read/head_parts.h"

enum {
    /* limits of one header: far above what files need, and low enough to be harmless */
    BLOCKS_MAX = 256,
    BLOCK_BYTES_MAX = 1 << 20,
    HEADER_BYTES_MAX = 4 << 20,
    MESSAGES_MAX = 8192
};

static const char *const beyond_end = "the object's header is beyond the end of the file";

bool ebpo_head_sound(const uint8_t *block, uint64_t size)
{
    /* A fuzzing build does not compare checksums. It does not even compute them, because the fuzzer
     * would spend most of its time on checksums. */
    return size >= 4 &&
           (!EBPO_CHECKSUMS_COMPARED || !ebpo_sum_differs(ebpo_load32(block + size - 4),
                                                          ebpo_lookup3(block, (size_t)size - 4)));
}

/* Records a lack of memory as a failure of the input. Returns false. */
static bool record_memory(ebpo_head_state *s, uint64_t bytes)
{
    s->bytes.status = ebpo_fail_memory(&s->bytes.error, bytes);
    return false;
}

/* Returns true if the links of a group (`links` is true) or the attributes of an object (`links` is
 * false) are in the object's header. Returns false if they are in B-trees and heaps, which only
 * libhdf5 reads. */
static bool is_compact(ebpo_head_state *s, ebpo_head_cursor c, bool links)
{
    unsigned version = ebpo_cursor_u8(&c), flags = ebpo_cursor_u8(&c);
    if (version != 0)
        return ebpo_refuse(s, "the object's links or attributes are stored in an unknown way");
    if (flags & 1) /* the greatest creation order follows */
        ebpo_cursor_take(&c, links ? 8 : 2);
    if (ebpo_cursor_u64(&c) != EBPO_NO_ADDRESS && !c.cut)
        return ebpo_refuse_foreign(s, links ? "a group's links are stored outside of its header"
                                            : "attributes are stored outside of their header");
    return !c.cut || ebpo_refuse(s, "the object's header ends within a message");
}

static bool add_message(ebpo_head_state *s, ebpo_head_header *h, const ebpo_head_message *m)
{
    enum { FAILS_IF_UNKNOWN = 0x80, LAST_KNOWN = 0x18 };
    if (m->type > LAST_KNOWN && m->flags & FAILS_IF_UNKNOWN)
        return ebpo_refuse(s, "the object's header has an unknown message");
    if (h->count == MESSAGES_MAX)
        return ebpo_refuse(s, "the object's header has too many messages");
    if (!ebpo_grow(&h->message, &h->capacity, h->count + 1, sizeof *h->message))
        return record_memory(s, (h->count + 1) * sizeof *h->message);
    h->message[h->count++] = *m;
    return true;
}

/* Lists the messages of one block. `from`: offset of the block in the header's bytes. `gap`: number
 * of bytes that each message has for its creation order. */
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
            return ebpo_refuse(s, "the object's header ends within a message");
        if (!add_message(s, h, &m))
            return false;
    }
    return true;
}

/* Reads a block at the address `at`. It has `before` bytes, then messages of `size` bytes, and then
 * four bytes of checksum. `gap`: see list_messages. */
static bool read_block(ebpo_head_state *s, ebpo_head_header *h, uint64_t at, uint64_t before,
                       uint64_t size, unsigned gap)
{
    if (size > BLOCK_BYTES_MAX || h->byte_count + size > HEADER_BYTES_MAX)
        return ebpo_refuse(s, "the object's header is too large");
    const uint8_t *block = ebpo_head_bytes_at(&s->bytes, at, before + size + 4);
    if (!block)
        return ebpo_refuse(s, beyond_end);
    if (!ebpo_head_sound(block, before + size + 4))
        return ebpo_refuse(s, "the checksum of the object's header differs");
    ebpo_head_note_range(s, at, before + size + 4);
    uint64_t from = h->byte_count;
    if (!ebpo_grow(&h->bytes, &h->byte_capacity, from + size + 1, 1))
        return record_memory(s, size);
    memcpy(h->bytes + from, block + before, (size_t)size);
    h->byte_count += size;
    return list_messages(s, h, from, gap);
}

/* Reads the first block of a header. Sets *gap for list_messages. */
static bool read_first_block(ebpo_head_state *s, ebpo_head_header *h, unsigned *gap)
{
    enum { PREFIX_MAX = 34 };
    uint64_t end = s->bytes.input->source.size, at = h->address;
    uint64_t size = at < end && end - at < PREFIX_MAX ? end - at : PREFIX_MAX;
    const uint8_t *prefix = ebpo_head_bytes_at(&s->bytes, at, size);
    if (!prefix)
        return ebpo_refuse(s, beyond_end);
    if (size >= 4 && prefix[0] == 1 && prefix[1] == 0)
        return ebpo_refuse_foreign(s, "an object's header is of version 1, without a checksum");
    ebpo_head_cursor c = { prefix, prefix + size, false };
    const uint8_t *name = ebpo_cursor_take(&c, 4);
    if (!name || memcmp(name, "OHDR", 4) != 0 || ebpo_cursor_u8(&c) != 2)
        return ebpo_refuse(s, "there is no header at the object's address");
    unsigned flags = ebpo_cursor_u8(&c);
    if (flags & 0xc0)
        return ebpo_refuse(s, "the object's header has unknown flags");
    /* skips the times of the object, and its limits for the storage of attributes */
    ebpo_cursor_take(&c, (flags & 0x20 ? 16 : 0) + (flags & 0x10 ? 4 : 0));
    uint64_t bytes = ebpo_cursor_uint(&c, 1u << (flags & 3));
    if (c.cut)
        return ebpo_refuse(s, beyond_end);
    *gap = flags & 4 ? 2 : 0; /* 4: messages have a creation order */
    return read_block(s, h, at, (uint64_t)(c.at - prefix), bytes, *gap);
}

/* Reads the block to which a continuation message refers. `message`: index of this message. */
static bool read_continuation(ebpo_head_state *s, ebpo_head_header *h, uint64_t message,
                              unsigned gap)
{
    ebpo_head_cursor c = ebpo_head_message_cursor(h, &h->message[message]);
    uint64_t at = ebpo_cursor_u64(&c), size = ebpo_cursor_u64(&c);
    if (c.cut || size < 8 || size > BLOCK_BYTES_MAX)
        return ebpo_refuse(s, "the object's header continues at an invalid address");
    const uint8_t *block = ebpo_head_bytes_at(&s->bytes, at, size);
    if (!block)
        return ebpo_refuse(s, beyond_end);
    if (memcmp(block, "OCHK", 4) != 0)
        return ebpo_refuse(s, "the object's header continues at an invalid address");
    return read_block(s, h, at, 4, size - 8, gap);
}

static bool read_blocks(ebpo_head_state *s, ebpo_head_header *h)
{
    unsigned gap = 0, blocks = 1;
    if (!read_first_block(s, h, &gap))
        return false;
    for (uint64_t i = 0; i < h->count; i++) {
        if (h->message[i].type != EBPO_M_CONTINUATION)
            continue;
        if (++blocks > BLOCKS_MAX)
            return ebpo_refuse(s, "the object's header has too many blocks");
        if (!read_continuation(s, h, i, gap))
            return false;
    }
    return true;
}

/* Finds the kind of object that the messages describe. */
static bool find_kind(ebpo_head_state *s, ebpo_head_header *h)
{
    unsigned array_messages = 0; /* bits of the three messages that every array has */
    h->kind = EBPO_HEAD_OTHER;
    for (uint64_t i = 0; i < h->count; i++) {
        const ebpo_head_message *m = &h->message[i];
        ebpo_head_cursor c = ebpo_head_message_cursor(h, m);
        switch (m->type) {
        case EBPO_M_SYMBOL_TABLE:
            return ebpo_refuse_foreign(s, "a group's links are stored in the form before HDF5 1.8");
        case EBPO_M_LINK_INFO:
        case EBPO_M_ATTRIBUTE_INFO:
            if (!is_compact(s, c, m->type == EBPO_M_LINK_INFO))
                return false;
            if (m->type == EBPO_M_LINK_INFO)
                h->kind = EBPO_HEAD_GROUP;
            break;
        case EBPO_M_GROUP_INFO: h->kind = EBPO_HEAD_GROUP; break;
        case EBPO_M_DATASPACE: array_messages |= 1; break;
        case EBPO_M_DATATYPE: array_messages |= 2; break;
        case EBPO_M_LAYOUT: array_messages |= 4; break;
        default: break; /* times, comments, counts: such messages do not affect reading */
        }
    }
    if (h->kind == EBPO_HEAD_OTHER && array_messages == 7)
        h->kind = EBPO_HEAD_ARRAY;
    return true;
}

/* Empties and returns the least recently used slot. The next header reuses the memory of this slot.
 */
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

/* Returns true if a datatype message describes a little-endian IEEE double. `bits`: the message's
 * bit field. */
static bool is_double(ebpo_head_cursor *c, unsigned bits, uint32_t size)
{
    /* description of an IEEE double: bit offset, number of bits, position and size of the exponent,
     * position and size of the mantissa, bias of the exponent */
    static const uint8_t ieee[12] = { 0, 0, 64, 0, 52, 11, 0, 52, 255, 3, 0, 0 };
    const uint8_t *at = ebpo_cursor_take(c, sizeof ieee);
    return at && size == 8 && bits == 0x3f20 && memcmp(at, ieee, sizeof ieee) == 0;
}

/* Returns true if a datatype message describes a little-endian integer that uses all bits of its
 * bytes. */
static bool is_integer(ebpo_head_cursor *c, unsigned bits, uint32_t size)
{
    enum { SIGNED = 8 };
    unsigned offset = ebpo_cursor_u16(c), precision = ebpo_cursor_u16(c);
    return !c->cut && !(bits & ~(unsigned)SIGNED) && offset == 0 && size <= 8 &&
           precision == 8 * size;
}

ebpo_head_type ebpo_head_read_type(ebpo_head_cursor c)
{
    enum { FIXED = 0, FLOAT = 1, STRING = 3 };
    unsigned kind = ebpo_cursor_u8(&c), bits = (unsigned)ebpo_cursor_uint(&c, 3);
    ebpo_head_type type = { .class = EBPO_CLASS_OTHER, .size = ebpo_cursor_u32(&c) };
    if (c.cut || kind >> 4 < 1 || kind >> 4 > 3)
        return type;
    if ((kind & 15) == FIXED && is_integer(&c, bits, type.size))
        type = (ebpo_head_type){ EBPO_CLASS_INTEGER, type.size, bits != 0 };
    else if ((kind & 15) == FIXED)
        type.class = EBPO_CLASS_OTHER_INTEGER;
    else if ((kind & 15) == FLOAT && is_double(&c, bits, type.size))
        type.class = EBPO_CLASS_DOUBLE;
    else if ((kind & 15) == STRING)
        type.class = EBPO_CLASS_TEXT;
    return type;
}

/* Reads dimensions. Also reads messages of version 1, because programs with HDF5's default settings
 * write this version when they add an attribute to a file. */
ebpo_head_space ebpo_head_read_space(ebpo_head_cursor c)
{
    enum { HAS_MAX = 1, PLAIN = 1, RANK_MAX = 32 };
    static const ebpo_head_space unread = { .rank = UINT32_MAX };
    unsigned version = ebpo_cursor_u8(&c), rank = ebpo_cursor_u8(&c), flags = ebpo_cursor_u8(&c);
    unsigned type = version == 2 ? ebpo_cursor_u8(&c) : PLAIN;
    if (version == 1)
        ebpo_cursor_take(&c, 5);
    if (version < 1 || version > 2 || type > PLAIN || rank > RANK_MAX)
        return unread;
    ebpo_head_space space = { .rank = rank, .fixed = true, .values = 1 };
    bool fits = true;
    uint64_t size[RANK_MAX] = { 0 };
    for (unsigned i = 0; i < rank; i++) {
        size[i] = ebpo_cursor_u64(&c);
        fits = fits && !__builtin_mul_overflow(space.values, size[i], &space.values);
    }
    for (unsigned i = 0; i < rank && flags & HAS_MAX; i++)
        space.fixed = space.fixed && ebpo_cursor_u64(&c) == size[i];
    memcpy(space.size, size, sizeof space.size);
    if (!fits)
        space.values = 0;
    return c.cut ? unread : space;
}

ebpo_head_filters ebpo_head_read_filters(ebpo_head_cursor c)
{
    enum { NAMED_FROM = 256 }; /* filters from this number on have a name */
    ebpo_head_filters filters = { .count = EBPO_HEAD_FILTERS + 1 };
    if (ebpo_cursor_u8(&c) != 2)
        return filters;
    unsigned count = ebpo_cursor_u8(&c);
    for (unsigned i = 0; i < count && i < EBPO_HEAD_FILTERS; i++) {
        unsigned id = ebpo_cursor_u16(&c), name = id >= NAMED_FROM ? ebpo_cursor_u16(&c) : 0;
        ebpo_cursor_u16(&c); /* ignores the flag "optional", because all filters are needed */
        unsigned values = ebpo_cursor_u16(&c);
        ebpo_cursor_take(&c, name);
        ebpo_head_cursor parameters = ebpo_cursor_part(&c, 4 * (size_t)values);
        filters.filter[i].id = id;
        filters.filter[i].values = values;
        filters.filter[i].first = values ? ebpo_cursor_u32(&parameters) : 0;
    }
    if (!c.cut)
        filters.count = count;
    return filters;
}

/* An attribute of an object. */
typedef struct attribute {
    ebpo_head_type type;
    ebpo_head_space space;
    const uint8_t *data; /* all values, or NULL */
} attribute;

static ebpo_status attribute_fails(const ebpo_head *head, const char *path, const char *name,
                                   const char *what, ebpo_error *error)
{
    char place[160];
    snprintf(place, sizeof place, "%s: attribute %s", path, name);
    return ebpo_fail_at(error, EBPO_E_FORMAT, head->shown, place, -1, "%s", what);
}

/* Returns the next part of a message. The part has `size` bytes. In messages of version 1, padding
 * follows, up to a multiple of eight bytes. */
static ebpo_head_cursor part_of(ebpo_head_cursor *c, unsigned version, unsigned size)
{
    ebpo_head_cursor part = ebpo_cursor_part(c, size);
    if (version == 1 && size % 8)
        ebpo_cursor_take(c, 8 - size % 8);
    return part;
}

/* Reads an attribute message into *a. Returns true if the attribute has this name. */
static bool attribute_is(ebpo_head_cursor c, const char *name, attribute *a)
{
    unsigned version = ebpo_cursor_u8(&c), flags = ebpo_cursor_u8(&c);
    unsigned name_size = ebpo_cursor_u16(&c), type_size = ebpo_cursor_u16(&c),
             space_size = ebpo_cursor_u16(&c);
    if (version == 3)
        ebpo_cursor_u8(&c); /* character set of the name */
    ebpo_head_cursor text = part_of(&c, version, name_size);
    size_t length = strlen(name) + 1;
    if (version < 1 || version > 3 || text.cut || ebpo_cursor_left(&text) < length ||
        memcmp(text.at, name, length) != 0)
        return false;
    ebpo_head_cursor type = part_of(&c, version, type_size),
                     space = part_of(&c, version, space_size);
    uint64_t bytes;
    *a = (attribute){ ebpo_head_read_type(type), ebpo_head_read_space(space), NULL };
    if (version > 1 && flags & 1) /* the type is in another object, which is not supported */
        a->type = (ebpo_head_type){ EBPO_CLASS_OTHER, 0, false };
    if (!__builtin_mul_overflow(a->space.values, (uint64_t)a->type.size, &bytes) &&
        bytes <= ebpo_cursor_left(&c) && !c.cut)
        a->data = c.at;
    return true;
}

/* Finds an attribute. Returns EBPO_E_ABSENT if the object has no attribute of this name. `values`:
 * required number of values. */
static ebpo_status find_attribute(ebpo_head *head, ebpo_head_object object, const char *path,
                                  const char *name, uint64_t values, attribute *out,
                                  ebpo_error *error)
{
    unsigned found = 0;
    head->state->refusal = (ebpo_head_refusal){ NULL, false };
    const ebpo_head_header *h = ebpo_head_header_at(head->state, object);
    if (!h)
        return ebpo_head_fail(head, path, "the object's header is damaged", error);
    for (uint64_t i = 0; i < h->count; i++)
        if (h->message[i].type == EBPO_M_ATTRIBUTE && !(h->message[i].flags & 2))
            found += attribute_is(ebpo_head_message_cursor(h, &h->message[i]), name, out);
    if (found == 0)
        return EBPO_E_ABSENT;
    if (found == 1 && out->space.rank != UINT32_MAX && out->space.values == values && out->data)
        return EBPO_OK;
    return attribute_fails(head, path, name,
                           "the attribute is damaged or has the wrong number of values", error);
}

ebpo_status ebpo_head_get_text(ebpo_head *head, ebpo_head_object object, const char *path,
                               const char *name, char *text, size_t size, ebpo_error *error)
{
    attribute a = { .data = NULL };
    memset(text, 0, size);
    ebpo_status status = find_attribute(head, object, path, name, 1, &a, error);
    if (status != EBPO_OK)
        return status;
    bool is_text = a.type.class == EBPO_CLASS_TEXT && a.type.size > 0;
    size_t length = is_text ? strnlen((const char *)a.data, a.type.size) : size;
    if (length < size)
        memcpy(text, a.data, length);
    if (length < size && ebpo_text_ok(text))
        return EBPO_OK;
    memset(text, 0, size);
    return attribute_fails(head, path, name,
                           "the attribute is not a fixed-length UTF-8 text of an allowed length",
                           error);
}

/* Reads the values of an attribute. Each value has `type`, which must have eight bytes. `count`:
 * number of values; 0 means one value. `what`: message if the attribute has another type. */
static ebpo_status get_numbers(ebpo_head *head, ebpo_head_object object, const char *path,
                               const char *name, ebpo_head_type type, uint64_t *values,
                               unsigned count, const char *what, ebpo_error *error)
{
    attribute a = { .data = NULL };
    count = count ? count : 1;
    ebpo_status status = find_attribute(head, object, path, name, count, &a, error);
    if (status != EBPO_OK)
        return status;
    if (a.type.class != type.class || a.type.size != type.size ||
        a.type.is_signed != type.is_signed)
        return attribute_fails(head, path, name, what, error);
    for (unsigned i = 0; i < count; i++)
        values[i] = ebpo_load64(a.data + 8 * (size_t)i);
    return EBPO_OK;
}

ebpo_status ebpo_head_get_int(ebpo_head *head, ebpo_head_object object, const char *path,
                              const char *name, int64_t *value, ebpo_error *error)
{
    static const ebpo_head_type type = { EBPO_CLASS_INTEGER, 8, true };
    uint64_t bits = 0;
    ebpo_status status =
        get_numbers(head, object, path, name, type, &bits, 0, "the attribute is not an i64", error);
    if (status == EBPO_OK)
        memcpy(value, &bits, sizeof bits);
    return status;
}

ebpo_status ebpo_head_get_count(ebpo_head *head, ebpo_head_object object, const char *path,
                                const char *name, uint64_t *value, ebpo_error *error)
{
    static const ebpo_head_type type = { EBPO_CLASS_INTEGER, 8, false };
    return get_numbers(head, object, path, name, type, value, 0, "the attribute is not a u64",
                       error);
}

ebpo_status ebpo_head_get_real(ebpo_head *head, ebpo_head_object object, const char *path,
                               const char *name, double *values, unsigned count, ebpo_error *error)
{
    enum { LIMIT = 16 };
    static const ebpo_head_type type = { EBPO_CLASS_DOUBLE, 8, false };
    uint64_t bits[LIMIT];
    if (count > LIMIT)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "attributes have at most %d values", LIMIT);
    ebpo_status status = get_numbers(head, object, path, name, type, bits, count,
                                     "the attribute's values are not f64", error);
    if (status == EBPO_OK)
        memcpy(values, bits, (count ? count : 1) * sizeof bits[0]);
    return status;
}
