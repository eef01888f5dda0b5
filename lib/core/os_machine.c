/* The machine as the operating system shows it: the processor's instruction sets and cores, the
 * memory that this process may use, and large pages. Memory is that of the machine or the least
 * limit of a control group of this process, version 1 or 2 (cgroups(7)), as in containers; advice
 * on pages changes nothing when the system declines it. On systems without these files the answers
 * are those of sysconf. */
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
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#else
    return false;
#endif
}

enum { PATH_BYTES = 4096 };

/* The number that a file holds; 0 when it holds none ("max"), or is not there. */
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

/* The number behind a word that begins a line; 0 when there is none. */
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

/* How the two versions of control groups call what is asked for. */
typedef struct group_files {
    const char *mounted, *limit, *used, *cached;
} group_files;
static const group_files files_of[] = {
    { "/sys/fs/cgroup", "memory.max", "memory.current", "inactive_file" },
    { "/sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes",
      "total_inactive_file" },
};

/* The least limit of the group `path` (it is cut short) and of those above it; `free`: of what is
 * left of it. What files have left in memory is free. */
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

/* Of the control groups of this process (cgroups(7): lines "0::/path", or of version 1
 * "4:memory:/path"); within a container the path may not be there, but the topmost group is its
 * own. */
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
