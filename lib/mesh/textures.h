/* Stores the image files that a source (mesh file) names. Each image is a row of the element
 * `ebpo:texture` of the attributes (mesh/attributes.h), with lists of bytes. Specification:
 * format-spec/attributes.md. For use by one thread. */
#ifndef EBPO_MESH_TEXTURES_H
#define EBPO_MESH_TEXTURES_H

#include <ebpo/base.h>
#include <ebpo/mesh.h>

#include "mesh/attributes.h"

enum {
    EBPO_TEXTURES = 1000,           /* maximum number of images of a mesh */
    EBPO_TEXTURE_NAME_BYTES = 1023, /* maximum length of a name */
    EBPO_TEXTURE_USE_BYTES = 8192,  /* maximum length of the uses of an image */
    /* maximum total length of the names of all images; also of the uses, and of the digests */
    EBPO_TEXTURE_TEXTS = 1 << 24
};

/* The arrays of the element. */
typedef enum ebpo_texture_array {
    EBPO_TEXTURE_NAME,   /* the name in the source */
    EBPO_TEXTURE_USE,    /* lines of uses, such as map_Kd and a material's name */
    EBPO_TEXTURE_SHA256, /* 32 bytes; empty: the file was not found */
    EBPO_TEXTURE_BYTES,  /* bytes of the file; this array exists only if bytes are kept */
    EBPO_TEXTURE_ARRAYS
} ebpo_texture_array;

const char *ebpo_texture_array_name(ebpo_texture_array which);

typedef struct ebpo_texture_bytes {
    const void *at;
    uint64_t count;
} ebpo_texture_bytes;

/* Returns an array, or NULL if it does not exist or has another type. */
const ebpo_attribute *ebpo_textures_array(const ebpo_attributes *all, ebpo_texture_array which);

/* Returns the list of a row; an empty list if `a` is NULL or the row does not exist. */
ebpo_texture_bytes ebpo_texture_list(const ebpo_attribute *a, uint64_t row);

/* Adds a row to the mesh's textures. The first call creates the arrays, with the array of bytes if
 * `keep` is true. EBPO_E_MEMORY, EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_textures_add(ebpo_attributes *to, bool keep,
                                            const ebpo_texture_bytes list[EBPO_TEXTURE_ARRAYS],
                                            ebpo_error *error);

/* Returns true if all kept bytes match their digests. */
bool ebpo_textures_good(const ebpo_attributes *all);

/* Keeps all rows with names, uses and digests, but only the bytes of images that these faces
 * (source indices) use. A face refers to its image by the attribute `material`, whose material uses
 * the image, or by the attribute `texnumber`, an index into the TextureFile comments of a PLY file.
 * Images that cannot be assigned to faces keep their bytes. EBPO_E_MEMORY, EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_textures_keep_named(ebpo_attributes *of, const uint32_t *faces,
                                                   uint64_t count, ebpo_error *error);

/* Adds the textures of a mesh to its attributes, with the images' bytes if `keep` is true. The mesh
 * was read from `data`, the content of the file `path`. Files are searched only in the source's
 * folder and below; links that leave this folder are not followed. Missing and omitted files are
 * recorded in the attributes. EBPO_E_MEMORY, EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_textures_find(ebpo_mesh *mesh, const char *path, const uint8_t *data,
                                             uint64_t size, bool keep, ebpo_error *error);

/* Names of image files in a PLY header, an OBJ file and its material libraries. */

typedef struct ebpo_texture_name {
    char *name; /* no control characters; zero-terminated */
    char *use;  /* one line for each use; the last line has no line end */
    uint64_t use_bytes, use_capacity;
} ebpo_texture_name;

enum { EBPO_TEXTURE_SLOTS = 4096 }; /* exceeds the number of names */

typedef struct ebpo_texture_names {
    ebpo_texture_name *name;
    uint64_t count, capacity;
    uint16_t slot[EBPO_TEXTURE_SLOTS]; /* hash table of indices from 1; 0: free */
    uint64_t omitted;                  /* names that are too long, too many, or with control
                                        * characters */
    bool no_memory;                    /* true: out of memory, so names are missing */
} ebpo_texture_names;

/* Adds the names from a header: `comment TextureFile NAME`. */
void ebpo_texture_names_of_ply(ebpo_texture_names *names, const char *header, uint64_t bytes);

/* Adds the maps of all materials of a library. */
void ebpo_texture_names_of_mtl(ebpo_texture_names *names, const uint8_t *text, uint64_t bytes);

/* Calls `take` with the text after `mtllib` for each line of an OBJ file that begins with this
 * word. */
void ebpo_obj_libraries(const uint8_t *text, uint64_t bytes,
                        void (*take)(void *context, const char *rest, size_t size), void *context);

void ebpo_texture_names_free(ebpo_texture_names *names);

#endif
