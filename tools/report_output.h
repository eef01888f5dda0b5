/* The folder of a report: made beside its place, put there when it is whole. */
#ifndef EBPO_TOOLS_REPORT_OUTPUT_H
#define EBPO_TOOLS_REPORT_OUTPUT_H

#include <stdbool.h>
#include <stddef.h>

/* False, said on stderr: something is in the way at `place` that is not a report (exit with EXIT_USAGE), or the folder cannot be made. */
bool output_begin(const char *place, char *folder, size_t room);
/* Moves the folder to its place; a report that was there is replaced. False, said on stderr: it cannot be. */
bool output_commit(const char *place, const char *folder);
/* Removes the folder with what is in it. Harmless when there is none. */
void output_drop(const char *folder);

#endif
