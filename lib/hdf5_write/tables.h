/* HDF5 files for other programs: plain arrays of numbers that grow by rows, compressed with what
 * every HDF5 has (shuffle, deflate). Errors name file and object. */
#ifndef EBPO_HDF5_WRITE_TABLES_H
#define EBPO_HDF5_WRITE_TABLES_H

#include "hdf5_write/h5.h"

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

/* [rows] when cols is 0, else [rows][cols]. */
typedef struct ebpo_h5_table {
    ebpo_h5_id id;
    char path[96];
    ebpo_h5_number number;
    uint32_t cols;
    uint64_t rows; /* so far */
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

/* Attributes as the VTKHDF format wants them: 64-bit integers [count], ASCII of fixed length. */
EBPO_MUST_USE ebpo_status ebpo_h5_put_ints(ebpo_h5_out *out, ebpo_h5_id id, const char *name,
                                           const int64_t *values, unsigned count,
                                           ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_h5_put_ascii(ebpo_h5_out *out, ebpo_h5_id id, const char *name,
                                            const char *text, ebpo_error *error);

/* Creates an array of no rows. The caller closes it with ebpo_h5_close_table. */
EBPO_MUST_USE ebpo_status ebpo_h5_make_table(ebpo_h5_out *out, const char *path,
                                             ebpo_h5_number number, uint32_t cols,
                                             ebpo_h5_table *table, ebpo_error *error);
/* Appends rows, in the machine's byte order; stored little-endian. */
EBPO_MUST_USE ebpo_status ebpo_h5_append(ebpo_h5_out *out, ebpo_h5_table *table, const void *data,
                                         uint64_t rows, ebpo_error *error);
/* A failure, as what is still to be compressed is written now, is told by the next call. */
void ebpo_h5_close_table(const ebpo_h5_out *out, ebpo_h5_table *table);

/* All three: an array that is written at once. */
EBPO_MUST_USE ebpo_status ebpo_h5_put_table(ebpo_h5_out *out, const char *path,
                                            ebpo_h5_number number, uint32_t cols, const void *data,
                                            uint64_t rows, ebpo_error *error);

#endif
