#include "io/stale_folders.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "io/file_source.h"
#include "io/stale_files.h"

static const char MARK[] = ".part-", MADE[] = "XXXXXX";

/* One number for all who see the same processes: since this start of the machine, in this
 * namespace. 0: not known. */
static uint32_t system_number(void)
{
    struct stat space;
    char start[64];
    int fd = open("/proc/sys/kernel/random/boot_id", O_RDONLY | O_CLOEXEC);
    ssize_t size = fd >= 0 ? read(fd, start, sizeof start) : -1;
    if (fd >= 0)
        close(fd);
    if (size < 32 || stat("/proc/self/ns/pid", &space) != 0)
        return 0;
    uint64_t sum = 0xcbf29ce484222325u ^ space.st_ino; /* FNV-1a */
    for (ssize_t i = 0; i < size; i++)
        sum = (sum ^ (uint8_t)start[i]) * 0x100000001b3u;
    return (uint32_t)(sum ^ sum >> 32);
}

/* Bytes of the path without slashes at its end, and where its name begins. */
static size_t without_slashes(const char *folder, size_t *name)
{
    size_t size = strlen(folder);
    while (size > 1 && folder[size - 1] == '/')
        size--;
    for (*name = size; *name && folder[*name - 1] != '/';)
        --*name;
    return size - *name > EBPO_TARGET_NAME_KEPT ? *name + EBPO_TARGET_NAME_KEPT : size;
}

char *ebpo_making_name(const char *folder)
{
    char *path;
    size_t name, size = without_slashes(folder, &name);
    if (asprintf(&path, "%.*s%s%08" PRIx32 "-%ld-%s", (int)size, folder, MARK, system_number(),
                 (long)getpid(), MADE) < 0)
        return NULL;
    return path;
}

void ebpo_making_settle(char **made)
{
    char *path;
    struct stat facts;
    int kept = (int)(strlen(*made) - strlen(MADE));
    if (stat(*made, &facts) != 0 ||
        asprintf(&path, "%.*s%ju", kept, *made, (uintmax_t)facts.st_ino) < 0)
        return;
    if (rename(*made, path) == 0) {
        free(*made);
        *made = path;
    } else {
        free(path);
    }
}

/* What follows the process's number, or NULL: it is there, or the name is no such. */
static const char *rest_of_dead(const char *file, const char *name, size_t kept, uint32_t system)
{
    char *end;
    size_t mark = sizeof MARK - 1;
    if (strncmp(file, name, kept) != 0 || strncmp(file + kept, MARK, mark) != 0 ||
        strtoull(file + kept + mark, &end, 16) != system || *end != '-')
        return NULL;
    long process = strtol(end + 1, &end, 10);
    bool dead = process > 0 && *end == '-' && kill((pid_t)process, 0) != 0 && errno == ESRCH;
    return dead ? end + 1 : NULL;
}

static void empty_folder(int fd)
{
    DIR *d = fdopendir(fd);
    for (struct dirent *e; d && (e = readdir(d));)
        (void)unlinkat(dirfd(d), e->d_name, 0); /* folders are none of ours, and stay */
    if (d)
        closedir(d);
    else
        close(fd);
}

/* One that had not got its inode's number yet has nothing in it. */
static void remove_one(int parent, const char *file, const char *rest)
{
    struct stat facts;
    char inode[32];
    int fd = openat(parent, file, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_DIRECTORY);
    if (fd < 0)
        return;
    bool ours = fstat(fd, &facts) == 0 && facts.st_uid == geteuid();
    snprintf(inode, sizeof inode, "%ju", ours ? (uintmax_t)facts.st_ino : 0);
    if (ours && strcmp(rest, inode) == 0)
        empty_folder(fd);
    else
        close(fd);
    if (ours)
        (void)unlinkat(parent, file, AT_REMOVEDIR);
}

void ebpo_remove_stale_folders(const char *folder)
{
    int saved = errno;
    uint32_t system = system_number();
    size_t name, end = without_slashes(folder, &name);
    char *parent = system ? name ? strndup(folder, name) : strdup(".") : NULL;
    DIR *d = parent ? opendir(parent) : NULL;
    for (struct dirent *e; d && (e = readdir(d));) {
        const char *rest = rest_of_dead(e->d_name, folder + name, end - name, system);
        if (rest)
            remove_one(dirfd(d), e->d_name, rest);
    }
    if (d)
        closedir(d);
    free(parent);
    errno = saved;
}
