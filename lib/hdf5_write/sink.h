/* Inside lib/hdf5_write only: a virtual file driver, through which libhdf5 writes. libhdf5 1.10
 * does not survive a write that fails: what it cannot flush stays behind with an id that has lost
 * its file, which it trips over when it is closed or at exit. Here the first failure is kept and
 * told by everything that is called after it; to libhdf5 all writes succeed, so that it always
 * comes to an end. */
#ifndef EBPO_HDF5_WRITE_SINK_H
#define EBPO_HDF5_WRITE_SINK_H

#include <hdf5.h>

#include <ebpo/base.h>

typedef struct ebpo_h5_sink {
    hid_t id;        /* libhdf5's registration of the driver */
    int fd;          /* -1: bytes are kept in memory */
    uint8_t *memory; /* [capacity] */
    uint64_t capacity, size;
    /* of the first failure */
    ebpo_status status;
    ebpo_error error;
    char shown[]; /* for messages */
} ebpo_h5_sink;

/* Opens the file, which is made empty, or memory when path is NULL. Inside the scope or not. */
EBPO_MUST_USE ebpo_status ebpo_h5_sink_open(ebpo_h5_sink **out, const char *path, const char *shown,
                                            ebpo_error *error);
/* Makes a file access list use it; false when libhdf5 refuses. To be called inside the scope. */
bool ebpo_h5_sink_use(ebpo_h5_sink *sink, hid_t fapl);
/* Keeps a failure, if it is the first. */
void ebpo_h5_sink_fail(ebpo_h5_sink *sink, const ebpo_error *error);
/* The kept failure, or EBPO_OK. */
EBPO_MUST_USE ebpo_status ebpo_h5_sink_status(const ebpo_h5_sink *sink, ebpo_error *error);
/* After libhdf5 has closed the file, inside the scope: closes the sink's, and tells the first
 * failure, of this closing too. */
EBPO_MUST_USE ebpo_status ebpo_h5_sink_close(ebpo_h5_sink *sink, ebpo_error *error);
/* libhdf5 could not close its file, for want of memory, and may call the driver again whenever it
 * likes: lets go of the file, but stays. */
void ebpo_h5_sink_abandon(ebpo_h5_sink *sink);

#endif
