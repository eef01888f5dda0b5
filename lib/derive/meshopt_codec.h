/* Encodes vertices and triangles as the glTF extension EXT_meshopt_compression prescribes. */
#ifndef EBPO_DERIVE_MESHOPT_CODEC_H
#define EBPO_DERIVE_MESHOPT_CODEC_H

#include <stdint.h>

/* Returns the greatest number of bytes of `count` encoded elements of `stride` bytes. */
uint64_t ebpo_meshopt_attributes_bound(uint64_t count, unsigned stride);

/* Encodes [count][stride] bytes in the mode ATTRIBUTES without a filter. stride: a multiple of 4,
 * at most 256; count: at least 1. Returns the number of bytes written to `out`. */
uint64_t ebpo_meshopt_attributes(const uint8_t *elements, uint64_t count, unsigned stride,
                                 uint8_t *out);

/* Returns the greatest number of bytes of `count` encoded triangles. */
uint64_t ebpo_meshopt_triangles_bound(uint64_t count);

/* Encodes [count][3] vertex indices in the mode TRIANGLES. Vertices that are numbered in the order
 * of their first use take the fewest bytes. A decoder may rotate the corners of a triangle. Returns
 * the number of bytes written to `out`. */
uint64_t ebpo_meshopt_triangles(const uint32_t *triangles, uint64_t count, uint8_t *out);

#endif
