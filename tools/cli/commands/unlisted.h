/* Opens a file without the lists of its chunks, to examine a file with a damaged list. */
#ifndef EBPO_CMD_UNLISTED_H
#define EBPO_CMD_UNLISTED_H

#include <ebpo/ebpo.h>

/* Opens it as if one more byte were at its end. The lists /chunk_sums and /subtrees/places are
 * valid for a file of the length that they state, and are not used in another one; then chunks are
 * found by the index of HDF5, and checked by their own checksums. Nothing proves that a chunk
 * belongs to its position: compare the content before using it. `path`: a local file, which must
 * stay while it is open. Fails with EBPO_E_IO, and the errors of ebpo_open_with. */
ebpo_status unlisted_open(const char *path, uint64_t max_expansion, ebpo_file **out,
                          ebpo_error *error);

#endif
