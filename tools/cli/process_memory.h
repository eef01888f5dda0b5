/* Limits the memory of a command: a model that needs too much ends with an error and does not
 * affect other programs. */
#ifndef EBPO_TOOLS_PROCESS_MEMORY_H
#define EBPO_TOOLS_PROCESS_MEMORY_H

#include <ebpo/base.h>
#include <stddef.h>

/* Sets the limit of all commands, before anything else: the free memory. */
void process_memory_default(void);

/* Sets the limit from --memory, for commands whose memory use follows from their work; `size` NULL:
 * unchanged. `threads`: as --threads; the stacks of the threads are added. The limit inherited from
 * the parent process is never exceeded. Returns false, with the usage message printed, for an
 * invalid size. */
bool process_memory_take(const char *command, const char *size, int64_t threads);

/* Writes the limit and its origin, for messages about memory; "" when there is none. */
void process_memory_reason(char *out, size_t capacity);

#endif
