/* Declares HDF5 filter 32015, which stores a chunk as one zstd frame. The library registers the
 * filter with libhdf5 in the process that uses the library. Other programs load the same code as a
 * plugin. The plugin does not link with libhdf5, so one plugin serves all builds of HDF5. */
#ifndef EBPO_HDF5_WRITE_ZSTD_FILTER_H
#define EBPO_HDF5_WRITE_ZSTD_FILTER_H

#include <hdf5.h>

enum { EBPO_ZSTD_FILTER_ID = 32015 };

/* The filter's only parameter, which may be missing, is the compression level (default 3). The
 * filter writes frames that state the size of their content and have a checksum. It also reads
 * frames without a size or without a checksum. */
extern const H5Z_class2_t ebpo_zstd_filter;

#endif
