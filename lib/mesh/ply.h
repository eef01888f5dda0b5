/* Parses PLY files from memory. */
#ifndef EBPO_MESH_PLY_H
#define EBPO_MESH_PLY_H

#include <ebpo/mesh.h>

/* Returns true if the bytes begin like a PLY file. */
bool ebpo_ply_recognise(const uint8_t *data, uint64_t size);

/* Parses a PLY file. `name` (a path or any other name) appears in messages and, without folders, in
 * the mesh. Sets source_size and source_format; the caller sets source_sha256. Reads ascii files,
 * and binary files of both byte orders, with elements (lists of vertices, faces or other items) in
 * any order. If `attributes` is false, skips data other than positions and faces. Bytes after the
 * last element are allowed. Errors: EBPO_E_FORMAT with the line (ascii) or byte offset (binary);
 * EBPO_E_LIMIT above 2^32 - 2 vertices or faces. Safe for untrusted bytes; the memory is at most a
 * small multiple of `size`. On failure `out` is cleared. `workspace` (NULL: none) holds the arrays.
 * `threads` 0 uses all cores; results and errors do not depend on the number of threads. `progress`
 * may be NULL. */
EBPO_MUST_USE ebpo_status ebpo_ply_parse_all(ebpo_mesh *out, const uint8_t *data, uint64_t size,
                                             const char *name, ebpo_workspace *workspace,
                                             bool attributes, unsigned threads,
                                             const ebpo_progress *progress, ebpo_error *error);

/* Same as ebpo_ply_parse_all, without attributes. */
EBPO_MUST_USE static inline ebpo_status ebpo_ply_parse_memory(
    ebpo_mesh *out, const uint8_t *data, uint64_t size, const char *name, ebpo_workspace *workspace,
    unsigned threads, const ebpo_progress *progress, ebpo_error *error)
{
    return ebpo_ply_parse_all(out, data, size, name, workspace, false, threads, progress, error);
}

#endif
