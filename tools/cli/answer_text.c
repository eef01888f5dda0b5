#include "cli/answer_text.h"

#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cli/command.h"

enum { FIRST = 1 << 16 };

bool answer_text_init(answer_text *t)
{
    *t = (answer_text){ .bytes = malloc(FIRST), .capacity = FIRST, .spill_at = ANSWER_SPILL };
    return t->bytes != NULL;
}

void answer_text_free(answer_text *t)
{
    free(t->bytes);
    free(t->cuts);
    *t = (answer_text){ .bytes = NULL };
}

static void clear_counts(answer_text *t)
{
    t->count = t->answer = t->piece = t->row = t->cut_count = 0;
}

void answer_text_lose(answer_text *t)
{
    t->failed = true;
    clear_counts(t);
}

/* Drops what is behind the last complete row. */
static void cut_row(answer_text *t)
{
    while (t->cut_count > 0 && t->cuts[t->cut_count - 1] > t->row)
        t->cut_count--;
    t->piece = t->cut_count ? t->cuts[t->cut_count - 1] : 0;
    t->count = t->answer = t->row;
}

void answer_text_retry(answer_text *t)
{
    cut_row(t);
    t->full = false;
    t->again += t->gone;
    t->gone = 0;
}

char *answer_text_grow(answer_text *t)
{
    if (t->count >= t->spill_at && t->spill && !t->full)
        t->spill(t, t->user);
    if (t->full)
        cut_row(t);
    if (t->count + ANSWER_MOST > t->capacity) {
        char *wider = realloc(t->bytes, 2 * t->capacity);
        if (wider) {
            t->bytes = wider;
            t->capacity *= 2;
        } else
            answer_text_lose(t);
    }
    return t->bytes + t->count;
}

void answer_text_cut(answer_text *t, size_t at)
{
    if (t->cut_count == t->cut_capacity) {
        size_t capacity = t->cut_capacity ? 2 * t->cut_capacity : 64;
        size_t *wider = realloc(t->cuts, capacity * sizeof *wider);
        if (!wider) {
            answer_text_lose(t);
            return;
        }
        t->cuts = wider;
        t->cut_capacity = capacity;
    }
    t->cuts[t->cut_count++] = t->piece = at;
}

bool answer_text_leave(answer_text *t, const char *command)
{
    struct stat st;
    bool fine = !t->failed && !t->refused,
         file = fstat(STDOUT_FILENO, &st) == 0 && S_ISREG(st.st_mode);
    size_t at = t->again < t->count ? t->again : t->count;
    t->again -= at;
    for (size_t i = 0; fine && !file && i < t->cut_count; i++) {
        if (t->cuts[i] <= at)
            continue;
        fine = command_write(command, t->bytes + at, t->cuts[i] - at);
        at = t->cuts[i];
    }
    if (fine && at < t->count)
        fine = command_write(command, t->bytes + at, t->count - at);
    t->gone = (t->row ? 0 : t->gone) + t->count - t->row;
    clear_counts(t);
    t->refused |= !fine;
    return fine;
}
