/* Computes the order of the checksums in /subtrees/checksums, which has those of the chunks that
 * subtrees use, and is read page by page. A page is a chunk of this array. The checksums of pages
 * and of all other chunks are in /subtrees/checksum_index, which is read as a whole
 * (chunk_directory.h). Source: format-spec/checksums.md, section 4. */
#ifndef EBPO_FORMAT_CHECKSUM_PAGES_H
#define EBPO_FORMAT_CHECKSUM_PAGES_H

#include <stddef.h>

#include "format/schema.h"
#include "hdf5_read/chunk.h"

/* Returns true if /subtrees/checksums has the chunks of an array of this shape, in files that have
 * /subtrees/checksums. The shape has several chunks then. */
bool ebpo_is_paged(const ebpo_info *info, ebpo_array_id id, int level, const ebpo_shape *shape);

/* An array whose chunks are in /subtrees/checksums. */
typedef struct ebpo_paged_array {
    ebpo_array_id id;
    int level;
    const ebpo_shape *shape;
    /* the row of chunk 0; the row of the next chunk is `step` bytes after it */
    uint32_t *row;
    size_t step;
    uint64_t done; /* number of chunks that have a row; 0 at first */
} ebpo_paged_array;

/* Computes the row of /subtrees/checksums of each chunk of all paged arrays, which are in the order
 * of their numbers. `index`: the values of /subtrees/index; any values are safe. The arrays have at
 * most 2^32 chunks together. */
void ebpo_number_checksums(const ebpo_info *info, const uint64_t *index, ebpo_paged_array *array,
                           unsigned count);

#endif
