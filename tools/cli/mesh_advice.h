/* Reports doubts about a mesh as a solid, and repairs that may help. */
#ifndef EBPO_TOOLS_MESH_ADVICE_H
#define EBPO_TOOLS_MESH_ADVICE_H

#include <stdio.h>

#include "cli/json.h"
#include "cli/mesh_input.h"

/* Prints a warning if the mesh is a surface or a doubtful solid. */
void advice_warn(FILE *out, const char *command, const char *path, const mesh_input *p);

/* Prints the result of each sequence of repairs; nothing when none was tried. */
void advice_print(FILE *out, const mesh_input *p);

/* Prints the closed components that are cavities, inside out or nested, after repairs; nothing when
 * there are none. */
void advice_print_shells(FILE *out, const mesh_input *p);

/* Writes members "doubts" and "repairs". */
void advice_json(json *j, const mesh_input *p);

/* Writes the doubts in words, separated by "; ", for messages. */
const char *advice_doubts(char *out, size_t size, const mesh_input *p);

#endif
