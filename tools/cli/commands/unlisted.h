/* A file without what its lists say of its chunks, for a look at one whose list is damaged. */
#ifndef EBPO_CMD_UNLISTED_H
#define EBPO_CMD_UNLISTED_H

#include <ebpo/ebpo.h>

/*
 * Opens it as if one byte more stood at its end. The lists /chunk_sums and /subtrees/places hold
 * for a file of the length that they state, and are not used in another one; chunks are found by
 * the index of HDF5 then, and told by their own checksums. Nothing says that a chunk is the one
 * of its place: compare the content before anything is believed. `path`: a local file, and stays
 * while it is open. EBPO_E_IO, and what ebpo_open_with fails with.
 */
ebpo_status unlisted_open(const char *path, uint64_t most_expansion, ebpo_file **out,
                          ebpo_error *error);

#endif
