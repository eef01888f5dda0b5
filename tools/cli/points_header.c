/* Reads text whose first line names its columns, as in CSV files. */
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "cli/numbers.h"
#include "cli/points_header.h"

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f';
}

/* Removes blanks and quotes around the field, which ends at `end`. */
static char *trim_field(char *s, char *end)
{
    while (s < end && is_blank(*s))
        s++;
    while (end > s && is_blank(end[-1]))
        end--;
    if (end - s >= 2 && *s == '"' && end[-1] == '"') {
        s++;
        end--;
    }
    *end = 0;
    return s;
}

/* Returns the end of the field: the first separator outside quotes, or `end`. */
static char *field_end(char separator, char *s, const char *end)
{
    for (bool quoted = false; s < end; s++) {
        quoted ^= *s == '"';
        if (!quoted && (separator ? *s == separator : is_blank(*s)))
            break;
    }
    return s;
}

int points_split(char separator, char *s, char *end, char *field[POINTS_FIELDS])
{
    int count = 0;
    while (count < POINTS_FIELDS) {
        while (!separator && s < end && is_blank(*s))
            s++;
        if (!separator && s == end)
            break;
        char *stop = field_end(separator, s, end);
        field[count++] = trim_field(s, stop);
        if (stop == end)
            break;
        s = stop + 1;
    }
    return count;
}

/* --- names --- */

static const char *const names[][POINTS_WIDEST] = { { "x", "y", "z" },
                                                    { "ox", "oy", "oz", "dx", "dy", "dz", "tmax" },
                                                    { "x0", "y0", "z0", "x1", "y1", "z1" } };

static int find_name(char **field, int fields, const char *name)
{
    for (int i = 0; i < fields; i++)
        if (strcasecmp(field[i], name) == 0)
            return i;
    return -1;
}

static bool all_numbers(char **field, int fields)
{
    for (int i = 0; i < fields; i++) {
        const char *after;
        (void)number_read(field[i], field[i] + strlen(field[i]), &after);
        if (after == field[i] || *after)
            return false;
    }
    return fields > 0;
}

/* Sets p->field to the columns with the needed names. If no column has a needed name, and the
 * number of columns is right, uses the columns in their order. Returns false if columns are
 * missing. */
static bool choose_fields(points *p, char **field, int fields)
{
    int needed = points_raw_width(p->kind), width = points_width(p->kind), found = 0;
    for (int i = 0; i < width; i++) {
        p->field[i] = find_name(field, fields, names[p->kind][i]);
        found += i < needed && p->field[i] >= 0;
    }
    if (found == 0 && fields >= needed && fields <= width) {
        for (int i = 0; i < width; i++)
            p->field[i] = i < fields ? i : -1;
        found = needed;
    }
    return found == needed;
}

bool points_take_header(points *p, points_block *b)
{
    static const char *const wanted[] = { "x, y, z", "ox, oy, oz, dx, dy, dz",
                                          "x0, y0, z0, x1, y1, z1" };
    char *field[POINTS_FIELDS], *s = b->bytes, *all = b->bytes + b->count, *end;
    for (;; s = end + 1) {
        b->lines++;
        end = memchr(s, '\n', (size_t)(all - s));
        end = end ? end : all;
        char *begin = s;
        while (begin < end && is_blank(*begin))
            begin++;
        b->begin = (size_t)(end - b->bytes) + (end < all);
        if (begin < end && *begin != '#')
            break;
        if (b->begin >= b->count)
            return true;
    }
    *end = 0;
    while (s < end && is_blank(*s))
        s++;
    s += s[0] == '/' && s[1] == '/' ? 2 : 0; /* CloudCompare writes // before the names */
    p->separator = (char)(memchr(s, ',', (size_t)(end - s))    ? ','
                          : memchr(s, ';', (size_t)(end - s))  ? ';'
                          : memchr(s, '\t', (size_t)(end - s)) ? '\t'
                                                               : 0);
    int fields = points_split(p->separator, s, end, field);
    if (all_numbers(field, fields)) {
        b->count = b->begin;
        return points_fault(b, b->lines--,
                            "holds numbers, which --header would take for names; omit --header, "
                            "or add a line of names");
    }
    if (choose_fields(p, field, fields)) {
        p->fields = fields;
        return true;
    }
    b->count = b->begin;
    return points_fault(b, b->lines--,
                        "this line does not name the columns %s, and does not have as many fields; "
                        "correct the line of names",
                        wanted[p->kind]);
}
