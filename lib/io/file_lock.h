/* Provides locks for programs that read, change and replace the file at a path. Locks affect only
 * programs that use this library.
 *
 * The lock of a file NAME is the empty file ".NAME.lock" in the same folder. The lock file is
 * locked by flock, and removed when the lock is released. NAME itself is not locked, because it is
 * replaced, and because libhdf5 locks files that it reads. If a process is killed, its lock file
 * remains, unlocked; the next process uses and removes this file. */
#ifndef EBPO_IO_FILE_LOCK_H
#define EBPO_IO_FILE_LOCK_H

#include <ebpo/base.h>

typedef struct ebpo_file_lock {
    int fd;       /* descriptor of the lock file; -1: not held */
    int slot;     /* index in the registry of unfinished files (unfinished.h); -1: none */
    long process; /* id of the process that took the lock; a child process must not release it */
    char *path;
} ebpo_file_lock;

#define EBPO_FILE_LOCK_INIT \
    {                       \
        -1, -1, 0, NULL     \
    }

/* Seconds that a save waits for other saves. */
#define EBPO_FILE_LOCK_SAVING 10.0

/* Waits up to `seconds` for the lock of the file at `path`, which need not exist. Reports the stage
 * "waiting" to `progress`, which may be NULL. If locking is not possible, returns EBPO_OK and sets
 * lock->fd to -1. This happens if the file system has no locks, if the folder has no write
 * permission, or if a file with the lock file's name is not empty. EBPO_E_IO: another program still
 * has the lock. EBPO_E_CANCELLED: `progress` has stopped the call. EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_file_lock_take(ebpo_file_lock *lock, const char *path,
                                              double seconds, const ebpo_progress *progress,
                                              ebpo_error *error);

/* Releases the lock. Does nothing if no lock is held. */
void ebpo_file_lock_release(ebpo_file_lock *lock);

#endif
