/* Files of images that a source names: a row of the element `ebpo:texture` for each, of lists of
 * bytes. format-spec/README.md, "Attributes". One thread. */
#ifndef EBPO_MESH_TEXTURES_H
#define EBPO_MESH_TEXTURES_H

#include "mesh/attributes.h"

enum {
    EBPO_TEXTURES = 1000,           /* of a mesh, at most */
    EBPO_TEXTURE_NAME_BYTES = 1023, /* at most */
    EBPO_TEXTURE_USE_BYTES = 8192,
    EBPO_TEXTURE_TEXTS = 1 << 24 /* names, uses or digests of all */
};

/* The arrays of a row. */
typedef enum ebpo_texture_array {
    EBPO_TEXTURE_NAME,   /* as the source has it */
    EBPO_TEXTURE_USE,    /* lines: what for, such as map_Kd and a material's name */
    EBPO_TEXTURE_SHA256, /* 32 bytes; none: no such file was found */
    EBPO_TEXTURE_BYTES,  /* of the file; this array is there if they are to be kept */
    EBPO_TEXTURE_ARRAYS
} ebpo_texture_array;

const char *ebpo_texture_array_name(ebpo_texture_array which);

typedef struct ebpo_texture_bytes {
    const void *at;
    uint64_t count;
} ebpo_texture_bytes;

/* NULL: there is no such array of the form that it has to have. */
const ebpo_attribute *ebpo_textures_array(const ebpo_attributes *all, ebpo_texture_array which);

/* The list of a row. */
ebpo_texture_bytes ebpo_texture_list(const ebpo_attribute *a, uint64_t row);

/* Adds a row to the mesh's textures; the first one makes the arrays, with BYTES if `keep`.
 * EBPO_E_MEMORY, EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_textures_add(ebpo_attributes *to, bool keep,
                                            const ebpo_texture_bytes list[EBPO_TEXTURE_ARRAYS],
                                            ebpo_error *error);

/* Whether all bytes that are kept are those that their digests say. */
bool ebpo_textures_good(const ebpo_attributes *all);

#endif
