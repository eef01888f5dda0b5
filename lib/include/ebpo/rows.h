/* SPDX-License-Identifier: MIT
 * Reads rows of numbers from any HDF5 file, as input for queries.
 */
#ifndef EBPO_ROWS_H
#define EBPO_ROWS_H

#include <ebpo/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * Reads a whole dataset of rows x columns as doubles. The dataset may contain integers or floats of
 * any size and byte order. Values are rounded to the nearest double.
 *
 * dataset        path of the dataset in the file, such as "/points". NULL or "": the call fails,
 *                and the message of the error lists the suitable datasets
 * least, most    minimum and maximum number of columns of the dataset, 1 to 64
 * fill           value for missing columns, if the dataset has fewer than `most`
 * rows           [*count][most] doubles; freed by free()
 *
 * EBPO_E_IO: the file cannot be read, or another program has it open for writing. EBPO_E_FORMAT:
 * the file is not an HDF5 file; the dataset does not exist; its values are in another file; its
 * shape or type is not suitable (for example complex numbers); the file is an .ebpo.h5 file whose
 * dataset has coded values instead of plain numbers; or `dataset` is NULL or "", and the file has
 * suitable datasets. EBPO_E_ABSENT: `dataset` is NULL or "", and the file has no suitable dataset.
 * EBPO_E_LIMIT: the rows would take more than 64 MiB, and more than 1,024 times the file size.
 * EBPO_E_UNSUPPORTED: the library was built without libhdf5.
 *
 * libhdf5 reads the file in a separate process, with limits on memory and time and without plugins.
 * The rows are passed through an unnamed file in TMPDIR.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_rows_read(const char *path, const char *dataset,
                                                  unsigned least, unsigned most, double fill,
                                                  double **rows, uint64_t *count,
                                                  ebpo_error *error);

/*
 * Reads consecutive rows of a dataset, as ebpo_rows_read reads all rows. Of a chunked dataset, only
 * the chunks that contain these rows are read.
 *
 * first      index of the first row to read
 * max_rows   maximum number of rows to read; 0: only *total is set
 * count      number of rows that were read
 * total      number of rows of the dataset; 0 on failure
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_rows_read_part(const char *path, const char *dataset,
                                                       unsigned least, unsigned most, double fill,
                                                       uint64_t first, uint64_t max_rows,
                                                       double **rows, uint64_t *count,
                                                       uint64_t *total, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
