/* Jenkins' lookup3 ("hashlittle", from 0), which guards HDF5's metadata. */
#ifndef EBPO_HDF5_READ_LOOKUP3_H
#define EBPO_HDF5_READ_LOOKUP3_H

#include <stddef.h>
#include <stdint.h>

uint32_t ebpo_lookup3(const uint8_t *bytes, size_t size);

#endif
