/* Files that other programs have laid out, through libhdf5, in a process of its own. */
#ifndef EBPO_HDF5_WRITE_COMPAT_H
#define EBPO_HDF5_WRITE_COMPAT_H

#include <ebpo/base.h>

#include "hdf5_read/shape.h"

typedef struct ebpo_apart_limits {
    uint64_t memory_bytes; /* of addresses, beyond those that this process has */
    uint64_t file_bytes;   /* of what it writes */
    unsigned seconds;      /* of processor time */
} ebpo_apart_limits;

/* Rows of a chunk of an array of this format. `stored`: its shape, with the chunk_rows that another
 * program has given it, 0 for none; `subtrees`: the file has that part; `kept`: the arrays whose
 * chunks the format fixes have these. */
typedef uint32_t (*ebpo_h5_chunk_rows_fn)(const char *path, const ebpo_shape *stored, bool subtrees,
                                          bool kept);

/* Writes what a file has of this format anew, in the layout of this format: from the file `from` to
 * the empty file `to`, which loses its name as soon as libhdf5, which wants one, has opened it; so
 * does `from` with `from_goes`. Chunks that fit the format are copied as they are stored; of other
 * layouts, filters and byte orders, libhdf5 reads the values. What does not fit the format is left
 * out; *left_out then says what and why of the first such array (EBPO_E_FORMAT), and has no message
 * else; on failure it is the failure. EBPO_E_FORMAT, EBPO_E_IO, EBPO_E_MEMORY; EBPO_E_UNSUPPORTED
 * without libhdf5.
 */
EBPO_MUST_USE ebpo_status ebpo_h5_clean_copy(const char *from, bool from_goes, const char *to,
                                             const char *shown, ebpo_h5_chunk_rows_fn chunk_rows,
                                             const ebpo_apart_limits *limits, ebpo_error *left_out,
                                             ebpo_error *error);

#endif
