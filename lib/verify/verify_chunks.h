/* The coding `gates` (format-spec/README.md, section 7) read once more: what that page says, line
 * by line, without a thought of speed. */
#ifndef EBPO_VERIFY_VERIFY_CHUNKS_H
#define EBPO_VERIFY_VERIFY_CHUNKS_H

#include <stdbool.h>
#include <stdint.h>

/* A chunk of `rows` faces, of 13 bytes each; rows > 0. `seen`: vertices seen before it, and then
 * after it. False, with nothing told of `faces`, where the page says to refuse. */
bool ebpo_plain_gates_read(const uint8_t *in, uint32_t rows, uint64_t *seen, uint32_t *faces);

#endif
