#include "mesh/obj_text.h"

#include <string.h>

#include "core/text.h"

static bool ends_line(char c) { return c == '\n' || c == '\r'; }

static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }

obj_text ebpo_obj_text(const uint8_t *data, uint64_t size)
{
    return (obj_text){ (const char *)data + ebpo_text_mark(data, size), (const char *)data + size,
                       1, false };
}

/* Characters at which a word may end. */
static const bool may_end[256] = { [' '] = true,  ['\t'] = true, ['\v'] = true, ['\f'] = true,
                                   ['\n'] = true, ['\r'] = true, ['\\'] = true };

/* Past the end of a line. */
static const char *past_end(const char *at, const char *end)
{
    if (end - at > 1 && at[0] == '\r' && at[1] == '\n')
        return at + 2;
    return at < end ? at + 1 : at;
}

/* The end of the line where a backslash joins it to the next; NULL: it does not. */
static const char *joined_end(const char *at, const char *end)
{
    if (*at != '\\')
        return NULL;
    for (at++; at < end && is_blank(*at);)
        at++;
    return at < end && ends_line(*at) ? at : NULL;
}

static void skip_blanks(obj_text *t)
{
    const char *joined;
    while (t->at < t->end) {
        if (is_blank(*t->at)) {
            t->at++;
        } else if ((joined = joined_end(t->at, t->end))) {
            t->at = past_end(joined, t->end);
            t->line++;
        } else {
            return;
        }
    }
}

bool ebpo_obj_next_word(obj_text *t, obj_word *word)
{
    skip_blanks(t);
    const char *s = t->at;
    if (s == t->end || ends_line(*s) || *s == '#')
        return false;
    const char *at = s;
    while (at < t->end && (!may_end[(uint8_t)*at] || (*at == '\\' && !joined_end(at, t->end))))
        at++;
    t->at = at;
    *word = (obj_word){ s, (size_t)(at - s) };
    return true;
}

static void skip_line(obj_text *t)
{
    while (t->at < t->end && !ends_line(*t->at))
        t->at++;
}

obj_word ebpo_obj_name(obj_text *t)
{
    while (t->at < t->end && is_blank(*t->at))
        t->at++;
    const char *s = t->at, *stop;
    skip_line(t);
    for (stop = t->at; stop > s && is_blank(stop[-1]);)
        stop--;
    return (obj_word){ s, (size_t)(stop - s) };
}

bool ebpo_obj_next_statement(obj_text *t, obj_word *word)
{
    bool begun = t->begun;
    t->begun = true;
    while (ebpo_obj_next_word(t, word))
        if (!begun)
            return true;
    for (;;) {
        skip_line(t);
        if (t->at == t->end)
            return false;
        t->at = past_end(t->at, t->end);
        t->line++;
        if (ebpo_obj_next_word(t, word))
            return true;
    }
}

bool ebpo_obj_word_is(obj_word word, const char *text)
{
    return word.n == strlen(text) && memcmp(word.s, text, word.n) == 0;
}
