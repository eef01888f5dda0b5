/* Buffers the results of queries. A row is the output for one input row; a piece is a part of the
 * output that is written to a pipe at once. */
#include "cli/result_text.h"

#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cli/command.h"

enum { FIRST_CAPACITY = 1 << 16 };

bool result_text_init(result_text *t)
{
    *t = (result_text){ .bytes = malloc(FIRST_CAPACITY),
                        .capacity = FIRST_CAPACITY,
                        .spill_at = RESULT_SPILL };
    return t->bytes != NULL;
}

void result_text_free(result_text *t)
{
    free(t->bytes);
    free(t->cuts);
    *t = (result_text){ .bytes = NULL };
}

static void clear_counts(result_text *t)
{
    t->count = t->result = t->piece = t->row = t->cut_count = 0;
}

void result_text_discard(result_text *t)
{
    t->failed = true;
    clear_counts(t);
}

/* Drops the text after the last complete row. */
static void drop_partial_row(result_text *t)
{
    while (t->cut_count > 0 && t->cuts[t->cut_count - 1] > t->row)
        t->cut_count--;
    t->piece = t->cut_count ? t->cuts[t->cut_count - 1] : 0;
    t->count = t->result = t->row;
}

void result_text_retry(result_text *t)
{
    drop_partial_row(t);
    t->full = false;
    t->skipped_bytes += t->row_written;
    t->row_written = 0;
}

char *result_text_grow(result_text *t)
{
    if (t->count >= t->spill_at && t->spill && !t->full)
        t->spill(t, t->user);
    if (t->full)
        drop_partial_row(t);
    if (t->count + RESULT_MAX > t->capacity) {
        char *larger = realloc(t->bytes, 2 * t->capacity);
        if (larger) {
            t->bytes = larger;
            t->capacity *= 2;
        } else
            result_text_discard(t);
    }
    return t->bytes + t->count;
}

void result_text_cut(result_text *t, size_t at)
{
    if (t->cut_count == t->cut_capacity) {
        size_t capacity = t->cut_capacity ? 2 * t->cut_capacity : 64;
        size_t *larger = realloc(t->cuts, capacity * sizeof *larger);
        if (!larger) {
            result_text_discard(t);
            return;
        }
        t->cuts = larger;
        t->cut_capacity = capacity;
    }
    t->cuts[t->cut_count++] = t->piece = at;
}

bool result_text_write(result_text *t, const char *command)
{
    struct stat st;
    bool success = !t->failed && !t->write_failed,
         is_file = fstat(STDOUT_FILENO, &st) == 0 && S_ISREG(st.st_mode); /* needs no pieces */
    size_t at = t->skipped_bytes < t->count ? t->skipped_bytes : t->count;
    t->skipped_bytes -= at;
    for (size_t i = 0; success && !is_file && i < t->cut_count; i++) {
        if (t->cuts[i] <= at)
            continue;
        success = command_write(command, t->bytes + at, t->cuts[i] - at);
        at = t->cuts[i];
    }
    if (success && at < t->count)
        success = command_write(command, t->bytes + at, t->count - at);
    t->row_written = (t->row ? 0 : t->row_written) + t->count - t->row;
    clear_counts(t);
    t->write_failed |= !success;
    return success;
}
