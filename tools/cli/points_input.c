#include "cli/points_input.h"

#include <errno.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

int points_width(points_kind kind) { return kind == POINTS ? 3 : kind == POINTS_RAYS ? 7 : 6; }

int points_raw_width(points_kind kind) { return kind == POINTS ? 3 : 6; }

bool points_fault(points_block *b, uint64_t at, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    vsnprintf(b->fault, sizeof b->fault, format, list);
    va_end(list);
    b->fault_at = at;
    b->failed = true;
    return false;
}

uint64_t points_share(uint64_t total, uint64_t number, uint64_t part_count)
{
    return total / part_count * number + total % part_count * number / part_count;
}

void points_block_free(points_block *b)
{
    free(b->bytes);
    free(b->space);
    *b = (points_block){ .bytes = NULL };
}

/* Waits for more input if p->wake_fd is a descriptor. Returns false if p->wake_fd has become
 * readable. */
static bool wait_for_more(const points *p)
{
    struct pollfd both[] = { { .fd = p->wake_fd, .events = POLLIN },
                             { .fd = p->fd, .events = POLLIN } };
    while (p->wake_fd >= 0 && poll(both, 2, -1) < 0 && errno == EINTR)
        ;
    return !(both[0].revents & POLLIN);
}

ssize_t points_read_some(points *p, points_block *b, char *to, size_t most)
{
    ssize_t read_bytes;
    if (p->limited && p->bytes_left < most)
        most = (size_t)p->bytes_left;
    if (most == 0 || !wait_for_more(p)) {
        p->is_ended = true;
        return 0;
    }
    do
        read_bytes = read(p->fd, to, most);
    while (read_bytes < 0 && errno == EINTR);
    if (read_bytes < 0)
        points_fault(b, 0, "cannot be read: %s", strerror(errno));
    p->is_ended |= read_bytes <= 0;
    p->bytes_taken += read_bytes > 0 ? (uint64_t)read_bytes : 0;
    p->bytes_left -= p->limited && read_bytes > 0 ? (uint64_t)read_bytes : 0;
    return read_bytes;
}

bool points_fill(points *p, points_block *b)
{
    ssize_t read_bytes =
        points_read_some(p, b, p->unread + p->unread_count, p->unread_capacity - p->unread_count);
    p->unread_count += read_bytes > 0 ? (size_t)read_bytes : 0;
    return read_bytes >= 0;
}

bool points_fill_all(points *p, points_block *b)
{
    while (!p->is_ended) {
        if (p->unread_count == p->unread_capacity) {
            char *larger = p->unread_capacity <= SIZE_MAX / 4
                               ? realloc(p->unread, 2 * p->unread_capacity + 1)
                               : NULL;
            if (!larger)
                return points_fault(b, 0, "not enough memory for %zu bytes",
                                    2 * p->unread_capacity);
            p->unread = larger;
            p->unread_capacity *= 2;
        }
        points_fill(p, b);
    }
    return !b->failed;
}

void points_drop(points *p, size_t bytes)
{
    p->unread_count -= bytes;
    memmove(p->unread, p->unread + bytes, p->unread_count);
}

bool points_more_is_there(const points *p)
{
    struct pollfd one = { .fd = p->fd, .events = POLLIN };
    return poll(&one, 1, 0) > 0;
}
