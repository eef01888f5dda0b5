/* --memory and --temp-dir, as commands that build or prove have them. */
#ifndef EBPO_TOOLS_MEMORY_ARGS_H
#define EBPO_TOOLS_MEMORY_ARGS_H

#include <ebpo/workspace.h>

#include "cli/args.h"

typedef struct memory_values {
    const char *memory, *temp_dir;
} memory_values;

/* False, with the usage message printed, when the values are none. */
bool memory_good(const char *command, const memory_values *v);

/* The workspace that they ask for; they are without fault. */
EBPO_MUST_USE ebpo_status memory_make(ebpo_workspace **out, const memory_values *v,
                                      ebpo_error *error);

#endif
