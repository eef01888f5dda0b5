/* For writing: how many rows chunks have, and which levels are laid out alike.
 * format-spec/README.md, section 9, "Order". */
#ifndef EBPO_CONTAINER_CHUNK_ROWS_H
#define EBPO_CONTAINER_CHUNK_ROWS_H

#include <ebpo/file.h>

#include "container/schema.h"

/* With subtrees: levels up to the first one lie as they are, from the second one on they are deep.
 */
int ebpo_last_whole_level(const ebpo_info *info);
int ebpo_first_deep_level(const ebpo_info *info);

/* Rows of an array's chunks, all or a power of two; `rows` are those of the array. */
uint32_t ebpo_rows_of_chunk(const ebpo_info *info, ebpo_array_id id, int level, uint64_t rows,
                            uint32_t cols, uint32_t element_size);

#endif
