/* Answers as bytes, until they leave: a buffer that grows, and knows where an answer ends. */
#ifndef EBPO_TOOLS_ANSWER_TEXT_H
#define EBPO_TOOLS_ANSWER_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct answer_text answer_text;
struct answer_text {
    char *bytes;
    size_t count, capacity;
    size_t spill_at;      /* so much is kept before it spills */
    size_t answer, piece; /* where the last answer ended, and the last piece */
    size_t *cuts;         /* [cut_count] ends of pieces: answers together, at most 4096 bytes */
    size_t cut_count, cut_capacity;
    uint64_t rows; /* whose answers are complete, since it was last set to 0 */
    size_t row;    /* where the last one of these ended */
    size_t gone;   /* bytes behind it that have left */
    size_t again;  /* the first bytes of the text, which left before and are not written again */
    bool failed;   /* for want of memory; what was there is lost */
    bool refused;  /* it could not be written, which has been said */
    bool full; /* what comes behind the last complete row is lost; answer_text_retry ends that */
    /* Called when the text is too long to be kept: lets it leave, loses it, or sets `full`. */
    void (*spill)(answer_text *t, void *user);
    void *user;
};

/* Longest answer, but for lists of hits and faces, whose items are shorter. */
enum { ANSWER_MOST = 768 };

/* False: not enough memory. answer_text_free in any case. */
bool answer_text_init(answer_text *t);
void answer_text_free(answer_text *t);

/* What answer_text_room does where there is too little room, or too much in it. */
char *answer_text_grow(answer_text *t);
/* A pipe takes so many bytes at once, or nothing; so much is usually kept before it spills. */
enum { ANSWER_PIECE = 4096, ANSWER_SPILL = 1 << 20 };

/* Where ANSWER_MOST bytes may be written; answer_text_end tells how far they go. Never NULL: where
 * there is no memory, what is there is lost, and `failed` says so. */
static inline char *answer_text_room(answer_text *t)
{
    return t->count < t->spill_at && t->count + ANSWER_MOST <= t->capacity ? t->bytes + t->count
                                                                           : answer_text_grow(t);
}
static inline void answer_text_end(answer_text *t, const char *end)
{
    t->count = (size_t)(end - t->bytes);
}

void answer_text_cut(answer_text *t, size_t at);
/* What is there ends an answer; what is short enough to stay with it leaves with it. */
static inline void answer_text_close(answer_text *t)
{
    if (t->count - t->piece > ANSWER_PIECE && t->answer > t->piece)
        answer_text_cut(t, t->answer);
    t->answer = t->count;
}

/* Ends the answer to a row of the input. */
static inline void answer_text_end_row(answer_text *t)
{
    answer_text_close(t);
    if (t->full)
        return;
    t->rows++;
    t->row = t->count;
    t->gone = 0;
}
/* Whether more answers would be lost. */
static inline bool answer_text_is_over(const answer_text *t)
{
    return t->failed || t->refused || t->full;
}

/* Drops what is behind the last complete row. The same bytes must come again: those of them that
 * have left are not written a second time. */
void answer_text_retry(answer_text *t);
/* Loses all of it; what comes is lost, too, when it leaves. */
void answer_text_lose(answer_text *t);

/* Writes all of it to standard output, to a pipe in its pieces, and empties it. False: it could not
 * be written, which is said. `command` is for the message. */
bool answer_text_leave(answer_text *t, const char *command);

#endif
