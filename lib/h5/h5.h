/* HDF5 files as this library uses them: groups, fixed-size attributes, chunked integer arrays whose
 * chunks come and go already encoded. The only module that includes <hdf5.h>; calls are serialised
 * inside and any thread may make them. Errors name file and object. */
#ifndef EBPO_H5_H5_H
#define EBPO_H5_H5_H

#include <ebpo/base.h>

#include "codec/chunk.h"
#include "io/byte_source.h"

typedef int64_t ebpo_h5_id; /* an open object; negative: none */

/* An integer array: [rows] when cols is 0, else [rows][cols]; chunks of chunk_rows rows. */
typedef struct ebpo_h5_shape {
    uint64_t rows;
    uint32_t cols;
    uint32_t chunk_rows;
    uint8_t element_size;
    bool is_signed;
    ebpo_pipeline pipeline;
} ebpo_h5_shape;

/* Rows of a chunk: the power of two that fills up to 64 KiB, or all rows when there are fewer. rows
 * > 0. */
uint32_t ebpo_h5_chunk_rows(uint64_t rows, uint32_t cols, uint32_t element_size);
static inline uint64_t ebpo_h5_chunk_count(const ebpo_h5_shape *shape)
{
    return shape->rows / shape->chunk_rows + (shape->rows % shape->chunk_rows != 0);
}
static inline size_t ebpo_h5_row_bytes(const ebpo_h5_shape *shape)
{
    return (size_t)shape->element_size * (shape->cols ? shape->cols : 1);
}

/* Registers filter 32015 with libhdf5 in this process. */
EBPO_MUST_USE ebpo_status ebpo_h5_register(ebpo_error *error);

/* Closes an object opened or created below; a negative id is fine. */
void ebpo_h5_close_id(ebpo_h5_id id);

/* --- writing --- */
typedef struct ebpo_h5_out {
    const char *shown; /* for messages; the caller's */
    ebpo_h5_id file;
    int codec_level; /* recorded with the filters */
} ebpo_h5_out;
#define EBPO_H5_OUT_INIT \
    {                    \
        "", -1, 0        \
    }

/* Creates a file by name, or in memory when path is NULL. The first `head_bytes` bytes are for
 * metadata. `links`: objects in the root group. */
EBPO_MUST_USE ebpo_status ebpo_h5_create(ebpo_h5_out *out, const char *path, const char *shown,
                                         uint64_t head_bytes, unsigned links, ebpo_error *error);
/* Closes a file by name and opens it again, nothing else of it being open: from here on metadata
 * that is allocated takes the next `metadata_bytes` in one piece. */
EBPO_MUST_USE ebpo_status ebpo_h5_reopen(ebpo_h5_out *out, const char *path,
                                         uint64_t metadata_bytes, ebpo_error *error);
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
                                             const ebpo_h5_shape *shape, ebpo_h5_id *id,
                                             ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_h5_put_chunk(ebpo_h5_out *out, const char *path, ebpo_h5_id id,
                                            const ebpo_h5_shape *shape, uint64_t chunk,
                                            const void *data, size_t bytes, ebpo_error *error);

/* Of a file in memory: bytes from the start up to the end of the last metadata so far, given that
 * raw data begins at first_raw. */
EBPO_MUST_USE ebpo_status ebpo_h5_head_used(ebpo_h5_out *out, uint64_t first_raw, uint64_t *bytes,
                                            ebpo_error *error);
/* Bytes that the file has so far. */
EBPO_MUST_USE ebpo_status ebpo_h5_size(ebpo_h5_out *out, uint64_t *bytes, ebpo_error *error);
/* Flushes and closes. Harmless when already closed. */
EBPO_MUST_USE ebpo_status ebpo_h5_finish(ebpo_h5_out *out, ebpo_error *error);
void ebpo_h5_discard(ebpo_h5_out *out);

/* --- reading: the head and where the chunks are; libhdf5 never sees the chunks themselves --- */
typedef struct ebpo_h5_in {
    const char *shown; /* the input's name */
    ebpo_h5_id file;
    uint64_t file_bytes;
    struct ebpo_h5_driver *driver;
} ebpo_h5_in;
#define EBPO_H5_IN_INIT   \
    {                     \
        NULL, -1, 0, NULL \
    }

/* Opens for reading, through the input, which stays the caller's and outlives `in`. EBPO_E_FORMAT
 * when it is no HDF5 file. */
EBPO_MUST_USE ebpo_status ebpo_h5_open(ebpo_h5_in *in, ebpo_input *input, ebpo_error *error);
/* Where more metadata is expected (a place within the file): it is then read in one go. */
void ebpo_h5_expect_index(ebpo_h5_in *in, ebpo_range index);
/* Closes everything, also what a failing open left. Returns `status`, unless the input failed at
 * any time since opening: then that, with its message, since libhdf5 reports failed reads as damage
 * or as absence. */
EBPO_MUST_USE ebpo_status ebpo_h5_close(ebpo_h5_in *in, ebpo_status status, ebpo_error *error);

/* What a path names. Soft and external links are not followed: OTHER. The path's folders have been
 * checked by the caller. */
typedef enum ebpo_h5_kind {
    EBPO_H5_ABSENT,
    EBPO_H5_GROUP,
    EBPO_H5_ARRAY,
    EBPO_H5_OTHER
} ebpo_h5_kind;
ebpo_h5_kind ebpo_h5_look(ebpo_h5_in *in, const char *path);

EBPO_MUST_USE ebpo_status ebpo_h5_open_group(ebpo_h5_in *in, const char *path, ebpo_h5_id *id,
                                             ebpo_error *error);
/* Opens an array for its attributes. */
EBPO_MUST_USE ebpo_status ebpo_h5_look_at_array(ebpo_h5_in *in, const char *path, ebpo_h5_id *id,
                                                ebpo_error *error);

/* Attributes of an open group; `object` names it in messages. EBPO_E_ABSENT (without a message)
 * when there is none, EBPO_E_FORMAT for another type or size. Text: of fixed length, at most size -
 * 1 bytes up to its first zero byte, UTF-8 without control characters. */
EBPO_MUST_USE ebpo_status ebpo_h5_get_text(ebpo_h5_in *in, ebpo_h5_id id, const char *object,
                                           const char *name, char *text, size_t size,
                                           ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_h5_get_int(ebpo_h5_in *in, ebpo_h5_id id, const char *object,
                                          const char *name, int64_t *value, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_h5_get_count(ebpo_h5_in *in, ebpo_h5_id id, const char *object,
                                            const char *name, uint64_t *value, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_h5_get_real(ebpo_h5_in *in, ebpo_h5_id id, const char *object,
                                           const char *name, double *values, unsigned count,
                                           ebpo_error *error);

/* Where a chunk lies in the file, as stored. */
typedef struct ebpo_h5_chunk {
    uint64_t address;
    uint32_t bytes;
} ebpo_h5_chunk;

/* How many rows the chunks of an array may have. */
typedef enum ebpo_h5_rows {
    EBPO_H5_ROWS_FULL,  /* as ebpo_h5_chunk_rows says */
    EBPO_H5_ROWS_POWER, /* a power of two, at most so many */
    EBPO_H5_ROWS_ALL    /* one chunk, however large */
} ebpo_h5_rows;

/* Tells an array's shape and its chunks' places, ebpo_h5_chunk_count(shape) of them, which the
 * caller frees; NULL on failure. Checked: little-endian integers, one or two fixed dimensions, one
 * of the pipelines, chunks of the rows asked for; every chunk is there, lies within the file,
 * has passed its filters, and takes at most ebpo_chunk_bound bytes. `stored_bytes`: their sum.
 * Arrays of more than `most` chunks: only the shape is told, *chunks is NULL. `coding`: what the
 * attribute says, which must be there; or NULL. */
enum { EBPO_H5_CODING_BYTES = 16 };
EBPO_MUST_USE ebpo_status ebpo_h5_read_array(ebpo_h5_in *in, const char *path, uint64_t most,
                                             ebpo_h5_rows rows, ebpo_h5_shape *shape,
                                             char coding[EBPO_H5_CODING_BYTES],
                                             ebpo_h5_chunk **chunks, uint64_t *stored_bytes,
                                             ebpo_error *error);

#endif
