/* Files that other programs have laid out, through libhdf5, in a process of its own. */
#ifndef EBPO_H5_COMPAT_H
#define EBPO_H5_COMPAT_H

#include <ebpo/base.h>

typedef struct ebpo_apart_limits {
    uint64_t memory_bytes; /* of addresses, beyond those that this process has */
    uint64_t file_bytes;   /* of what it writes */
    unsigned seconds;      /* of processor time */
} ebpo_apart_limits;

/* Writes what a file has of this format anew, in the layout of this format, chunks as they are
 * stored: from the file `from` to the empty file `to`, which loses its name as soon as libhdf5,
 * which wants one, has opened it; so does `from` with `from_goes`. What does not fit the format is
 * left out. EBPO_E_FORMAT, EBPO_E_IO, EBPO_E_MEMORY; EBPO_E_UNSUPPORTED without libhdf5. */
EBPO_MUST_USE ebpo_status ebpo_h5_clean_copy(const char *from, bool from_goes, const char *to,
                                             const char *shown, const ebpo_apart_limits *limits,
                                             ebpo_error *error);

#endif
