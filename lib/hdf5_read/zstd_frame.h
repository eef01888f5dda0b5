/* What decoders of zstd do not look at in a frame, and no checksum covers. */
#ifndef EBPO_HDF5_READ_ZSTD_FRAME_H
#define EBPO_HDF5_READ_ZSTD_FRAME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* What is wrong, or NULL: a bit is set that RFC 8878 wants to be 0 and zstd, of most versions,
 * ignores (bit 4 of the frame's descriptor, and the two lowest of the modes of each section of
 * sequences); a block repeats its byte once, which zstd writes as it is. NULL as well where the
 * frame cannot be followed, which decoding tells. */
const char *ebpo_zstd_fault(const uint8_t *frame, size_t bytes);

/* Returns true if a frame has a checksum of its content: zstd decodes frames without one as well,
 * and does not notice damage then. RFC 8878, 3.1.1. */
bool ebpo_zstd_has_checksum(const uint8_t *frame, size_t bytes);

#endif
