/* Inside lib/h5 only: a virtual file driver, through which libhdf5 reads from an ebpo_input. */
#ifndef EBPO_H5_DRIVER_H
#define EBPO_H5_DRIVER_H

#include <hdf5.h>

#include <ebpo/base.h>

#include "io/byte_source.h"

/* One file's bytes as libhdf5 gets them, buffered: our writer puts headers at the start of the
 * file, and the index of large arrays in one piece behind the first levels. */
typedef struct ebpo_h5_driver {
    ebpo_input *input;
    hid_t id;               /* libhdf5's registration of the driver */
    uint8_t *head, *window; /* the first bytes, and a piece elsewhere, NULL until needed */
    uint8_t *table;         /* all of `index`, NULL until needed */
    uint64_t head_bytes, window_at, window_bytes;
    ebpo_range index; /* where more metadata is expected, or nothing */
    /* of the input's first failure; libhdf5 only learns that there was one */
    ebpo_status status;
    ebpo_error error;
    /* While recording, reads of raw data only leave here what they asked for. Reading a chunk is
     * the one call of libhdf5 1.10 that finds a chunk's address in constant time. */
    bool recording;
    unsigned recorded; /* reads since recording was switched on */
    uint64_t address, bytes;
} ebpo_h5_driver;

/* Fetches the head. */
EBPO_MUST_USE ebpo_status ebpo_h5_driver_open(ebpo_h5_driver *driver, ebpo_input *input,
                                              ebpo_error *error);
/* After the file that was opened through it. */
void ebpo_h5_driver_close(ebpo_h5_driver *driver);

/* Makes a file access list open files through this driver. To be called inside the scope, once;
 * false when libhdf5 refuses. */
bool ebpo_h5_driver_use(ebpo_h5_driver *driver, hid_t fapl);

#endif
