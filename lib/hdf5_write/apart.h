/* Inside lib/hdf5_write only: what libhdf5 does with files of others happens in a process of its
 * own, with limits. What goes wrong there, whatever it is, ends that process and not this one. */
#ifndef EBPO_HDF5_WRITE_APART_H
#define EBPO_HDF5_WRITE_APART_H

#include <ebpo/base.h>

#include "hdf5_write/compat.h"

/* What is done there: no other thread exists, no plugin is loaded, libhdf5 prints nothing. What it
 * leaves in memory is gone; files that it writes stay. */
typedef ebpo_status (*ebpo_apart_fn)(void *user, ebpo_error *error);

/* Its status and error, of which EBPO_OK may have one, too; EBPO_E_FORMAT when it died or took more
 * than it may; `shown`: the file. */
EBPO_MUST_USE ebpo_status ebpo_apart(ebpo_apart_fn work, void *user, const char *shown,
                                     const ebpo_apart_limits *limits, ebpo_error *error);

/* All of it, however often it is interrupted; false, with errno: it could not be written. */
bool ebpo_apart_write(int fd, const void *data, size_t bytes);

#endif
