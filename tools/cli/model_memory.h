/* Sets the default memory budget of a model. */
#ifndef EBPO_TOOLS_MODEL_MEMORY_H
#define EBPO_TOOLS_MODEL_MEMORY_H

#include <ebpo/query.h>

/* Sets options->memory. If the whole model needs at most half of the free memory, there is no limit
 * (0). Otherwise the limit is half of the free memory. If the model needs more than this half, the
 * limit is the least memory that the model needs, and a note is printed on standard error. Remote
 * files keep the default budget of the library. */
void model_memory_default(const char *command, const ebpo_file *file, const char *path,
                          ebpo_model_options *options);

/* Prints the note that a model needs more than half of the free memory. `what`: name of the model.
 * `least`: the least memory that the model needs, in bytes. `half`: half of the free memory, in
 * bytes. */
void model_memory_report_least(const char *command, const char *what, uint64_t least,
                               uint64_t half);

#endif
