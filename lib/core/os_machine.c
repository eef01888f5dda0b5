/* Reads the machine's properties from the operating system: instruction sets, cores, and the memory
 * that this process may use. Also advises the system on large pages. If a control group of this
 * process (as in a container) limits the memory to less than the machine has, the result is the
 * lowest such limit. Control groups of version 1 and 2 are supported (cgroups(7)). On systems
 * without the files in /proc and /sys, the values come from sysconf. */
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include <ebpo/memory.h>

#include "core/cpu.h"
#include "core/os.h"

bool ebpo_cpu_has_v3(void)
{
#if defined(__x86_64__)
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
           __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
#else
    return false;
#endif
}

enum { PATH_BYTES = 4096 };

/* Returns the number in a file. Returns 0 if the file is missing, or has the word "max" (no limit)
 * instead of a number. */
static uint64_t number_in(const char *path)
{
    unsigned long long value = 0;
    FILE *f = fopen(path, "re");
    if (!f)
        return 0;
    if (fscanf(f, "%llu", &value) != 1)
        value = 0;
    fclose(f);
    return value;
}

/* Returns the number after `word` in the first line that begins with this word in the file `path`.
 * Returns 0 if no line begins with the word. */
static uint64_t number_of(const char *path, const char *word)
{
    char line[256];
    uint64_t value = 0;
    size_t length = strlen(word);
    FILE *f = fopen(path, "re");
    while (f && !value && fgets(line, sizeof line, f))
        if (strncmp(line, word, length) == 0 && (line[length] == ' ' || line[length] == ':'))
            value = strtoull(line + length + 1, NULL, 10);
    if (f)
        fclose(f);
    return value;
}

/* The names that one version of control groups uses. */
typedef struct group_files {
    const char *mounted; /* folder that has the folders of all groups */
    const char *limit;   /* file in a group's folder with the memory limit */
    const char *used;    /* file in a group's folder with the used memory */
    const char *cached;  /* word in a group's file memory.stat for cached file data */
} group_files;
static const group_files files_of[] = {
    { "/sys/fs/cgroup", "memory.max", "memory.current", "inactive_file" },
    { "/sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes",
      "total_inactive_file" },
};

/* Returns the least of these values: `least`, and the limits of the group `path` and of all groups
 * above it. If `free` is true, uses the free memory of each group in place of its limit; cached
 * file data count as free. Changes `path`. */
static uint64_t least_limit(const group_files *files, char *path, bool free, uint64_t least)
{
    for (;;) {
        char name[PATH_BYTES + 128];
        snprintf(name, sizeof name, "%s%s/%s", files->mounted, path, files->limit);
        uint64_t limit = number_in(name);
        if (limit && free) {
            snprintf(name, sizeof name, "%s%s/%s", files->mounted, path, files->used);
            uint64_t used = number_in(name);
            snprintf(name, sizeof name, "%s%s/memory.stat", files->mounted, path);
            uint64_t cached = number_of(name, files->cached);
            used -= cached < used ? cached : used;
            limit -= used < limit ? used : limit - 1;
        }
        least = limit && limit < least ? limit : least;
        char *slash = strrchr(path, '/');
        if (!slash)
            return least;
        *slash = 0;
    }
}

/* Returns the least of `least` and the memory limits of the control groups of this process. If
 * `free` is true, uses their free memory in place of the limits. `groups`: file with the lines
 * "0::/path", or in version 1 "4:memory:/path" (cgroups(7)). In a container, the path may not
 * exist, but the topmost group is that of the container. */
static uint64_t group_memory(const char *groups, bool free, uint64_t least)
{
    char line[PATH_BYTES];
    FILE *f = fopen(groups, "re");
    while (f && fgets(line, sizeof line, f)) {
        line[strcspn(line, "\n")] = 0;
        char *controller = strchr(line, ':'),
             *path = controller ? strchr(controller + 1, ':') : NULL;
        if (!path)
            continue;
        *path++ = 0;
        if (!controller[1])
            least = least_limit(&files_of[0], path, free, least);
        else if (strstr(controller, "memory"))
            least = least_limit(&files_of[1], path, free, least);
    }
    if (f)
        fclose(f);
    return least;
}

uint64_t ebpo_machine_memory(void)
{
    long pages = sysconf(_SC_PHYS_PAGES), page = sysconf(_SC_PAGESIZE);
    return group_memory("/proc/self/cgroup", false,
                        pages > 0 && page > 0 ? (uint64_t)pages * (uint64_t)page
                                              : UINT64_C(1) << 32);
}

uint64_t ebpo_free_memory(void)
{
    uint64_t kilobytes = number_of("/proc/meminfo", "MemAvailable");
    return group_memory("/proc/self/cgroup", true,
                        kilobytes ? 1024 * kilobytes : ebpo_machine_memory() / 2);
}

void ebpo_prefer_huge_pages(void *array, size_t bytes)
{
#if defined(EBPO_HAVE_MADVISE) && defined(MADV_HUGEPAGE)
    const uintptr_t page = (uintptr_t)1 << 21;
    uintptr_t from = (uintptr_t)array, to = from + bytes;
    uintptr_t skipped = (page - from % page) % page;
    to -= to % page;
    if (array && bytes > skipped && to > from + skipped)
        madvise((char *)array + skipped, to - from - skipped, MADV_HUGEPAGE);
#else
    (void)array, (void)bytes;
#endif
}

int ebpo_cores(void)
{
#ifdef EBPO_HAVE_SCHED_GETAFFINITY
    cpu_set_t set;
    int cores = sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
#else
    int cores = (int)sysconf(_SC_NPROCESSORS_ONLN);
#endif
    return cores < 1 ? 1 : cores;
}
