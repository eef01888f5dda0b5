#include "hdf5_read/head_types.h"

#include <string.h>

static bool is_double(ebpo_head_cursor *c, unsigned bits, uint32_t size)
{
    /* offset, bits, exponent's place and size, mantissa's, bias */
    static const uint8_t ieee[12] = { 0, 0, 64, 0, 52, 11, 0, 52, 255, 3, 0, 0 };
    const uint8_t *at = ebpo_cursor_take(c, sizeof ieee);
    return at && size == 8 && bits == 0x3f20 && memcmp(at, ieee, sizeof ieee) == 0;
}

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

/* Version 1 is what programs write that add an attribute to a file, with HDF5 as it is set. */
ebpo_head_space ebpo_head_read_space(ebpo_head_cursor c)
{
    enum { HAS_MOST = 1, PLAIN = 1, RANK_MOST = 32 };
    static const ebpo_head_space unread = { .rank = UINT32_MAX };
    unsigned version = ebpo_cursor_u8(&c), rank = ebpo_cursor_u8(&c), flags = ebpo_cursor_u8(&c);
    unsigned type = version == 2 ? ebpo_cursor_u8(&c) : PLAIN;
    if (version == 1)
        ebpo_cursor_take(&c, 5);
    if (version < 1 || version > 2 || type > PLAIN || rank > RANK_MOST)
        return unread;
    ebpo_head_space space = { .rank = rank, .fixed = true, .values = 1 };
    bool fits = true;
    uint64_t size[RANK_MOST] = { 0 };
    for (unsigned i = 0; i < rank; i++) {
        size[i] = ebpo_cursor_u64(&c);
        fits = fits && !__builtin_mul_overflow(space.values, size[i], &space.values);
    }
    for (unsigned i = 0; i < rank && flags & HAS_MOST; i++)
        space.fixed = space.fixed && ebpo_cursor_u64(&c) == size[i];
    memcpy(space.size, size, sizeof space.size);
    if (!fits)
        space.values = 0;
    return c.cut ? unread : space;
}

ebpo_head_filters ebpo_head_read_filters(ebpo_head_cursor c)
{
    enum { NAMED_FROM = 256 };
    ebpo_head_filters filters = { .count = EBPO_HEAD_FILTERS + 1 };
    if (ebpo_cursor_u8(&c) != 2)
        return filters;
    unsigned count = ebpo_cursor_u8(&c);
    for (unsigned i = 0; i < count && i < EBPO_HEAD_FILTERS; i++) {
        unsigned id = ebpo_cursor_u16(&c), name = id >= NAMED_FROM ? ebpo_cursor_u16(&c) : 0;
        ebpo_cursor_u16(&c); /* optional or not: they are all needed */
        unsigned values = ebpo_cursor_u16(&c);
        ebpo_cursor_take(&c, name);
        ebpo_head_cursor of = ebpo_cursor_part(&c, 4 * (size_t)values);
        filters.filter[i].id = id;
        filters.filter[i].values = values;
        filters.filter[i].first = values ? ebpo_cursor_u32(&of) : 0;
    }
    if (!c.cut)
        filters.count = count;
    return filters;
}
