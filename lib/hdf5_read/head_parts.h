/* Declares the parts of an open head (the HDF5 headers of a file): its bytes, a cursor in bytes,
 * headers of objects, and types, dimensions and filters. This header is private to lib/hdf5_read.
 * The library's writer puts headers at the start of the file. It puts the chunk indexes of all
 * arrays with more than one chunk into one range after the first levels. */
#ifndef EBPO_HDF5_READ_HEAD_PARTS_H
#define EBPO_HDF5_READ_HEAD_PARTS_H

#include <stdbool.h>
#include <stddef.h>

#include <ebpo/base.h>

#include "core/alloc.h"
#include "core/endian.h"
#include "hdf5_read/head.h"
#include "io/byte_source.h"

/* The bytes of an open head, which are read in few reads. */
typedef struct ebpo_head_bytes {
    ebpo_input *input;
    /* first: the file's first bytes. window: a range at another offset; NULL until needed */
    uint8_t *first, *window;
    uint8_t *table; /* the bytes of `index`; NULL until needed */
    uint8_t *large; /* a range that is too large for the window; NULL until needed */
    /* first_bytes: size of `first`. window_at, window_bytes: offset and size of the window.
     * large_capacity: size of `large` */
    uint64_t first_bytes, window_at, window_bytes, large_capacity;
    ebpo_range index; /* range of the chunk indexes (ebpo_head_hint_index), or empty */
    /* status of the input's first failure, after which nothing more is read */
    ebpo_status status;
    ebpo_error error;
} ebpo_head_bytes;

/* Fetches the first bytes. Call ebpo_head_bytes_close even if this function fails. */
EBPO_MUST_USE ebpo_status ebpo_head_bytes_open(ebpo_head_bytes *bytes, ebpo_input *input,
                                               ebpo_error *error);
void ebpo_head_bytes_close(ebpo_head_bytes *bytes);

/* Returns the bytes [at, at + size) of the file, valid until the next call. The caller has checked
 * that `size` is not too large to allocate. Returns NULL if the bytes are beyond the end of the
 * file, or could not be read (bytes->status). */
const uint8_t *ebpo_head_bytes_at(ebpo_head_bytes *bytes, uint64_t at, uint64_t size);

#define EBPO_NO_ADDRESS UINT64_MAX /* HDF5's value for an undefined address */

/* A read position in untrusted bytes. Reads beyond the end return zeros and set `cut`. */
typedef struct ebpo_head_cursor {
    const uint8_t *at, *end;
    bool cut; /* true: a read went beyond the end */
} ebpo_head_cursor;

static inline size_t ebpo_cursor_left(const ebpo_head_cursor *c)
{
    return (size_t)(c->end - c->at);
}

/* Returns the next `bytes` bytes, and advances. If fewer bytes are left, returns NULL and moves to
 * the end. */
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

/* Reads a little-endian unsigned integer of at most 8 bytes. */
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

/* Returns the next `bytes` bytes as a separate cursor. */
static inline ebpo_head_cursor ebpo_cursor_part(ebpo_head_cursor *c, size_t bytes)
{
    const uint8_t *from = ebpo_cursor_take(c, bytes);
    return (ebpo_head_cursor){ from ? from : c->end, from ? from + bytes : c->end, !from };
}

/* --- an open head, and the headers of its objects --- */

/* Types of the messages in an object's header. */
enum {
    EBPO_M_DATASPACE = 0x01,
    EBPO_M_LINK_INFO = 0x02,
    EBPO_M_DATATYPE = 0x03,
    EBPO_M_LINK = 0x06,
    EBPO_M_EXTERNAL = 0x07,
    EBPO_M_LAYOUT = 0x08,
    EBPO_M_GROUP_INFO = 0x0a,
    EBPO_M_PIPELINE = 0x0b,
    EBPO_M_ATTRIBUTE = 0x0c,
    EBPO_M_CONTINUATION = 0x10,
    EBPO_M_SYMBOL_TABLE = 0x11,
    EBPO_M_ATTRIBUTE_INFO = 0x15
};

typedef struct ebpo_head_message {
    uint32_t offset,
        size; /* offset of the message's data in the header's bytes; size of the data */
    uint8_t type, flags;
} ebpo_head_message;

/* An object's header: the bytes of its blocks, one after another, and the messages in them. */
typedef struct ebpo_head_header {
    uint64_t address, used; /* used: time of last use by the state's clock; 0: the slot is free */
    uint8_t *bytes;         /* [byte_count] */
    ebpo_head_message *message; /* [count] */
    uint64_t byte_count, byte_capacity, count, capacity;
    ebpo_head_kind kind;
} ebpo_head_header;

/* Why the reader refuses a file or an object. */
typedef struct ebpo_head_refusal {
    const char *what; /* the reason, for messages; NULL: no refusal */
    bool foreign;     /* true: the file is valid HDF5 of another writer, which only libhdf5 reads */
} ebpo_head_refusal;

enum { EBPO_HEAD_SLOTS = 32 };

typedef struct ebpo_head_state {
    ebpo_head_bytes bytes;
    uint64_t root;                          /* address of the root group's header */
    uint64_t clock;                         /* number of accesses to headers so far */
    ebpo_head_header slot[EBPO_HEAD_SLOTS]; /* the last used headers */
    ebpo_head_refusal refusal;              /* the last refusal */
    ebpo_range *kept;                       /* recorded ranges: ebpo_head_keep_ranges */
    uint64_t kept_count, kept_capacity;
    bool keeps;          /* true: ranges are recorded */
    bool kept_no_memory; /* true: memory was short when a range was recorded */
} ebpo_head_state;

/* Records a range of the file that a header or index uses, if ebpo_head_keep_ranges was called. */
static inline void ebpo_head_note_range(ebpo_head_state *s, uint64_t at, uint64_t size)
{
    if (!s->keeps)
        return;
    if (ebpo_grow(&s->kept, &s->kept_capacity, s->kept_count + 1, sizeof *s->kept))
        s->kept[s->kept_count++] = (ebpo_range){ at, size };
    else
        s->kept_no_memory = true;
}

/* These functions record the reason of a refusal, and return false, so that the caller can return
 * their result. ebpo_refuse_foreign is for valid HDF5 of other writers. */
static inline bool ebpo_refuse(ebpo_head_state *s, const char *what)
{
    s->refusal = (ebpo_head_refusal){ what, false };
    return false;
}
static inline bool ebpo_refuse_foreign(ebpo_head_state *s, const char *what)
{
    s->refusal = (ebpo_head_refusal){ what, true };
    return false;
}

/* Returns true if the checksum of a block is right. The last four of the block's `size` bytes are
 * the checksum. */
bool ebpo_head_sound(const uint8_t *block, uint64_t size);

/* Returns the header at an address. The header is valid until the next call. Returns NULL if the
 * header is refused; then s->refusal has the reason. Also returns NULL if reading failed. */
const ebpo_head_header *ebpo_head_header_at(ebpo_head_state *s, uint64_t address);
void ebpo_head_headers_free(ebpo_head_state *s);

/* Returns a cursor over the data of a message. */
static inline ebpo_head_cursor ebpo_head_message_cursor(const ebpo_head_header *h,
                                                        const ebpo_head_message *m)
{
    const uint8_t *from = h->bytes + m->offset;
    return (ebpo_head_cursor){ from, from + m->size, false };
}

/* Returns the kind of object at a path, and the address of its header in *object. If s->refusal is
 * set, the kinds ABSENT and OTHER are not reliable, because a header could not be read. */
ebpo_head_kind ebpo_head_find(ebpo_head_state *s, const char *path, ebpo_head_object *object);

/* Sets the error for a refusal, with the message "path: what: reason of the refusal". `what` may be
 * "". If the input has failed, sets the input's error instead. */
EBPO_MUST_USE ebpo_status ebpo_head_fail(const ebpo_head *head, const char *path, const char *what,
                                         ebpo_error *error);

/* Types, dimensions and filters as messages describe them. */

typedef enum ebpo_head_class {
    EBPO_CLASS_INTEGER,       /* little-endian, using all bits */
    EBPO_CLASS_DOUBLE,        /* IEEE 754, little-endian, 64 bits */
    EBPO_CLASS_TEXT,          /* of fixed length, with any padding */
    EBPO_CLASS_OTHER_INTEGER, /* another integer, for example big-endian */
    EBPO_CLASS_OTHER
} ebpo_head_class;

typedef struct ebpo_head_type {
    ebpo_head_class class;
    uint32_t size; /* bytes of a value */
    bool is_signed;
} ebpo_head_type;

ebpo_head_type ebpo_head_read_type(ebpo_head_cursor c);

/* Dimensions of an array or attribute. */
typedef struct ebpo_head_space {
    unsigned rank;    /* number of dimensions; UINT32_MAX: not readable */
    bool fixed;       /* true: the dimensions cannot grow */
    uint64_t size[2]; /* the first two dimensions */
    uint64_t values;  /* product of the dimensions; 0: no values, or the product exceeds 64 bits */
} ebpo_head_space;

ebpo_head_space ebpo_head_read_space(ebpo_head_cursor c);

/* Filters in the order of application. */
enum { EBPO_HEAD_FILTERS = 3 };
typedef struct ebpo_head_filters {
    unsigned count; /* more than EBPO_HEAD_FILTERS: the format does not allow these filters */
    struct {
        unsigned id, values,
            first; /* number of the filter; number of its parameters; first parameter */
    } filter[EBPO_HEAD_FILTERS];
} ebpo_head_filters;

ebpo_head_filters ebpo_head_read_filters(ebpo_head_cursor c);

#endif
