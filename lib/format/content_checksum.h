/* Computes the content checksum: over all arrays of a file, sorted by path: path, a zero byte,
 * SHA-256 of the array as stored before shuffle and compression. It does not depend on codec,
 * chunks or HDF5, and a few lines of Python compute it. */
#ifndef EBPO_FORMAT_CONTENT_CHECKSUM_H
#define EBPO_FORMAT_CONTENT_CHECKSUM_H

#include <ebpo/base.h>

#include "core/checksum.h"
#include "format/schema.h"
#include "hdf5_read/chunk.h"
#include "mesh/attributes.h"

typedef struct ebpo_content_entry {
    char path[EBPO_PATH_BYTES];
    uint8_t digest[32];
} ebpo_content_entry;

/* Returns true if a checksum includes the array. Tables of subtrees are excluded, as the layout
 * does not count. */
bool ebpo_content_has(const ebpo_info *info, ebpo_array_id id);

/* The checksum that includes an array: the content checksum is the same with and without colours.
 */
enum { EBPO_DIGEST_CONTENT, EBPO_DIGEST_COLOURS, EBPO_DIGESTS };
static inline int ebpo_content_of(ebpo_array_id id)
{
    return id == EBPO_A_GRAY_COLOURS ? EBPO_DIGEST_COLOURS : EBPO_DIGEST_CONTENT;
}

/* Digest of one array, chunk by chunk. Chunks with fewer rows than without subtrees are joined to
 * larger ones: codes that restart with them are recoded. */
typedef struct ebpo_array_digest {
    ebpo_sha256 state;
    uint64_t last[3]; /* running sums of the components at the end of the chunk before */
} ebpo_array_digest;

void ebpo_array_digest_begin(ebpo_array_digest *digest);
/* Adds the chunk that begins with `row` of an array of this shape, without padding. */
void ebpo_array_digest_add(ebpo_array_digest *digest, const ebpo_info *info, ebpo_array_id id,
                           const ebpo_shape *shape, uint64_t row, uint64_t rows,
                           const uint8_t *bytes);
void ebpo_array_digest_end(ebpo_array_digest *digest, uint8_t out[32]);

/* Initialise with zeros. Arrays may come in any order. */
typedef struct ebpo_content {
    bool short_of_memory;
    ebpo_content_entry *entries;
    uint64_t count, capacity;
} ebpo_content;

void ebpo_content_put(ebpo_content *content, const char *path, const uint8_t digest[32]);
EBPO_MUST_USE ebpo_status ebpo_content_end(ebpo_content *content, uint8_t digest[32],
                                           ebpo_error *error);
void ebpo_content_free(ebpo_content *content);

/* --- the checksum of the part `attributes` --- */

EBPO_MUST_USE ebpo_status ebpo_attributes_digest(const ebpo_attributes *attributes,
                                                 uint8_t digest[32], ebpo_error *error);

#endif
