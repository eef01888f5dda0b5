/* --subtree-faces and --face-coding, as commands that write files have it. */
#ifndef EBPO_TOOLS_SUBTREE_ARGS_H
#define EBPO_TOOLS_SUBTREE_ARGS_H

#include <stdbool.h>
#include <stdint.h>

#include "cli/args.h"

/* A row for the tables of options; `member` is a text in the struct `type`. */
#define SUBTREE_OPTION(type, member)                                                      \
    OPTION_TEXT("subtree-faces", 0, type, member, "N",                                    \
                "what lies below nodes with at least N faces each on average lies "       \
                "together, to be read at once; none: as in format 1.0; default: 1024 in " \
                "files of 131072 faces and more")

/* The same; `member` is an int, 0 unless given: a number of ebpo_face_coding. */
#define FACE_CODING_OPTION(type, member)                                                        \
    OPTION_WORD("face-coding", 0, type, member, "NAME", face_coding_words,                      \
                "of the corners of faces: high-water (as in format 1.0), gates (across edges "  \
                "of other faces: fewer bytes) or usual (the default: high-water, in copies as " \
                "in the source)")

extern const char *const face_coding_words[];

/* The member of the same name of ebpo_write_options; `text` may be NULL. False, with the usage
 * message printed, when it is no such number. */
bool subtree_faces_read(const char *command, const char *text, uint64_t *out);

#endif
