/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: rows of numbers from any HDF5 file, to ask about.
 */
#ifndef EBPO_ROWS_H
#define EBPO_ROWS_H

#include <ebpo/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * Reads a dataset of rows x columns, of integers or floats of any size and byte order, as doubles;
 * what a double cannot hold is rounded to the nearest. It is read as a whole.
 *
 * dataset        such as "/points"; NULL or "": none is read, and the error's message names
 *                those that could be
 * least, most    how many columns it may have; 1 to 64
 * fill           the value of columns from the dataset's to `most`
 * rows           [*count][most] doubles. Freed by free(). On failure NULL.
 *
 * EBPO_E_IO: the file cannot be read, or is open for writing in another program. EBPO_E_FORMAT: it
 * is no HDF5 file, has no such dataset, or one of another shape or type (complex numbers, say, or
 * an array of an .ebpo.h5 file, which holds codes), or whose values lie in another file.
 * EBPO_E_ABSENT: no dataset was named, and none could be. EBPO_E_LIMIT: the rows would take more
 * than 64 MiB and than 1,024 times the file. EBPO_E_ARGUMENT, EBPO_E_MEMORY. EBPO_E_UNSUPPORTED:
 * this library was built without libhdf5. That reads the file in a process of its own, with limits
 * on memory and time and without plugins; rows come by a file without a name in TMPDIR.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_rows_read(const char *path, const char *dataset,
                                                  unsigned least, unsigned most, double fill,
                                                  double **rows, uint64_t *count,
                                                  ebpo_error *error);

/*
 * The same for a part of the rows; of a dataset in chunks those are read that it meets.
 *
 * first, most_rows   from row `first` on, at most so many; 0: none, to learn *total
 * count              the rows that were there
 * total              the rows of the dataset, as the file says; 0 on failure
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_rows_read_part(const char *path, const char *dataset,
                                                       unsigned least, unsigned most, double fill,
                                                       uint64_t first, uint64_t most_rows,
                                                       double **rows, uint64_t *count,
                                                       uint64_t *total, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
