/* Sets the default memory budget of a model. */
#ifndef EBPO_TOOLS_MODEL_MEMORY_H
#define EBPO_TOOLS_MODEL_MEMORY_H

#include <ebpo/query.h>

/* Sets `options->memory`: to the size of the whole model when that is at most half of the free
 * memory, else to half of the free memory. When even the minimum is more, sets the minimum, with a
 * note on standard error. Remote files keep the default budget of the library. */
void model_memory_default(const char *command, const ebpo_file *file, const char *path,
                          ebpo_model_options *options);

/* Prints the note, when `least` bytes are more than `half` of the free memory. */
void model_memory_report_least(const char *command, const char *what, uint64_t least,
                               uint64_t half);

#endif
