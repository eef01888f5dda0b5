/* Handles standard streams. Replaces closed streams. Replaces the operand "-" by a temporary file.
 * For an input, standard input is copied to the temporary file at first. For an output, the
 * temporary file is copied to standard output at the end. Commands need files, because meshes are
 * not read sequentially, and outputs are replaced atomically. */
#ifndef EBPO_TOOLS_STANDARD_FILES_H
#define EBPO_TOOLS_STANDARD_FILES_H

#include "cli/args.h"

/* Replaces closed standard streams by unusable files. Must be called before any file is opened.
 * Returns false after a failure; then the program must not open any file. */
bool standard_files_occupy(void);

/* Replaces operands "-" by temporary files, as spec->dash states. If an output is replaced, all
 * text that the command prints on standard output goes to standard error. Returns an exit code,
 * EXIT_OK also if no operand is "-". Errors have been reported. */
int standard_files_begin(const arg_spec *spec, const char *operand[ARGS_OPERANDS_MAX]);

/* Returns the name of a file for messages: "standard-input" or "standard-output" for a temporary
 * file, else the path. */
const char *standard_files_shown(const char *path);

/* Ends the streams after the command has ended with `code`. If the code is EXIT_OK, copies the
 * temporary output to standard output. Returns the exit code. */
int standard_files_end(const arg_spec *spec, int code);

#endif
