/* Removes unfinished files. When a signal ends this process, its outputs and lock files are
 * removed. Their names are in static memory with atomic states, because a signal handler reads the
 * names. Temporary files and folders of killed processes are also removed. Their names contain the
 * id of a process that has ended, and no process holds a lock of such a file. Files that cannot be
 * examined or removed stay. This file also creates new folders atomically: a folder is made under
 * another name in the same parent folder, filled by the caller, and renamed. */
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

/* States of a slot. TAKEN: reserved without a file. LIVE: `path` is a file to remove. */
enum { SLOT_FREE, SLOT_TAKEN, SLOT_LIVE };
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

/* A temporary file of the output NAME has the name ".NAME.PROCESS-NUMBER.tmp". Returns the process
 * id in the file name `file`, or 0 if it is not such a name for the output `name`. */
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

/* Parts of the name of an unfinished folder (making_name). */
static const char MARK[] = ".part-", MADE[] = "XXXXXX";

/* Returns a number that identifies this namespace of process ids (container) until the machine is
 * restarted. A process id in a file name is valid only together with this number, because on
 * another machine the process may still run. Returns 0 if the number is not known. */
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

/* Returns the length of the path `folder` without slashes at its end, and with at most
 * EBPO_TARGET_NAME_KEPT bytes of its last part. *name: offset of the last part. */
static size_t without_slashes(const char *folder, size_t *name)
{
    size_t size = strlen(folder);
    while (size > 1 && folder[size - 1] == '/')
        size--;
    for (*name = size; *name && folder[*name - 1] != '/';)
        --*name;
    return size - *name > EBPO_TARGET_NAME_KEPT ? *name + EBPO_TARGET_NAME_KEPT : size;
}

/* Returns "FOLDER.part-SYSTEM-PROCESS-XXXXXX" for mkdtemp. SYSTEM: system_number(). Long names are
 * cut. The caller frees the result. Returns NULL when out of memory. */
static char *making_name(const char *folder)
{
    char *path;
    size_t name, size = without_slashes(folder, &name);
    if (asprintf(&path, "%.*s%s%08" PRIx32 "-%ld-%s", (int)size, folder, MARK, system_number(),
                 (long)getpid(), MADE) < 0)
        return NULL;
    return path;
}

/* Renames the folder that mkdtemp has made: the folder's inode number replaces the random letters.
 * If another folder gets this name later, the inode number differs, so remove_one does not remove
 * its content. */
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

/* Returns the text after the process id in `file`, a name that settle_making has made for a folder.
 * Returns NULL for other names, and if the process with this id exists. `name`: the beginning of
 * the folder's name, of `kept` bytes. `system`: system_number(). */
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

/* Removes the files in a folder, but not folders, because the library makes no folders there. */
static void empty_folder(int fd)
{
    DIR *d = fdopendir(fd);
    for (struct dirent *e; d && (e = readdir(d));)
        (void)unlinkat(dirfd(d), e->d_name, 0);
    if (d)
        closedir(d);
    else
        close(fd);
}

/* Removes an unfinished folder of this user. `suffix`: the end of the folder's name. If the suffix
 * is the folder's inode number, removes the files in the folder first. Otherwise removes the folder
 * only if it is empty. */
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

/* Removes the unfinished folders of the output `folder` that are abandoned, with their content. A
 * folder is abandoned if this user owns it, and a process of this system that has ended made it.
 * Files that cannot be examined or removed stay. */
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
                              "exists already; name a new folder for the output");
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
