/* Reading meshes of all formats: which one a file has, and the mesh that it holds. Safe on
 * untrusted bytes. */
#ifndef EBPO_MESH_IMPORT_H
#define EBPO_MESH_IMPORT_H

#include <ebpo/mesh.h>

#include "mesh/import_build.h"

/* Tells the format from the first bytes, else from the ending of `name`; of OBJ, which has no mark,
 * from the first word that is in no comment. NULL when it is none of the table. */
const ebpo_import_format *ebpo_import_recognise(const uint8_t *data, uint64_t size,
                                                const char *name);

/* Parses a file that is in memory, of the format that it is recognised as. EBPO_E_FORMAT: it is of
 * none; if it is known what else it is, the message says that. Otherwise as ebpo_import_memory. */
EBPO_MUST_USE ebpo_status ebpo_import_any(ebpo_mesh *out, const ebpo_import_job *job,
                                          ebpo_error *error);

/* Parses a file of this format that is in memory. Positions are the nearest floats where each of
 * them, rounded to the last digit of its text, gives the text; else all are the nearest doubles
 * (the PLY reader has types to go by). source_size, source_name and source_format are set; if
 * attributes are wanted, the mesh's attributes too, if the file has any. What the file holds or
 * names and could not be read is noted in any case. The arrays are in the workspace.
 *
 * No other file is opened (material libraries are not read). Faces keep the file's order; vertices
 * are numbered by first use, and those of one position are one (a PLY keeps its own).
 *
 * EBPO_E_FORMAT: no mesh, or a damaged one. EBPO_E_UNSUPPORTED: a dialect that is not read.
 * EBPO_E_LIMIT, EBPO_E_MEMORY, EBPO_E_IO, EBPO_E_CANCELLED. On failure `out` is cleared. */
EBPO_MUST_USE ebpo_status ebpo_import_memory(ebpo_mesh *out, const ebpo_import_format *format,
                                             const ebpo_import_job *job, ebpo_error *error);

/* Frees what reading has made. */
void ebpo_import_clear(ebpo_mesh *mesh);

#endif
