/* Reading PLY files that are in memory. */
#ifndef EBPO_MESH_PLY_H
#define EBPO_MESH_PLY_H

#include <ebpo/mesh.h>

/* True when the bytes begin as a PLY file does. */
bool ebpo_ply_recognise(const uint8_t *data, uint64_t size);

/* Parses a whole PLY file. `name` (a path or any other name) is shown in messages and kept, without
 * folders, in the mesh; source_size and source_format are set, source_sha256 is left to the caller.
 * Reads ascii and binary of both byte orders, elements in any order; other elements and properties
 * are skipped, unless attributes are asked for; bytes behind the last element are allowed. Errors:
 * EBPO_E_FORMAT with the line (ascii) or byte offset (binary) of the trouble; EBPO_E_LIMIT beyond
 * 2^32 - 2 vertices or faces. Safe on untrusted bytes; memory stays within a small multiple of
 * `size`. On failure `out` is cleared. `workspace`: for the arrays, or NULL. `attributes`: those
 * properties are read as well. `threads` 0: all cores; the result, errors too, does not depend on
 * it. `progress` may be NULL. */
EBPO_MUST_USE ebpo_status ebpo_ply_parse_all(ebpo_mesh *out, const uint8_t *data, uint64_t size,
                                             const char *name, ebpo_workspace *workspace,
                                             bool attributes, unsigned threads,
                                             const ebpo_progress *progress, ebpo_error *error);

/* The same without attributes. */
EBPO_MUST_USE static inline ebpo_status ebpo_ply_parse_memory(
    ebpo_mesh *out, const uint8_t *data, uint64_t size, const char *name, ebpo_workspace *workspace,
    unsigned threads, const ebpo_progress *progress, ebpo_error *error)
{
    return ebpo_ply_parse_all(out, data, size, name, workspace, false, threads, progress, error);
}

#endif
