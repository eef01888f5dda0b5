/* Writing HDF5 files as this library does: groups, fixed-size attributes, chunked integer arrays
 * whose chunks come already encoded (lib/hdf5_read reads them). The only module that includes
 * <hdf5.h>; calls are serialised inside and any thread may make them. Errors name file and object.
 */
#ifndef EBPO_HDF5_WRITE_H5_H
#define EBPO_HDF5_WRITE_H5_H

#include <ebpo/base.h>

#include "hdf5_read/shape.h"

typedef int64_t ebpo_h5_id; /* an open object; negative: none */

/* Registers filter 32015 with libhdf5 in this process. */
EBPO_MUST_USE ebpo_status ebpo_h5_register(ebpo_error *error);

/* The first failure of a write is told by the call that meets it, and by all after it. */
typedef struct ebpo_h5_out {
    const char *shown; /* for messages; the caller's */
    ebpo_h5_id file;
    int codec_level; /* recorded with the filters */
    struct ebpo_h5_sink *sink;
} ebpo_h5_out;
#define EBPO_H5_OUT_INIT \
    {                    \
        "", -1, 0, NULL  \
    }

/* Closes an object opened or created below, before the file is; a negative id is fine. A failure is
 * told by the next call, ebpo_h5_finish at the latest. */
void ebpo_h5_close_id(const ebpo_h5_out *out, ebpo_h5_id id);

/* Creates a file by name, or in memory when path is NULL. The first `head_bytes` bytes are for
 * metadata. `links`: objects in the root group. */
EBPO_MUST_USE ebpo_status ebpo_h5_create(ebpo_h5_out *out, const char *path, const char *shown,
                                         uint64_t head_bytes, unsigned links, ebpo_error *error);
/* Closes the file and opens it again, nothing else of it being open: from here on metadata that is
 * allocated takes the next `metadata_bytes` in one piece. */
EBPO_MUST_USE ebpo_status ebpo_h5_reopen(ebpo_h5_out *out, uint64_t metadata_bytes,
                                         ebpo_error *error);
/* Opens the root group for its attributes, or creates a group made for `links` links. The caller
 * closes the id. */
EBPO_MUST_USE ebpo_status ebpo_h5_root(ebpo_h5_out *out, ebpo_h5_id *id, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_h5_make_group(ebpo_h5_out *out, const char *path, unsigned links,
                                             ebpo_h5_id *id, ebpo_error *error);

/* Attributes. `count` 0: a scalar; else a one-dimensional array. Putting a name again overwrites
 * the value (same type and size). */
EBPO_MUST_USE ebpo_status ebpo_h5_put_text(ebpo_h5_out *out, ebpo_h5_id id, const char *name,
                                           const char *text, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_h5_put_int(ebpo_h5_out *out, ebpo_h5_id id, const char *name,
                                          int64_t value, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_h5_put_count(ebpo_h5_out *out, ebpo_h5_id id, const char *name,
                                            uint64_t value, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_h5_put_real(ebpo_h5_out *out, ebpo_h5_id id, const char *name,
                                           const double *values, unsigned count, ebpo_error *error);

EBPO_MUST_USE ebpo_status ebpo_h5_open_array(ebpo_h5_out *out, const char *path, ebpo_h5_id *id,
                                             ebpo_error *error);
/* Creates an array; the caller closes the id. Then its chunks, encoded, by number. */
EBPO_MUST_USE ebpo_status ebpo_h5_make_array(ebpo_h5_out *out, const char *path,
                                             const ebpo_shape *shape, ebpo_h5_id *id,
                                             ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_h5_put_chunk(ebpo_h5_out *out, const char *path, ebpo_h5_id id,
                                            const ebpo_shape *shape, uint64_t chunk,
                                            const void *data, size_t bytes, ebpo_error *error);

/* Of a file in memory: bytes from the start up to the end of the last metadata so far, given that
 * raw data begins at first_raw. */
EBPO_MUST_USE ebpo_status ebpo_h5_head_used(ebpo_h5_out *out, uint64_t first_raw, uint64_t *bytes,
                                            ebpo_error *error);
/* Bytes that the file has so far. */
EBPO_MUST_USE ebpo_status ebpo_h5_size(ebpo_h5_out *out, uint64_t *bytes, ebpo_error *error);
/* Flushes and closes. Harmless when already closed. Only after EBPO_OK is the file whole. */
EBPO_MUST_USE ebpo_status ebpo_h5_finish(ebpo_h5_out *out, ebpo_error *error);
/* Closes without writing any more, also what a failing call above left. Harmless after
 * ebpo_h5_finish. */
void ebpo_h5_discard(ebpo_h5_out *out);

#endif
