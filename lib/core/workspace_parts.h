/* What a workspace is made of. */
#ifndef EBPO_CORE_WORKSPACE_PARTS_H
#define EBPO_CORE_WORKSPACE_PARTS_H

#include <ebpo/workspace.h>
#include <pthread.h>
#include <stdatomic.h>

/* Arrays smaller than a page are malloc's; those smaller than an extent are parts of a pool, which
 * is one: a build has thousands of them. */
enum {
    EBPO_PAGE = 4096,
    EBPO_LEAST_EXTENT = 1 << 16,
    EBPO_POOL_BYTES = 1 << 20,
    EBPO_FOLDER_BYTES = 4096,
    EBPO_BUCKET_BITS = 10
};

typedef enum ebpo_extent_kind {
    EBPO_EXTENT_OWN,
    EBPO_EXTENT_POOL,
    EBPO_EXTENT_PART
} ebpo_extent_kind;

typedef struct ebpo_extent {
    void *at;
    size_t bytes;
    ebpo_extent_kind kind;
    bool filed;               /* in a file */
    struct ebpo_extent *pool; /* of a part */
    size_t used;              /* of a pool: bytes given out; and the parts that are not freed */
    uint64_t parts;
    struct ebpo_extent *next;
} ebpo_extent;

struct ebpo_workspace {
    pthread_mutex_t lock; /* guards the figures */
    pthread_mutex_t pool_lock;
    ebpo_workspace_stats figures;
    uint64_t holders;   /* and the owner is one */
    ebpo_extent *pool;  /* that the next part comes from; NULL: none */
    _Atomic int failed; /* errno of the last allocation in a file that failed, 0: memory */
    int statm;          /* /proc/self/statm */
    /* bytes of files, libraries among them, that stayed resident when pages were released */
    uint64_t floor;
    size_t page;
    char folder[EBPO_FOLDER_BYTES];
    /* its extents by address: pieces of a build have their arrays freed one by one, so there are
     * thousands at most */
    pthread_mutex_t table_lock;
    ebpo_extent *table[1 << EBPO_BUCKET_BITS];
};

static inline ebpo_extent **ebpo_extent_bucket(ebpo_workspace *w, const void *at)
{
    uint64_t page = (uint64_t)((uintptr_t)at / EBPO_PAGE);
    return &w->table[page * UINT64_C(0x9e3779b97f4a7c15) >> (64 - EBPO_BUCKET_BITS)];
}

#endif
