/* The folder of a report: made beside its place, put there when it is whole. */
#ifndef EBPO_TOOLS_REPORT_OUTPUT_H
#define EBPO_TOOLS_REPORT_OUTPUT_H

#include <stdbool.h>
#include <stddef.h>

/* Makes the folder. An exit code; what is wrong has been said on stderr. EXIT_FAILED: something is
 * in the way at `place` that is not a report, or the folder cannot be made; EXIT_USAGE: one of the
 * operands (NULL-terminated) lies in the report that would be replaced. A report: a folder with
 * nothing but the files of one, report.json among them. */
int output_begin(const char *place, const char *const *operand, char *folder, size_t capacity);
/* Moves the folder to its place; a report that was there is replaced. False, said on stderr: it
 * cannot be. */
bool output_commit(const char *place, const char *folder);
/* Removes the folder with what is in it. Harmless when there is none. */
void output_drop(const char *folder);

#endif
