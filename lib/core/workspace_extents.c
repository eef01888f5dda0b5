#include "core/workspace_extents.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "core/alloc.h"
#include "core/release_pages.h"
#include "core/unnamed_file.h"
#include "core/workspace.h"

static void enter(ebpo_workspace *w, ebpo_extent *b)
{
    pthread_mutex_lock(&w->table_lock);
    ebpo_extent **bucket = ebpo_extent_bucket(w, b->at);
    b->next = *bucket;
    *bucket = b;
    pthread_mutex_unlock(&w->table_lock);
}

static bool is_at(const ebpo_extent *b, const void *at)
{
    return b->at == at && b->kind != EBPO_EXTENT_POOL;
}

/* Not pools: their first parts begin where they do. */
ebpo_extent *ebpo_extent_take(ebpo_workspace *w, const void *at)
{
    pthread_mutex_lock(&w->table_lock);
    ebpo_extent **link = ebpo_extent_bucket(w, at), *found = NULL;
    while (*link && !is_at(*link, at))
        link = &(*link)->next;
    if (*link) {
        found = *link;
        *link = found->next;
    }
    pthread_mutex_unlock(&w->table_lock);
    return found;
}

/* Says where it goes, and counts it. */
static bool admit(ebpo_workspace *w, size_t bytes)
{
    ebpo_workspace_stats *f = &w->figures;
    pthread_mutex_lock(&w->lock);
    bool filed = f->held + bytes > f->memory / 2;
    if (filed) {
        f->filed += bytes;
        f->filed_total += bytes;
        f->filed_peak = f->filed > f->filed_peak ? f->filed : f->filed_peak;
    } else {
        f->held += bytes;
        f->held_peak = f->held > f->held_peak ? f->held : f->held_peak;
    }
    w->holders++;
    pthread_mutex_unlock(&w->lock);
    return filed;
}

static void dismiss(ebpo_workspace *w, size_t bytes, bool filed)
{
    pthread_mutex_lock(&w->lock);
    *(filed ? &w->figures.filed : &w->figures.held) -= bytes;
    pthread_mutex_unlock(&w->lock);
    ebpo_workspace_leave(w);
}

/* 0, or why not. */
static int take_blocks(int fd, size_t bytes)
{
#ifdef EBPO_HAVE_POSIX_FALLOCATE
    int fault;
    do /* some file systems give way to signals */
        fault = posix_fallocate(fd, 0, (off_t)bytes);
    while (fault == EINTR);
    return fault;
#else
    static const char zeros[1 << 16];
    for (size_t left = bytes; left > 0;) {
        ssize_t done = write(fd, zeros, left < sizeof zeros ? left : sizeof zeros);
        if (done < 0 && errno != EINTR)
            return errno;
        left -= done > 0 ? (size_t)done : 0;
    }
    return 0;
#endif
}

/* The file's blocks are had before it is written to: a full disk would otherwise show as a signal.
 */
static void *map_file(ebpo_workspace *w, size_t bytes)
{
    int fd = ebpo_open_unnamed(w->folder), fault = fd < 0 ? errno : take_blocks(fd, bytes);
    void *at = MAP_FAILED;
    if (fault == 0) {
        at = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
        fault = at == MAP_FAILED ? errno : 0;
    }
    if (fd >= 0)
        close(fd);
    if (at == MAP_FAILED)
        w->failed = fault;
    return at;
}

static void *map_memory(ebpo_workspace *w, size_t bytes)
{
    void *at = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (at == MAP_FAILED)
        w->failed = 0;
    return at;
}

ebpo_extent *ebpo_extent_make(ebpo_workspace *w, size_t bytes, ebpo_extent_kind kind)
{
    ebpo_release_pages(w); /* those who make many write to them without more ado */
    ebpo_extent *b = ebpo_alloc_zero(1, sizeof *b);
    if (!b) {
        w->failed = 0;
        return NULL;
    }
    bytes = (bytes + w->page - 1) / w->page * w->page;
    *b = (ebpo_extent){ .bytes = bytes, .kind = kind, .filed = admit(w, bytes) };
    b->at = b->filed ? map_file(w, bytes) : map_memory(w, bytes);
    if (b->at == MAP_FAILED) {
        dismiss(w, bytes, b->filed);
        free(b);
        return NULL;
    }
    enter(w, b);
    return b;
}

static void unmap(ebpo_workspace *w, ebpo_extent *b)
{
    munmap(b->at, b->bytes);
    dismiss(w, b->bytes, b->filed);
    free(b);
}

/* --- parts of pools --- */

/* No place is given out twice, so parts are zero. */
ebpo_extent *ebpo_part_make(ebpo_workspace *w, size_t bytes)
{
    ebpo_extent *part = ebpo_alloc_zero(1, sizeof *part);
    bytes = (bytes + EBPO_PAGE - 1) / EBPO_PAGE * EBPO_PAGE;
    pthread_mutex_lock(&w->pool_lock);
    if (part && (!w->pool || w->pool->bytes - w->pool->used < bytes))
        w->pool = ebpo_extent_make(w, EBPO_POOL_BYTES, EBPO_EXTENT_POOL);
    ebpo_extent *pool = part ? w->pool : NULL;
    if (pool) {
        *part = (ebpo_extent){ .at = (char *)pool->at + pool->used,
                               .bytes = bytes,
                               .kind = EBPO_EXTENT_PART,
                               .filed = pool->filed,
                               .pool = pool };
        pool->used += bytes;
        pool->parts++;
    }
    pthread_mutex_unlock(&w->pool_lock);
    if (!pool) {
        w->failed = part ? w->failed : 0;
        free(part);
        return NULL;
    }
    enter(w, part);
    return part;
}

static void leave_pool(ebpo_workspace *w, ebpo_extent *pool)
{
    pthread_mutex_lock(&w->pool_lock);
    bool last = --pool->parts == 0;
    if (last && w->pool == pool)
        w->pool = NULL;
    pthread_mutex_unlock(&w->pool_lock);
    if (!last)
        return;
    pthread_mutex_lock(&w->table_lock);
    ebpo_extent **link = ebpo_extent_bucket(w, pool->at);
    while (*link != pool)
        link = &(*link)->next;
    *link = pool->next;
    pthread_mutex_unlock(&w->table_lock);
    unmap(w, pool);
}

/* A part's memory or blocks; whether it can be done or not. */
static void give_back(const ebpo_extent *b)
{
#ifdef EBPO_HAVE_MADV_REMOVE
    madvise(b->at, b->bytes, b->filed ? MADV_REMOVE : MADV_DONTNEED);
#else
    (void)b;
#endif
}

void ebpo_extent_free(ebpo_workspace *w, ebpo_extent *b)
{
    if (b->kind != EBPO_EXTENT_PART) {
        unmap(w, b);
        return;
    }
    if (w->page == EBPO_PAGE) /* whole pages, so none of a neighbour's */
        give_back(b);
    ebpo_extent *pool = b->pool;
    free(b);
    leave_pool(w, pool);
}
