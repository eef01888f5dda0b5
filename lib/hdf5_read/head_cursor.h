/* Inside lib/hdf5_read only: a reading place in bytes that nobody vouches for. Beyond the end it
 * gives zeros and notes that it did. */
#ifndef EBPO_HDF5_READ_HEAD_CURSOR_H
#define EBPO_HDF5_READ_HEAD_CURSOR_H

#include <stdbool.h>
#include <stddef.h>

#include "core/endian.h"

#define EBPO_NO_ADDRESS UINT64_MAX

typedef struct ebpo_head_cursor {
    const uint8_t *at, *end;
    bool cut; /* more was asked for than there is */
} ebpo_head_cursor;

static inline size_t ebpo_cursor_left(const ebpo_head_cursor *c)
{
    return (size_t)(c->end - c->at);
}

/* Moves on; NULL when there are not so many bytes. */
static inline const uint8_t *ebpo_cursor_take(ebpo_head_cursor *c, size_t bytes)
{
    const uint8_t *from = c->at;
    if (bytes > ebpo_cursor_left(c)) {
        c->cut = true;
        c->at = c->end;
        return NULL;
    }
    c->at += bytes;
    return from;
}

/* An unsigned integer of at most 8 bytes. */
static inline uint64_t ebpo_cursor_uint(ebpo_head_cursor *c, unsigned bytes)
{
    const uint8_t *from = ebpo_cursor_take(c, bytes);
    uint64_t value = 0;
    for (unsigned i = bytes; from && i-- > 0;)
        value = value << 8 | from[i];
    return value;
}
static inline uint8_t ebpo_cursor_u8(ebpo_head_cursor *c)
{
    return (uint8_t)ebpo_cursor_uint(c, 1);
}
static inline uint16_t ebpo_cursor_u16(ebpo_head_cursor *c)
{
    return (uint16_t)ebpo_cursor_uint(c, 2);
}
static inline uint32_t ebpo_cursor_u32(ebpo_head_cursor *c)
{
    return (uint32_t)ebpo_cursor_uint(c, 4);
}
static inline uint64_t ebpo_cursor_u64(ebpo_head_cursor *c) { return ebpo_cursor_uint(c, 8); }

/* The next `bytes` bytes as a cursor of their own. */
static inline ebpo_head_cursor ebpo_cursor_part(ebpo_head_cursor *c, size_t bytes)
{
    const uint8_t *from = ebpo_cursor_take(c, bytes);
    return (ebpo_head_cursor){ from ? from : c->end, from ? from + bytes : c->end, !from };
}

#endif
