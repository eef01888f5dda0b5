/* Images that a file's attributes name: format-spec/README.md, section 18. */
#ifndef EBPO_TOOLS_TEXTURES_H
#define EBPO_TOOLS_TEXTURES_H

#include <ebpo/file.h>
#include <stdio.h>

#include "cli/json.h"

enum { TEXTURE_ARRAYS = 4 };

/* The lists of bytes that a file has of them: names, uses, digests, and bytes of files. */
typedef struct textures {
    uint64_t count;
    ebpo_attribute_values list[TEXTURE_ARRAYS]; /* without values: not in the file, or not read */
    uint32_t columns[TEXTURE_ARRAYS];           /* where there are no ends */
    bool embedded;                              /* the file has bytes of images */
} textures;

/* `bytes`: the images as well. On failure nothing is left to free. */
EBPO_MUST_USE ebpo_status textures_read(textures *out, const ebpo_file *file, bool bytes,
                                        ebpo_error *error);
void textures_free(textures *t);
/* Whether the file has bytes of images; nothing of them is read. */
bool textures_embedded(const ebpo_file *file);

/* Whether both files name the same images, of the same bytes as far as digests tell. True where one
 * of them cannot be read. */
bool textures_same(const ebpo_file *a, const ebpo_file *b);

void textures_print(FILE *out, const textures *t);
void textures_json(json *j, const textures *t);

/* Writes all images that the file has to the folder, under their names; the folder is made if need
 * be. Names that lead out of it are refused before anything is written, and what is there already
 * stays: EBPO_E_FORMAT, EBPO_E_IO. EBPO_E_ABSENT: there are none. `t` was read with bytes. */
EBPO_MUST_USE ebpo_status textures_write(const textures *t, const char *folder, uint64_t *written,
                                         ebpo_error *error);

#endif
