/* Reading OFF files, by words: rows may go over lines, and lines hold several rows. Sources: the
 * manual of Geomview 1.9.4, "OFF Files"; CGAL and MeshLab, whose colours are of three or four
 * values.
 */
#ifndef EBPO_MESH_OFF_H
#define EBPO_MESH_OFF_H

#include "mesh/import_build.h"

/* Whether a file begins with the word OFF, with letters before it that say what vertices have. */
bool ebpo_off_recognise(const uint8_t *data, uint64_t size);

/* Makes the mesh, and its attributes if they are kept. Errors are those of ebpo_import_memory. */
EBPO_MUST_USE ebpo_status ebpo_off_read(import_build *b, const uint8_t *data, uint64_t size);

#endif
