/* Reads the bytes of an open head (the HDF5 headers of a file, head.h) in few reads, and keeps the
 * first failure. One read fetches the first bytes of the file, which have all headers. Another read
 * fetches all chunk indexes, which HDF5 has for arrays of more than one chunk. All other bytes are
 * read through a window. Bytes beyond the end of the file are not read. After a failure of the
 * input, nothing is read. If the input failed, ebpo_head_fail reports the input's error. Otherwise
 * it reports the reason why the reader refuses the file. */
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "hdf5_read/head_parts.h"

enum {
    FIRST_BYTES = 131072, /* sufficient for all headers */
    /* size of the window for all other bytes: headers that were added later, and chunk indexes
       whose range is not known */
    WINDOW_BYTES = 131072
};

ebpo_status ebpo_head_bytes_open(ebpo_head_bytes *b, ebpo_input *input, ebpo_error *error)
{
    uint64_t bytes = input->source.size < FIRST_BYTES ? input->source.size : FIRST_BYTES;
    if (ebpo_input_is_remote(input) && input->source.prefetched < bytes)
        bytes = input->source.prefetched;
    *b = (ebpo_head_bytes){
        .input = input, .first = ebpo_alloc(bytes, 1), .first_bytes = bytes, .status = EBPO_OK
    };
    return b->first ? ebpo_input_read(input, 0, bytes, b->first, error)
                    : ebpo_fail_memory(error, bytes);
}

void ebpo_head_bytes_close(ebpo_head_bytes *b)
{
    free(b->first);
    free(b->window);
    free(b->table);
    free(b->large);
    *b = (ebpo_head_bytes){ .status = EBPO_OK };
}

/* Returns the bytes [at, at + size) of the file from a buffer. `buffer` contains the range `held`
 * of the file. Returns NULL if this range does not contain all these bytes. */
static const uint8_t *bytes_within(const uint8_t *buffer, ebpo_range held, uint64_t at,
                                   uint64_t size)
{
    if (!buffer || at < held.offset || at - held.offset > held.size ||
        size > held.size - (at - held.offset))
        return NULL;
    return buffer + (at - held.offset);
}

/* Reads a range into *buffer, and allocates *buffer with `capacity` bytes if it is NULL. */
static bool read_into(ebpo_head_bytes *b, uint8_t **buffer, uint64_t capacity, ebpo_range range)
{
    if (!*buffer)
        *buffer = ebpo_alloc(capacity, 1);
    b->status = *buffer ? ebpo_input_read(b->input, range.offset, range.size, *buffer, &b->error)
                        : ebpo_fail_memory(&b->error, capacity);
    return b->status == EBPO_OK;
}

static const uint8_t *read_table(ebpo_head_bytes *b, uint64_t at, uint64_t size)
{
    return read_into(b, &b->table, b->index.size, b->index)
               ? bytes_within(b->table, b->index, at, size)
               : NULL;
}

/* Returns the range of the window to read for an offset. Windows begin at multiples of half their
 * size, so that reading back and forth around an offset does not move the window. A window that
 * begins before the chunk indexes ends where the indexes begin, because the indexes are read
 * separately. */
static ebpo_range window_around(const ebpo_head_bytes *b, uint64_t at)
{
    uint64_t begin = at / (WINDOW_BYTES / 2) * (WINDOW_BYTES / 2), end = b->input->source.size;
    if (b->index.size && at < b->index.offset)
        end = b->index.offset;
    return (ebpo_range){ begin, end - begin < WINDOW_BYTES ? end - begin : WINDOW_BYTES };
}

/* Reads a range that is too large for the window. */
static const uint8_t *read_large(ebpo_head_bytes *b, uint64_t at, uint64_t size)
{
    if (size > b->large_capacity) {
        free(b->large);
        b->large = NULL;
        b->large_capacity = size;
    }
    return read_into(b, &b->large, b->large_capacity, (ebpo_range){ at, size }) ? b->large : NULL;
}

const uint8_t *ebpo_head_bytes_at(ebpo_head_bytes *b, uint64_t at, uint64_t size)
{
    uint64_t end = b->input->source.size;
    if (b->status != EBPO_OK || at > end || size > end - at)
        return NULL;
    const uint8_t *found = bytes_within(b->first, (ebpo_range){ 0, b->first_bytes }, at, size);
    if (!found)
        found = bytes_within(b->window, (ebpo_range){ b->window_at, b->window_bytes }, at, size);
    if (!found && b->table)
        found = bytes_within(b->table, b->index, at, size);
    if (found)
        return found;
    if (b->index.size && !b->table && at >= b->index.offset &&
        at - b->index.offset < b->index.size && size <= b->index.size - (at - b->index.offset))
        return read_table(b, at, size);
    ebpo_range window = window_around(b, at);
    if (at - window.offset > window.size || size > window.size - (at - window.offset))
        return read_large(b, at, size);
    b->window_bytes = 0; /* the window is empty if reading fails */
    if (!read_into(b, &b->window, WINDOW_BYTES, window))
        return NULL;
    b->window_at = window.offset;
    b->window_bytes = window.size;
    return b->window + (at - window.offset);
}

/* --- errors --- */

/* Sets the error for a refusal. `what`: the beginning of the message, or "". */
static ebpo_status fail_refused(const ebpo_head *head, const char *path, const char *what,
                                const ebpo_head_refusal *why, ebpo_error *error)
{
    if (why->foreign)
        return ebpo_fail_at(error, EBPO_E_UNSUPPORTED, head->shown, path, -1,
                            "%s, " EBPO_HEAD_FOREIGN, why->what);
    return why->what && *what ? ebpo_fail_at(error, EBPO_E_FORMAT, head->shown, path, -1, "%s: %s",
                                             what, why->what)
                              : ebpo_fail_at(error, EBPO_E_FORMAT, head->shown, path, -1, "%s",
                                             why->what ? why->what : what);
}

ebpo_status ebpo_head_fail(const ebpo_head *head, const char *path, const char *what,
                           ebpo_error *error)
{
    const ebpo_head_state *s = head->state;
    if (s->bytes.status != EBPO_OK)
        return ebpo_fail_with(error, &s->bytes.error);
    return fail_refused(head, path, what, &s->refusal, error);
}
