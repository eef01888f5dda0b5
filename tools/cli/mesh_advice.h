/* Whether a mesh is the solid that was meant, and which repairs would make it one. */
#ifndef EBPO_TOOLS_MESH_ADVICE_H
#define EBPO_TOOLS_MESH_ADVICE_H

#include <stdio.h>

#include "cli/json.h"
#include "cli/mesh_input.h"

/* A warning for a surface, and for a solid that is doubtful; nothing for another one. */
void advice_warn(FILE *out, const char *command, const char *path, const mesh_input *p);

/* What each sequence of repairs would leave; nothing when none were tried. */
void advice_print(FILE *out, const mesh_input *p);

/* Closed components that are cavities, inside out or in others, as mended; nothing without such. */
void advice_print_shells(FILE *out, const mesh_input *p);

/* Members "doubts" and "repairs". */
void advice_json(json *j, const mesh_input *p);

/* The doubts in words, with "; " between; for messages. */
const char *advice_doubts(char *out, size_t size, const mesh_input *p);

#endif
