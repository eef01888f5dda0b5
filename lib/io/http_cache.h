/* Caches fetched parts of a file on a server: ranges in memory, and blocks of equal size in a
 * folder on disk (the cache folder). Blocks stay after the process has ended. */
#ifndef EBPO_IO_HTTP_CACHE_H
#define EBPO_IO_HTTP_CACHE_H

#include <ebpo/base.h>

#include "io/http_response.h"
#include "io/http_transfer.h"

enum {
    EBPO_DISK_BLOCK = 32768,      /* default size of a block in bytes */
    EBPO_DISK_BLOCK_LEAST = 4096, /* least size of a block in bytes */
    /* size of the first request, in bytes; blocks begin after these bytes. The first request
       returns the bytes that opening needs (about 50 KB for 13 levels), and levels 0 to 4 */
    EBPO_HTTP_HEAD = 131072
};
_Static_assert(EBPO_HTTP_HEAD % EBPO_DISK_BLOCK == 0, "blocks would begin within the head");

/* The blocks of a cache folder. Each block is a separate file with a checksum. The name of this
 * file consists of a digest of URL and version, and the block's index. A block is written under a
 * temporary name and then renamed, so any number of processes may share the folder. A failure of
 * the folder is never an error: blocks that cannot be read or are damaged count as missing, and
 * failed writes are ignored. Any thread may call these functions. */
typedef struct ebpo_disk ebpo_disk;

/* Opens the folder. Makes the folder and its parents if they are missing. Returns EBPO_E_ARGUMENT
 * if the folder cannot be written. `bytes`: limit of the size of all blocks in the folder. `block`:
 * size of a block. */
EBPO_MUST_USE ebpo_status ebpo_disk_open(ebpo_disk **out, const char *folder, uint64_t bytes,
                                         size_t block, const char *url,
                                         const ebpo_http_version *version, ebpo_error *error);
/* Counts the bytes of the blocks that were in the folder when it was opened. *held: bytes of this
 * version of this file. *others: bytes of other files and versions. */
void ebpo_disk_held(const ebpo_disk *disk, uint64_t *held, uint64_t *others);
void ebpo_disk_close(ebpo_disk *disk);

/* A cache of ranges reads a file's bytes in ranges. A prefetch hint lists ranges that will be read
 * soon, so that the cache requests them early. One request fetches a range. A range stays in memory
 * while the memory limit allows. Ranges that were read least recently are dropped first. Ranges of
 * a hint that are not read yet are dropped last. */

enum { EBPO_RANGE_BYTES = 4 << 20 }; /* limit of one request in bytes */

typedef struct ebpo_cached_range ebpo_cached_range;

/* A cache of ranges. Any thread may call its functions. */
typedef struct ebpo_range_cache {
    pthread_mutex_t lock;
    pthread_cond_t done; /* broadcast when a request or a load from disk has ended */
    ebpo_transfers *transfers;
    ebpo_disk *disk;      /* NULL: no cache folder */
    uint64_t block;       /* size of the disk's blocks */
    uint64_t begin, size; /* ranges are within [begin, size); `size`: size of the file */
    uint64_t held_limit;  /* limit of `held`; if a reader waits, `held` may exceed this limit */
    ebpo_cached_range **range; /* [count] by offset, without overlaps */
    uint64_t count, capacity;
    uint64_t held;       /* bytes of fetched and requested ranges */
    uint64_t hint_count; /* number of prefetch hints with new ranges */
    uint64_t clock;      /* counts reads */
    bool hinting;        /* true: ranges are being made for a prefetch hint */
    /* number of ranges that came completely from disk; bytes that came from disk */
    uint64_t disk_hits, disk_bytes;
    double wait_seconds; /* time in which readers waited */
} ebpo_range_cache;

/* Records prefetch hints for ranges within [0, size), in any order. If memory is short, ranges are
 * not recorded, and are read later without a hint. */
void ebpo_range_cache_hint(ebpo_range_cache *cache, const ebpo_range *ranges, size_t count);
/* Reads the bytes [offset, offset + size), which are within [cache->begin, cache->size). */
EBPO_MUST_USE ebpo_status ebpo_range_cache_read(ebpo_range_cache *cache, uint64_t offset,
                                                uint64_t size, uint8_t *data, ebpo_error *error);
/* Frees all ranges; call it after freeing the transfers. */
void ebpo_range_cache_clear(ebpo_range_cache *cache);

#endif
