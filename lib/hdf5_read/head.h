/* Reads the head of an untrusted file (its HDF5 headers): objects, attributes, and chunk offsets.
 * Reads the part of HDF5 that format-spec/README.md, section 4, allows, and rejects other HDF5
 * files with specific messages. Does not use libhdf5. Every block's checksum is compared, every
 * count and address is bounded before use, and links cannot cause endless loops. Error messages
 * name the file and the object. Only one thread may use a head. Source: The HDF Group, "HDF5 File
 * Format Specification Version 3.0". */
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

/* The end of messages about files that other programs have rewritten. */
#define EBPO_HEAD_FOREIGN                                                                 \
    "as in files that other programs have rewritten; rewrite the file with `ebpo repack " \
    "--compat`, or use the option --compat of a command that has it"

/* Address of an object's header. An object need not be closed. */
typedef uint64_t ebpo_head_object;

/* Opens a head for reading through `input`, which the caller keeps and which must outlive the head.
 * Call ebpo_head_close even if this function fails. Returns EBPO_E_FORMAT if the input is not a
 * complete HDF5 file. This function and the functions below return EBPO_E_UNSUPPORTED if another
 * program has written the file in a layout that only libhdf5 reads. */
EBPO_MUST_USE ebpo_status ebpo_head_open(ebpo_head *head, ebpo_input *input, ebpo_error *error);
/* Sets the range of HDF5's chunk indexes in the file. The whole range is read at once when a part
 * of this range is needed for the first time. */
void ebpo_head_hint_index(ebpo_head *head, ebpo_range index);
/* Closes the head. Returns `status`, the result of the reader so far. If the input has failed at
 * any time since opening, returns the status and message of this failure instead, because the
 * reader may have treated unreadable data as absent. */
EBPO_MUST_USE ebpo_status ebpo_head_close(ebpo_head *head, ebpo_status status, ebpo_error *error);

/* Starts to record the byte ranges of the headers and indexes that are read, for callers that look
 * for unused bytes. A range that is read several times is recorded several times. */
void ebpo_head_keep_ranges(ebpo_head *head);
/* Returns the recorded ranges, without the superblock (the first EBPO_HEAD_SUPERBLOCK_BYTES bytes
 * of the file); the caller frees them. Returns EBPO_E_MEMORY if memory was short during recording.
 */
EBPO_MUST_USE ebpo_status ebpo_head_take_ranges(ebpo_head *head, ebpo_range **ranges,
                                                uint64_t *count, ebpo_error *error);
enum { EBPO_HEAD_SUPERBLOCK_BYTES = 48 };

/* The kind of object that a path names. EBPO_HEAD_OTHER: a damaged object, or a soft or external
 * link, which is not followed. */
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

/* The functions ebpo_head_get_... read an attribute of an open object. `path`: path of the object,
 * for messages. They return EBPO_E_ABSENT (without a message) if the object has no such attribute,
 * and EBPO_E_FORMAT if the attribute has another type or number of values. A text must have a fixed
 * length and at most size - 1 bytes before its first zero byte. It must be UTF-8 without control
 * characters. */
EBPO_MUST_USE ebpo_status ebpo_head_get_text(ebpo_head *head, ebpo_head_object object,
                                             const char *path, const char *name, char *text,
                                             size_t size, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_head_get_int(ebpo_head *head, ebpo_head_object object,
                                            const char *path, const char *name, int64_t *value,
                                            ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_head_get_count(ebpo_head *head, ebpo_head_object object,
                                              const char *path, const char *name, uint64_t *value,
                                              ebpo_error *error);
/* Reads `count` doubles; 0: one double. */
EBPO_MUST_USE ebpo_status ebpo_head_get_real(ebpo_head *head, ebpo_head_object object,
                                             const char *path, const char *name, double *values,
                                             unsigned count, ebpo_error *error);

/* The rule for the rows of an array's chunks. */
typedef enum ebpo_head_rows {
    EBPO_HEAD_ROWS_FULL,  /* the number that ebpo_full_chunk_rows returns */
    EBPO_HEAD_ROWS_POWER, /* the number of ebpo_full_chunk_rows, or a smaller power of two */
    EBPO_HEAD_ROWS_ALL    /* all rows of the array: one chunk, however large */
} ebpo_head_rows;

/* Reads an array's shape and the locations of its chunks. Checks that the array has little-endian
 * integers, one or two fixed dimensions, one of the pipelines, and chunks with the required number
 * of rows. Checks that every chunk is present, within the file, stored with all filters, and at
 * most ebpo_chunk_bound bytes large. `most`: if the array has more chunks than this, reads only the
 * shape. *chunks: [ebpo_shape_chunks(shape)], which the caller frees; NULL if the chunks were not
 * read, or on failure. *stored_bytes: sum of the chunks' sizes, or 0 if the chunks were not read.
 * `coding`: receives the value of the attribute "coding", which must exist; NULL: the attribute is
 * not read. */
enum { EBPO_HEAD_CODING_BYTES = 16 };
EBPO_MUST_USE ebpo_status ebpo_head_read_array(ebpo_head *head, const char *path, uint64_t most,
                                               ebpo_head_rows rows, ebpo_shape *shape,
                                               char coding[EBPO_HEAD_CODING_BYTES],
                                               ebpo_chunk_location **chunks, uint64_t *stored_bytes,
                                               ebpo_error *error);

#endif
