/* HDF5 filter 32015: a chunk as one zstd frame. One filter class serves the library's programs,
 * which register it, and all others, which load it as a plugin. It does not link with HDF5's
 * library, so one plugin serves the serial and the MPI builds. */
#ifndef EBPO_HDF5_WRITE_ZSTD_FILTER_H
#define EBPO_HDF5_WRITE_ZSTD_FILTER_H

#include <hdf5.h>

enum { EBPO_ZSTD_FILTER_ID = 32015 };

/* cd_values[0], when given, is the compression level (default 3). Frames have their content's size
 * and a checksum. The filter reads any single zstd frame, also without size or checksum. */
extern const H5Z_class2_t ebpo_zstd_filter;

#endif
