/* Buffers results as bytes until they are written to standard output.
 *
 * A *row* is all output for one input row; it has one or more *results*, such as the faces of a
 * list. A *piece* is a sequence of results that is written to a pipe at once. It has at most
 * RESULT_PIECE bytes, unless a single result is longer. If a row becomes too long for the buffer,
 * the buffer *spills*: the owner decides whether to write or to drop the text (`spill`). */
#ifndef EBPO_TOOLS_RESULT_TEXT_H
#define EBPO_TOOLS_RESULT_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct result_text result_text;
struct result_text {
    char *bytes;
    size_t count, capacity;
    size_t spill_at;      /* number of bytes from which the buffer spills */
    size_t result, piece; /* end of the last result and of the last piece */
    size_t *cuts;         /* [cut_count] ends of pieces */
    size_t cut_count, cut_capacity;
    uint64_t rows;        /* number of complete rows since the owner has set this to 0 */
    size_t row;           /* end of the last complete row */
    size_t row_written;   /* bytes of the row after `row` that were already written */
    size_t skipped_bytes; /* first bytes of the text that were already written, to be skipped */
    bool failed;          /* true: out of memory; the buffered text is lost */
    bool write_failed;    /* true: writing failed, which has been reported */
    bool full; /* true: text after the last complete row is dropped until result_text_retry */
    /* Called when the text is too long to be kept: writes it, discards it, or sets `full`. */
    void (*spill)(result_text *t, void *user);
    void *user;
};

/* Maximum size of a result in bytes. For a list of hits or faces, this is the maximum size of an
 * item. */
enum { RESULT_MAX = 768 };

/* Begins an empty buffer. Returns false when out of memory. Call result_text_free in any case. */
bool result_text_init(result_text *t);
void result_text_free(result_text *t);

/* Grows or spills the buffer, so that there is space for RESULT_MAX bytes. Returns the position of
 * this space. */
char *result_text_grow(result_text *t);
/* RESULT_PIECE: number of bytes that a pipe takes at once, without a part of another writer in
 * between. RESULT_SPILL: default of spill_at. */
enum { RESULT_PIECE = 4096, RESULT_SPILL = 1 << 20 };

/* Returns the position at which the caller may write at most RESULT_MAX bytes. The caller then
 * calls result_text_end with the end of the written bytes. Never returns NULL: without memory, the
 * buffered text is lost and `failed` is set. */
static inline char *result_text_capacity(result_text *t)
{
    return t->count < t->spill_at && t->count + RESULT_MAX <= t->capacity ? t->bytes + t->count
                                                                          : result_text_grow(t);
}
static inline void result_text_end(result_text *t, const char *end)
{
    t->count = (size_t)(end - t->bytes);
}

/* Ends a piece at the offset `at`. */
void result_text_cut(result_text *t, size_t at);
/* Ends a result. If the result and the current piece together are longer than RESULT_PIECE, first
 * ends the piece before the result. */
static inline void result_text_close(result_text *t)
{
    if (t->count - t->piece > RESULT_PIECE && t->result > t->piece)
        result_text_cut(t, t->result);
    t->result = t->count;
}

/* Ends the results of an input row. */
static inline void result_text_end_row(result_text *t)
{
    result_text_close(t);
    if (t->full)
        return;
    t->rows++;
    t->row = t->count;
    t->row_written = 0;
}
/* Returns true if further results would be lost. */
static inline bool result_text_is_over(const result_text *t)
{
    return t->failed || t->write_failed || t->full;
}

/* Drops the text after the last complete row. The caller must add the same bytes again; bytes that
 * were already written are not written twice. */
void result_text_retry(result_text *t);
/* Discards the text. Later text is discarded, too, at the time when it would be written. */
void result_text_discard(result_text *t);

/* Writes the text to standard output (to a pipe in pieces) and empties the buffer. Returns false
 * after an error, which is reported. `command` is for the message. */
bool result_text_write(result_text *t, const char *command);

#endif
