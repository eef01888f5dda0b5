/* Declares HDF5 filter 32015, which stores a chunk as one zstd frame. The library registers the
 * filter; other programs load the same code as a plugin. The plugin does not link with HDF5's
 * library, so one plugin serves the serial and the MPI builds of HDF5. */
#ifndef EBPO_HDF5_WRITE_ZSTD_FILTER_H
#define EBPO_HDF5_WRITE_ZSTD_FILTER_H

#include <hdf5.h>

enum { EBPO_ZSTD_FILTER_ID = 32015 };

/* cd_values[0], when given, is the compression level (default 3). Frames have their content's size
 * and a checksum. The filter also reads zstd frames without a size or a checksum. */
extern const H5Z_class2_t ebpo_zstd_filter;

#endif
