/* A list of u64 that is a single chunk, however long: of what tells of all chunks of a file. */
#ifndef EBPO_FORMAT_LONG_CHUNK_H
#define EBPO_FORMAT_LONG_CHUNK_H

#include "format/file_in.h"

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

/* EBPO_E_FORMAT: what such a list says of `path` is wrong. */
EBPO_MUST_USE ebpo_status ebpo_long_chunk_fail(const ebpo_file *file, ebpo_array_id list,
                                               const char *what, const char *path,
                                               ebpo_error *error);

#endif
