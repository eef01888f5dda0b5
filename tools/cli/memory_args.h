/* Options --memory and --temp-dir of commands that build or verify files. */
#ifndef EBPO_TOOLS_MEMORY_ARGS_H
#define EBPO_TOOLS_MEMORY_ARGS_H

#include <ebpo/workspace.h>

#include "cli/args.h"

typedef struct memory_values {
    const char *memory, *temp_dir; /* NULL: not given */
} memory_values;

/* Returns false for invalid values, after an error message. */
bool memory_check(const char *command, const memory_values *v);

/* Creates the workspace of these values, which must be valid. */
EBPO_MUST_USE ebpo_status memory_new(ebpo_workspace **out, const memory_values *v,
                                     ebpo_error *error);

#endif
