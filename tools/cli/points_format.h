/* Recognises the storage format of points by the first bytes. */
#ifndef EBPO_TOOLS_POINTS_FORMAT_H
#define EBPO_TOOLS_POINTS_FORMAT_H

#include "cli/points_input.h"

/* Recognises a PLY, a NumPy array, HDF5, text or raw doubles by the first bytes. On false the block
 * holds the error. */
bool points_recognise(points *p, points_block *b);

/* Returns true for "FILE.h5:/path" where FILE.h5 is a file. */
bool points_is_dataset(const char *path);
/* Finds the file that holds the points; returns false when there is none. *dataset: the text after
 * the file name, or "". */
struct stat;
bool points_file(const char *path, struct stat *st, const char **dataset);
/* Opens part `number` of `part_count` of a dataset, the same part as points_cut takes. Returns
 * false after an error, which has been reported. */
bool points_open_dataset(points *p, const char *path, uint64_t number, uint64_t part_count);

#endif
