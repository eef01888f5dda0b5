#include "cli/memory_args.h"

#include <stddef.h>
#include <stdio.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include "cli/command.h"
#include "cli/words.h"

bool memory_check(const char *command, const memory_values *v)
{
    uint64_t bytes;
    if (!v->memory)
        return true;
    if (!words_read_size(v->memory, &bytes)) {
        command_usage(command, "--memory: '%s' is not " WORDS_SIZE_EXPECTED, v->memory);
        return false;
    }
    if (bytes < EBPO_WORKSPACE_MIN)
        fprintf(stderr, "ebpo %s: --memory %s is too little for any mesh; allow at least %dM\n",
                command, v->memory, EBPO_WORKSPACE_MIN / 1000000);
    return bytes >= EBPO_WORKSPACE_MIN;
}

/* Sets malloc so that freed memory returns to the system at once. By default, freed memory stays in
 * the heaps of threads, and counts as resident memory of the process. */
static void return_memory(void)
{
#ifdef __GLIBC__
    mallopt(M_MMAP_THRESHOLD, 1 << 20);
    mallopt(M_TRIM_THRESHOLD, 1 << 20);
#endif
}

ebpo_status memory_new(ebpo_workspace **out, const memory_values *v, ebpo_error *error)
{
    ebpo_workspace_options o = EBPO_WORKSPACE_OPTIONS_INIT;
    return_memory();
    o.temp_dir = v->temp_dir;
    if (v->memory)
        (void)words_read_size(v->memory, &o.memory); /* memory_check has checked it */
    return ebpo_workspace_new(&o, out, error);
}
