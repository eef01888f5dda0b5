/* Inside lib/hdf5_write only: every use of libhdf5 happens between enter and leave. Debian's serial
 * build is not thread-safe, so one mutex of the library serialises us; HDF5's printing of errors is
 * switched off meanwhile and given back as it was. */
#ifndef EBPO_HDF5_WRITE_SCOPE_H
#define EBPO_HDF5_WRITE_SCOPE_H

#include <hdf5.h>

#include <ebpo/base.h>

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

#endif
