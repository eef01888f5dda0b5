/* Files of images that a mesh's source names: their digests, and their bytes. */
#ifndef EBPO_MESH_TEXTURE_FILES_H
#define EBPO_MESH_TEXTURE_FILES_H

#include <ebpo/mesh.h>

/* Adds to the attributes of a mesh that was read from `data`, the file `path`, the textures that it
 * names; with their bytes if `keep`. Files are looked for in the source's folder and below only,
 * and links that lead out of it are not followed; what is not found, and what is not kept, is
 * noted. EBPO_E_MEMORY, EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_textures_find(ebpo_mesh *mesh, const char *path, const uint8_t *data,
                                             uint64_t size, bool keep, ebpo_error *error);

#endif
