/* Names of parts: as files, and in a scene. */
#ifndef EBPO_TOOLS_PART_NAMES_H
#define EBPO_TOOLS_PART_NAMES_H

#include <ebpo/groups.h>

enum { PART_NAME_SIZE = 96, PART_SHOWN_SIZE = 256 };

/* "KIND-NUMBER-NAME", of letters, digits, '-' and '_' only; the number, of so many digits, tells
 * them apart. `own`: NULL: without. */
void part_file_name(char out[PART_NAME_SIZE], const char *kind, int digits, uint64_t number,
                    const char *own);

/* The group's own name, where a scene can have it; else what can be said of it, with a number.
 * `taken`: sorted, the own names that are shown as they are. */
void part_shown_name(char out[PART_SHOWN_SIZE], const char *own, uint64_t number,
                     const char *const *taken, uint64_t taken_count);

/* A scene can have this name: 1 to 255 bytes of UTF-8 without control characters and no selector.
 */
bool part_name_fits(const char *own);

/* For qsort, of pointers to names. */
int part_compare_names(const void *a, const void *b);

#endif
