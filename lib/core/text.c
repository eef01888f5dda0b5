/* Checks that text is valid UTF-8 (RFC 3629) without control characters. Checks dates and times of
 * ISO 8601. Provides streams into memory. The streams use fopencookie, because with open_memstream
 * a failed allocation is not always reported. If the C library has no fopencookie, the streams use
 * open_memstream nevertheless. */
#include <stdlib.h>
#include <string.h>

#include <ebpo/base.h>

#include "core/alloc.h"
#include "core/text.h"

bool ebpo_text_is_utf8(const char *text)
{
    const uint8_t *p = (const uint8_t *)text;
    while (*p) {
        enum { INVALID = 9 };
        /* number of bytes that must follow this byte */
        unsigned more = *p < 0x80                 ? 0
                        : *p >= 0xc2 && *p < 0xe0 ? 1
                        : *p >= 0xe0 && *p < 0xf0 ? 2
                        : *p >= 0xf0 && *p < 0xf5 ? 3
                                                  : INVALID;
        if (more == INVALID)
            return false;
        if ((*p == 0xe0 && p[1] < 0xa0) || (*p == 0xed && p[1] >= 0xa0) ||
            (*p == 0xf0 && p[1] < 0x90) || (*p == 0xf4 && p[1] >= 0x90))
            return false; /* a longer encoding than needed, a surrogate, or beyond Unicode */
        for (p++; more; more--, p++)
            if (*p < 0x80 || *p > 0xbf)
                return false;
    }
    return true;
}

bool ebpo_text_ok(const char *text)
{
    for (const uint8_t *p = (const uint8_t *)text; *p; p++)
        if (*p < 0x20 || *p == 0x7f || (*p == 0xc2 && p[1] < 0xa0))
            return false; /* a control character */
    return ebpo_text_is_utf8(text);
}

uint64_t ebpo_text_bom_length(const void *text, uint64_t size)
{
    return size >= 3 && memcmp(text, "\xef\xbb\xbf", 3) == 0 ? 3 : 0;
}

/* --- dates --- */

/* Reads a number of exactly `count` digits and moves *text to the first character after it. Returns
 * false if a digit is missing or the number is not within `least` .. `most`. */
static bool read_digits(const char **text, int count, int least, int most, int *out)
{
    *out = 0;
    for (int i = 0; i < count; i++, (*text)++) {
        if (**text < '0' || **text > '9')
            return false;
        *out = 10 * *out + (**text - '0');
    }
    return *out >= least && *out <= most;
}

/* Returns the number of days of a month. */
static int days_in_month(int year, int month)
{
    static const int days[] = { 31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31 };
    bool is_leap_year = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
    return days[month - 1] + (month == 2 && is_leap_year);
}

/* Returns true for HH:MM, HH:MM:SS and HH:MM:SS.decimals, each followed by Z, +HH:MM, -HH:MM or
 * nothing. */
static bool is_time(const char *t)
{
    int n;
    if (!read_digits(&t, 2, 0, 23, &n) || *t != ':' || (t++, !read_digits(&t, 2, 0, 59, &n)))
        return false;
    if (*t == ':') {
        t++;
        if (!read_digits(&t, 2, 0, 60, &n)) /* 60: a leap second */
            return false;
        if (*t == '.' || *t == ',') {
            size_t digits = strspn(t + 1, "0123456789");
            if (digits == 0)
                return false;
            t += 1 + digits;
        }
    }
    if (*t == 'Z')
        return t[1] == 0;
    if (*t == '+' || *t == '-') {
        t++;
        if (!read_digits(&t, 2, 0, 23, &n) || *t != ':' || (t++, !read_digits(&t, 2, 0, 59, &n)))
            return false;
    }
    return *t == 0;
}

bool ebpo_is_date(const char *text)
{
    int year, month, day;
    if (!read_digits(&text, 4, 0, 9999, &year))
        return false;
    if (*text == 0)
        return true;
    if (*text++ != '-' || !read_digits(&text, 2, 1, 12, &month))
        return false;
    if (*text == 0)
        return true;
    if (*text++ != '-' || !read_digits(&text, 2, 1, days_in_month(year, month), &day))
        return false;
    return *text == 0 || (*text == 'T' && is_time(text + 1));
}

/* --- streams into memory --- */

#ifdef EBPO_HAVE_FOPENCOOKIE
/* Appends to s->text what stdio writes. This is the `write` function of fopencookie. */
static ssize_t keep_text(void *cookie, const char *data, size_t bytes)
{
    ebpo_text_stream *s = cookie;
    if (s->failed || !ebpo_grow(&s->text, &s->capacity, s->bytes + bytes + 1, 1)) {
        s->failed = true;
        return 0; /* stdio treats 0 as an error */
    }
    memcpy(s->text + s->bytes, data, bytes);
    s->bytes += bytes;
    return (ssize_t)bytes;
}

bool ebpo_text_stream_begin(ebpo_text_stream *s)
{
    memset(s, 0, sizeof *s);
    s->file = fopencookie(s, "w", (cookie_io_functions_t){ .write = keep_text });
    if (s->file)
        setvbuf(s->file, s->buffer, _IOFBF, sizeof s->buffer);
    return s->file != NULL;
}
#else
bool ebpo_text_stream_begin(ebpo_text_stream *s)
{
    memset(s, 0, sizeof *s);
    s->file = open_memstream(&s->text, &s->size);
    return s->file != NULL;
}
#endif

bool ebpo_text_stream_end(ebpo_text_stream *s)
{
    s->failed = s->failed || ferror(s->file);
    bool complete = fclose(s->file) == 0 && !s->failed;
    s->file = NULL;
#ifdef EBPO_HAVE_FOPENCOOKIE
    complete = complete && ebpo_grow(&s->text, &s->capacity, 1, 1);
#else
    complete = complete && s->text;
    s->bytes = s->size;
#endif
    if (complete) {
        s->text[s->bytes] = 0;
        return true;
    }
    free(s->text);
    s->text = NULL;
    return false;
}
