/* Computes the content checksum of a file: the SHA-256 of one entry per array, sorted by path. An
 * entry is the path, a zero byte, and the SHA-256 of the array as stored before shuffle and
 * compression. The checksum does not depend on the codec, the chunks or HDF5, so other programs can
 * compute it from the arrays. */
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

/* Returns true if one of the four checksums below includes the array. The checksums exclude the
 * tables of subtrees, because checksums must not depend on the layout of the file. */
bool ebpo_content_has(const ebpo_info *info, ebpo_array_id id);

/* The four checksums. These parts have separate checksums: colours, the border of a surface with
 * its winding numbers, and the simplified surface. So the content checksum is the same with and
 * without these parts. */
enum {
    EBPO_DIGEST_CONTENT,
    EBPO_DIGEST_COLOURS,
    EBPO_DIGEST_BORDER,
    EBPO_DIGEST_SURFACE,
    EBPO_DIGESTS
};
/* Returns the checksum to which an array belongs. */
static inline int ebpo_content_of(ebpo_array_id id, bool solid)
{
    bool border = id == EBPO_A_BORDER_LOOPS || id == EBPO_A_BORDER_POINTS ||
                  (!solid && (id == EBPO_A_LEAF_WINDING || id == EBPO_A_WHITE_WINDING));
    if (id >= EBPO_A_SURFACE_PATCHES && id <= EBPO_A_SURFACE_COLOURS)
        return EBPO_DIGEST_SURFACE;
    return border                      ? EBPO_DIGEST_BORDER
           : id == EBPO_A_GRAY_COLOURS ? EBPO_DIGEST_COLOURS
                                       : EBPO_DIGEST_CONTENT;
}

/* Digest of one array, computed chunk by chunk. Files with a table of subtrees have chunks with
 * fewer rows than other files. To give the same digest, these chunks are combined into chunks as
 * large as in other files, and codes that restart with each chunk are recoded. */
typedef struct ebpo_array_digest {
    ebpo_sha256 state;
    uint64_t last[3]; /* running sums of the components at the end of the previous chunk */
} ebpo_array_digest;

void ebpo_array_digest_begin(ebpo_array_digest *digest);
/* Adds the chunk with the rows [row, row + rows) of an array of this shape, without padding. Chunks
 * must be added in order. */
void ebpo_array_digest_add(ebpo_array_digest *digest, const ebpo_info *info, ebpo_array_id id,
                           const ebpo_shape *shape, uint64_t row, uint64_t rows,
                           const uint8_t *bytes);
void ebpo_array_digest_end(ebpo_array_digest *digest, uint8_t out[32]);

/* The entries of the arrays. Initialise with zeros. Arrays may be added in any order. */
typedef struct ebpo_content {
    bool short_of_memory;
    ebpo_content_entry *entries;
    uint64_t count, capacity;
} ebpo_content;

/* Adds the entry of an array; a lack of memory is reported by ebpo_content_end. */
void ebpo_content_put(ebpo_content *content, const char *path, const uint8_t digest[32]);
/* Computes the checksum of all entries. */
EBPO_MUST_USE ebpo_status ebpo_content_end(ebpo_content *content, uint8_t digest[32],
                                           ebpo_error *error);
void ebpo_content_free(ebpo_content *content);

/* --- the checksum of the part `attributes` --- */

EBPO_MUST_USE ebpo_status ebpo_attributes_digest(const ebpo_attributes *attributes,
                                                 uint8_t digest[32], ebpo_error *error);

#endif
