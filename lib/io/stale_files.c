#include "io/stale_files.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

/* ".NAME.PROCESS-NUMBER.tmp": the process, or 0. */
static long process_of(const char *file, const char *name)
{
    char *end;
    size_t kept = strnlen(name, EBPO_TARGET_NAME_KEPT);
    if (file[0] != '.' || strncmp(file + 1, name, kept) != 0 || file[kept + 1] != '.')
        return 0;
    long process = strtol(file + kept + 2, &end, 10);
    if (process <= 0 || *end != '-')
        return 0;
    (void)strtoul(end + 1, &end, 10);
    return strcmp(end, ".tmp") == 0 ? process : 0;
}

static void remove_if_stale(int folder, const char *file)
{
    struct stat facts;
    int fd = openat(folder, file, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY);
    if (fd < 0)
        return;
    if (fstat(fd, &facts) == 0 && S_ISREG(facts.st_mode) && flock(fd, LOCK_EX | LOCK_NB) == 0)
        (void)unlinkat(folder, file, 0); /* it may stay */
    close(fd);
}

void ebpo_remove_stale_files(const char *folder, const char *name)
{
    int saved = errno;
    DIR *d = opendir(folder);
    for (struct dirent *e; d && (e = readdir(d));) {
        long process = process_of(e->d_name, name);
        if (process && kill((pid_t)process, 0) != 0 && errno == ESRCH)
            remove_if_stale(dirfd(d), e->d_name);
    }
    if (d)
        closedir(d);
    errno = saved;
}
