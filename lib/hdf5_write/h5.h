/* Writes HDF5 files in this library's layout: groups, fixed-size attributes, and chunked integer
 * arrays whose chunks are already encoded (lib/hdf5_read reads these files without libhdf5). Only
 * files in lib/hdf5_write include <hdf5.h>. A mutex serialises the calls of libhdf5, so any thread
 * may call these functions. Error messages name the file and the object. */
#ifndef EBPO_HDF5_WRITE_H5_H
#define EBPO_HDF5_WRITE_H5_H

#include <ebpo/base.h>

#include "hdf5_read/chunk.h"

typedef int64_t ebpo_h5_id; /* an open object; negative: none */

/* Registers filter 32015 (zstd) with libhdf5 in this process. */
EBPO_MUST_USE ebpo_status ebpo_h5_register(ebpo_error *error);

/* An output file. If a write fails, the call that detects this failure returns it, and so do all
 * later calls. */
typedef struct ebpo_h5_out {
    const char *shown; /* the file's name for messages; owned by the caller */
    ebpo_h5_id file;   /* negative: not open */
    int codec_level;   /* compression level that the HDF5 headers state with the filters; 0: the
                          default */
    struct ebpo_h5_sink *sink; /* virtual file driver through which libhdf5 writes (h5_parts.h) */
} ebpo_h5_out;
#define EBPO_H5_OUT_INIT \
    {                    \
        "", -1, 0, NULL  \
    }

/* Closes an object that a function below has opened or created. Close all objects before the file.
 * A negative id is allowed. If closing fails, the next call for this file returns this failure. */
void ebpo_h5_close_id(const ebpo_h5_out *out, ebpo_h5_id id);

/* Creates a file by name, or in memory if `path` is NULL. The first `head_bytes` bytes are reserved
 * for metadata (HDF5 headers). `links`: number of objects in the root group. */
EBPO_MUST_USE ebpo_status ebpo_h5_create(ebpo_h5_out *out, const char *path, const char *shown,
                                         uint64_t head_bytes, unsigned links, ebpo_error *error);
/* Closes the file and opens it again. No object of the file may be open. HDF5 stores all further
 * metadata in one contiguous range of `metadata_bytes` bytes. HDF5 allocates this range at the end
 * of the file when it allocates the first of these metadata. */
EBPO_MUST_USE ebpo_status ebpo_h5_reopen(ebpo_h5_out *out, uint64_t metadata_bytes,
                                         ebpo_error *error);
/* ebpo_h5_root opens the root group for its attributes. ebpo_h5_make_group creates a group with
 * capacity for `links` links. The caller closes the id. */
EBPO_MUST_USE ebpo_status ebpo_h5_root(ebpo_h5_out *out, ebpo_h5_id *id, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_h5_make_group(ebpo_h5_out *out, const char *path, unsigned links,
                                             ebpo_h5_id *id, ebpo_error *error);

/* These functions write an attribute. If `count` is 0, the attribute is a scalar, else a
 * one-dimensional array. If the attribute exists, its value is overwritten; then type and size must
 * be unchanged. */
EBPO_MUST_USE ebpo_status ebpo_h5_put_text(ebpo_h5_out *out, ebpo_h5_id id, const char *name,
                                           const char *text, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_h5_put_int(ebpo_h5_out *out, ebpo_h5_id id, const char *name,
                                          int64_t value, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_h5_put_count(ebpo_h5_out *out, ebpo_h5_id id, const char *name,
                                            uint64_t value, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_h5_put_real(ebpo_h5_out *out, ebpo_h5_id id, const char *name,
                                           const double *values, unsigned count, ebpo_error *error);

/* These functions write attributes in the types that VTKHDF requires: arrays of `count` > 0
 * integers of 64 bits, and ASCII texts of fixed length. */
EBPO_MUST_USE ebpo_status ebpo_h5_put_ints(ebpo_h5_out *out, ebpo_h5_id id, const char *name,
                                           const int64_t *values, unsigned count,
                                           ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_h5_put_ascii(ebpo_h5_out *out, ebpo_h5_id id, const char *name,
                                            const char *text, ebpo_error *error);

/* Opens an array. The caller closes the id. */
EBPO_MUST_USE ebpo_status ebpo_h5_open_array(ebpo_h5_out *out, const char *path, ebpo_h5_id *id,
                                             ebpo_error *error);
/* ebpo_h5_make_array creates an array; the caller closes the id. ebpo_h5_put_chunk writes the chunk
 * with the number `chunk` of an array; `data` is the encoded chunk. */
EBPO_MUST_USE ebpo_status ebpo_h5_make_array(ebpo_h5_out *out, const char *path,
                                             const ebpo_shape *shape, ebpo_h5_id *id,
                                             ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_h5_put_chunk(ebpo_h5_out *out, const char *path, ebpo_h5_id id,
                                            const ebpo_shape *shape, uint64_t chunk,
                                            const void *data, size_t bytes, ebpo_error *error);

/* Sets *bytes to the number of bytes from the start of a file in memory to the end of its metadata
 * so far. `first_raw`: offset at which raw data (chunks) begin. */
EBPO_MUST_USE ebpo_status ebpo_h5_head_used(ebpo_h5_out *out, uint64_t first_raw, uint64_t *bytes,
                                            ebpo_error *error);
/* Returns the current size of the file in bytes. */
EBPO_MUST_USE ebpo_status ebpo_h5_size(ebpo_h5_out *out, uint64_t *bytes, ebpo_error *error);
/* Flushes and closes the file. Does nothing if the file is closed already. The file is complete
 * only if this function returns EBPO_OK. */
EBPO_MUST_USE ebpo_status ebpo_h5_finish(ebpo_h5_out *out, ebpo_error *error);
/* Closes the file without further writing. May be called after a failed call. Does nothing after
 * ebpo_h5_finish. */
void ebpo_h5_discard(ebpo_h5_out *out);

/* The functions below write HDF5 files for other programs. These files have plain arrays of numbers
 * that grow by rows, with filters that every build of HDF5 has (shuffle, deflate). Error messages
 * name the file and the object. */

/* Type of the numbers of an array. */
typedef enum ebpo_h5_number {
    EBPO_H5_U8,
    EBPO_H5_I32,
    EBPO_H5_I64,
    EBPO_H5_F32,
    EBPO_H5_F64
} ebpo_h5_number;

static inline size_t ebpo_h5_number_bytes(ebpo_h5_number number)
{
    return number == EBPO_H5_U8 ? 1 : number == EBPO_H5_I32 || number == EBPO_H5_F32 ? 4 : 8;
}

/* An array that grows by rows: [rows] if cols is 0, else [rows][cols]. */
typedef struct ebpo_h5_table {
    ebpo_h5_id id;
    char path[96];
    ebpo_h5_number number;
    uint32_t cols;
    uint64_t rows; /* current number of rows */
} ebpo_h5_table;
#define EBPO_H5_TABLE_INIT       \
    {                            \
        -1, "", EBPO_H5_U8, 0, 0 \
    }

/* Creates a file by name that programs with any HDF5 from 1.8 on can read. Finish it with
 * ebpo_h5_finish or ebpo_h5_discard. */
EBPO_MUST_USE ebpo_status ebpo_h5_create_plain(ebpo_h5_out *out, const char *path,
                                               const char *shown, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_h5_make_plain_group(ebpo_h5_out *out, const char *path,
                                                   ebpo_h5_id *id, ebpo_error *error);

/* Creates an array without rows. The caller closes the array with ebpo_h5_close_table. */
EBPO_MUST_USE ebpo_status ebpo_h5_make_table(ebpo_h5_out *out, const char *path,
                                             ebpo_h5_number number, uint32_t cols,
                                             ebpo_h5_table *table, ebpo_error *error);
/* Appends rows. `data`: [rows][cols] in the machine's byte order. */
EBPO_MUST_USE ebpo_status ebpo_h5_append(ebpo_h5_out *out, ebpo_h5_table *table, const void *data,
                                         uint64_t rows, ebpo_error *error);
/* Closes a table; this writes the last data of the table. If closing fails, the next call for this
 * file returns the failure. */
void ebpo_h5_close_table(const ebpo_h5_out *out, ebpo_h5_table *table);

/* Creates an array, writes all its rows and closes it. */
EBPO_MUST_USE ebpo_status ebpo_h5_put_table(ebpo_h5_out *out, const char *path,
                                            ebpo_h5_number number, uint32_t cols, const void *data,
                                            uint64_t rows, ebpo_error *error);

/* Creates a volume for other programs: an array of float64, [dims[0]][dims[1]][dims[2]]. Each
 * dimension is at least 1. ebpo_h5_put_layers then writes the volume layer by layer; a layer is
 * [dims[1]][dims[2]]. The caller closes the id. */
EBPO_MUST_USE ebpo_status ebpo_h5_make_volume(ebpo_h5_out *out, const char *path,
                                              const uint64_t dims[3], ebpo_h5_id *id,
                                              ebpo_error *error);
/* Writes `layers` layers from layer `first` on. `data`: [layers][dims[1]][dims[2]]. */
EBPO_MUST_USE ebpo_status ebpo_h5_put_layers(ebpo_h5_out *out, const char *path, ebpo_h5_id id,
                                             const uint64_t dims[3], uint64_t first,
                                             uint64_t layers, const double *data,
                                             ebpo_error *error);

/* The functions below read files in layouts of other programs, through libhdf5 in a separate
 * process. */

/* Limits of a separate process. */
typedef struct ebpo_process_limits {
    uint64_t memory_bytes; /* address space in addition to the address space of this process */
    uint64_t file_bytes;   /* greatest size of a file that the process writes */
    unsigned seconds;      /* processor time */
} ebpo_process_limits;

/* Callback that returns the number of rows that an array's chunks have in this format. `stored`:
 * the array's shape in the file. stored->chunk_rows is the number that the other program has
 * chosen, or 0 if the array has no chunks. `subtrees`: true if the file has subtrees. `kept`: true
 * if the other program has kept the chunk size of the arrays whose chunk size the format fixes. */
typedef uint32_t (*ebpo_h5_chunk_rows_fn)(const char *path, const ebpo_shape *stored, bool subtrees,
                                          bool kept);

/* Copies the parts of a file that belong to this format, in this format's layout, from the file
 * `from` to the empty file `to`. libhdf5 opens files by name. The name `to` is removed as soon as
 * libhdf5 has opened the file; the name `from` is removed in the same way if `from_goes` is true.
 * Chunks that fit the format are copied as stored. For other layouts, filters and byte orders,
 * libhdf5 decodes the values. Arrays that do not fit the format are omitted. *omitted describes the
 * first omitted array and the reason (EBPO_E_FORMAT). If no array is omitted, *omitted has no
 * message. On failure, *omitted is a copy of *error. Returns EBPO_E_FORMAT, EBPO_E_IO,
 * EBPO_E_MEMORY; EBPO_E_UNSUPPORTED if the library was built without libhdf5. */
EBPO_MUST_USE ebpo_status ebpo_h5_clean_copy(const char *from, bool from_goes, const char *to,
                                             const char *shown, ebpo_h5_chunk_rows_fn chunk_rows,
                                             const ebpo_process_limits *limits, ebpo_error *omitted,
                                             ebpo_error *error);

#endif
