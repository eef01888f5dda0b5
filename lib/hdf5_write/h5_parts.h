/* Inside lib/hdf5_write only: the use of libhdf5. Every call happens between enter and leave.
 * Debian's serial build is not thread-safe, so one mutex of the library serialises us; HDF5's
 * printing of errors is switched off meanwhile and given back as it was. */
#ifndef EBPO_HDF5_WRITE_H5_PARTS_H
#define EBPO_HDF5_WRITE_H5_PARTS_H

#include <hdf5.h>

#include <ebpo/base.h>

#include "hdf5_write/h5.h"

typedef struct ebpo_h5_scope {
    H5E_auto2_t printer;
    void *printer_data;
} ebpo_h5_scope;

void ebpo_h5_enter(ebpo_h5_scope *scope);
void ebpo_h5_leave(ebpo_h5_scope *scope);

/* "shown: object: what (libhdf5: innermost message)"; to be called inside the scope, right after
 * the failing call. `object` may be "". */
ebpo_status ebpo_h5_fail(ebpo_error *error, ebpo_status status, const char *shown,
                         const char *object, const char *what);

/* Whether the failing call, right before, lacked memory. */
bool ebpo_h5_short_of_memory(void);

/* Opens a file of another program to read. With `lock` it fails while another program has the file
 * open for writing, as what is read then may be half of two versions; a file system that has no
 * locks is no reason to fail. -1 in *file on failure. */
EBPO_MUST_USE ebpo_status ebpo_h5_open_to_read(const char *path, const char *shown, bool lock,
                                               hid_t *file, ebpo_error *error);

/* Returns true if the values are stored in files that this one names. */
bool ebpo_h5_is_elsewhere(hid_t set);

/* The stored type for integers of `size` bytes, little-endian; -1 for another size. */
hid_t ebpo_h5_integer_type(unsigned size, bool is_signed);

/* A virtual file driver, through which libhdf5 writes. libhdf5 1.10
 * does not survive a write that fails: what it cannot flush stays behind with an id that has lost
 * its file, which it trips over when it is closed or at exit. Here the first failure is kept and
 * told by everything that is called after it; to libhdf5 all writes succeed, so that it always
 * comes to an end. */

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

/* Inside lib/hdf5_write, within a scope: what is written into every file, whatever its layout. What
 * is taken over is closed, also when something failed before. */

/* Properties of a file that is written through the sink; -1 when libhdf5 refuses. */
struct ebpo_h5_sink;
hid_t ebpo_h5_write_access(struct ebpo_h5_sink *sink, H5F_libver_t version);
/* Whether libhdf5 has created out->file. */
ebpo_status ebpo_h5_created(const ebpo_h5_out *out, ebpo_error *error);

/* EBPO_OK if it went well, and no write has failed so far: else the first such failure, or what
 * libhdf5 says. Right after the call, as others wipe libhdf5's reason. */
ebpo_status ebpo_h5_written(const ebpo_h5_out *out, const char *what, bool good, ebpo_error *error);

/* Takes over the list of properties; `good`: it has them all. */
ebpo_status ebpo_h5_put_group(const ebpo_h5_out *out, const char *path, hid_t gcpl, bool good,
                              ebpo_h5_id *id, ebpo_error *error);
/* Takes over space and properties. */
ebpo_status ebpo_h5_put_dataset(const ebpo_h5_out *out, const char *path, hid_t type, hid_t space,
                                hid_t dcpl, bool good, ebpo_h5_id *id, ebpo_error *error);
/* Writes an attribute, from its stored type where `memory` is -1. Takes over the space. */
ebpo_status ebpo_h5_put_attribute(const ebpo_h5_out *out, hid_t object, const char *name,
                                  hid_t type, hid_t space, hid_t memory, const void *value,
                                  ebpo_error *error);

void ebpo_h5_close_list(hid_t list);
void ebpo_h5_close_space(hid_t space);

/* What libhdf5 does with files of others happens in a process of its
 * own, with limits. What goes wrong there, whatever it is, ends that process and not this one. */

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
