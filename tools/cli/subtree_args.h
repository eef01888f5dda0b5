/* Options --subtree-faces and --face-coding of commands that write files. */
#ifndef EBPO_TOOLS_SUBTREE_ARGS_H
#define EBPO_TOOLS_SUBTREE_ARGS_H

#include <stdbool.h>
#include <stdint.h>

#include "cli/args.h"

/* In the order of ebpo_face_coding. */
extern const char *const face_coding_words[];

/* Reads --subtree-faces as the member subtree_faces of ebpo_write_options; `text` may be NULL.
 * Returns false, after an error message, for an invalid number. */
bool subtree_faces_read(const char *command, const char *text, uint64_t *out);

#endif
