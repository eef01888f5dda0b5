/* Bits of zstd frames that decoders do not look at. */
#ifndef EBPO_CODEC_ZSTD_FRAME_H
#define EBPO_CODEC_ZSTD_FRAME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Whether a bit is set that RFC 8878 wants to be 0 and zstd, of most versions, ignores: bit 4 of
 * the frame's descriptor, and the two lowest of the modes of each section of sequences. No checksum
 * covers them. False as well where the frame cannot be followed, which decoding tells. */
bool ebpo_zstd_unused_set(const uint8_t *frame, size_t bytes);

#endif
