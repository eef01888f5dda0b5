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

/* Whether an array counts. How a file is laid out does not: tables of subtrees are left out. */
bool ebpo_content_has(const ebpo_info *info, ebpo_array_id id);
/* Rows from `row` on of one that counts, in order, as far as they do. */
void ebpo_content_rows(const ebpo_info *info, ebpo_array_id id, uint64_t row, uint64_t rows,
                       size_t row_bytes, const uint8_t *bytes, ebpo_sha256 *state);

/* Zero-initialise. Arrays come in any order. */
typedef struct ebpo_content {
    bool short_of_memory;
    ebpo_content_entry *entries;
    uint64_t count, capacity;
} ebpo_content;

void ebpo_content_put(ebpo_content *content, const char *path, const uint8_t digest[32]);
EBPO_MUST_USE ebpo_status ebpo_content_end(ebpo_content *content, uint8_t digest[32],
                                           ebpo_error *error);
void ebpo_content_free(ebpo_content *content);

#endif
