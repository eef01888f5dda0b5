/* Files of other kinds that are given as meshes or models by mistake. */
#ifndef EBPO_IO_FOREIGN_BYTES_H
#define EBPO_IO_FOREIGN_BYTES_H

#include <stdbool.h>
#include <stdint.h>

/* Names what the first bytes are and what to do about it, to follow a file's name in a message:
 * "is compressed by gzip; ...". NULL: nothing known. A binary STL file begins with any bytes: look
 * whether it is one first. */
const char *ebpo_foreign_bytes(const uint8_t *data, uint64_t size);

/* True for text: the first bytes hold no control characters but white space. */
bool ebpo_bytes_are_text(const uint8_t *data, uint64_t size);

#endif
