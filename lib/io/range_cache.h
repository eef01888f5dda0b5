/* Reading and reading ahead: a file's bytes in pieces, each fetched by one request and kept as long
 * as memory allows. Pieces announced but not yet read are kept first, then those read last. */
#ifndef EBPO_IO_RANGE_CACHE_H
#define EBPO_IO_RANGE_CACHE_H

#include "io/disk.h"
#include "io/transfer.h"

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
