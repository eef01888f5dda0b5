/* Reports doubts (reasons why a mesh may not bound the intended solid), and repairs that may help.
 */
#ifndef EBPO_TOOLS_MESH_ADVICE_H
#define EBPO_TOOLS_MESH_ADVICE_H

#include <stdio.h>

#include "cli/json.h"
#include "cli/mesh_input.h"

/* Prints warnings: if the mesh is a surface, if there are doubts, if faces are repeated, and if
 * components are inside out or nested. `command`, `path`: for the messages. */
void advice_warn(FILE *out, const char *command, const char *path, const mesh_input *p);

/* Prints the result of each sequence of repairs that was tried, if any. */
void advice_print(FILE *out, const mesh_input *p);

/* Prints facts about the repaired mesh: the number of repeated faces, and the numbers of closed
 * components that are cavities, inside out or nested. Prints nothing if all numbers are 0. */
void advice_print_shells(FILE *out, const mesh_input *p);

/* Writes the members "doubts", "repeated_by_position", "shells" and "repairs". */
void advice_json(json *j, const mesh_input *p);

/* Writes the doubts in words, separated by "; ", for messages. */
const char *advice_doubts(char *out, size_t size, const mesh_input *p);

#endif
