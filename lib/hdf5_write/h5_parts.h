/* Declares how lib/hdf5_write uses libhdf5; private to this folder. Every call of libhdf5 is in a
 * scope, that is, between ebpo_h5_enter and ebpo_h5_leave. A scope locks a mutex that all threads
 * share, because Debian's serial build of libhdf5 is not thread-safe. A scope also switches off
 * HDF5's error printing; ebpo_h5_leave restores the printing. */
#ifndef EBPO_HDF5_WRITE_H5_PARTS_H
#define EBPO_HDF5_WRITE_H5_PARTS_H

#include <hdf5.h>

#include <ebpo/base.h>

#include "hdf5_write/h5.h"

typedef struct ebpo_h5_scope {
    H5E_auto2_t printer; /* the error printing to restore */
    void *printer_data;
} ebpo_h5_scope;

void ebpo_h5_enter(ebpo_h5_scope *scope);
void ebpo_h5_leave(ebpo_h5_scope *scope);

/* Sets the error "shown: object: what (libhdf5: innermost message)". Call this function inside the
 * scope, right after the failing libhdf5 call. `object` may be "". */
ebpo_status ebpo_h5_fail(ebpo_error *error, ebpo_status status, const char *shown,
                         const char *object, const char *what);

/* Returns true if the last call of libhdf5 failed for lack of memory. */
bool ebpo_h5_short_of_memory(void);

/* Opens a file of another program for reading. If `lock` is true, fails while another program has
 * the file open for writing, because the data may then be a mixture of two versions. If the file
 * system has no locks, opens the file without a lock. On failure, *file is -1. */
EBPO_MUST_USE ebpo_status ebpo_h5_open_to_read(const char *path, const char *shown, bool lock,
                                               hid_t *file, ebpo_error *error);

/* Returns true if a dataset's values are stored in other files or datasets, which the dataset
 * names.
 */
bool ebpo_h5_is_elsewhere(hid_t set);

/* Returns HDF5's type for little-endian integers of `size` bytes (1, 2, 4 or 8), or -1 for another
 * size. */
hid_t ebpo_h5_integer_type(unsigned size, bool is_signed);

/* A sink: a virtual file driver, through which libhdf5 writes. A sink stores the first failed
 * write, but reports every write to libhdf5 as successful; sink.c explains why. */

typedef struct ebpo_h5_sink {
    hid_t id;                /* libhdf5's registration of the driver */
    int fd;                  /* descriptor of the file; -1: the bytes are in `memory` */
    uint8_t *memory;         /* [capacity] */
    uint64_t capacity, size; /* size: bytes of the file or of the used memory */
    /* status and error of the first failure */
    ebpo_status status;
    ebpo_error error;
    char shown[]; /* for messages */
} ebpo_h5_sink;

/* Opens the file and empties it; if `path` is NULL, the sink keeps the bytes in memory. May be
 * called inside or outside a scope. */
EBPO_MUST_USE ebpo_status ebpo_h5_sink_open(ebpo_h5_sink **out, const char *path, const char *shown,
                                            ebpo_error *error);
/* Sets the sink as the driver of a file access property list. Returns false if libhdf5 reports an
 * error. Call this function inside a scope. */
bool ebpo_h5_sink_use(ebpo_h5_sink *sink, hid_t fapl);
/* Stores a failure. Does nothing if an earlier failure is stored. */
void ebpo_h5_sink_fail(ebpo_h5_sink *sink, const ebpo_error *error);
/* Returns the stored failure, or EBPO_OK. */
EBPO_MUST_USE ebpo_status ebpo_h5_sink_status(const ebpo_h5_sink *sink, ebpo_error *error);
/* Closes the sink's descriptor and frees the sink. Call this function after libhdf5 has closed the
 * file. Call this function inside a scope. Returns the first failure, including a failure of this
 * function. */
EBPO_MUST_USE ebpo_status ebpo_h5_sink_close(ebpo_h5_sink *sink, ebpo_error *error);
/* Closes the sink's descriptor or frees its bytes, but keeps the sink. This is for the case that
 * libhdf5 could not close its file because memory was short: libhdf5 may then call the driver again
 * at any time. */
void ebpo_h5_sink_abandon(ebpo_h5_sink *sink);

/* The functions below write objects for h5_write.c (this library's layout) and tables.c (files for
 * other programs). Call them inside a scope. They close the spaces and property lists that they
 * receive, also after an earlier failure. */

/* Returns the access properties of a file that is written through the sink, or -1 if libhdf5
 * reports an error. `version`: format version of HDF5 to write. */
struct ebpo_h5_sink;
hid_t ebpo_h5_write_access(struct ebpo_h5_sink *sink, H5F_libver_t version);
/* Returns EBPO_OK if libhdf5 has created out->file. */
ebpo_status ebpo_h5_created(const ebpo_h5_out *out, ebpo_error *error);

/* Returns EBPO_OK if a call of libhdf5 succeeded (`good`) and no write has failed so far. If a
 * write has failed, returns the failure of the first failed write. Otherwise returns the failure of
 * the call. `what`: the object that was written, for the message. Call this function right after
 * the call of libhdf5, because further calls erase libhdf5's reason. */
ebpo_status ebpo_h5_written(const ebpo_h5_out *out, const char *what, bool good, ebpo_error *error);

/* Creates a group, and closes the property list `gcpl`. `good`: false if setting a property has
 * failed; then this function fails. */
ebpo_status ebpo_h5_put_group(const ebpo_h5_out *out, const char *path, hid_t gcpl, bool good,
                              ebpo_h5_id *id, ebpo_error *error);
/* Creates a dataset, and closes the space and the property list. `good`: see ebpo_h5_put_group. */
ebpo_status ebpo_h5_put_dataset(const ebpo_h5_out *out, const char *path, hid_t type, hid_t space,
                                hid_t dcpl, bool good, ebpo_h5_id *id, ebpo_error *error);
/* Writes an attribute of the stored type `type`, and closes the space. `memory`: type of the values
 * in memory; -1: the stored type. */
ebpo_status ebpo_h5_put_attribute(const ebpo_h5_out *out, hid_t object, const char *name,
                                  hid_t type, hid_t space, hid_t memory, const void *value,
                                  ebpo_error *error);

void ebpo_h5_close_list(hid_t list);
void ebpo_h5_close_space(hid_t space);

/* Callback for the work of a separate process, in which libhdf5 reads untrusted files. The process
 * has no other thread, loads no plugin, and libhdf5 prints nothing. After the process has ended,
 * only two things remain: the files that the work has written, and the status and error that it has
 * returned. */
typedef ebpo_status (*ebpo_process_fn)(void *user, ebpo_error *error);

/* Runs `work` in a separate process with limits. A crash ends only that process. Returns the status
 * and error of the work. Even if the status is EBPO_OK, *error may have a message. Returns
 * EBPO_E_FORMAT if the process crashed or exceeded a limit. `shown`: name of the file for messages.
 */
EBPO_MUST_USE ebpo_status ebpo_run_in_process(ebpo_process_fn work, void *user, const char *shown,
                                              const ebpo_process_limits *limits, ebpo_error *error);

/* Writes all bytes, also if signals interrupt the writing. Returns false on failure, with the
 * reason in errno. */
bool ebpo_process_write(int fd, const void *data, size_t bytes);

#endif
