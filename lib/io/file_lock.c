/* Locks the file at a path: makes a lock file in the same folder, and locks the lock file by flock.
 * The system releases this lock when the process ends. If another process removes the lock file
 * between opening and locking, a new lock file is made. Locks affect only programs that use this
 * library, and some file systems have no locks, so replacing a file also compares versions
 * (publish.c). */
#include "io/file_lock.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "core/os.h"
#include "core/error.h"
#include "core/parallel.h"
#include "io/file_source.h"
#include "io/unfinished.h"

/* Opens the lock file, and makes the file if necessary. Opens it for writing, because locks over
 * NFS require this, or only for reading if the file belongs to another user. Returns -1 with errno
 * on failure. EACCES: the lock file cannot be made or read. */
static int open_lock_file(const char *path)
{
    enum { FLAGS = O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY };
    int fd = open(path, O_RDWR | FLAGS);
    if (fd < 0 && errno == ENOENT)
        return open(path, O_RDWR | O_CREAT | O_EXCL | FLAGS, 0666);
    if (fd < 0 && errno == EACCES && (fd = open(path, O_RDONLY | FLAGS)) < 0 && errno == ENOENT)
        errno = EEXIST; /* the file existed: try again */
    return fd;
}

/* Returns true if the file is regular and empty. Another file with the name of a lock file must not
 * be removed. */
static bool is_lock_file(int fd)
{
    struct stat st;
    return fstat(fd, &st) == 0 && S_ISREG(st.st_mode) && st.st_size == 0;
}

/* Returns true if the descriptor's file still has the name `path`. The previous holder of the lock
 * may have removed the name. */
static bool has_its_name(int fd, const char *path)
{
    struct stat opened, named;
    return fstat(fd, &opened) == 0 && lstat(path, &named) == 0 && opened.st_dev == named.st_dev &&
           opened.st_ino == named.st_ino;
}

/* Result of try_lock. BUSY: another process has the lock. NO_LOCKS: locking is not possible. */
typedef enum attempt { TAKEN, BUSY, NO_LOCKS } attempt;

/* Tries to take the lock without waiting. Tries again if another process made or removed the lock
 * file at the same moment. */
static attempt try_lock(ebpo_file_lock *lock)
{
    for (int tries = 0; tries < 100; tries++) {
        int fd = open_lock_file(lock->path);
        if (fd < 0 && (errno == EEXIST || errno == EINTR))
            continue; /* another process has just made or removed the lock file */
        if (fd < 0)
            return NO_LOCKS;
        if (!is_lock_file(fd)) {
            close(fd);
            return NO_LOCKS;
        }
        if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
            attempt result = errno == EWOULDBLOCK || errno == EINTR ? BUSY : NO_LOCKS;
            /* EBADF: the lock file belongs to another user, and must stay */
            if (result == NO_LOCKS && errno != EBADF)
                unlink(lock->path);
            close(fd);
            return result;
        }
        if (has_its_name(fd, lock->path)) {
            lock->fd = fd;
            return TAKEN;
        }
        close(fd);
    }
    return BUSY;
}

/* Waits before the next attempt, longer after the first 20 attempts. */
static void pause_between(unsigned attempts)
{
    long ms = attempts < 20 ? 5 : 50;
    nanosleep(&(struct timespec){ 0, ms * 1000000 }, NULL);
}

/* Sets *out to the path of the lock file of the file at `path`. */
static ebpo_status name_lock_file(const char *path, char **out)
{
    char *target;
    ebpo_status status = ebpo_target_path(path, &target, NULL);
    if (status != EBPO_OK)
        return status;
    const char *name = ebpo_path_name(target);
    int folder = (int)(name - target);
    if (asprintf(out, "%.*s.%.*s.lock", folder, target, EBPO_TARGET_NAME_KEPT, name) < 0) {
        *out = NULL;
        status = EBPO_E_MEMORY;
    }
    free(target);
    return status;
}

ebpo_status ebpo_file_lock_take(ebpo_file_lock *lock, const char *path, double seconds,
                                const ebpo_progress *progress, ebpo_error *error)
{
    double begun = ebpo_seconds();
    attempt result;
    *lock = (ebpo_file_lock)EBPO_FILE_LOCK_INIT;
    ebpo_status status = name_lock_file(path, &lock->path);
    if (status != EBPO_OK)
        return status == EBPO_E_MEMORY ? ebpo_fail_memory(error, strlen(path)) : EBPO_OK;
    for (unsigned i = 0; (result = try_lock(lock)) == BUSY; i++) {
        if (!ebpo_progress_stage(progress, "waiting", error)) {
            ebpo_file_lock_release(lock);
            return EBPO_E_CANCELLED;
        }
        if (ebpo_seconds() - begun >= seconds) {
            ebpo_file_lock_release(lock);
            return ebpo_fail_file(error, EBPO_E_IO, path,
                                  "another program has been changing the file for %.3g s; try "
                                  "again later, or write to another file",
                                  seconds);
        }
        pause_between(i);
    }
    if (result == TAKEN) {
        lock->process = (long)getpid();
        lock->slot = strlen(lock->path) < PATH_MAX ? ebpo_unfinished_reserve() : -1;
        if (lock->slot >= 0)
            ebpo_unfinished_set(lock->slot, lock->path);
    } else {
        ebpo_file_lock_release(lock);
    }
    return EBPO_OK;
}

void ebpo_file_lock_release(ebpo_file_lock *lock)
{
    if (lock->fd >= 0 && lock->process == (long)getpid()) {
        /* removed before the release, so that the next holder sees that the name is gone */
        unlink(lock->path);
        flock(lock->fd, LOCK_UN);
    }
    if (lock->fd >= 0)
        close(lock->fd);
    ebpo_unfinished_forget(lock->slot);
    free(lock->path);
    *lock = (ebpo_file_lock)EBPO_FILE_LOCK_INIT;
}
