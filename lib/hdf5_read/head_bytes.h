/* Inside lib/hdf5_read only: a file's bytes, in few reads. Our writer puts headers at the start of
 * the file, and the index of large arrays in one piece behind the first levels. */
#ifndef EBPO_HDF5_READ_HEAD_BYTES_H
#define EBPO_HDF5_READ_HEAD_BYTES_H

#include <ebpo/base.h>

#include "io/byte_source.h"

typedef struct ebpo_head_bytes {
    ebpo_input *input;
    uint8_t *first, *window; /* the first bytes, and a piece elsewhere, NULL until needed */
    uint8_t *table;          /* all of `index`, NULL until needed */
    uint8_t *large;          /* what fits none of them */
    uint64_t first_bytes, window_at, window_bytes, large_capacity;
    ebpo_range index; /* where more metadata is expected, or nothing */
    /* of the input's first failure, after which nothing is read any more */
    ebpo_status status;
    ebpo_error error;
} ebpo_head_bytes;

/* Fetches the first bytes. Close also after an error. */
EBPO_MUST_USE ebpo_status ebpo_head_bytes_open(ebpo_head_bytes *bytes, ebpo_input *input,
                                               ebpo_error *error);
void ebpo_head_bytes_close(ebpo_head_bytes *bytes);

/* Bytes [at, at + size), until the next call; the caller bounds `size`. NULL: they lie beyond the
 * end of the file, or, as `status` says then, could not be read. */
const uint8_t *ebpo_head_bytes_at(ebpo_head_bytes *bytes, uint64_t at, uint64_t size);

#endif
