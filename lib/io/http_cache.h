/* Caches fetched parts of a file on a server: ranges in memory, and blocks of equal size in a
 * folder on disk. Blocks stay after the process has ended. */
#ifndef EBPO_IO_HTTP_CACHE_H
#define EBPO_IO_HTTP_CACHE_H

#include <ebpo/base.h>

#include "io/http_response.h"
#include "io/http_transfer.h"

enum {
    EBPO_DISK_BLOCK = 32768, /* default size of a block in bytes */
    EBPO_DISK_BLOCK_LEAST = 4096,
    /* size of the first request, in bytes; whole blocks follow. The first request returns the bytes
       that opening needs (about 50 KB for 13 levels), and levels 0 to 4 */
    EBPO_HTTP_HEAD = 131072
};
_Static_assert(EBPO_HTTP_HEAD % EBPO_DISK_BLOCK == 0, "blocks would begin within the head");

/* The blocks of a cache folder. Each block is a separate file with a checksum. The name consists of
 * the digest of URL and version, and the block's index. A block is written under a temporary name
 * and then renamed, so any number of processes may share the folder. The cache works without the
 * folder: blocks that cannot be read or are damaged count as missing, and failed writes are
 * ignored. Thread-safe. */
typedef struct ebpo_disk ebpo_disk;

/* Opens the folder, and makes the folder and its missing parents first. EBPO_E_ARGUMENT when the
 * folder cannot be written. `bytes`: limit of all blocks in the folder; `block`: size of a block.
 */
EBPO_MUST_USE ebpo_status ebpo_disk_open(ebpo_disk **out, const char *folder, uint64_t bytes,
                                         size_t block, const char *url,
                                         const ebpo_http_version *version, ebpo_error *error);
/* Returns the number of bytes that the folder held when it was opened: *held: bytes of this version
 * of this file; *others: all other bytes. */
void ebpo_disk_held(const ebpo_disk *disk, uint64_t *held, uint64_t *others);
void ebpo_disk_close(ebpo_disk *disk);

/* Reads a file's bytes in ranges, also ahead of the reader. One request fetches a range. A range
 * stays in memory while the limit allows. Ranges that have a prefetch hint and are not read yet
 * stay longest; then the ranges that were read last. */

enum { EBPO_RANGE_BYTES = 4 << 20 }; /* limit of one request */

typedef struct ebpo_cached_range ebpo_cached_range;

/* A cache of ranges. Thread-safe. */
typedef struct ebpo_range_cache {
    pthread_mutex_t lock;
    pthread_cond_t done; /* a request or a load from disk has ended */
    ebpo_transfers *transfers;
    ebpo_disk *disk;           /* NULL: no cache folder */
    uint64_t block;            /* size of the disk's blocks */
    uint64_t begin, size;      /* ranges are within [begin, size) */
    uint64_t held_limit;       /* limit of `held`; readers that wait for a range may exceed it */
    ebpo_cached_range **range; /* [count] by offset, without overlaps */
    uint64_t count, capacity;
    /* bytes of fetched and requested ranges; number of prefetch hints with new ranges */
    uint64_t held, hint_count;
    uint64_t clock; /* counts reads */
    bool hinting;   /* ranges are being made for a prefetch hint */
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
