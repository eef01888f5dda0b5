/* Standard streams: those that are closed, and "-" among the operands: standard input read into a
 * temporary file, standard output written from one, as meshes are not read once through and outputs
 * appear whole or not at all. */
#ifndef EBPO_TOOLS_STANDARD_FILES_H
#define EBPO_TOOLS_STANDARD_FILES_H

#include "cli/args.h"

/* Puts something unusable in place of standard streams that are closed, before any file is opened.
 * False: that is not possible; nothing may be opened then. */
bool standard_files_occupy(void);

/* Puts temporary files in place of operands that are "-", as spec->dash says of each. Where one is
 * an output, what the command prints goes to standard error. An exit code; EXIT_FINE also where
 * there is nothing to do. What is wrong was said. */
int standard_files_begin(const arg_spec *spec, const char *operand[ARGS_OPERANDS_MAX]);

/* A path as it is told of: the temporary ones are nobody's. */
const char *standard_files_shown(const char *path);

/* After the command: if its exit code is EXIT_FINE, its output is copied. The exit code. */
int standard_files_end(const arg_spec *spec, int code);

#endif
