/* Removes unfinished files: outputs and locks, when a signal ends this process. The names of these
 * files are in fixed storage with lock-free states, because a signal handler reads the names.
 * Temporary files and folders of killed processes are recognised by their names, which contain the
 * process id; they are removed when the process has ended and no process holds their lock. New
 * folders are created atomically: they are made under another name in the same parent folder, and
 * renamed. Files that cannot be examined or removed stay. */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <ebpo/base.h>

#include "core/error.h"
#include "core/hash.h"
#include "io/file_source.h"
#include "io/unfinished.h"

enum { SLOT_FREE, SLOT_TAKEN, SLOT_LIVE }; /* LIVE: `path` is a file to remove */
static struct slot {
    atomic_int state;
    char path[PATH_MAX];
} slots[EBPO_UNFINISHED_MAX];

int ebpo_unfinished_reserve(void)
{
    for (int i = 0; i < EBPO_UNFINISHED_MAX; i++) {
        int expected = SLOT_FREE;
        if (atomic_compare_exchange_strong(&slots[i].state, &expected, SLOT_TAKEN))
            return i;
    }
    return -1;
}

void ebpo_unfinished_set(int slot, const char *path)
{
    strcpy(slots[slot].path, path);
    atomic_store(&slots[slot].state, SLOT_LIVE);
}

void ebpo_unfinished_unset(int slot) { atomic_store(&slots[slot].state, SLOT_TAKEN); }

void ebpo_unfinished_forget(int slot)
{
    if (slot >= 0)
        atomic_store(&slots[slot].state, SLOT_FREE);
}

void ebpo_unfinished_remove(void)
{
    int saved = errno;
    for (int i = 0; i < EBPO_UNFINISHED_MAX; i++)
        if (atomic_load(&slots[i].state) == SLOT_LIVE)
            unlink(slots[i].path);
    errno = saved;
}

/* Returns the process id in ".NAME.PROCESS-NUMBER.tmp", or 0. */
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

/* Removes a file if no process holds its lock. */
static void remove_if_stale(int folder, const char *file)
{
    struct stat facts;
    int fd = openat(folder, file, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY);
    if (fd < 0)
        return;
    if (fstat(fd, &facts) == 0 && S_ISREG(facts.st_mode) && flock(fd, LOCK_EX | LOCK_NB) == 0)
        (void)unlinkat(folder, file, 0); /* the file may stay */
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

static const char MARK[] = ".part-", MADE[] = "XXXXXX";

/* Returns a number that is the same for all processes in this namespace of process ids until the
 * machine is restarted. 0: not known. */
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
    uint64_t sum = ebpo_hash_bytes(EBPO_HASH_BYTES_BEGIN ^ space.st_ino, start, (size_t)size);
    return (uint32_t)(sum ^ sum >> 32);
}

/* Returns the length of the path without slashes at its end, and sets *name to the offset of its
 * last part. */
static size_t without_slashes(const char *folder, size_t *name)
{
    size_t size = strlen(folder);
    while (size > 1 && folder[size - 1] == '/')
        size--;
    for (*name = size; *name && folder[*name - 1] != '/';)
        --*name;
    return size - *name > EBPO_TARGET_NAME_KEPT ? *name + EBPO_TARGET_NAME_KEPT : size;
}

/* Returns "FOLDER.part-SYSTEM-PROCESS-XXXXXX" for mkdtemp, where SYSTEM is system_number(); long
 * names are cut. Freed by free(); NULL: no memory. */
static char *making_name(const char *folder)
{
    char *path;
    size_t name, size = without_slashes(folder, &name);
    if (asprintf(&path, "%.*s%s%08" PRIx32 "-%ld-%s", (int)size, folder, MARK, system_number(),
                 (long)getpid(), MADE) < 0)
        return NULL;
    return path;
}

/* Renames the folder that mkdtemp has made: its inode number replaces XXXXXX. If another folder
 * later gets this name, its inode number differs. */
static void settle_making(char **made)
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

/* Returns the text after the process id in a name made by making_name, or NULL if that process
 * exists or the name has another form. */
static const char *suffix_of_dead(const char *file, const char *name, size_t kept, uint32_t system)
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
        (void)unlinkat(dirfd(d), e->d_name,
                       0); /* the library makes no folders here, so folders stay */
    if (d)
        closedir(d);
    else
        close(fd);
}

/* Removes one folder of this user. Removes its files only if the name ends with the folder's inode
 * number; a folder without this number in its name is empty. */
static void remove_one(int parent, const char *file, const char *suffix)
{
    struct stat facts;
    char inode[32];
    int fd = openat(parent, file, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_DIRECTORY);
    if (fd < 0)
        return;
    bool ours = fstat(fd, &facts) == 0 && facts.st_uid == geteuid();
    snprintf(inode, sizeof inode, "%ju", ours ? (uintmax_t)facts.st_ino : 0);
    if (ours && strcmp(suffix, inode) == 0)
        empty_folder(fd);
    else
        close(fd);
    if (ours)
        (void)unlinkat(parent, file, AT_REMOVEDIR);
}

/* Removes abandoned unfinished folders for `folder` with their content: those of this user, made by
 * a process of this system that has ended. Files that cannot be examined or removed stay. */
static void remove_stale_folders(const char *folder)
{
    int saved = errno;
    uint32_t system = system_number();
    size_t name, end = without_slashes(folder, &name);
    char *parent = system ? name ? strndup(folder, name) : strdup(".") : NULL;
    DIR *d = parent ? opendir(parent) : NULL;
    for (struct dirent *e; d && (e = readdir(d));) {
        const char *suffix = suffix_of_dead(e->d_name, folder + name, end - name, system);
        if (suffix)
            remove_one(dirfd(d), e->d_name, suffix);
    }
    if (d)
        closedir(d);
    free(parent);
    errno = saved;
}

/* --- new folders --- */

ebpo_status ebpo_folder_begin(const char *folder, char **making, ebpo_error *error)
{
    struct stat st;
    *making = NULL;
    if (stat(folder, &st) == 0)
        return ebpo_fail_file(error, EBPO_E_IO, folder,
                              "exists already; the output must be a new folder");
    remove_stale_folders(folder);
    char *path = making_name(folder);
    if (!path)
        return ebpo_fail_memory(error, strlen(folder));
    if (mkdtemp(path)) {
        settle_making(&path);
        *making = path;
        return EBPO_OK;
    }
    free(path);
    return ebpo_fail_errno(error, folder, "the folder cannot be made");
}

ebpo_status ebpo_folder_publish(const char *making, const char *folder, ebpo_error *error)
{
    mode_t mask = umask(0);
    umask(mask);
    if (chmod(making, 0777 & ~mask) != 0 || rename(making, folder) != 0)
        return ebpo_fail_errno(error, folder, "the folder cannot be renamed to its final name");
    return EBPO_OK;
}
