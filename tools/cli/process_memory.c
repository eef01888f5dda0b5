/* Limits the memory of the process by RLIMIT_DATA, which counts private writable memory. */
#include "cli/process_memory.h"

#include <ebpo/memory.h>
#include <stdio.h>
#include <sys/resource.h>
#include <unistd.h>

#include "cli/words.h"

enum { THREADS_MAX = 256 };

static uint64_t limit_bytes; /* limit of this process without stacks; 0: only the inherited limit */
static bool limit_by_option; /* true: --memory has set the limit; false: the default */
static rlim_t inherited_limit = RLIM_INFINITY; /* limit inherited from the parent process */

/* Returns the number of bytes in use that count for the limit: private writable memory. Under
 * sanitizers, this is most of the address space. 0: not known. */
static uint64_t used_bytes(void)
{
    unsigned long long pages = 0;
    FILE *f = fopen("/proc/self/statm", "re");
    if (!f)
        return 0;
    if (fscanf(f, "%*u %*u %*u %*u %*u %llu", &pages) != 1)
        pages = 0;
    fclose(f);
    return pages * (uint64_t)sysconf(_SC_PAGESIZE);
}

/* Returns the number of bytes of the stacks of threads. The system counts complete stacks for the
 * limit, although threads use only a small part of a stack. `threads`: number of threads; 0: one
 * for each core. */
static uint64_t stack_bytes(int64_t threads)
{
    struct rlimit stack;
    long cores = sysconf(_SC_NPROCESSORS_ONLN);
    uint64_t each = UINT64_C(8) << 20;
    if (getrlimit(RLIMIT_STACK, &stack) == 0 && stack.rlim_cur != RLIM_INFINITY)
        each = stack.rlim_cur;
    int64_t most = threads > cores ? threads : cores;
    return each * (uint64_t)(most < 1 ? 1 : most > THREADS_MAX ? THREADS_MAX : most);
}

/* Sets the limit, which never exceeds the limit inherited from the parent process. If `bytes` is 0,
 * only the inherited limit remains. `given` is true if the limit comes from --memory. */
static void set_limit(uint64_t bytes, int64_t threads, bool given)
{
    struct rlimit limit;
    uint64_t already = used_bytes(), all = already + stack_bytes(threads) + bytes;
    if (!already || all < bytes || getrlimit(RLIMIT_DATA, &limit) != 0)
        return;
    if (!given)
        inherited_limit = limit.rlim_cur;
    bool ours = bytes && all <= inherited_limit; /* RLIM_INFINITY is the greatest value */
    limit.rlim_cur = ours ? all : inherited_limit;
    if (setrlimit(RLIMIT_DATA, &limit) != 0)
        return;
    limit_bytes = ours ? bytes : 0;
    limit_by_option = given;
}

void process_memory_default(void) { set_limit(ebpo_free_memory(), 0, false); }

bool process_memory_take(const char *command, const char *size, int64_t threads)
{
    uint64_t bytes;
    if (!size)
        return true;
    if (!words_read_size(size, &bytes)) {
        fprintf(stderr,
                "ebpo %s: --memory: '%s' is not " WORDS_SIZE_EXPECTED "; try 'ebpo %s --help'\n",
                command, size, command);
        return false;
    }
    set_limit(bytes, threads, true);
    return true;
}

void process_memory_reason(char *out, size_t capacity)
{
    char size[32];
    words_bytes(size, sizeof size, limit_bytes);
    snprintf(out, capacity, "%s%s%s", limit_bytes ? "; " : "", limit_bytes ? size : "",
             !limit_bytes      ? ""
             : limit_by_option ? " is what --memory allows"
                               : " was free at the start");
}
