#include "mesh/off_text.h"

#include <string.h>

static bool ends_line(char c) { return c == '\n' || c == '\r'; }

static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }

/* A comment may follow a word without a blank; in 1.#INF and 1.#IND, as older programs write what
 * is not finite, no comment begins. */
static bool begins_comment(const char *word, const char *at, const char *end)
{
    return *at == '#' && !(at - word >= 2 && at[-2] == '1' && at[-1] == '.' && end - at > 1 &&
                           at[1] && strchr("IQS", at[1]));
}

bool ebpo_off_next_here(off_text *t, off_word *word)
{
    while (t->at < t->end && is_blank(*t->at))
        t->at++;
    if (t->at < t->end && *t->at == '#')
        while (t->at < t->end && !ends_line(*t->at))
            t->at++;
    const char *s = t->at;
    while (t->at < t->end && !is_blank(*t->at) && !ends_line(*t->at) &&
           !begins_comment(s, t->at, t->end))
        t->at++;
    *word = (off_word){ s, (size_t)(t->at - s) };
    return word->n > 0;
}

/* False at the end of the file. */
static bool next_line(off_text *t)
{
    if (t->at == t->end)
        return false;
    t->at += t->end - t->at > 1 && t->at[0] == '\r' && t->at[1] == '\n' ? 2 : 1;
    t->line++;
    return true;
}

bool ebpo_off_next(off_text *t, off_word *word)
{
    while (!ebpo_off_next_here(t, word))
        if (!next_line(t))
            return false;
    return true;
}

uint64_t ebpo_off_lines(const off_text *t)
{
    off_text ahead = *t;
    off_word word;
    uint64_t lines = 0;
    do {
        while (ebpo_off_next_here(&ahead, &word))
            continue;
        if (!next_line(&ahead))
            return lines;
        off_text line = ahead;
        lines += ebpo_off_next_here(&line, &word);
    } while (true);
}
