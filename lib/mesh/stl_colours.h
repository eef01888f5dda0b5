/* The two bytes behind each face of a binary STL file. assimp takes them for colours where programs
 * that follow Magics mean that there is none, so they are read here. */
#ifndef EBPO_MESH_STL_COLOURS_H
#define EBPO_MESH_STL_COLOURS_H

#include <ebpo/mesh.h>

/* Adds to the mesh's attributes, if any of them says something: `attribute`, as they are, and `red
 * green blue`, five bits each: of files with COLOR= in the first 80 bytes (Magics) red first, where
 * bit 15 is 0, else the colour that stands there; of others (VisCAM) blue first, where bit 15 is 1,
 * else white. Nothing of a file in text. The mesh's faces are those of the file. EBPO_E_MEMORY,
 * EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_import_stl_colours(ebpo_mesh *mesh, const uint8_t *data,
                                                  uint64_t size, ebpo_error *error);

#endif
