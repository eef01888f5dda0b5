/* Reading OBJ, STL and OFF. Safe on untrusted bytes. */
#ifndef EBPO_MESH_IMPORT_H
#define EBPO_MESH_IMPORT_H

#include <ebpo/mesh.h>

#include "mesh/obj.h"

typedef enum ebpo_import_format {
    EBPO_IMPORT_OBJ,
    EBPO_IMPORT_STL,
    EBPO_IMPORT_OFF
} ebpo_import_format;

/* Tells the format from the first bytes, else from the ending of `name`; of OBJ, which has no mark,
 * from the first word that is in no comment. False when it is none of the three. */
bool ebpo_import_recognise(ebpo_import_format *format, const uint8_t *data, uint64_t size,
                           const char *name);

/* Parses a file that is in memory. Positions are the nearest floats where each of them, rounded to
 * the last digit of its text, gives the text; else all are the nearest doubles. source_size,
 * source_name and source_format are set; `attributes`: and the mesh's attributes, if the file has
 * any. What the file holds or names and could not be read is noted in any case. The arrays are in
 * the workspace (which may be NULL).
 *
 * No other file is opened (material libraries are not read). Faces keep the file's order; vertices
 * are numbered by first use, and those of one position are one.
 *
 * EBPO_E_FORMAT: no mesh, or a damaged one. EBPO_E_UNSUPPORTED: a dialect that is not read.
 * EBPO_E_LIMIT, EBPO_E_MEMORY, EBPO_E_IO. On failure `out` is cleared. */
EBPO_MUST_USE ebpo_status ebpo_import_memory(ebpo_mesh *out, ebpo_import_format format,
                                             const uint8_t *data, uint64_t size, const char *name,
                                             ebpo_workspace *workspace, bool attributes,
                                             ebpo_error *error);

/* An OBJ file with its runs and their faces; their names point into `data`. One run: the file has
 * no names. */
EBPO_MUST_USE ebpo_status ebpo_import_groups(ebpo_mesh *out, const uint8_t *data, uint64_t size,
                                             const char *name, ebpo_workspace *workspace,
                                             bool attributes, ebpo_obj_runs *runs,
                                             ebpo_error *error);

/* Frees what reading has made. */
void ebpo_import_clear(ebpo_mesh *mesh);

#endif
