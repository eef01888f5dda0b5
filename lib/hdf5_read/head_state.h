/* Inside lib/hdf5_read only: an open head, and the headers of its objects. */
#ifndef EBPO_HDF5_READ_HEAD_STATE_H
#define EBPO_HDF5_READ_HEAD_STATE_H

#include "core/alloc.h"
#include "hdf5_read/head.h"
#include "hdf5_read/head_bytes.h"
#include "hdf5_read/head_cursor.h"

/* Types of messages. */
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
    uint32_t offset, size; /* in the header's bytes */
    uint8_t type, flags;
} ebpo_head_message;

/* An object's header: its blocks, one behind the other, and the messages in them. */
typedef struct ebpo_head_header {
    uint64_t address, used; /* used: by the state's clock, 0: the slot is free */
    uint8_t *bytes;
    ebpo_head_message *message;
    uint64_t byte_count, byte_capacity, count, capacity;
    ebpo_head_kind kind;
} ebpo_head_header;

/* Why something was refused. */
typedef struct ebpo_head_refusal {
    const char *what; /* NULL: nothing was */
    bool foreign;     /* it is not damaged, but of a kind that only libhdf5 reads */
} ebpo_head_refusal;

enum { EBPO_HEAD_SLOTS = 32 };

typedef struct ebpo_head_state {
    ebpo_head_bytes bytes;
    uint64_t root, clock;
    ebpo_head_header slot[EBPO_HEAD_SLOTS]; /* those used last */
    ebpo_head_refusal refusal;              /* the last one */
    ebpo_range *kept;                       /* see ebpo_head_keep_ranges */
    uint64_t kept_count, kept_capacity;
    bool keeps, kept_short; /* short of memory */
} ebpo_head_state;

/* These bytes of the file are ours. */
static inline void ebpo_head_note_range(ebpo_head_state *s, uint64_t at, uint64_t size)
{
    if (!s->keeps)
        return;
    if (ebpo_grow(&s->kept, &s->kept_capacity, s->kept_count + 1, sizeof *s->kept))
        s->kept[s->kept_count++] = (ebpo_range){ at, size };
    else
        s->kept_short = true;
}

/* Notes why; false, so that `return` reads well. */
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

/* Whether `size` bytes, the last four of which are the checksum of the others, are whole. */
bool ebpo_head_sound(const uint8_t *block, uint64_t size);

/* Reads the superblock: where the root group is. False: the refusal says why. */
bool ebpo_head_read_superblock(ebpo_head_state *s);
/* True for bytes that begin as those of any HDF5 file. */
bool ebpo_head_has_signature(ebpo_head_state *s);

/* The header at an address, until the next call. NULL: the refusal says why. */
const ebpo_head_header *ebpo_head_header_at(ebpo_head_state *s, uint64_t address);
void ebpo_head_headers_free(ebpo_head_state *s);

static inline ebpo_head_cursor ebpo_head_message_cursor(const ebpo_head_header *h,
                                                        const ebpo_head_message *m)
{
    const uint8_t *from = h->bytes + m->offset;
    return (ebpo_head_cursor){ from, from + m->size, false };
}

/* What a path names, and where its header is. Without a refusal ABSENT and OTHER are what they say.
 */
ebpo_head_kind ebpo_head_find(ebpo_head_state *s, const char *path, ebpo_head_object *object);

/* The error that says what was refused: "`path`: `what`: the refusal". A failed input's own error
 * goes before. */
EBPO_MUST_USE ebpo_status ebpo_head_fail(const ebpo_head *head, const char *path, const char *what,
                                         ebpo_error *error);

#endif
