/* Reading OBJ, STL and OFF through assimp.
 *
 * assimp's own decimal reader does not round correctly. Measured with assimp 5.2.4, 27,000
 * coordinates each, against correct rounding: of text such as "0.296502" 0.3 % of the coordinates
 * are one unit in the last place off; with 9 or 17 digits 0.5 %; with an exponent
 * ("2.96502000e-01") 32 %, by up to two units. Binary STL is exact. Who needs every bit of a text
 * file converts it to PLY with another program. assimp is large and has had memory errors on
 * damaged files: for untrusted files prefer PLY, whose reader is ours.
 */
#ifndef EBPO_IMPORT_IMPORT_H
#define EBPO_IMPORT_IMPORT_H

#include <ebpo/mesh.h>

#include "import/obj_runs.h"

typedef enum ebpo_import_format {
    EBPO_IMPORT_OBJ,
    EBPO_IMPORT_STL,
    EBPO_IMPORT_OFF
} ebpo_import_format;

/* Tells the format from the first bytes, else from the ending of `name`; false when it is none of
 * the three. */
bool ebpo_import_recognise(ebpo_import_format *format, const uint8_t *data, uint64_t size,
                           const char *name);

/* Parses a file that is in memory. Positions are float32. source_size, source_name and
 * source_format are set; `attributes`: and the mesh's attributes, if the file has any. The arrays
 * are in the workspace, but assimp itself has all of the file in memory, several times over:
 * EBPO_E_LIMIT when that is likely more than `workspace` (which may be NULL) allows.
 * EBPO_E_UNSUPPORTED in a build without assimp, EBPO_E_FORMAT when assimp refuses the file. No
 * other file is opened (material libraries are not read). Runs one at a time in a process, since
 * assimp's error text is global. On failure `out` is cleared. Faces keep the file's order within
 * each object or group of an OBJ file; vertices are numbered by first use. */
EBPO_MUST_USE ebpo_status ebpo_import_memory(ebpo_mesh *out, ebpo_import_format format,
                                             const uint8_t *data, uint64_t size, const char *name,
                                             ebpo_workspace *workspace, bool attributes,
                                             ebpo_error *error);

/* As ebpo_import_memory, but that names of groups are left out is not noted. `runs`: NULL, or those
 * that `data` is the text of, whose faces are counted. */
EBPO_MUST_USE ebpo_status ebpo_import_runs(ebpo_mesh *out, ebpo_import_format format,
                                           const uint8_t *data, uint64_t size, const char *name,
                                           ebpo_workspace *workspace, bool attributes,
                                           ebpo_obj_runs *runs, ebpo_error *error);

/* An OBJ file with its runs and their faces; their names point into `data`. One run: the file has
 * no names. Assimp reads it twice, so that the mesh is what ebpo_import_memory gives, and
 * EBPO_E_UNSUPPORTED where that would not be so. */
EBPO_MUST_USE ebpo_status ebpo_import_groups(ebpo_mesh *out, const uint8_t *data, uint64_t size,
                                             const char *name, ebpo_workspace *workspace,
                                             bool attributes, ebpo_obj_runs *runs,
                                             ebpo_error *error);

/* Frees what reading has made. */
void ebpo_import_clear(ebpo_mesh *mesh);

#endif
