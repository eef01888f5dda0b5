/* Reading the head of a file that nobody vouches for: objects, attributes, and where chunks are. Of
 * HDF5's file format it knows what section 2 of the specification says that writers use, and
 * refuses the rest by name; libhdf5 has no part in it. Every block's checksum is compared, every
 * count and address is bounded before it is used, and nothing leads in a circle. Errors name file
 * and object. A head is one thread's.
 * Source: The HDF Group, "HDF5 File Format Specification Version 3.0". */
#ifndef EBPO_HDF5_READ_HEAD_H
#define EBPO_HDF5_READ_HEAD_H

#include <ebpo/base.h>

#include "hdf5_read/chunk.h"
#include "io/byte_source.h"

typedef struct ebpo_head {
    const char *shown; /* the input's name */
    uint64_t file_bytes;
    struct ebpo_head_state *state;
} ebpo_head;
#define EBPO_HEAD_INIT \
    {                  \
        NULL, 0, NULL  \
    }

/* How the messages of that end. */
#define EBPO_HEAD_FOREIGN                                                                     \
    "as other programs write it; write it anew with `ebpo repack --compat`, or read it with " \
    "--compat where a command has that"

/* Where an object's header is. There is nothing to close. */
typedef uint64_t ebpo_head_object;

/* Opens for reading, through the input, which stays the caller's and outlives the head. Close it
 * also after an error. EBPO_E_FORMAT when it is no whole HDF5 file; EBPO_E_UNSUPPORTED, here and
 * below, when it is one that another program has laid out in a way of its own. */
EBPO_MUST_USE ebpo_status ebpo_head_open(ebpo_head *head, ebpo_input *input, ebpo_error *error);
/* Where more metadata is expected (a place within the file): it is then read in one go. */
void ebpo_head_expect_index(ebpo_head *head, ebpo_range index);
/* Returns `status`, unless the input failed at any time since opening: then that, with its message,
 * as what could not be read may have been taken for absent meanwhile. */
EBPO_MUST_USE ebpo_status ebpo_head_close(ebpo_head *head, ebpo_status status, ebpo_error *error);

/* From here on keeps which bytes of the file headers and indexes are, each as often as it is read:
 * for who looks for bytes that belong to nothing. */
void ebpo_head_keep_ranges(ebpo_head *head);
/* These ranges, the caller's to free; the superblock is not among them. EBPO_E_MEMORY, also when
 * memory was short meanwhile. */
EBPO_MUST_USE ebpo_status ebpo_head_take_ranges(ebpo_head *head, ebpo_range **ranges,
                                                uint64_t *count, ebpo_error *error);
enum { EBPO_HEAD_SUPERBLOCK_BYTES = 48 };

/* What a path names. Soft and external links are not followed: OTHER, as is what is damaged. */
typedef enum ebpo_head_kind {
    EBPO_HEAD_ABSENT,
    EBPO_HEAD_GROUP,
    EBPO_HEAD_ARRAY,
    EBPO_HEAD_OTHER
} ebpo_head_kind;
ebpo_head_kind ebpo_head_look(ebpo_head *head, const char *path);

EBPO_MUST_USE ebpo_status ebpo_head_open_group(ebpo_head *head, const char *path,
                                               ebpo_head_object *object, ebpo_error *error);
/* Opens an array for its attributes. */
EBPO_MUST_USE ebpo_status ebpo_head_open_array(ebpo_head *head, const char *path,
                                               ebpo_head_object *object, ebpo_error *error);

/* Attributes of an open object; `path` names it in messages. EBPO_E_ABSENT (without a message)
 * when there is none, EBPO_E_FORMAT for another type or size. Text: of fixed length, at most size -
 * 1 bytes up to its first zero byte, UTF-8 without control characters. */
EBPO_MUST_USE ebpo_status ebpo_head_get_text(ebpo_head *head, ebpo_head_object object,
                                             const char *path, const char *name, char *text,
                                             size_t size, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_head_get_int(ebpo_head *head, ebpo_head_object object,
                                            const char *path, const char *name, int64_t *value,
                                            ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_head_get_count(ebpo_head *head, ebpo_head_object object,
                                              const char *path, const char *name, uint64_t *value,
                                              ebpo_error *error);
/* `count` numbers; 0: one. */
EBPO_MUST_USE ebpo_status ebpo_head_get_real(ebpo_head *head, ebpo_head_object object,
                                             const char *path, const char *name, double *values,
                                             unsigned count, ebpo_error *error);

/* How many rows the chunks of an array may have. */
typedef enum ebpo_head_rows {
    EBPO_HEAD_ROWS_FULL,  /* as ebpo_full_chunk_rows says */
    EBPO_HEAD_ROWS_POWER, /* a power of two, at most so many */
    EBPO_HEAD_ROWS_ALL    /* one chunk, however large */
} ebpo_head_rows;

/* Tells an array's shape and its chunks' places, ebpo_shape_chunks(shape) of them, which the
 * caller frees; NULL on failure. Checked: little-endian integers, one or two fixed dimensions, one
 * of the pipelines, chunks of the rows asked for; every chunk is there, lies within the file,
 * has passed its filters, and takes at most ebpo_chunk_bound bytes. `stored_bytes`: their sum.
 * Arrays of more than `most` chunks: only the shape is told, *chunks is NULL. `coding`: what the
 * attribute says, which must be there; or NULL. */
enum { EBPO_HEAD_CODING_BYTES = 16 };
EBPO_MUST_USE ebpo_status ebpo_head_read_array(ebpo_head *head, const char *path, uint64_t most,
                                               ebpo_head_rows rows, ebpo_shape *shape,
                                               char coding[EBPO_HEAD_CODING_BYTES],
                                               ebpo_chunk_place **chunks, uint64_t *stored_bytes,
                                               ebpo_error *error);

#endif
