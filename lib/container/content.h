/* The content checksum: over all arrays of a file, sorted by path: path, a zero byte, SHA-256 of
 * the array as stored before shuffle and compression. It does not depend on codec, chunks or HDF5,
 * and a few lines of Python compute it. */
#ifndef EBPO_CONTAINER_CONTENT_H
#define EBPO_CONTAINER_CONTENT_H

#include <ebpo/base.h>

#include "base/sha256.h"
#include "container/schema.h"

typedef struct ebpo_content_entry {
    char path[EBPO_PATH_BYTES];
    uint8_t digest[32];
} ebpo_content_entry;

/* Zero-initialise. Bytes of an array are added in order, then the array is ended; then the next, in
 * any order of arrays. */
typedef struct ebpo_content {
    ebpo_sha256 state;
    bool open, short_of_memory;
    ebpo_content_entry *entries;
    uint64_t count, capacity;
} ebpo_content;

void ebpo_content_add(ebpo_content *content, const void *data, size_t bytes);
/* An array whose digest is known. */
void ebpo_content_put(ebpo_content *content, const char *path, const uint8_t digest[32]);
void ebpo_content_end_array(ebpo_content *content, const char *path);
EBPO_MUST_USE ebpo_status ebpo_content_end(ebpo_content *content, uint8_t digest[32],
                                           ebpo_error *error);
void ebpo_content_free(ebpo_content *content);

#endif
