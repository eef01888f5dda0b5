/* Reads the head of an untrusted file (its HDF5 headers): objects, attributes, and chunk offsets.
 * Reads what section 4 of the specification allows writers, and rejects other HDF5 files with
 * specific messages. Does not use libhdf5. Every block's checksum is compared, every count and
 * address is bounded before use, and there are no cycles. Errors name file and object. A head is
 * used by one thread. Source: The HDF Group, "HDF5 File Format Specification Version 3.0". */
#ifndef EBPO_HDF5_READ_HEAD_H
#define EBPO_HDF5_READ_HEAD_H

#include <ebpo/base.h>

#include "hdf5_read/chunk.h"
#include "io/byte_source.h"

typedef struct ebpo_head {
    const char *shown; /* the input's name, for messages */
    uint64_t end;      /* end of the HDF5 data in bytes; the stored file may be longer */
    struct ebpo_head_state *state;
} ebpo_head;
#define EBPO_HEAD_INIT \
    {                  \
        NULL, 0, NULL  \
    }

/* The end of messages about files that other programs have written. */
#define EBPO_HEAD_FOREIGN                                                                  \
    "as other programs write it; rewrite it with `ebpo repack --compat`, or read it with " \
    "--compat where a command has that"

/* Address of an object's header. An object need not be closed. */
typedef uint64_t ebpo_head_object;

/* Opens a head for reading through `input`, which stays the caller's and must outlive the head.
 * Call ebpo_head_close also after an error. EBPO_E_FORMAT when the input is not a complete HDF5
 * file; EBPO_E_UNSUPPORTED, here and below, when another program has written the file in an
 * unsupported layout. */
EBPO_MUST_USE ebpo_status ebpo_head_open(ebpo_head *head, ebpo_input *input, ebpo_error *error);
/* Sets the range of the chunk index in the file. The whole range is read when a part of it is first
 * needed. */
void ebpo_head_hint_index(ebpo_head *head, ebpo_range index);
/* Closes the head. Returns `status`, or, if the input has failed at any time since opening, the
 * input's status with its message, because the reader may have taken unreadable data for absent
 * data. */
EBPO_MUST_USE ebpo_status ebpo_head_close(ebpo_head *head, ebpo_status status, ebpo_error *error);

/* Starts to record the byte ranges of the headers and indexes that are read, for callers that look
 * for unused bytes. A range that is read several times is recorded several times. */
void ebpo_head_keep_ranges(ebpo_head *head);
/* Returns the recorded ranges, without the superblock; the caller frees them. EBPO_E_MEMORY, also
 * when memory was short during recording. */
EBPO_MUST_USE ebpo_status ebpo_head_take_ranges(ebpo_head *head, ebpo_range **ranges,
                                                uint64_t *count, ebpo_error *error);
enum { EBPO_HEAD_SUPERBLOCK_BYTES = 48 };

/* The kind of object that a path names. Soft and external links are not followed: they have the
 * kind OTHER, like damaged objects. */
typedef enum ebpo_head_kind {
    EBPO_HEAD_ABSENT,
    EBPO_HEAD_GROUP,
    EBPO_HEAD_ARRAY,
    EBPO_HEAD_OTHER
} ebpo_head_kind;
ebpo_head_kind ebpo_head_find_kind(ebpo_head *head, const char *path);

/* Opens a group for its attributes. */
EBPO_MUST_USE ebpo_status ebpo_head_open_group(ebpo_head *head, const char *path,
                                               ebpo_head_object *object, ebpo_error *error);
/* Opens an array for its attributes. */
EBPO_MUST_USE ebpo_status ebpo_head_open_array(ebpo_head *head, const char *path,
                                               ebpo_head_object *object, ebpo_error *error);

/* Reads an attribute of an open object; `path` names it in messages. EBPO_E_ABSENT (without a
 * message) when the object has no such attribute, EBPO_E_FORMAT for another type or size. A text
 * must have a fixed length, at most size - 1 bytes before its first zero byte, and be UTF-8 without
 * control characters. */
EBPO_MUST_USE ebpo_status ebpo_head_get_text(ebpo_head *head, ebpo_head_object object,
                                             const char *path, const char *name, char *text,
                                             size_t size, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_head_get_int(ebpo_head *head, ebpo_head_object object,
                                            const char *path, const char *name, int64_t *value,
                                            ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_head_get_count(ebpo_head *head, ebpo_head_object object,
                                              const char *path, const char *name, uint64_t *value,
                                              ebpo_error *error);
/* Reads `count` numbers; with `count` 0, one number. */
EBPO_MUST_USE ebpo_status ebpo_head_get_real(ebpo_head *head, ebpo_head_object object,
                                             const char *path, const char *name, double *values,
                                             unsigned count, ebpo_error *error);

/* The rule for the rows of an array's chunks. */
typedef enum ebpo_head_rows {
    EBPO_HEAD_ROWS_FULL,  /* the number that ebpo_full_chunk_rows returns */
    EBPO_HEAD_ROWS_POWER, /* that number, or a smaller power of two */
    EBPO_HEAD_ROWS_ALL    /* one chunk, however large */
} ebpo_head_rows;

/* Returns an array's shape and its chunk offsets, ebpo_shape_chunks(shape) of them, which the
 * caller frees; NULL on failure. Checks that the array has little-endian integers, one or two fixed
 * dimensions, one of the pipelines, and chunks of the required rows. Checks that every chunk is
 * present, within the file, stored with all filters, and at most ebpo_chunk_bound bytes large.
 * `stored_bytes`: the sum of the chunks' sizes. For arrays of more than `most` chunks only the
 * shape is returned; *chunks is NULL. `coding`: if not NULL, receives the value of the attribute
 * "coding", which must then exist. */
enum { EBPO_HEAD_CODING_BYTES = 16 };
EBPO_MUST_USE ebpo_status ebpo_head_read_array(ebpo_head *head, const char *path, uint64_t most,
                                               ebpo_head_rows rows, ebpo_shape *shape,
                                               char coding[EBPO_HEAD_CODING_BYTES],
                                               ebpo_chunk_location **chunks, uint64_t *stored_bytes,
                                               ebpo_error *error);

#endif
