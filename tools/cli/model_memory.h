/* How much of a model is held where --memory does not say it. */
#ifndef EBPO_TOOLS_MODEL_MEMORY_H
#define EBPO_TOOLS_MODEL_MEMORY_H

#include <ebpo/query.h>

/* Sets `options->memory`: all of the model where it takes at most half of what is free, else half
 * of it, else the least that will do, of which standard error is told. A file on a server keeps the
 * library's usual budget. */
void model_memory_usual(const char *command, const ebpo_file *file, const char *path,
                        ebpo_model_options *options);

/* The note, where `least` bytes are more than `half` of what is free. */
void model_memory_tell_least(const char *command, const char *what, uint64_t least, uint64_t half);

#endif
