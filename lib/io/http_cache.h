/* Caches fetched parts of a file on a server: ranges in memory, and blocks in a folder. Blocks
 * persist between sessions. */
#ifndef EBPO_IO_HTTP_CACHE_H
#define EBPO_IO_HTTP_CACHE_H

#include <ebpo/base.h>

#include "io/http_response.h"
#include "io/http_transfer.h"

enum {
    EBPO_DISK_BLOCK = 32768, /* default */
    EBPO_DISK_BLOCK_LEAST = 4096,
    /* size of the first request, after which whole blocks follow. It includes the bytes that
     * opening needs, some 50 KB for 13 levels, and levels 0 to 4 */
    EBPO_HTTP_HEAD = 131072
};
_Static_assert(EBPO_HTTP_HEAD % EBPO_DISK_BLOCK == 0, "blocks would begin within the head");

/* Each block is a separate file, named by the digest of address and version and the block's index,
 * with a checksum. It is written to a temporary name and renamed, so any number of processes may
 * share the folder. Nothing depends on the folder: unreadable, damaged or unwritable blocks count
 * as missing. Thread-safe. */
typedef struct ebpo_disk ebpo_disk;

/* Makes the folder, if its parent exists. EBPO_E_ARGUMENT when it cannot be written. `bytes`: limit
 * of the folder; `block`: size of a block. */
EBPO_MUST_USE ebpo_status ebpo_disk_open(ebpo_disk **out, const char *folder, uint64_t bytes,
                                         size_t block, const char *url,
                                         const ebpo_http_version *version, ebpo_error *error);
/* Returns the number of bytes that the folder held when it was opened: *held of this version of
 * this file, *others of all else. */
void ebpo_disk_held(const ebpo_disk *disk, uint64_t *held, uint64_t *others);
void ebpo_disk_close(ebpo_disk *disk);

/* Reading and reading ahead: a file's bytes in ranges, each fetched by one request and kept while
 * memory allows. Ranges with prefetch hints that are not read yet are kept longest, then the ranges
 * read last. */

enum { EBPO_RANGE_BYTES = 4 << 20 }; /* limit of one request */

typedef struct ebpo_cached_range ebpo_cached_range;

/* Thread-safe. */
typedef struct ebpo_range_cache {
    pthread_mutex_t lock;
    pthread_cond_t done;
    ebpo_transfers *transfers;
    ebpo_disk *disk;           /* or NULL */
    uint64_t block;            /* size of the disk's blocks */
    uint64_t begin, size;      /* ranges are within [begin, size) */
    uint64_t held_limit;       /* bytes of ranges; waiting readers may exceed it */
    ebpo_cached_range **range; /* [count] by offset, without overlaps */
    uint64_t count, capacity;
    /* bytes of fetched and requested ranges; number of prefetch hints with new ranges */
    uint64_t held, hint_count;
    uint64_t clock; /* counts reads */
    bool hinting;
    uint64_t disk_hits, disk_bytes;
    double wait_seconds;
} ebpo_range_cache;

/* Records prefetch hints within [0, size), in any order. Ranges that cannot be recorded for lack of
 * memory are read without a hint. */
void ebpo_range_cache_hint(ebpo_range_cache *cache, const ebpo_range *ranges, size_t count);
/* Reads bytes [offset, offset + size) within [begin, size of the file). */
EBPO_MUST_USE ebpo_status ebpo_range_cache_read(ebpo_range_cache *cache, uint64_t offset,
                                                uint64_t size, uint8_t *data, ebpo_error *error);
/* Frees all ranges; call it after freeing the transfers. */
void ebpo_range_cache_clear(ebpo_range_cache *cache);

#endif
