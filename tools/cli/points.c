/* Reads the input into blocks of rows. Bytes that were read, but belong to a later block, are in
 * p->unread. */
#include "cli/points.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/points_format.h"
#include "cli/points_header.h"
#include "cli/points_parse.h"

/* --- opening --- */

/* Reports an error of the input. `number`: errno, whose text follows `what`; 0: none. Returns
 * false. */
static bool fail_input(points *p, const char *what, int number)
{
    fprintf(stderr, "ebpo %s: %s: %s%s%s\n", p->command, p->name, what, number ? ": " : "",
            number ? strerror(number) : "");
    p->failed = true;
    return false;
}

bool points_open(points *p, const char *command, const char *path, points_kind kind, bool raw,
                 double tmax)
{
    return points_open_shard(p, command, path, kind, raw, tmax, 0, 1);
}

bool points_open_shard(points *p, const char *command, const char *path, points_kind kind, bool raw,
                       double tmax, uint64_t number, uint64_t part_count)
{
    bool standard = !path || strcmp(path, "-") == 0;
    struct stat st;
    *p = (points){ .command = command,
                   .name = standard ? "standard input" : path,
                   .kind = kind,
                   .raw = raw,
                   .tmax = tmax,
                   .layout = { points_raw_width(kind), 8, false },
                   .fd = STDIN_FILENO,
                   .wake_fd = -1,
                   .rows_per_block = POINTS_BATCH,
                   .unread_capacity = POINTS_LINE };
    if (!standard && points_is_dataset(path))
        return points_open_dataset(p, path, number, part_count);
    if (!standard)
        p->fd = open(path, O_RDONLY | O_CLOEXEC | O_NOCTTY);
    if (p->fd < 0)
        return fail_input(p, "cannot be opened", errno);
    off_t at = lseek(p->fd, 0, SEEK_CUR);
    if (at >= 0 && fstat(p->fd, &st) == 0 && S_ISREG(st.st_mode) && st.st_size > at)
        p->bytes_total = (uint64_t)(st.st_size - at);
    p->rows_known = raw && p->bytes_total;
    p->rows_total = p->bytes_total / (8 * (uint64_t)p->layout.per_row);
    p->unread = malloc(p->unread_capacity + 1);
    return p->unread || fail_input(p, "not enough memory", 0);
}

void points_close(points *p)
{
    if (p->fd > STDIN_FILENO)
        close(p->fd);
    free(p->unread);
    free(p->all_rows);
    points_block_free(&p->batch);
    *p = (points){ .fd = -1 };
}

/* --- blocks --- */

static bool alloc_block(points_block *b, size_t bytes)
{
    if (b->capacity < bytes) {
        free(b->bytes);
        b->bytes = malloc(bytes + 1);
        b->capacity = b->bytes ? bytes : 0;
    }
    return b->bytes || points_fault(b, 0, "not enough memory");
}

/* Moves the bytes of a block from `from` on to p->unread, for the next block. */
static void keep_unread(points *p, points_block *b, size_t from)
{
    p->unread_count = b->count - from;
    memcpy(p->unread, b->bytes + from, p->unread_count);
    b->count = from;
}

static const char *last_line_end(const char *text, size_t bytes)
{
#ifdef EBPO_HAVE_MEMRCHR
    return memrchr(text, '\n', bytes);
#else
    while (bytes > 0 && text[bytes - 1] != '\n')
        bytes--;
    return bytes ? text + bytes - 1 : NULL;
#endif
}

/* Reads complete lines into the block. The last line of the input may lack its line end. */
static void take_lines(points *p, points_block *b)
{
    size_t whole = 0, scanned = 0; /* bytes of complete lines; bytes searched for line ends */
    for (;;) {
        const char *last = last_line_end(b->bytes + scanned, b->count - scanned);
        whole = last ? (size_t)(last - b->bytes) + 1 : whole;
        scanned = b->count;
        if (p->is_ended || b->count == POINTS_LINE ||
            (whole && (b->count >= POINTS_TEXT || !points_more_is_there(p))))
            break;
        size_t target = b->count < POINTS_TEXT ? POINTS_TEXT : POINTS_LINE;
        ssize_t read_count = points_read_some(p, b, b->bytes + b->count, target - b->count);
        b->count += read_count > 0 ? (size_t)read_count : 0;
    }
    if (b->failed || (!p->is_ended && !whole)) {
        size_t all = b->count;
        b->count = whole;
        if (!b->failed && all == POINTS_LINE)
            points_fault(b, POINTS_NEXT_LINE,
                         "is longer than %d bytes; this is not a text file of points (--raw reads "
                         "raw doubles)",
                         POINTS_LINE);
    } else if (!p->is_ended) {
        keep_unread(p, b, whole);
    }
}

/* Compares the number of rows read so far with the number that the header of the array states.
 * `count`: number of rows of this block. */
static void check_rows(points *p, points_block *b, uint64_t count)
{
    p->rows_taken += count;
    if (!b->failed &&
        (p->rows_taken > p->rows_total || (p->is_ended && p->rows_taken < p->rows_total)))
        points_fault(b, 0, "has %s rows than its shape states, %" PRIu64 "; the input is %s",
                     p->rows_taken > p->rows_total ? "more" : "fewer", p->rows_total,
                     p->rows_taken > p->rows_total ? "in another format" : "cut short");
}

/* Reads complete rows of binary numbers into the block. */
static void take_numbers(points *p, points_block *b)
{
    size_t row_bytes = (size_t)(p->layout.per_row * p->layout.bytes),
           block_bytes = p->rows_per_block * row_bytes;
    while (!p->is_ended && b->count < block_bytes &&
           (b->count < row_bytes || points_more_is_there(p))) {
        ssize_t read_count = points_read_some(p, b, b->bytes + b->count, block_bytes - b->count);
        b->count += read_count > 0 ? (size_t)read_count : 0;
    }
    size_t partial_bytes = b->count % row_bytes; /* bytes of an incomplete row */
    if (!p->is_ended)
        keep_unread(p, b, b->count - partial_bytes);
    else if (partial_bytes && !b->failed)
        points_fault(b, 0,
                     "%zu bytes remain at the end, but each row takes %zu bytes; the input is "
                     "truncated or in another format",
                     partial_bytes, row_bytes);
    b->count -= p->is_ended ? partial_bytes : 0;
    if (p->rows_stated)
        check_rows(p, b, b->count / row_bytes);
}

static void take_all_rows(points *p, points_block *b)
{
    uint64_t rows_left = p->rows_total - p->all_rows_at;
    b->row_count = rows_left < p->rows_per_block ? rows_left : p->rows_per_block;
    b->rows = p->all_rows + p->all_rows_at * (uint64_t)points_width(p->kind);
    p->all_rows_at += b->row_count;
}

/* Recognises the format of the input, unless an earlier call has done so. */
static void begin_input(points *p, points_block *b)
{
    if (!p->is_begun && !p->failed)
        p->is_ended |= !points_recognise(p, b);
    p->is_begun = true;
}

bool points_begin(points *p)
{
    begin_input(p, &p->batch);
    return !p->failed && points_finish_block(p, &p->batch);
}

bool points_take(points *p, points_block *b)
{
    b->begin = b->count = 0;
    b->lines = b->row_count = b->fault_at = 0;
    b->rows = NULL;
    b->failed = false;
    b->first = !p->taken && !p->line_from;
    p->taken = true;
    begin_input(p, b);
    if (b->failed || p->failed)
        return b->failed;
    if (p->all_rows) {
        take_all_rows(p, b);
        return b->row_count > 0;
    }
    size_t bytes = p->raw ? p->rows_per_block * (size_t)(p->layout.per_row * p->layout.bytes)
                          : (size_t)POINTS_LINE;
    if (!alloc_block(b, bytes > p->unread_count ? bytes : p->unread_count))
        return p->is_ended = true;
    memcpy(b->bytes, p->unread, p->unread_count);
    b->count = p->unread_count;
    p->unread_count = 0;
    if (p->raw)
        take_numbers(p, b);
    else
        take_lines(p, b);
    if (!p->raw && p->header && !p->fields && !b->failed)
        points_take_header(p, b);
    p->is_ended |= b->failed;
    return b->count > 0 || b->failed;
}

/* --- end of a block --- */

/* Prints the error of a block with its position. The position is the number of a line, point, ray
 * or box (from 1), or the index of a vertex (from 0, as in PLY files). */
static void report_fault(const points *p, const points_block *b)
{
    static const char *const names[] = { "point", "ray", "box" };
    fprintf(stderr, "ebpo %s: %s: ", p->command, p->name);
    if (b->fault_at && (p->raw || p->all_rows))
        fprintf(stderr, "%s %" PRIu64 ": ", p->from_zero ? "vertex" : names[p->kind],
                p->row + b->fault_at - p->from_zero);
    else if (b->fault_at && p->line_from)
        fprintf(stderr, "line %" PRIu64 " after byte %" PRIu64 ": ", p->line + b->fault_at,
                p->line_from);
    else if (b->fault_at)
        fprintf(stderr, "line %" PRIu64 ": ", p->line + b->fault_at);
    fprintf(stderr, "%s\n", b->fault);
}

bool points_finish_block(points *p, points_block *b)
{
    if (b->failed)
        report_fault(p, b);
    p->failed |= b->failed;
    p->line += b->lines;
    p->row += b->row_count;
    return !b->failed;
}

uint64_t points_next(points *p, double *rows)
{
    points_block *b = &p->batch;
    uint64_t width = (uint64_t)points_width(p->kind);
    while (p->batch_at == b->row_count) {
        p->batch_at = 0;
        if (!points_finish_block(p, b) || p->failed || !points_take(p, b)) {
            b->row_count = b->lines = 0;
            b->failed = false;
            return 0;
        }
        points_parse(p, b);
    }
    uint64_t count = b->row_count - p->batch_at;
    count = count < POINTS_BATCH ? count : POINTS_BATCH;
    memcpy(rows, b->rows + p->batch_at * width, count * width * sizeof *rows);
    p->batch_at += count;
    return count;
}
