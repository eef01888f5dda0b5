/* Inside lib/hdf5_write, within a scope: what is written into every file, whatever its layout. What
 * is taken over is closed, also when something failed before. */
#ifndef EBPO_HDF5_WRITE_H5_OBJECTS_H
#define EBPO_HDF5_WRITE_H5_OBJECTS_H

#include "hdf5_write/h5.h"
#include "hdf5_write/scope.h"

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

#endif
