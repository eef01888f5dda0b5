/* Inside lib/extras/map: what writes a lattice's values into a file, layer by layer. */
#ifndef EBPO_MAP_MAP_FILE_H
#define EBPO_MAP_MAP_FILE_H

#include <ebpo/map.h>
#include <stdio.h>

#include "hdf5_write/h5.h"

typedef struct ebpo_map_file {
    const ebpo_lattice *lattice;
    const char *shown;
    const char *path; /* of the file by name: HDF5 */
    FILE *stream;     /* NRRD */
    ebpo_h5_out out;
    ebpo_h5_id values;
} ebpo_map_file;

/* Headers; then layers in order; then the end, which tells what failed late. `discard` after a
 * failure. */
EBPO_MUST_USE ebpo_status ebpo_map_nrrd_begin(ebpo_map_file *f, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_map_nrrd_layers(ebpo_map_file *f, const double *values,
                                               uint64_t first, uint64_t layers, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_map_vtkhdf_begin(ebpo_map_file *f, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_map_vtkhdf_layers(ebpo_map_file *f, const double *values,
                                                 uint64_t first, uint64_t layers,
                                                 ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_map_vtkhdf_end(ebpo_map_file *f, ebpo_error *error);

#endif
