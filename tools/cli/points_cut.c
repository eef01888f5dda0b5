/* Selects part `number` of `part_count` parts of the input, by a range of bytes or rows. */
#include "cli/points_cut.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cli/points.h"
#include "cli/points_header.h"

static bool fail_cut(points *p, const char *what)
{
    fprintf(stderr, "ebpo %s: %s: %s\n", p->command, p->name, what);
    p->failed = true;
    return false;
}

/* Limits reading to the bytes [from, to) of the file. */
static bool limit_bytes(points *p, uint64_t from, uint64_t to)
{
    p->unread_count = 0;
    p->limited = true;
    p->bytes_left = p->bytes_total = to - from;
    p->bytes_taken = 0;
    p->is_ended = false;
    return lseek(p->fd, (off_t)from, SEEK_SET) >= 0 || fail_cut(p, strerror(errno));
}

/* --- numbers --- */

/* Selects a part of binary numbers. `begin`: offset of the first row. `size`: size of the file. */
static bool cut_numbers(points *p, uint64_t begin, uint64_t size, uint64_t number,
                        uint64_t part_count)
{
    uint64_t row_bytes = (uint64_t)(p->layout.per_row * p->layout.bytes),
             rows = (size - begin) / row_bytes;
    if (p->rows_stated && rows != p->rows_total)
        return fail_cut(p, rows > p->rows_total
                               ? "has more rows than its shape states; it is in another format"
                               : "has fewer rows than its shape states; it is truncated");
    uint64_t first = points_share(rows, number, part_count),
             end = points_share(rows, number + 1, part_count);
    p->row = first;
    p->rows_stated = false; /* rows_total was checked above, so take_numbers need not check it */
    p->rows_known = true;
    p->rows_total = end - first;
    /* The last part also reads the bytes after the last complete row, so that an incomplete row is
     * reported. */
    return limit_bytes(p, begin + first * row_bytes,
                       number + 1 < part_count ? begin + end * row_bytes : size);
}

/* Selects a part of an input that has been read completely. */
static bool cut_all_rows(points *p, uint64_t number, uint64_t part_count)
{
    uint64_t rows = p->rows_total;
    if (p->all_rows_are_part)
        return true;
    p->row = p->all_rows_at = points_share(rows, number, part_count);
    p->rows_total =
        points_share(rows, number + 1, part_count); /* take_all_rows stops before this row */
    return true;
}

/* --- text --- */

/* Returns the offset of the first line that begins at the offset `at` or later. Returns `size`, the
 * size of the file, if there is no such line, and UINT64_MAX after an error (reported on stderr).
 * `begin`: offset of the file's first line. */
static uint64_t next_line(points *p, uint64_t begin, uint64_t at, uint64_t size)
{
    char piece[1 << 14];
    if (at <= begin)
        return begin;
    for (uint64_t from = at - 1; from < size;) {
        ssize_t read_bytes = pread(p->fd, piece, sizeof piece, (off_t)from);
        if (read_bytes < 0 && errno == EINTR)
            continue;
        if (read_bytes < 0)
            return fail_cut(p, strerror(errno)), UINT64_MAX;
        const char *end = memchr(piece, '\n', (size_t)read_bytes);
        if (end)
            return from + (uint64_t)(end - piece) + 1;
        if (read_bytes == 0)
            break;
        from += (uint64_t)read_bytes;
    }
    return size;
}

/* Reads the line with the names of columns, which all parts need. `begin`: offset of the file's
 * first line. *out: offset of the line after the names, at which the first part begins. */
static bool take_names(points *p, uint64_t begin, uint64_t *out)
{
    points_block b = { .bytes = malloc(POINTS_LINE + 1), .first = true };
    ssize_t read_bytes = b.bytes ? pread(p->fd, b.bytes, POINTS_LINE, (off_t)begin) : -1;
    bool success = read_bytes >= 0 || fail_cut(p, b.bytes ? strerror(errno) : "not enough memory");
    b.count = read_bytes > 0 ? (size_t)read_bytes : 0;
    if (success && b.count > 0) {
        success = points_take_header(p, &b);
        if (!success)
            (void)points_finish_block(p, &b);
        else if (!p->fields && read_bytes == POINTS_LINE)
            success = fail_cut(p, "has no line of column names in its first bytes");
    }
    *out = begin + b.begin;
    points_block_free(&b);
    return success;
}

static bool cut_text(points *p, uint64_t begin, uint64_t size, uint64_t number, uint64_t part_count)
{
    uint64_t first = begin;
    if (p->header && !take_names(p, begin, &first))
        return false;
    uint64_t from =
                 next_line(p, first, first + points_share(size - first, number, part_count), size),
             to = from == UINT64_MAX
                      ? from
                      : next_line(p, first,
                                  first + points_share(size - first, number + 1, part_count), size);
    if (to == UINT64_MAX)
        return false;
    p->line_from = from;
    return limit_bytes(p, from, number + 1 < part_count ? to : size);
}

/* --- all kinds of input --- */

bool points_cut(points *p, uint64_t number, uint64_t part_count)
{
    struct stat st = { .st_size = 0 };
    if (!p->all_rows && (p->fd < 0 || fstat(p->fd, &st) != 0 || !S_ISREG(st.st_mode)))
        return fail_cut(p, "is not a file; a shard needs a file");
    if (!points_begin(p))
        return false;
    if (p->all_rows)
        return cut_all_rows(p, number, part_count);
    uint64_t begin = p->bytes_taken - p->unread_count, size = (uint64_t)st.st_size;
    return (p->raw ? cut_numbers : cut_text)(p, begin, size, number, part_count);
}
