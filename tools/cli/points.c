#include "cli/points.h"

#include <ebpo/mesh.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cli/command.h"

enum { ROOM = 1 << 18 };

/* What an attempt to take a row came to. */
typedef enum taken { TAKEN, NOTHING_THERE, MORE_NEEDED, NOT_GOOD } taken;

int points_width(points_kind kind) { return kind == POINTS ? 3 : kind == POINTS_RAYS ? 7 : 6; }

int points_raw_width(points_kind kind) { return kind == POINTS ? 3 : 6; }

__attribute__((format(printf, 2, 3))) static taken fail(points *p, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    command_flush(p->command); /* the answers so far come first where both go to one place */
    fprintf(stderr, "ebpo %s: %s: ", p->command, p->name);
    vfprintf(stderr, format, list);
    fputc('\n', stderr);
    va_end(list);
    p->failed = true;
    return NOT_GOOD;
}

/* The place of the row read last, as people count: lines, or points from 1. */
__attribute__((format(printf, 2, 3))) static taken fail_row(points *p, const char *format, ...)
{
    static const char *const names[] = { "point", "ray", "box" };
    char text[160];
    va_list list;
    va_start(list, format);
    vsnprintf(text, sizeof text, format, list);
    va_end(list);
    if (p->ply || p->raw)
        return fail(p, "%s %" PRIu64 ": %s", p->ply ? "vertex" : names[p->kind], p->row, text);
    return fail(p, "line %" PRIu64 ": %s", p->line, text);
}

/* --- bytes --- */

bool points_open(points *p, const char *by, const char *path, points_kind kind, bool raw,
                 double tmax)
{
    bool standard = !path || strcmp(path, "-") == 0;
    *p = (points){ .command = by,
                   .name = standard ? "standard input" : path,
                   .kind = kind,
                   .raw = raw,
                   .tmax = tmax,
                   .fd = STDIN_FILENO,
                   .capacity = ROOM };
    if (!standard)
        p->fd = open(path, O_RDONLY | O_CLOEXEC | O_NOCTTY);
    if (p->fd < 0)
        return fail(p, "cannot be opened: %s", strerror(errno)) == TAKEN;
    p->buffer = malloc(p->capacity + 1);
    if (!p->buffer)
        return fail(p, "not enough memory") == TAKEN;
    return true;
}

void points_close(points *p)
{
    if (p->fd > STDIN_FILENO)
        close(p->fd);
    free(p->buffer);
    free(p->ply);
    *p = (points){ .fd = -1 };
}

/* Reads on, behind what is left in the buffer. False after an error. */
static bool fill(points *p)
{
    memmove(p->buffer, p->buffer + p->at, p->end - p->at);
    p->end -= p->at;
    p->at = 0;
    ssize_t got;
    do
        got = read(p->fd, p->buffer + p->end, p->capacity - p->end);
    while (got < 0 && errno == EINTR);
    if (got < 0)
        return fail(p, "cannot be read: %s", strerror(errno)) == TAKEN;
    p->end += (size_t)got;
    p->ended = got == 0;
    return true;
}

/* --- checks that all kinds of input share --- */

static taken check_row(points *p, const double *row)
{
    for (int i = 0; i < points_raw_width(p->kind); i++)
        if (!isfinite(row[i]))
            return fail_row(p, "number %d is not finite", i + 1);
    if (p->kind == POINTS_RAYS && row[3] == 0 && row[4] == 0 && row[5] == 0)
        return fail_row(p, "the direction is 0 0 0");
    if (p->kind == POINTS_RAYS && !(row[6] >= 0))
        return fail_row(p, "tmax must be 0 or more");
    for (int k = 0; k < 3 && p->kind == POINTS_BOXES; k++)
        if (row[k] > row[3 + k])
            return fail_row(p, "the lower corner of a box comes first, but %c0 is greater than %c1",
                            "xyz"[k], "xyz"[k]);
    return TAKEN;
}

/* --- text --- */

static char *skip_blanks(char *s)
{
    while (*s == ' ' || *s == '\t' || *s == '\r' || *s == '\v' || *s == '\f')
        s++;
    return s;
}

static taken wrong_count(points *p)
{
    static const char *const expected[] = {
        "expected three numbers", "expected six or seven numbers: origin, direction and tmax",
        "expected six numbers: the lower and the upper corner"
    };
    return fail_row(p, "%s", expected[p->kind]);
}

/* The program never leaves the "C" locale, so strtod rounds correctly and knows the dot only. */
static taken parse_line(points *p, char *s, double *row)
{
    int count = 0, most = points_width(p->kind);
    s = skip_blanks(s);
    if (!*s || *s == '#')
        return NOTHING_THERE;
    while (*s && *s != '#') {
        char *end;
        if (count == most)
            return wrong_count(p);
        row[count] = strtod(s, &end);
        if (end == s || !strchr(" \t\r\v\f,#", *end))
            return wrong_count(p);
        if (!isfinite(row[count++]))
            return fail_row(p, "number %d is not finite", count);
        s = skip_blanks(end);
        if (*s == ',')
            s = skip_blanks(s + 1);
    }
    if (count < points_raw_width(p->kind))
        return wrong_count(p);
    if (count < most)
        row[count] = p->tmax;
    return check_row(p, row);
}

static taken take_line(points *p, double *row)
{
    char *begin = p->buffer + p->at, *end = memchr(begin, '\n', p->end - p->at);
    if (!end) {
        if (!p->ended && p->end - p->at < p->capacity)
            return MORE_NEEDED;
        if (!p->ended) {
            p->line++;
            return fail_row(p,
                            "is longer than %d bytes; this is not a text file of points (--raw "
                            "reads raw doubles)",
                            ROOM);
        }
        if (p->at == p->end)
            return MORE_NEEDED;
        end = p->buffer + p->end; /* the last line may lack its end */
    }
    p->at = (size_t)(end - p->buffer) + (end < p->buffer + p->end);
    p->line++;
    if (memchr(begin, 0, (size_t)(end - begin)))
        return fail_row(
            p, "contains a zero byte; this is not a text file of points (--raw reads raw doubles)");
    *end = 0;
    if (p->line == 1 && strncmp(begin, "\xef\xbb\xbf", 3) == 0) /* byte order mark */
        begin += 3;
    return parse_line(p, begin, row);
}

/* --- raw doubles --- */

static double load_little(const char *at)
{
    uint8_t b[8];
    uint64_t bits = 0;
    double v;
    memcpy(b, at, sizeof b);
    for (int i = 7; i >= 0; i--)
        bits = bits << 8 | b[i];
    memcpy(&v, &bits, sizeof v);
    return v;
}

static taken take_raw(points *p, double *row)
{
    int width = points_raw_width(p->kind);
    size_t bytes = (size_t)width * 8, left = p->end - p->at;
    if (left < bytes && (!p->ended || !left))
        return MORE_NEEDED;
    if (left < bytes)
        return fail(p,
                    "%zu bytes are left over at the end, but each item takes %zu; the input is cut "
                    "short or is something else",
                    left, bytes);
    for (int i = 0; i < width; i++)
        row[i] = load_little(p->buffer + p->at + 8 * i);
    if (p->kind == POINTS_RAYS)
        row[6] = p->tmax;
    p->at += bytes;
    p->row++;
    return check_row(p, row);
}

/* --- PLY --- */

/* Reads to the end; a PLY is taken whole. */
static bool read_all(points *p)
{
    while (!p->ended && !p->failed) {
        if (p->end == p->capacity) {
            char *wider =
                p->capacity <= SIZE_MAX / 4 ? realloc(p->buffer, 2 * p->capacity + 1) : NULL;
            if (!wider)
                return fail(p, "not enough memory for %zu bytes", 2 * p->capacity) == TAKEN;
            p->buffer = wider;
            p->capacity *= 2;
        }
        fill(p);
    }
    return !p->failed;
}

static void read_ply(points *p)
{
    ebpo_error error = EBPO_ERROR_INIT;
    if (p->kind != POINTS) {
        fail(p, "is a PLY file, which holds points; give %s as text or with --raw",
             p->kind == POINTS_RAYS ? "rays" : "boxes");
        return;
    }
    if (!read_all(p))
        return;
    if (ebpo_points_parse_ply(p->buffer, p->end, p->name, &p->ply, &p->ply_count, &error) !=
        EBPO_OK) {
        fprintf(stderr, "ebpo %s: %s\n", p->command, error.message);
        p->failed = true;
    }
    p->at = p->end;
}

static taken take_vertex(points *p, double *row)
{
    if (p->ply_at == p->ply_count)
        return MORE_NEEDED; /* there is no more */
    memcpy(row, p->ply + 3 * p->ply_at++, 3 * sizeof *row);
    p->row = p->ply_at - 1; /* vertices are numbered from 0 everywhere */
    return check_row(p, row);
}

/* --- batches --- */

enum { HEAD = 8 }; /* bytes of HDF5's signature */

static bool begins_as_hdf5(const points *p)
{
    return p->end >= HEAD && memcmp(p->buffer, "\211HDF\r\n\032\n", HEAD) == 0;
}

/* Raw doubles may begin with these four bytes, but hardly with letters behind: then the first one
 * is about 1e219 or 1e243. */
static bool begins_as_ply(const points *p)
{
    if (p->end < 4 || memcmp(p->buffer, "ply", 3) != 0 ||
        (p->buffer[3] != '\n' && p->buffer[3] != '\r'))
        return false;
    for (size_t i = 5; i < HEAD && p->raw; i++)
        if (i >= p->end || p->buffer[i] < 'a' || p->buffer[i] > 'z')
            return false;
    return true;
}

/* The first bytes tell a PLY, and files of other kinds. A short line of text is not kept waiting
 * for more. */
static void begin(points *p)
{
    p->begun = true;
    while (p->end < (p->raw || (p->end && p->buffer[0] == '\211') ? HEAD : 4) && !p->ended &&
           !p->failed)
        fill(p);
    static const char *const wanted[] = { "points", "rays", "boxes" };
    if (p->failed)
        return;
    if (begins_as_hdf5(p))
        fail(p, "is an HDF5 file and holds no %s; the model comes first, then what to ask about",
             wanted[p->kind]);
    else if (begins_as_ply(p) && !p->raw)
        read_ply(p);
    else if (begins_as_ply(p) && p->kind == POINTS)
        fail(p, "is a PLY file, not raw doubles; leave out --raw");
    else if (begins_as_ply(p))
        fail(p, "is a PLY file, which holds points; give %s as text or as raw doubles",
             wanted[p->kind]);
}

uint64_t points_next(points *p, double *rows)
{
    uint64_t count = 0;
    int width = points_width(p->kind);
    if (!p->begun)
        begin(p);
    while (count < POINTS_BATCH && !p->failed) {
        double *row = rows + count * (uint64_t)width;
        taken t = p->ply ? take_vertex(p, row) : p->raw ? take_raw(p, row) : take_line(p, row);
        if (t == TAKEN)
            count++;
        else if (t == MORE_NEEDED &&
                 (count || p->ended ||
                  !fill(p))) /* what is there is answered before more is waited for */
            break;
    }
    return count;
}
