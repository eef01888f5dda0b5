/* Files of images that a source names: a row of the element `ebpo:texture` for each, of lists of
 * bytes. format-spec/README.md, "Attributes". One thread. */
#ifndef EBPO_MESH_TEXTURES_H
#define EBPO_MESH_TEXTURES_H

#include <ebpo/base.h>
#include <ebpo/mesh.h>

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

/* Of a mesh's images those that some of its faces name. */

/* Rows stay, with names, uses and digests; the bytes of images stay that these faces (by their
 * numbers in the source) name: by the name of their `material`, or as number `texnumber` of a PLY's
 * comments TextureFile. An image whose use does not tell which faces name it stays. EBPO_E_MEMORY,
 * EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_textures_keep_named(ebpo_attributes *of, const uint32_t *faces,
                                                   uint64_t count, ebpo_error *error);

/* Files of images that a mesh's source names: their digests, and their bytes. */

/* Adds to the attributes of a mesh that was read from `data`, the file `path`, the textures that it
 * names; with their bytes if `keep`. Files are looked for in the source's folder and below only,
 * and links that lead out of it are not followed; what is not found, and what is not kept, is
 * noted. EBPO_E_MEMORY, EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_textures_find(ebpo_mesh *mesh, const char *path, const uint8_t *data,
                                             uint64_t size, bool keep, ebpo_error *error);

/* The names of image files in a PLY's header, an OBJ file and its material libraries. */

typedef struct ebpo_texture_name {
    char *name; /* no control characters; ends with a zero */
    char *use;  /* lines, the last one without an end */
    uint64_t use_bytes, use_capacity;
} ebpo_texture_name;

enum { EBPO_TEXTURE_SLOTS = 4096 }; /* more than there are names */

typedef struct ebpo_texture_names {
    ebpo_texture_name *of;
    uint64_t count, capacity;
    uint16_t slot[EBPO_TEXTURE_SLOTS]; /* a table of numbers from 1; 0: free */
    uint64_t left_out;                 /* too long or too many, or with control characters */
    bool no_memory;                    /* some are missing */
} ebpo_texture_names;

/* Adds what a header says: `comment TextureFile NAME`. */
void ebpo_texture_names_of_ply(ebpo_texture_names *names, const char *header, uint64_t bytes);

/* Adds what a material library says: of each material its maps. */
void ebpo_texture_names_of_mtl(ebpo_texture_names *names, const uint8_t *text, uint64_t bytes);

/* Calls `take` with what follows `mtllib` in each such line of an OBJ file. */
void ebpo_obj_libraries(const uint8_t *text, uint64_t bytes,
                        void (*take)(void *context, const char *rest, size_t size), void *context);

void ebpo_texture_names_free(ebpo_texture_names *names);

#endif
