/* The offset, stored size and checksum of every chunk of an open file.
 * format-spec/README.md, sections 9 and 20. */
#ifndef EBPO_FORMAT_CHUNK_DIRECTORY_H
#define EBPO_FORMAT_CHUNK_DIRECTORY_H

#include <ebpo/base.h>

#include "core/endian.h"
#include "format/file_in.h"
#include "format/schema.h"
#include "hdf5_read/chunk.h"

/* All arrays that a file can have, by one index, in the order of the numbers that the format gives
 * them (ebpo_place_number). */
enum {
    EBPO_ARRAYS_OF_LEVELS = EBPO_LEVELS_MAX * EBPO_LEVEL_ARRAYS,
    EBPO_ARRAYS_OF_FORMAT = EBPO_ARRAYS_OF_LEVELS + EBPO_ARRAYS - EBPO_LEVEL_ARRAYS
    /* then come attributes */
};

static inline int ebpo_all_arrays(const ebpo_file *file)
{
    return EBPO_ARRAYS_OF_FORMAT + file->attributes.arrays;
}

/* Number i of these, present or not. */
static inline ebpo_array_in *ebpo_array_number(ebpo_file *file, int i)
{
    return i < EBPO_ARRAYS_OF_LEVELS
               ? &file->level_array[i / EBPO_LEVEL_ARRAYS][i % EBPO_LEVEL_ARRAYS]
           : i < EBPO_ARRAYS_OF_FORMAT
               ? &file->root_array[EBPO_LEVEL_ARRAYS + i - EBPO_ARRAYS_OF_LEVELS]
               : &file->attributes.array[i - EBPO_ARRAYS_OF_FORMAT];
}

/* --- the list of all chunks, /subtrees/places: format-spec/README.md, section 9, "Places" --- */

/* Stands for a gap. */
#define EBPO_PLACE_GAP UINT32_MAX

/* The number of an array in the list. */
uint32_t ebpo_place_number(ebpo_array_id id, int level);
/* EBPO_ARRAYS: none that this library knows. */
ebpo_array_id ebpo_place_array(uint32_t number, int *level); /* of attributes: any number */

/* A row of the list. */
static inline uint64_t ebpo_place(uint32_t number, uint64_t bytes)
{
    return (uint64_t)number << 32 | (uint32_t)bytes;
}
static inline uint32_t ebpo_place_number_of(uint64_t place) { return (uint32_t)(place >> 32); }
static inline uint32_t ebpo_place_bytes_of(uint64_t place) { return (uint32_t)place; }

/* --- lists of u64 in a single chunk, however long --- */

/* `bytes`: of the encoded list, which the caller frees. `codec_level`: as in ebpo_write_options. */
EBPO_MUST_USE ebpo_status ebpo_long_chunk_encode(const uint64_t *values, uint64_t count,
                                                 ebpo_pipeline pipeline, int codec_level,
                                                 uint8_t **stored, size_t *bytes,
                                                 ebpo_error *error);

/* Of `stored_bytes` that may be anything; *values is the caller's. EBPO_E_FORMAT: *why says what is
 * wrong. */
EBPO_MUST_USE ebpo_status ebpo_long_chunk_decode(const uint8_t *stored, size_t stored_bytes,
                                                 ebpo_pipeline pipeline, uint64_t count,
                                                 uint64_t **values, const char **why,
                                                 ebpo_error *error);

/* Reads such an array of a file: array->shape.rows values, which the caller frees. */
EBPO_MUST_USE ebpo_status ebpo_long_chunk_read(const ebpo_file *file, const ebpo_array_in *array,
                                               uint64_t **values, ebpo_error *error);

/* --- stored sizes --- */

/* EBPO_E_FORMAT: the arrays whose chunks are known take more bytes than the file has. */
EBPO_MUST_USE ebpo_status ebpo_stored_check(const ebpo_file *file, ebpo_error *error);

/* EBPO_E_LIMIT: decoded they take more than `most` times the file's bytes, and more than
 * EBPO_EXPANSION_FREE. `most` as in ebpo_open_options. */
EBPO_MUST_USE ebpo_status ebpo_stored_check_expansion(const ebpo_file *file, uint64_t most,
                                                      ebpo_error *error);

/* --- checksums: how every chunk of a file ends, in one list. A chunk's own checksum does not tell
 * which chunk it is, so one in another's place, or from another version of the file, would be taken
 * for the right one. format-spec/README.md, section 20 --- */

/* What the list says of a chunk: its last four bytes, which are its checksum in every pipeline that
 * has one. `bytes`: as stored, four or more. */
static inline uint32_t ebpo_chunk_sum(const uint8_t *stored, size_t bytes)
{
    return ebpo_load32(stored + bytes - 4);
}

/* Reads the list, once, if the file has one that holds. After this ebpo_chunk_fits may be asked.
 * Any thread. */
EBPO_MUST_USE ebpo_status ebpo_chunk_sums_read(const ebpo_file *file, ebpo_error *error);

/* Whether the bytes are those of this chunk of this array; true where the file does not say. */
static inline bool ebpo_chunk_fits(const ebpo_file *file, const ebpo_array_in *array,
                                   uint64_t chunk, const uint8_t *stored, size_t bytes)
{
    return !file->sums ||
           (bytes >= 4 && ebpo_chunk_sum(stored, bytes) == file->sums[array->first_sum + chunk]);
}

#endif
