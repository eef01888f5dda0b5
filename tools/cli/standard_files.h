/* Standard streams: replaces closed streams, and the operand "-": standard input is read into a
 * temporary file, standard output is written from one. Meshes are not read sequentially, and
 * outputs are replaced atomically. */
#ifndef EBPO_TOOLS_STANDARD_FILES_H
#define EBPO_TOOLS_STANDARD_FILES_H

#include "cli/args.h"

/* Replaces closed standard streams by unusable files, before any file is opened. Returns false if
 * that is impossible; then nothing may be opened. */
bool standard_files_occupy(void);

/* Replaces operands "-" by temporary files, as spec->dash says for each. If one of them is an
 * output, the command prints to standard error. Returns an exit code, EXIT_OK also if no operand is
 * "-". Errors have been reported. */
int standard_files_begin(const arg_spec *spec, const char *operand[ARGS_OPERANDS_MAX]);

/* Returns a path for messages: "standard-input" or "standard-output" for a temporary file. */
const char *standard_files_shown(const char *path);

/* Called after the command: copies its output if its exit code is EXIT_OK. Returns the exit code.
 */
int standard_files_end(const arg_spec *spec, int code);

#endif
