#include "cli/numbers.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* --- reading --- */

/* Returns true for characters that may follow a number. If such a character follows, <charconv> and
 * strtod read the same number. */
static bool ends_number(char c)
{
    return c == 0 || c == ' ' || c == '\t' || c == ',' || c == '\r' || c == '\v' || c == '\f' ||
           c == '#' || c == '\n';
}

/* If a name such as #INF follows the number v, moves *after to the end of the name, and returns
 * NAN; otherwise returns v. Microsoft's C library writes 1.#INF, 1.#IND, 1.#QNAN and 1.#SNAN for
 * non-finite numbers. */
static double pass_names(double v, const char **after)
{
    const char *at = *after;
    if (at[0] != '#' || at[-1] != '.' || !at[1] || !strchr("IQS", at[1]))
        return v;
    while (!ends_number(at[1]))
        at++;
    *after = at + 1;
    return NAN;
}

/* Uses <charconv> if possible. strtod reads the texts that <charconv> refuses: hexadecimal numbers,
 * numbers beyond the range of doubles, and invalid text. */
double number_read(const char *text, const char *end, const char **after)
{
    double v = 0;
#ifdef EBPO_HAVE_CHARCONV
    const char *digits = text + (*text == '+' && text + 1 < end && text[1] != '-');
    if (number_charconv_read(digits, end, after, &v) && (*after == end || ends_number(**after)))
        return pass_names(v, after);
#else
    (void)end;
#endif
    char *stop;
    v = strtod(text, &stop);
    *after = stop;
    return stop > text ? pass_names(v, after) : v;
}

const char *number_skip_mark(const char *text)
{
    return text + (strncmp(text, "\xef\xbb\xbf", 3) == 0 ? 3 : 0);
}

/* --- printing --- */

#ifndef EBPO_HAVE_CHARCONV
static char *digits_of(char *out, double v)
{
    int length = 0;
    for (int more = 0; more <= 16; more++) {
        length = snprintf(out, NUMBER_CAPACITY, "%.*e", more, v);
        if (strtod(out, NULL) == v)
            break;
    }
    return out + length;
}
#else
#define digits_of number_charconv_digits
#endif

static char *put_zeros(char *out, int count)
{
    if (count > 0)
        memset(out, '0', (size_t)count);
    return count > 0 ? out + count : out;
}

/* Writes a number without an exponent. `digits`: "123" for 1.23 times ten to the power `exponent`.
 * `count`: number of digits. `exponent`: -4 to 16. Returns the end of the output. */
static char *write_fixed(char *out, const char *digits, int count, int exponent)
{
    int whole = exponent < 0 ? 0 : exponent + 1 < count ? exponent + 1 : count;
    memcpy(out, digits, (size_t)whole);
    out = put_zeros(out + whole, exponent < 0 ? 1 : exponent + 1 - count);
    if (whole < count) {
        *out++ = '.';
        out = put_zeros(out, -exponent - 1);
        memcpy(out, digits + whole, (size_t)(count - whole));
        out += count - whole;
    }
    return out;
}

char *number_write(char *out, double v)
{
    char text[NUMBER_CAPACITY + 1], digits[NUMBER_CAPACITY];
    if (!isfinite(v))
        return out + snprintf(out, NUMBER_CAPACITY, "%g", v);
    if (signbit(v))
        *out++ = '-';
    if (v == 0) {
        *out = '0';
        return out + 1;
    }
    char *end = digits_of(text, fabs(v)), *e = text + 1;
    int count = 1, exponent = 0;
    digits[0] = text[0];
    for (e += *e == '.'; *e != 'e'; e++)
        digits[count++] = *e;
    for (const char *d = e + 2; d < end; d++)
        exponent = 10 * exponent + (*d - '0');
    exponent = e[1] == '-' ? -exponent : exponent;
    if (exponent >= -4 && exponent < 17)
        return write_fixed(out, digits, count, exponent);
    memcpy(out, text, (size_t)(end - text));
    return out + (end - text);
}

char *number_write_uint(char *out, uint64_t v)
{
    char digits[20];
    int count = 0;
    if (v < 10) { /* fast path for winding numbers, which are small */
        *out = (char)('0' + v);
        return out + 1;
    }
    do
        digits[count++] = (char)('0' + v % 10);
    while ((v /= 10) > 0);
    while (count > 0)
        *out++ = digits[--count];
    return out;
}

char *number_write_int(char *out, int64_t v)
{
    if (v < 0)
        *out++ = '-';
    return number_write_uint(out, v < 0 ? -(uint64_t)v : (uint64_t)v);
}
