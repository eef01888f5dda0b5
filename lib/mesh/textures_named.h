/* Of a mesh's images those that some of its faces name. */
#ifndef EBPO_MESH_TEXTURES_NAMED_H
#define EBPO_MESH_TEXTURES_NAMED_H

#include "mesh/attributes.h"

/* Rows stay, with names, uses and digests; the bytes of images stay that these faces (by their
 * numbers in the source) name: by the name of their `material`, or as number `texnumber` of a PLY's
 * comments TextureFile. An image whose use does not tell which faces name it stays. EBPO_E_MEMORY,
 * EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_textures_keep_named(ebpo_attributes *of, const uint32_t *faces,
                                                   uint64_t count, ebpo_error *error);

#endif
