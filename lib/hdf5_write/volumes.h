/* HDF5 arrays of three dimensions for other programs, of float64, written layer by layer. */
#ifndef EBPO_HDF5_WRITE_VOLUMES_H
#define EBPO_HDF5_WRITE_VOLUMES_H

#include "hdf5_write/h5.h"

/* [dims[0]][dims[1]][dims[2]], each at least 1. The caller closes the id. */
EBPO_MUST_USE ebpo_status ebpo_h5_make_volume(ebpo_h5_out *out, const char *path,
                                              const uint64_t dims[3], ebpo_h5_id *id,
                                              ebpo_error *error);
/* Layers from `first` on; data[layers][dims[1]][dims[2]]. */
EBPO_MUST_USE ebpo_status ebpo_h5_put_layers(ebpo_h5_out *out, const char *path, ebpo_h5_id id,
                                             const uint64_t dims[3], uint64_t first,
                                             uint64_t layers, const double *data,
                                             ebpo_error *error);

#endif
