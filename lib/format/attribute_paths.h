/* The arrays of /attributes in a file: a header, then of each array of attributes its values and,
 * of lists of different lengths, their items. format-spec/README.md, "Attributes". */
#ifndef EBPO_FORMAT_ATTRIBUTE_PATHS_H
#define EBPO_FORMAT_ATTRIBUTE_PATHS_H

#include "format/schema.h"

/* Numbers of arrays, and their paths. */
static inline int ebpo_values_number(uint64_t n) { return 1 + 2 * (int)n; }
static inline int ebpo_items_number(uint64_t n) { return 2 + 2 * (int)n; }
void ebpo_attribute_path(int number, char path[EBPO_PATH_BYTES]);

extern const char ebpo_coding_plain[], ebpo_coding_columns[];

#endif
