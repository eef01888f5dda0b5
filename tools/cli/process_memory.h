/* Limits the memory of the process, so that a command that needs too much memory ends with an error
 * and does not affect other programs. */
#ifndef EBPO_TOOLS_PROCESS_MEMORY_H
#define EBPO_TOOLS_PROCESS_MEMORY_H

#include <ebpo/base.h>
#include <stddef.h>

/* Sets the default limit of all commands: the memory that is free now. Call first in main. */
void process_memory_default(void);

/* Sets the limit from the value of --memory, for commands that have no other way to limit their
 * memory. If `size` is NULL, the limit stays unchanged. `threads`: value of --threads; the stacks
 * of the threads do not count for `size`. The limit never exceeds the limit inherited from the
 * parent process. Returns false, after an error message, for an invalid size. */
bool process_memory_take(const char *command, const char *size, int64_t threads);

/* Writes text about the limit and its origin, to be appended to messages about memory. Writes "" if
 * this process has set no limit. */
void process_memory_reason(char *out, size_t capacity);

#endif
