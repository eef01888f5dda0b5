/* What `ebpo paint` reads: colours, places, and the way of a hand. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/numbers.h"
#include "cli/commands/paint_job.h"

bool paint_read_colour(const char *text, uint32_t *out)
{
    size_t length = strlen(text), digits = strspn(text, "0123456789abcdefABCDEF");
    if (length != digits || (length != 6 && length != 8))
        return false;
    uint32_t value = (uint32_t)strtoul(text, NULL, 16);
    *out = length == 8 ? value : value << 8 | 255;
    return true;
}

/* --- paths --- */

/* Numbers separated by blanks or commas; -1: there is something else, or more than `most`. */
static int read_numbers(const char *text, double *out, int most)
{
    int count = 0;
    for (;;) {
        text += strspn(text, " \t\r\n,");
        if (*text == 0 || *text == '#')
            return count;
        const char *end;
        double v = number_read(text, text + strlen(text), &end);
        bool ends = *end == 0 || strchr(" \t\r\n,#", *end);
        if (end == text || !ends || count == most || !isfinite(v))
            return -1;
        out[count++] = v;
        text = end;
    }
}

bool paint_read_place(const char *text, double out[3]) { return read_numbers(text, out, 3) == 3; }

static bool fail_line(const paint_values *v, uint64_t line, const char *what)
{
    fprintf(stderr, "ebpo paint: %s: line %llu: %s\n", v->path, (unsigned long long)line, what);
    return false;
}

/* A line's numbers as a place of the hand; `number` of those before. */
static const char *take_row(const paint_values *v, const double *row, int count, uint64_t number,
                            ebpo_paint_hand *out)
{
    if (count < 3)
        return "expected three to five numbers: x y z [pressure [ms]]";
    memcpy(out->place, row, sizeof out->place);
    out->pressure = count > 3 ? row[3] : v->pressure;
    out->time = count > 4 ? row[4] : (double)number * 1000 / v->rate;
    if (!(out->pressure >= 0 && out->pressure <= 1))
        return "the pressure is not 0 to 1";
    return out->time >= 0 && out->time <= UINT32_MAX
               ? NULL
               : "the time is not 0 to 2^32 - 1 milliseconds, which are 49 days";
}

static bool read_lines(const paint_values *v, FILE *in, ebpo_paint_hand **hand, uint64_t *count)
{
    char *line = NULL;
    size_t room = 0;
    uint64_t number = 0, capacity = 0;
    const char *wrong = NULL;
    ssize_t length;
    while (!wrong && (length = getline(&line, &room, in)) >= 0) {
        double row[5];
        const char *text = number++ ? line : number_skip_mark(line);
        int found = strlen(line) == (size_t)length ? read_numbers(text, row, 5) : -1;
        if (found == 0)
            continue;
        if (*count == capacity) {
            capacity = capacity ? 2 * capacity : 1024;
            ebpo_paint_hand *more = realloc(*hand, capacity * sizeof *more);
            wrong = more ? NULL : "not enough memory";
            *hand = more ? more : *hand;
        }
        if (!wrong)
            wrong = take_row(v, row, found, *count, &(*hand)[*count]);
        *count += !wrong;
    }
    free(line);
    if (wrong)
        return fail_line(v, number, wrong);
    if (ferror(in))
        return fail_line(v, number + 1, strerror(errno));
    if (*count == 0)
        fprintf(stderr, "ebpo paint: the path '%s' has no place\n", v->path);
    return *count > 0;
}

bool paint_read_path(const paint_values *v, ebpo_paint_hand **hand, uint64_t *count)
{
    bool standard = strcmp(v->path, "-") == 0;
    FILE *in = standard ? stdin : fopen(v->path, "r");
    *hand = NULL;
    *count = 0;
    if (!in) {
        fprintf(stderr, "ebpo paint: %s: cannot be opened: %s\n", v->path, strerror(errno));
        return false;
    }
    bool fine = read_lines(v, in, hand, count);
    if (!standard)
        fclose(in);
    return fine;
}
