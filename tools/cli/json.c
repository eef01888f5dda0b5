#include "cli/json.h"

#include <assert.h>
#include <ebpo/base.h>
#include <math.h>
#include <string.h>

#include "cli/words.h"

/* Begins a new line with its indentation. */
static void begin_line(json *j)
{
    fputc('\n', j->out);
    for (int i = 0; i < j->depth; i++)
        fputs("  ", j->out);
}

int json_utf8_length(const char *text)
{
    const unsigned char *s = (const unsigned char *)text;
    unsigned char a = s[0];
    if (a < 0x80)
        return 1;
    int length = a >= 0xf0 ? 4 : a >= 0xe0 ? 3 : 2;
    if (a < 0xc2 || a > 0xf4)
        return 0;
    for (int i = 1; i < length; i++)
        if ((s[i] & 0xc0) != 0x80)
            return 0;
    bool bad = (a == 0xe0 && s[1] < 0xa0) || (a == 0xed && s[1] > 0x9f) ||
               (a == 0xf0 && s[1] < 0x90) || (a == 0xf4 && s[1] > 0x8f);
    return bad ? 0 : length;
}

static void print_quoted(json *j, const char *text)
{
    fputc('"', j->out);
    for (const unsigned char *s = (const unsigned char *)text; *s;) {
        int length = json_utf8_length((const char *)s);
        if (length == 0)
            fputs("\\ufffd", j->out);
        else if (*s == '"' || *s == '\\')
            fprintf(j->out, "\\%c", *s);
        else if (*s < 0x20 || *s == 0x7f || (*s == '<' && j->in_page))
            fprintf(j->out, "\\u%04x", *s);
        else
            fwrite(s, 1, (size_t)length, j->out);
        s += length ? length : 1;
    }
    fputc('"', j->out);
}

/* Writes the comma, the line break and the key before a value. */
static void begin_value(json *j, const char *key)
{
    if (j->depth) {
        if (j->filled[j->depth])
            fputc(',', j->out);
        j->filled[j->depth] = true;
        begin_line(j);
    }
    if (key) {
        print_quoted(j, key);
        fputs(": ", j->out);
    }
}

/* Begins an object or an array. open, close: its brackets. */
static void open_level(json *j, const char *key, char open, char close)
{
    begin_value(j, key);
    assert(j->depth + 1 < JSON_DEPTH);
    fputc(open, j->out);
    j->depth++;
    j->filled[j->depth] = false;
    j->close[j->depth] = close;
}

void json_begin(json *j, FILE *out)
{
    memset(j, 0, sizeof *j);
    j->out = out;
}

void json_object(json *j, const char *key)
{
    bool outermost = j->depth == 0;
    open_level(j, key, '{', '}');
    if (outermost && (j->out == stdout || j->out == stderr))
        json_text(j, "ebpo", ebpo_version());
}

void json_array(json *j, const char *key) { open_level(j, key, '[', ']'); }

void json_end(json *j)
{
    assert(j->depth > 0);
    char close = j->close[j->depth];
    bool filled = j->filled[j->depth];
    j->depth--;
    if (filled)
        begin_line(j);
    fputc(close, j->out);
}

void json_finish(json *j)
{
    while (j->depth)
        json_end(j);
    fputc('\n', j->out);
}

void json_text(json *j, const char *key, const char *text)
{
    begin_value(j, key);
    print_quoted(j, text);
}

void json_uint(json *j, const char *key, uint64_t v)
{
    begin_value(j, key);
    fprintf(j->out, "%llu", (unsigned long long)v);
}

void json_int(json *j, const char *key, int64_t v)
{
    begin_value(j, key);
    fprintf(j->out, "%lld", (long long)v);
}

void json_real(json *j, const char *key, double v)
{
    char text[32];
    begin_value(j, key);
    fputs(json_number(v, text), j->out);
}

void json_bool(json *j, const char *key, bool v)
{
    begin_value(j, key);
    fputs(v ? "true" : "false", j->out);
}

void json_null(json *j, const char *key)
{
    begin_value(j, key);
    fputs("null", j->out);
}

void json_reals(json *j, const char *key, const double *v, int count)
{
    begin_value(j, key);
    fputc('[', j->out);
    for (int i = 0; i < count; i++)
        fprintf(j->out, "%s%s", i ? ", " : "", json_number(v[i], (char[32]){ 0 }));
    fputc(']', j->out);
}

const char *json_number(double x, char text[32])
{
    return isfinite(x) ? words_real(x, text) : strcpy(text, "null");
}
