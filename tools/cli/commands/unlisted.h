/* Opens a file without its lists of chunks, to examine a file with a damaged list. */
#ifndef EBPO_CMD_UNLISTED_H
#define EBPO_CMD_UNLISTED_H

#include <ebpo/ebpo.h>

/* Opens the file as if it were one byte longer. The lists /chunk_checksums and
 * /subtrees/chunk_directory state the length of their file, and the library ignores them in a file
 * of another length. It then finds chunks by the index of HDF5, and checks each chunk by the
 * checksum in the chunk. A chunk at a wrong position is not detected, so compare the checksum of
 * the content before using the content. Fails with EBPO_E_IO, and with the errors of
 * ebpo_open_with. path: a local file; the string must exist while the file is open. */
ebpo_status unlisted_open(const char *path, uint64_t max_expansion, ebpo_file **out,
                          ebpo_error *error);

#endif
