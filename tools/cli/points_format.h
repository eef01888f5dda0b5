/* What points are stored as, by their first bytes. */
#ifndef EBPO_TOOLS_POINTS_FORMAT_H
#define EBPO_TOOLS_POINTS_FORMAT_H

#include "cli/points_input.h"

/* By the first bytes: a PLY, a NumPy array, HDF5, text or raw doubles. False: the block tells. */
bool points_recognise(points *p, points_block *b);

/* The same for "FILE.h5:/path" where FILE.h5 is a file. False after an error, which has been said.
 */
bool points_is_dataset(const char *path);
/* The file that holds them. False: there is none. *dataset: what follows the file's name, or "". */
struct stat;
bool points_file(const char *path, struct stat *st, const char **dataset);
/* Part `number` of `of`, as points_cut takes them. */
bool points_open_dataset(points *p, const char *path, uint64_t number, uint64_t of);

#endif
