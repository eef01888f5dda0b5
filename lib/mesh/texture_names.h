/* The names of image files in a PLY's header, an OBJ file and its material libraries. */
#ifndef EBPO_MESH_TEXTURE_NAMES_H
#define EBPO_MESH_TEXTURE_NAMES_H

#include <ebpo/base.h>

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
