/* Sets the default memory budget of a model. */
#ifndef EBPO_TOOLS_MODEL_MEMORY_H
#define EBPO_TOOLS_MODEL_MEMORY_H

#include <ebpo/query.h>

/* Sets options->memory to no limit if the whole model needs at most half of the free memory, and
 * otherwise to half of the free memory. If that is less than the minimum of the model, sets the
 * minimum and prints a note on standard error. Remote files keep the default budget of the
 * library. */
void model_memory_default(const char *command, const ebpo_file *file, const char *path,
                          ebpo_model_options *options);

/* Prints the note, when `least` bytes are more than `half` of the free memory. */
void model_memory_report_least(const char *command, const char *what, uint64_t least,
                               uint64_t half);

#endif
