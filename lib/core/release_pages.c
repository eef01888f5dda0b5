#include "core/release_pages.h"

#include <stdio.h>
#include <sys/mman.h>
#include <unistd.h>

#include "core/workspace_parts.h"

typedef struct residency {
    uint64_t all, files; /* bytes */
} residency;

static residency resident(const ebpo_workspace *w)
{
    char text[128];
    unsigned long long size, pages, of_files;
    ssize_t got = w->statm >= 0 ? pread(w->statm, text, sizeof text - 1, 0) : -1;
    text[got > 0 ? got : 0] = 0;
    if (sscanf(text, "%llu %llu %llu", &size, &pages, &of_files) != 3)
        return (residency){ UINT64_MAX, UINT64_MAX }; /* not known: let go always */
    return (residency){ pages * w->page, of_files * w->page };
}

static void let_go(const ebpo_extent *b)
{
#ifdef EBPO_HAVE_MADVISE
    madvise(b->at, b->bytes, MADV_DONTNEED);
#else
    msync(b->at, b->bytes, MS_ASYNC); /* the system then takes them when it is short */
#endif
}

void ebpo_release_pages(ebpo_workspace *workspace)
{
    ebpo_workspace *w = workspace;
    if (!w || resident(w).all <= w->figures.memory / 4 * 3)
        return;
    pthread_mutex_lock(&w->table_lock);
    residency now = resident(w); /* another thread may have done it meanwhile */
    if (now.all <= w->figures.memory / 4 * 3 ||
        now.files < w->floor + w->figures.memory / 16) { /* there is hardly anything to let go of */
        pthread_mutex_unlock(&w->table_lock);
        return;
    }
    for (int i = 0; i < 1 << EBPO_BUCKET_BITS; i++)
        for (ebpo_extent *b = w->table[i]; b; b = b->next)
            if (b->kind != EBPO_EXTENT_PART && b->filed)
                /* of a file: what was written stays in it */
                let_go(b);
    /* Other threads bring pages in meanwhile, which are no floor: it rises slowly. */
    uint64_t left = resident(w).files, most = w->floor + w->figures.memory / 64;
    w->floor = left < most ? left : most;
    pthread_mutex_unlock(&w->table_lock);
}
