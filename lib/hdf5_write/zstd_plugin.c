/* The filter as an HDF5 plugin, for h5dump, h5py and every other program that uses libhdf5. */
#include <H5PLextern.h>

#include "hdf5_write/zstd_filter.h"

__attribute__((visibility("default"))) H5PL_type_t H5PLget_plugin_type(void)
{
    return H5PL_TYPE_FILTER;
}

__attribute__((visibility("default"))) const void *H5PLget_plugin_info(void)
{
    return &ebpo_zstd_filter;
}
