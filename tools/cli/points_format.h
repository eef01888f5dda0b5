/* Recognises the storage format of points by the first bytes. */
#ifndef EBPO_TOOLS_POINTS_FORMAT_H
#define EBPO_TOOLS_POINTS_FORMAT_H

#include "cli/points_input.h"

/* Recognises a PLY, a NumPy array, HDF5, text or raw doubles by the first bytes. Returns false
 * after an error, which is then in the block or has been reported. */
bool points_recognise(points *p, points_block *b);

/* Returns true for "FILE.h5:/path" if FILE.h5 is a file. */
bool points_is_dataset(const char *path);
/* Gets the status of the file that has the points. Returns false if the file does not exist.
 * *dataset: the text after the file name (":/path"), or "". */
struct stat;
bool points_file(const char *path, struct stat *st, const char **dataset);
/* Reads part `number` of `part_count` parts of a dataset. This is the part that points_cut would
 * select. Returns false after an error, which has been reported. */
bool points_open_dataset(points *p, const char *path, uint64_t number, uint64_t part_count);

#endif
