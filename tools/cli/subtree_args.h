/* --subtree-faces and --face-coding, as commands that write files have it. */
#ifndef EBPO_TOOLS_SUBTREE_ARGS_H
#define EBPO_TOOLS_SUBTREE_ARGS_H

#include <stdbool.h>
#include <stdint.h>

#include "cli/args.h"

/* In the order of ebpo_face_coding. */
extern const char *const face_coding_words[];

/* The member of the same name of ebpo_write_options; `text` may be NULL. False, with the usage
 * message printed, when it is no such number. */
bool subtree_faces_read(const char *command, const char *text, uint64_t *out);

#endif
