/* What a command may hold besides files, whatever it does: a model that is larger than it seems
 * ends with an error, and not with other programs of this machine. */
#ifndef EBPO_TOOLS_PROCESS_MEMORY_H
#define EBPO_TOOLS_PROCESS_MEMORY_H

#include <ebpo/base.h>
#include <stddef.h>

/* The limit of all commands, before anything else: what is free. */
void process_memory_usual(void);

/* --memory of commands that hold as much as their work takes; NULL: as it is. `threads`
 * as of --threads: their stacks come on top. What whoever began the process allows is never
 * exceeded. False, with the usage message printed, when it is no size. */
bool process_memory_take(const char *command, const char *size, int64_t threads);

/* For messages where memory was short: what the limit is, and whose; "" where there is none. */
void process_memory_why(char *out, size_t capacity);

#endif
