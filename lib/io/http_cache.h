/* What has been fetched of a file on a server: pieces in memory, and blocks in a folder from one
 * session to the next. */
#ifndef EBPO_IO_HTTP_CACHE_H
#define EBPO_IO_HTTP_CACHE_H

#include <ebpo/base.h>

#include "io/http_answer.h"
#include "io/http_transfer.h"

enum {
    EBPO_DISK_BLOCK = 32768, /* usually */
    EBPO_DISK_BLOCK_LEAST = 4096,
    /* of the first request, after which whole blocks follow: opening needs some 50 KB (13 levels),
       and levels 0 to 4 come with it */
    EBPO_HTTP_HEAD = 131072
};
_Static_assert(EBPO_HTTP_HEAD % EBPO_DISK_BLOCK == 0, "blocks would begin within the head");

/* Each block is a file of its own, named by the digest of address and version and the block's
 * number, and carries a checksum. Written to a temporary name and renamed, so any number of
 * processes may share the folder. Nothing depends on it: what cannot be read, is damaged or cannot
 * be written is as if it were not there. Any thread. */
typedef struct ebpo_disk ebpo_disk;

/* Makes the folder, if its parent is there. EBPO_E_ARGUMENT when it cannot be written. `bytes`:
 * that the folder may hold; `block`: of a block. */
EBPO_MUST_USE ebpo_status ebpo_disk_open(ebpo_disk **out, const char *folder, uint64_t bytes,
                                         size_t block, const char *url,
                                         const ebpo_http_version *version, ebpo_error *error);
/* Bytes that the folder held when it was opened: of this version of this file, and others. */
void ebpo_disk_held(const ebpo_disk *disk, uint64_t *held, uint64_t *others);
void ebpo_disk_close(ebpo_disk *disk);

/* Reading and reading ahead: a file's bytes in pieces, each fetched by one request and kept as long
 * as memory allows. Pieces announced but not yet read are kept first, then those read last. */

enum { EBPO_RANGE_BYTES = 4 << 20 }; /* of one request, at most */

typedef struct ebpo_cached_range ebpo_cached_range;

/* The functions may be called by any thread. */
typedef struct ebpo_range_cache {
    pthread_mutex_t lock;
    pthread_cond_t done;
    ebpo_transfers *transfers;
    ebpo_disk *disk;           /* or NULL */
    uint64_t block;            /* of the disk's */
    uint64_t begin, size;      /* pieces lie within [begin, size) */
    uint64_t held_limit;       /* bytes of pieces; readers that wait may go above it */
    ebpo_cached_range **piece; /* [count] by offset, without overlaps */
    uint64_t count, capacity;
    /* bytes of fetched pieces and those under way; announcements that brought something new */
    uint64_t held, plan;
    uint64_t clock; /* of reads */
    bool announcing;
    uint64_t disk_hits, disk_bytes;
    double wait_seconds;
} ebpo_range_cache;

/* Announced ranges within [0, size), in any order. What cannot be noted for want of memory is read
 * without it. */
void ebpo_range_cache_expect(ebpo_range_cache *pieces, const ebpo_range *ranges, size_t count);
/* Bytes [offset, offset + size) within [begin, size of the file). */
EBPO_MUST_USE ebpo_status ebpo_range_cache_read(ebpo_range_cache *pieces, uint64_t offset,
                                                uint64_t size, uint8_t *data, ebpo_error *error);
/* After the transfers are gone. */
void ebpo_range_cache_clear(ebpo_range_cache *pieces);

#endif
