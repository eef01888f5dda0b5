/* For writing: how many rows chunks have, and which levels are laid out alike.
 * format-spec/README.md, section 9, "Order". */
#ifndef EBPO_FORMAT_CHUNK_ROWS_H
#define EBPO_FORMAT_CHUNK_ROWS_H

#include <ebpo/file.h>

#include "hdf5_read/chunk.h"
#include "format/schema.h"

/* With subtrees: levels up to the first one lie as they are, from the second one on they are deep.
 */
int ebpo_last_whole_level(const ebpo_info *info);
int ebpo_first_deep_level(const ebpo_info *info);

/* Rows of an array's chunks, all or a power of two; `rows` are those of the array. */
uint32_t ebpo_rows_of_chunk(const ebpo_info *info, ebpo_array_id id, int level, uint64_t rows,
                            uint32_t cols, uint32_t element_size);

/* The same of a file that another program has rewritten: as ebpo_h5_chunk_rows_fn says. The numbers
 * of arrays start anew at chunks, so the right ones have to be found where that program changed
 * them; arrays whose chunks nothing fixes keep theirs if the format takes them. */
uint32_t ebpo_rows_of_foreign_chunk(const char *path, const ebpo_shape *stored, bool subtrees,
                                    bool kept);

#endif
