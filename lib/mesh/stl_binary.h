/* Binary STL files. */
#ifndef EBPO_MESH_STL_BINARY_H
#define EBPO_MESH_STL_BINARY_H

#include "mesh/import_build.h"

/* True where all bytes are those of binary models: of one, also with the bytes that its facets'
 * attribute byte counts state, or of several, one behind the other. */
bool ebpo_stl_fits_binary(const uint8_t *data, uint64_t size);

/* True if the first `known` bytes of a file state that a binary model takes `size` bytes. */
bool ebpo_stl_states_size(const uint8_t *data, uint64_t known, uint64_t size);

/* Reads the facets as vertices, three each, and notes bytes that are not read. *plain: the size of
 * the one model whose facets have their two bytes of attributes; 0: it is another file. */
EBPO_MUST_USE ebpo_status ebpo_stl_read_binary(import_build *b, const uint8_t *data, uint64_t size,
                                               uint64_t *plain);

#endif
