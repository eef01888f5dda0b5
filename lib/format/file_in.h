/* An open file, and where its arrays are. */
#ifndef EBPO_FORMAT_FILE_IN_H
#define EBPO_FORMAT_FILE_IN_H

#include <pthread.h>
#include <stdatomic.h>

#include <ebpo/file.h>

#include "format/schema.h"
#include "hdf5_read/chunk.h"
#include "hdf5_read/head.h"
#include "io/byte_source.h"
#include "mesh/attributes.h"

/* Decoding state and room for one stored chunk, of one thread. */
typedef struct ebpo_chunk_reader {
    ebpo_chunk_coder coder;
    uint8_t *stored;
    size_t capacity;
} ebpo_chunk_reader;

/* What one thread needs. */
typedef struct ebpo_idle_reader ebpo_idle_reader;
struct ebpo_idle_reader {
    ebpo_idle_reader *next;
    ebpo_chunk_reader reader;
    uint8_t raw[EBPO_CHUNK_BYTES_MAX];
};

/* Readers of chunks that wait for the next thread: setting up a decoder takes longer than decoding
 * a chunk. They stay with the file, a few of them, and count to no budget. */
typedef struct ebpo_idle_readers {
    pthread_mutex_t lock; /* of what follows */
    ebpo_idle_reader *first;
    unsigned count;
} ebpo_idle_readers;

typedef struct ebpo_array_in {
    bool present;
    ebpo_array_id id;
    int level;
    char path[EBPO_PATH_BYTES];
    ebpo_shape shape; /* of what ebpo_reader_chunk gives */
    bool gates;       /* it makes that of another coding: ebpo_stored_shape */
    uint64_t stored_bytes;
    /* [ebpo_shape_chunks(&shape)] where each is; NULL when the array is absent. After
     * ebpo_reader_locate, unless it has one chunk only */
    ebpo_chunk_place *chunks;
    uint64_t first_sum; /* of its chunks, in the file's sums */
    const char *coding; /* of attributes; the others' stand in ebpo_schema */
} ebpo_array_in;

/* Bytes that a stored chunk of it can have at most. */
static inline size_t ebpo_reader_chunk_bound(const ebpo_array_in *array)
{
    ebpo_shape stored = ebpo_stored_shape(&array->shape, array->gates);
    return ebpo_chunk_bound(stored.chunk_rows * ebpo_shape_row_bytes(&stored));
}

/* What the head says of an array of attributes. */
typedef struct ebpo_attribute_in {
    ebpo_attribute head; /* without values */
    bool different;      /* lists of different lengths */
    bool has_range;
    double range[2];
} ebpo_attribute_in;

typedef struct ebpo_attributes_in {
    uint64_t count;
    ebpo_attribute_in *head; /* [count] */
    ebpo_array_in *array;    /* [arrays], see ebpo_attribute_path */
    int arrays;
    uint8_t sha256[32];
} ebpo_attributes_in;

struct ebpo_file {
    ebpo_input in;
    ebpo_info info;
    ebpo_array_in level_array[EBPO_LEVELS_MAX][EBPO_LEVEL_ARRAYS];
    ebpo_array_in root_array[EBPO_ARRAYS]; /* those from EBPO_A_VERTICES on */
    ebpo_attributes_in attributes;
    pthread_mutex_t lock;
    atomic_bool located; /* the chunks of all arrays are known */
    bool has_places;     /* a list says where they are */
    bool has_sums;       /* a list says how each chunk ends: chunk_directory.h */
    atomic_bool summed;  /* it has been read */
    uint32_t *sums;
    ebpo_idle_readers idle;
};

/* ebpo_open of what this process has written: however much it has decoded. */
EBPO_MUST_USE ebpo_status ebpo_open_own(const char *path, ebpo_file **out, ebpo_error *error);

/* After this the chunks of an array that is present are known. Reads from a file that is far away,
 * once. Any thread. */
EBPO_MUST_USE ebpo_status ebpo_reader_locate(const ebpo_file *file, const ebpo_array_in *array,
                                             ebpo_error *error);

static inline const ebpo_array_in *ebpo_reader_array(const ebpo_file *file, ebpo_array_id id,
                                                     int level)
{
    return id < EBPO_LEVEL_ARRAYS   ? &file->level_array[level][id]
           : id == EBPO_A_ATTRIBUTE ? &file->attributes.array[level]
                                    : &file->root_array[id];
}

/* `workspace`: what the arrays are in, or NULL. */
static inline ebpo_check ebpo_reader_check(const ebpo_file *file, ebpo_workspace *workspace)
{
    return (ebpo_check){ file->in.shown, EBPO_E_FORMAT, workspace };
}

/* What the file keeps for itself while it is read: counters, where chunks lie, idle readers.
 * Atomic, or under its locks. */
static inline ebpo_file *ebpo_reader_own(const ebpo_file *file)
{
    return (ebpo_file *)(uintptr_t)file;
}

/* How many rows the file's chunks may have. */
static inline ebpo_head_rows ebpo_reader_rows_of_chunk(const ebpo_file *file, ebpo_array_id id)
{
    return ebpo_schema_is_list(id)    ? EBPO_HEAD_ROWS_ALL
           : file->info.subtree_level ? EBPO_HEAD_ROWS_POWER
                                      : EBPO_HEAD_ROWS_FULL;
}

/* Of an array: 0 while another thread may be finding out where its chunks are. */
uint64_t ebpo_reader_stored_bytes(const ebpo_file *file, const ebpo_array_in *array);

/* Bytes of a level in the file, once it has been read. */
uint64_t ebpo_reader_level_bytes(const ebpo_file *file, int level);

#endif
