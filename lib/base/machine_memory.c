#include "base/machine_memory.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

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

/* The least limit of the group `path` (it is cut short) and of those above it. */
static uint64_t least_limit(const char *mounted, char *path, const char *file, uint64_t least)
{
    for (;;) {
        char name[PATH_BYTES + 128];
        snprintf(name, sizeof name, "%s%s/%s", mounted, path, file);
        uint64_t limit = number_in(name);
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
static uint64_t group_memory(const char *groups, uint64_t least)
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
            least = least_limit("/sys/fs/cgroup", path, "memory.max", least);
        else if (strstr(controller, "memory"))
            least = least_limit("/sys/fs/cgroup/memory", path, "memory.limit_in_bytes", least);
    }
    if (f)
        fclose(f);
    return least;
}

uint64_t ebpo_machine_memory(void)
{
    long pages = sysconf(_SC_PHYS_PAGES), page = sysconf(_SC_PAGESIZE);
    return group_memory("/proc/self/cgroup", pages > 0 && page > 0
                                                 ? (uint64_t)pages * (uint64_t)page
                                                 : UINT64_C(1) << 32);
}
