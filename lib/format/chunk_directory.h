/* Declares the lists of all chunks of a file. The chunk directory gives the offset and stored size
 * of each chunk (format-spec/subtrees.md). The list of chunk checksums gives the checksum of each
 * chunk (checksums.md). A chunk is the unit of compression in HDF5. */
#ifndef EBPO_FORMAT_CHUNK_DIRECTORY_H
#define EBPO_FORMAT_CHUNK_DIRECTORY_H

#include <ebpo/base.h>

#include "core/endian.h"
#include "format/file_in.h"
#include "format/schema.h"
#include "hdf5_read/chunk.h"

/* Indices of all arrays that a file can have: first the arrays of the levels, then the arrays of
 * the root, then the arrays of attributes. Ascending indices have ascending numbers in the format
 * (ebpo_array_list_number). */
enum {
    EBPO_ARRAYS_OF_LEVELS = EBPO_LEVELS_MAX * EBPO_LEVEL_ARRAYS,
    EBPO_ARRAYS_OF_FORMAT = EBPO_ARRAYS_OF_LEVELS + EBPO_ARRAYS - EBPO_LEVEL_ARRAYS
    /* attributes follow */
};

/* Returns the number of indices: all arrays of the format, present or absent, plus the file's
 * attribute arrays. */
static inline int ebpo_all_arrays(const ebpo_file *file)
{
    return EBPO_ARRAYS_OF_FORMAT + file->attributes.arrays;
}

/* Returns the array with index i, which may be absent. */
static inline ebpo_array_in *ebpo_array_number(ebpo_file *file, int i)
{
    return i < EBPO_ARRAYS_OF_LEVELS
               ? &file->level_array[i / EBPO_LEVEL_ARRAYS][i % EBPO_LEVEL_ARRAYS]
           : i < EBPO_ARRAYS_OF_FORMAT
               ? &file->root_array[EBPO_LEVEL_ARRAYS + i - EBPO_ARRAYS_OF_LEVELS]
               : &file->attributes.array[i - EBPO_ARRAYS_OF_FORMAT];
}

/* --- rows of both lists: format-spec/subtrees.md, section 3 --- */

/* Array number in rows of the chunk directory that stand for bytes between chunks. */
#define EBPO_ROW_NO_ARRAY UINT32_MAX

/* Returns the number that both lists use for an array. */
uint32_t ebpo_array_list_number(ebpo_array_id id, int level);

/* Encode and decode a row of a list of chunks: the array's number, and the stored bytes or the
 * checksum of the chunk. */
static inline uint64_t ebpo_list_row(uint32_t number, uint64_t value)
{
    return (uint64_t)number << 32 | (uint32_t)value;
}
static inline uint32_t ebpo_list_row_number(uint64_t row) { return (uint32_t)(row >> 32); }
static inline uint32_t ebpo_list_row_value(uint64_t row) { return (uint32_t)row; }

/* --- lists of uint64_t, of any length, that are stored as a single chunk --- */

/* Encodes a list into *stored, which the caller frees. *bytes is its size. `codec_level`: as in
 * ebpo_write_options. */
EBPO_MUST_USE ebpo_status ebpo_long_chunk_encode(const uint64_t *values, uint64_t count,
                                                 ebpo_pipeline pipeline, int codec_level,
                                                 uint8_t **stored, size_t *bytes,
                                                 ebpo_error *error);

/* Decodes a list of `count` values from `stored`, which may be untrusted. The caller frees *values.
 * Returns EBPO_E_FORMAT for damaged bytes; *why then describes the damage. */
EBPO_MUST_USE ebpo_status ebpo_long_chunk_decode(const uint8_t *stored, size_t stored_bytes,
                                                 ebpo_pipeline pipeline, uint64_t count,
                                                 uint64_t **values, const char **why,
                                                 ebpo_error *error);

/* Reads an array that is a list in a single chunk: array->shape.rows values, which the caller
 * frees. */
EBPO_MUST_USE ebpo_status ebpo_long_chunk_read(const ebpo_file *file, const ebpo_array_in *array,
                                               uint64_t **values, ebpo_error *error);

/* --- stored sizes --- */

/* Returns EBPO_E_FORMAT if the arrays whose chunks are located take more bytes than the file has.
 */
EBPO_MUST_USE ebpo_status ebpo_stored_check(const ebpo_file *file, ebpo_error *error);

/* Returns EBPO_E_LIMIT if the decoded size of all arrays exceeds both `most` times the file size
 * and EBPO_EXPANSION_FREE. `most`: as max_expansion in ebpo_open_options. */
EBPO_MUST_USE ebpo_status ebpo_stored_check_expansion(const ebpo_file *file, uint64_t most,
                                                      ebpo_error *error);

/* --- checksums --- */

/* The list /chunk_checksums contains the last four bytes of every chunk of a file, which are its
 * checksum. The list is necessary because a chunk with a correct checksum may come from another
 * position or from another version of the file. Files with many subtrees have the list
 * /subtrees/checksum_index instead, without the chunks that /subtrees/checksums has
 * (checksum_pages.h). Source: format-spec/checksums.md. */

/* Returns the list entry of a chunk: the last four bytes of the chunk. They are its checksum in
 * every pipeline (set of HDF5 filters) that has a checksum. `bytes`: stored size, at least four. */
static inline uint32_t ebpo_chunk_checksum(const uint8_t *stored, size_t bytes)
{
    return ebpo_load32(stored + bytes - 4);
}

/* Reads the list of chunk checksums if the file has the list; later calls do nothing. Must be
 * called before ebpo_chunk_fits. Any thread may call this function. */
EBPO_MUST_USE ebpo_status ebpo_chunk_checksums_read(const ebpo_file *file, ebpo_error *error);

#endif
