/* Reads and writes images named by the attributes of a file: format-spec/attributes.md. */
#ifndef EBPO_TOOLS_TEXTURES_H
#define EBPO_TOOLS_TEXTURES_H

#include <ebpo/file.h>
#include <stdio.h>

#include "cli/json.h"

enum { TEXTURE_ARRAYS = 4 };

/* The four arrays about images: names, uses, digests and bytes. Row i of each array is for image i.
 */
typedef struct textures {
    uint64_t count;                             /* number of images */
    ebpo_attribute_values list[TEXTURE_ARRAYS]; /* an array without values is absent or not read */
    uint32_t columns[TEXTURE_ARRAYS]; /* bytes of each row, for arrays whose rows are equally long
                                       * (list[i].ends is NULL) */
    bool embedded;                    /* true: the file has the bytes of images */
} textures;

/* Reads the arrays. If `bytes`, also reads the bytes of the images. After a failure, there is
 * nothing to free. */
EBPO_MUST_USE ebpo_status textures_read(textures *out, const ebpo_file *file, bool bytes,
                                        ebpo_error *error);
void textures_free(textures *t);
/* Returns true if the file has the bytes of images. Does not read them. */
bool textures_embedded(const ebpo_file *file);

/* Returns true if both files name the same images with the same digests, or if a file cannot be
 * read. */
bool textures_same(const ebpo_file *a, const ebpo_file *b);

void textures_print(FILE *out, const textures *t);
void textures_json(json *j, const textures *t);

/* Writes all images in the file to the folder, under their names; creates the folder if needed.
 * Refuses names that lead out of the folder before anything is written (EBPO_E_FORMAT). Existing
 * files stay unchanged (EBPO_E_IO). EBPO_E_ABSENT: there are no images. `t` must have been read
 * with bytes. */
EBPO_MUST_USE ebpo_status textures_write(const textures *t, const char *folder, uint64_t *written,
                                         ebpo_error *error);

#endif
