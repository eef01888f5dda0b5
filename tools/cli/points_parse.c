/* Parses the numbers of a block of input rows. */
#include "cli/points_header.h"
#include "cli/points_parse.h"

#include <ctype.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cli/numbers.h"

/* --- checks for all kinds of input --- */

/* Checks the values of a row. `at`: number of the row's line, or of the row, for the message. */
static bool check_row(const points *p, points_block *b, uint64_t at, const double *row)
{
    for (int i = 0; i < points_raw_width(p->kind); i++)
        if (!isfinite(row[i]))
            return points_fault(b, at, "number %d is not finite", i + 1);
    if (p->kind == POINTS_RAYS && row[3] == 0 && row[4] == 0 && row[5] == 0)
        return points_fault(b, at, "the direction is 0 0 0");
    if (p->kind == POINTS_RAYS && !(row[6] >= 0))
        return points_fault(b, at, "tmax must be 0 or more");
    for (int k = 0; k < 3 && p->kind == POINTS_BOXES; k++)
        if (row[k] > row[3 + k])
            return points_fault(b, at,
                                "the lower corner of a box comes first, but %c0 is greater than "
                                "%c1",
                                "xyz"[k], "xyz"[k]);
    return true;
}

static bool alloc_rows(const points *p, points_block *b, uint64_t rows)
{
    if (b->capacity_rows < rows) {
        free(b->space);
        b->space = malloc(rows * (uint64_t)points_width(p->kind) * sizeof *b->space);
        b->capacity_rows = b->space ? rows : 0;
    }
    b->rows = b->space;
    return b->space || points_fault(b, 0, "not enough memory");
}

/* --- raw numbers --- */

static double load_number(points_layout layout, const char *at)
{
    uint64_t bits = 0;
    double v;
    float f;
    for (int i = 0; i < layout.bytes; i++)
        bits |= (uint64_t)(uint8_t)at[layout.big_endian ? layout.bytes - 1 - i : i] << 8 * i;
    uint32_t low = (uint32_t)bits;
    memcpy(&f, &low, sizeof f);
    memcpy(&v, &bits, sizeof v);
    return layout.bytes == 4 ? (double)f : v;
}

/* Returns true if the input numbers have the layout of query rows, so that no conversion is
 * needed. */
static bool is_query_layout(const points *p)
{
    return p->layout.bytes == 8 && p->layout.per_row == points_width(p->kind) &&
           p->layout.big_endian == (__BYTE_ORDER__ == __ORDER_BIG_ENDIAN__);
}

static bool all_finite(const double *v, uint64_t count)
{
    const uint64_t exponent = UINT64_C(0x7ff) << 52;
    uint64_t bad = 0;
    for (uint64_t i = 0; i < count; i++) {
        uint64_t bits;
        memcpy(&bits, v + i, sizeof bits);
        bad |= (bits & exponent) == exponent;
    }
    return !bad;
}

/* Checks `count` rows. Sets b->row_count to the number of rows before the first invalid row. */
static void check_rows(const points *p, points_block *b, uint64_t count)
{
    uint64_t width = (uint64_t)points_width(p->kind), valid_rows = 0;
    if (p->kind == POINTS && all_finite(b->rows, 3 * count))
        valid_rows = count;
    while (valid_rows < count && check_row(p, b, valid_rows + 1, b->rows + valid_rows * width))
        valid_rows++;
    b->row_count = valid_rows;
}

static void parse_numbers(const points *p, points_block *b)
{
    uint64_t width = (uint64_t)points_width(p->kind), each = (uint64_t)p->layout.per_row,
             bytes = (uint64_t)p->layout.bytes, count = b->count / (each * bytes);
    if (is_query_layout(p))
        b->rows = (const double *)(const void *)b->bytes;
    else if (!alloc_rows(p, b, count))
        return;
    for (uint64_t i = 0; i < count && b->rows == b->space; i++) {
        double *row = b->space + i * width;
        row[width - 1] = p->tmax;
        for (uint64_t k = 0; k < each; k++)
            row[k] = load_number(p->layout, b->bytes + (i * each + k) * bytes);
    }
    check_rows(p, b, count);
}

/* --- text --- */

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f';
}

static char *skip_blanks(char *s)
{
    while (is_blank(*s))
        s++;
    return s;
}

/* Reports a wrong number of values. `at`: the text at which parsing stopped. If `more`, the row is
 * complete, but more values follow. */
static bool wrong_count(const points *p, points_block *b, const char *at, bool more)
{
    static const char *const expected[] = {
        "expected three numbers", "expected six or seven numbers: origin, direction and tmax",
        "expected six numbers: the lower and the upper corner"
    };
    bool names = b->first && !b->row_count && !p->no_header &&
                 (isalpha((uint8_t)*at) || *at == '"' || (at[0] == '/' && at[1] == '/'));
    return points_fault(b, b->lines, "%s%s%s", expected[p->kind], more ? ", but more follow" : "",
                        names ? "; --header reads the first line as names of columns"
                        : more && !p->no_header
                            ? "; name the columns in a line before the first, and give --header"
                            : "");
}

/* Parses numbers that are separated by blanks or commas. */
static bool parse_values(const points *p, points_block *b, char *s, char *end, double *row,
                         int *count)
{
    while (*s && *s != '#') {
        const char *after;
        if (*count == points_width(p->kind))
            return wrong_count(p, b, s, true);
        row[*count] = number_read(s, end, &after);
        if (after == s || !(is_blank(*after) || *after == ',' || *after == '#' || !*after))
            return wrong_count(p, b, s, false);
        if (!isfinite(row[(*count)++]))
            return points_fault(b, b->lines, "number %d is not finite", *count);
        s = skip_blanks((char *)after);
        if (*s == ',')
            s = skip_blanks(s + 1);
    }
    return true;
}

/* Parses the fields that a header has chosen. */
static bool parse_fields(const points *p, points_block *b, char *s, char *end, double *row,
                         int *count)
{
    char *field[POINTS_FIELDS];
    int fields = points_split(p->separator, s, end, field);
    if (fields != p->fields)
        return points_fault(b, b->lines, "has %d fields, but the header names %d", fields,
                            p->fields);
    for (int i = 0; i < points_width(p->kind) && p->field[i] >= 0; i++) {
        char *at = field[p->field[i]];
        const char *after;
        row[i] = number_read(at, at + strlen(at), &after);
        if (after == at || *after)
            return points_fault(b, b->lines, "'%.40s' is not a number", at);
        if (!isfinite(row[i]))
            return points_fault(b, b->lines, "number %d is not finite", i + 1);
        *count = i + 1;
    }
    return true;
}

/* Adds the row of a line; empty lines and comments have no row. Returns false after an error. */
static bool parse_line(const points *p, points_block *b, char *s, char *end)
{
    double *row = b->space + b->row_count * (uint64_t)points_width(p->kind);
    int count = 0;
    s = skip_blanks(s);
    if (!*s || *s == '#')
        return true;
    if (!(p->fields ? parse_fields : parse_values)(p, b, s, end, row, &count))
        return false;
    if (count < points_raw_width(p->kind))
        return wrong_count(p, b, s, false);
    if (count < points_width(p->kind))
        row[count] = p->tmax;
    b->row_count++;
    return check_row(p, b, b->lines, row) || (b->row_count--, false);
}

static void parse_text(const points *p, points_block *b)
{
    char *s = b->bytes + b->begin, *all = b->bytes + b->count;
    const char *zero = memchr(s, 0, (size_t)(all - s));
    /* The shortest possible row has a digit and a separator for each number. */
    if (!alloc_rows(p, b, (uint64_t)(all - s) / (2 * (uint64_t)points_raw_width(p->kind)) + 1))
        return;
    while (s < all) {
        char *end = memchr(s, '\n', (size_t)(all - s));
        end = end ? end : all;
        b->lines++;
        if (zero && zero < end) {
            points_fault(b, b->lines,
                         "contains a zero byte; this is not a text file of points (--raw reads raw "
                         "doubles)");
            return;
        }
        *end = 0;
        if (!parse_line(p, b, s, end))
            return;
        s = end + 1;
    }
}

/* points_take may have recorded an error, which is after the last row of the block. If parsing
 * finds an error in a row, the error of this row replaces the recorded error. */
void points_parse(const points *p, points_block *b)
{
    if (p->all_rows)
        check_rows(p, b, b->row_count);
    else if (b->count > b->begin)
        (p->raw ? parse_numbers : parse_text)(p, b);
    if (b->failed && b->fault_at == POINTS_NEXT_LINE) /* an error that points_take has recorded */
        b->fault_at = b->lines + 1;
}
