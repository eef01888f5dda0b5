/* How every chunk of a file ends, in one list: a chunk's own checksum does not tell which chunk it
 * is, so one in another's place, or from another version of the file, would be taken for the right
 * one. format-spec/README.md, section 20. */
#ifndef EBPO_FORMAT_CHUNK_SUMS_H
#define EBPO_FORMAT_CHUNK_SUMS_H

#include "core/endian.h"
#include "format/file_in.h"

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
