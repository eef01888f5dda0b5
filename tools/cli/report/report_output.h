/* Makes a temporary folder beside the folder `place` of a report, and renames it to `place` when it
 * is complete. */
#ifndef EBPO_TOOLS_REPORT_OUTPUT_H
#define EBPO_TOOLS_REPORT_OUTPUT_H

#include <stdbool.h>
#include <stddef.h>

#include "cli/report/report_data.h"

enum {
    OUTPUT_NAME_MAX = 80, /* maximum size of a model file's name, including the final zero byte */
    OUTPUT_MODELS_MAX = METHODS_MAX + 1 /* a file for each method, and one temporary model */
};

/* Makes the temporary folder. Returns an exit code; errors have been reported on stderr.
 * EXIT_FAILED: `place` exists and is not a report, or the folder cannot be made. EXIT_USAGE: an
 * operand is in the report that would be replaced. `operand`: NULL-terminated. A folder is a report
 * if all of its files have names of a report and it has report.json. */
int output_begin(const char *place, const char *const *operand, char *folder, size_t capacity);
/* Sets `path` to the path of the model file STEM.ebpo.h5 in the temporary folder. A signal handler
 * then removes this file. Call before the file is made. */
void output_add_model(const char *folder, const char *stem, char *path, size_t capacity);
/* Renames the folder to `place`, and replaces an existing report. Returns false after a failure,
 * which has been reported on stderr. */
bool output_commit(const char *place, const char *folder);
/* Removes the folder and its contents, if it exists. */
void output_remove(const char *folder);

#endif
