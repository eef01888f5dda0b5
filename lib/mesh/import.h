/* Reads meshes of all formats: recognises the format and builds the mesh. Safe for untrusted input.
 */
#ifndef EBPO_MESH_IMPORT_H
#define EBPO_MESH_IMPORT_H

#include <ebpo/mesh.h>

#include "mesh/import_build.h"

/* Recognises the format by the first bytes, or, if this is not possible, by the ending of `name`.
 * OBJ files have no signature: an OBJ file is recognised by its first word outside comments.
 * Returns NULL for an unknown format. */
const ebpo_import_format *ebpo_import_recognise(const uint8_t *data, uint64_t size,
                                                const char *name);

/* Parses a file in memory with the recognised format. EBPO_E_FORMAT: unknown format; the message
 * names the type of the file if the type is known. Other errors are the errors of
 * ebpo_import_memory. */
EBPO_MUST_USE ebpo_status ebpo_import_any(ebpo_mesh *out, const ebpo_import_job *job,
                                          ebpo_error *error);

/* Parses a file in memory. Positions are floats if every float, printed with as many digits as its
 * text in the file, gives the same text. Otherwise all positions are doubles, each the nearest
 * value. (The PLY reader uses the declared types.) Sets source_size, source_name and source_format,
 * and the attributes if they are requested and present. Data that could not be read are always
 * noted (attributes->unread). The arrays are in the workspace.
 *
 * Opens no other file (material libraries are not read). Faces keep the file's order. Vertices are
 * numbered by first use, and vertices at one position are merged. Vertices of PLY files are
 * unchanged.
 *
 * EBPO_E_FORMAT: the file is no mesh, or a damaged mesh. EBPO_E_UNSUPPORTED: an unsupported
 * dialect. EBPO_E_LIMIT, EBPO_E_MEMORY, EBPO_E_IO, EBPO_E_CANCELLED. On failure `out` is cleared.
 */
EBPO_MUST_USE ebpo_status ebpo_import_memory(ebpo_mesh *out, const ebpo_import_format *format,
                                             const ebpo_import_job *job, ebpo_error *error);

/* Frees the arrays and attributes of a mesh that was read. */
void ebpo_import_clear(ebpo_mesh *mesh);

#endif
