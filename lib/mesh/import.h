/* Reads meshes of all formats: recognises the format and builds the mesh. Safe for untrusted input.
 */
#ifndef EBPO_MESH_IMPORT_H
#define EBPO_MESH_IMPORT_H

#include <ebpo/mesh.h>

#include "mesh/import_build.h"

/* Recognises the format by the first bytes, otherwise by the ending of `name`. OBJ files have no
 * signature: an OBJ file is recognised by its first word outside comments. Returns NULL for an
 * unknown format. */
const ebpo_import_format *ebpo_import_recognise(const uint8_t *data, uint64_t size,
                                                const char *name);

/* Parses a file in memory with the recognised format. EBPO_E_FORMAT: unknown format; the message
 * names the type of the file if it is known. Otherwise the same as ebpo_import_memory. */
EBPO_MUST_USE ebpo_status ebpo_import_any(ebpo_mesh *out, const ebpo_import_job *job,
                                          ebpo_error *error);

/* Parses a file in memory. Positions are floats if each float, rounded to the last digit of its
 * text, gives the text; otherwise all are doubles, each the nearest value. (The PLY reader uses the
 * declared types.) Sets source_size, source_name and source_format, and the attributes if they are
 * requested and present. Data that could not be read are always noted. The arrays are in the
 * workspace.
 *
 * Opens no other file (material libraries are not read). Faces keep the file's order. Vertices are
 * numbered by first use, and those at one position are merged; PLY vertices are unchanged.
 *
 * EBPO_E_FORMAT: no mesh, or a damaged one. EBPO_E_UNSUPPORTED: an unsupported dialect.
 * EBPO_E_LIMIT, EBPO_E_MEMORY, EBPO_E_IO, EBPO_E_CANCELLED. On failure `out` is cleared. */
EBPO_MUST_USE ebpo_status ebpo_import_memory(ebpo_mesh *out, const ebpo_import_format *format,
                                             const ebpo_import_job *job, ebpo_error *error);

/* Frees the results of reading. */
void ebpo_import_clear(ebpo_mesh *mesh);

#endif
