/* Defines an open file and the locations of the file's arrays. */
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

/* Decoding state and buffer for one stored chunk, for one thread. */
typedef struct ebpo_chunk_reader {
    ebpo_chunk_coder coder;
    uint8_t *stored;
    size_t capacity;
} ebpo_chunk_reader;

/* Chunk reader, and buffer for the decoded chunk, of one thread. */
typedef struct ebpo_idle_reader ebpo_idle_reader;
struct ebpo_idle_reader {
    ebpo_idle_reader *next;
    ebpo_chunk_reader reader;
    uint8_t raw[EBPO_CHUNK_BYTES_MAX];
};

/* Idle chunk readers for reuse, because creating a decoder takes longer than decoding a chunk. The
 * file keeps a few idle readers, whose memory counts toward no budget. */
typedef struct ebpo_idle_readers {
    pthread_mutex_t lock; /* protects `first` and `count` */
    ebpo_idle_reader *first;
    unsigned count;
} ebpo_idle_readers;

/* An array of an open file. */
typedef struct ebpo_array_in {
    bool present; /* false: the file lacks the array, and no other field is valid */
    ebpo_array_id id;
    /* for attributes: number of the array in /attributes; 0 for other arrays without a level */
    int level;
    char path[EBPO_PATH_BYTES];
    ebpo_shape shape; /* shape of the rows that ebpo_reader_chunk returns */
    /* true: faces stored as gates; ebpo_stored_shape returns their shape in the file */
    bool gates;
    uint64_t stored_bytes; /* size in the file; 0: the chunks are not located yet */
    /* [ebpo_shape_chunks(&shape)] location of each chunk; NULL when the array is absent. Valid
     * after ebpo_reader_locate, or always for a single chunk */
    ebpo_chunk_location *chunks;
    uint64_t first_checksum; /* index of the array's first chunk in the list of chunk checksums */
    const char *coding;      /* for attributes; ebpo_schema has the codings of other arrays */
} ebpo_array_in;

/* Returns the maximum size of a stored chunk. */
static inline size_t ebpo_reader_chunk_bound(const ebpo_array_in *array)
{
    ebpo_shape stored = ebpo_stored_shape(&array->shape, array->gates);
    return ebpo_chunk_bound(stored.chunk_rows * ebpo_shape_row_bytes(&stored));
}

/* Properties of an attribute array that its HDF5 attributes state. */
typedef struct ebpo_attribute_in {
    ebpo_attribute head; /* names and types, without values */
    bool different;      /* true: the values are lists of different lengths */
    bool has_range;
    double range[2]; /* if has_range: least and greatest value */
} ebpo_attribute_in;

typedef struct ebpo_attributes_in {
    uint64_t count;
    ebpo_attribute_in *head; /* [count] */
    ebpo_array_in *array;    /* [arrays] header, values and items (ebpo_values_number) */
    int arrays;              /* 1 + 2 * count; 0: the file has no attributes */
    uint8_t sha256[32];
} ebpo_attributes_in;

struct ebpo_file {
    ebpo_input in;
    uint64_t end; /* end of the HDF5 data in bytes; the stored file may be longer */
    ebpo_info info;
    ebpo_array_in level_array[EBPO_LEVELS_MAX][EBPO_LEVEL_ARRAYS];
    ebpo_array_in root_array[EBPO_ARRAYS]; /* used from EBPO_A_VERTICES on */
    ebpo_attributes_in attributes;
    pthread_mutex_t lock;        /* held while chunks are located or checksums are read */
    atomic_bool located;         /* the chunks of all arrays are located */
    bool has_directory;          /* the file has a list of chunk offsets */
    bool has_checksums;          /* the file has a list of chunk checksums: chunk_directory.h */
    atomic_bool checksums_read;  /* the list of chunk checksums has been read */
    ebpo_array_id checksum_list; /* if has_checksums: the array that is this list */
    uint32_t *checksums;         /* the list, or NULL before it has been read */
    /* checksums that are read page by page (checksum_pages.h), if the list is
     * EBPO_A_CHECKSUM_INDEX. A page is a chunk of /subtrees/checksums */
    atomic_bool pages_ready; /* the members below and `checksum_row` of chunks are valid */
    uint32_t *page_value;    /* [rows of /subtrees/checksums] values of the pages read so far */
    atomic_uchar *page_read; /* [chunks of /subtrees/checksums] 1: the page has been read */
    ebpo_idle_readers idle;
};

/* Opens a file that this process has written, without a limit on its decoded size. */
EBPO_MUST_USE ebpo_status ebpo_open_own(const char *path, ebpo_file **out, ebpo_error *error);

/* Locates the chunks of an array that is present. The first call for an array with several chunks
 * locates the chunks of all arrays; later calls do not read the file. Any thread may call this
 * function. */
EBPO_MUST_USE ebpo_status ebpo_reader_locate(const ebpo_file *file, const ebpo_array_in *array,
                                             ebpo_error *error);

/* Returns an array of the file, which may be absent. `level`: the array's level; for attributes,
 * the array's number in /attributes; not used for other arrays of the root. */
static inline const ebpo_array_in *ebpo_reader_array(const ebpo_file *file, ebpo_array_id id,
                                                     int level)
{
    return id < EBPO_LEVEL_ARRAYS   ? &file->level_array[level][id]
           : id == EBPO_A_ATTRIBUTE ? &file->attributes.array[level]
                                    : &file->root_array[id];
}

/* Returns the context for the checks of schema.h. */
static inline ebpo_check ebpo_reader_check(const ebpo_file *file, ebpo_workspace *workspace)
{
    return (ebpo_check){ file->in.shown, EBPO_E_FORMAT, workspace };
}

/* Returns a mutable pointer to the file, so that a reader can change counters, chunk offsets and
 * idle readers. These members are atomic or protected by the file's locks. */
static inline ebpo_file *ebpo_reader_own(const ebpo_file *file)
{
    return (ebpo_file *)(uintptr_t)file;
}

/* Returns which numbers of rows are allowed in the chunks of an array. */
static inline ebpo_head_rows ebpo_reader_rows_of_chunk(const ebpo_file *file, ebpo_array_id id)
{
    return ebpo_schema_is_list(id)    ? EBPO_HEAD_ROWS_ALL
           : file->info.subtree_level ? EBPO_HEAD_ROWS_POWER
                                      : EBPO_HEAD_ROWS_FULL;
}

/* Returns the stored size of an array; 0 while another thread may be locating its chunks. */
uint64_t ebpo_reader_stored_bytes(const ebpo_file *file, const ebpo_array_in *array);

/* Returns the stored bytes of a level. While another thread may be locating the chunks, counts only
 * sizes that have been known since the file was opened. */
uint64_t ebpo_reader_level_bytes(const ebpo_file *file, int level);

#endif
