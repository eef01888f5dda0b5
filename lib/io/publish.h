/* Replaces output files atomically: temporary name in the same folder, fsync, rename, fsync of the
 * folder.
 *
 *     ebpo_publish out = EBPO_PUBLISH_INIT;
 *     status = ebpo_publish_begin(&out, path, error);
 *     ... write through ebpo_publish_stream(&out), or let a library open ebpo_publish_path(&out) by
 *     name ...
 *     status = ebpo_publish_commit(&out, error);
 *     done: ebpo_publish_abort(&out);      (does nothing after a commit) */
#ifndef EBPO_IO_PUBLISH_H
#define EBPO_IO_PUBLISH_H

#include <stdbool.h>
#include <stdio.h>
#include <sys/types.h>
#include <time.h>

#include <ebpo/base.h>

#include "io/byte_source.h"

/* Identifies the version of a file at a path. */
typedef struct ebpo_file_version {
    bool exists; /* false: there is no file, and the other fields are unused */
    dev_t device;
    ino_t inode;
    off_t size;
    struct timespec modified;
} ebpo_file_version;

/* Returns the version of an open file. While the descriptor is open, no later file can have the
 * same inode. */
ebpo_file_version ebpo_file_version_of(int fd);

typedef struct ebpo_publish {
    char *shown;  /* the target as the caller named it, for messages */
    char *target; /* absolute, so that changing the working folder does no harm */
    char *folder; /* folder of the target; ends with '/' */
    char *temporary;
    FILE *stream; /* NULL until first used */
    char *buffer; /* buffer of the stream */
    int fd;       /* descriptor of the temporary file */
    int slot;     /* in the registry of unfinished files (unfinished.h) */
    int mode;     /* mode of the file that existed at the beginning; -1: none */
    bool expects; /* the target must still have the version `expected` when it is replaced */
    bool locked;  /* the caller holds the lock */
    ebpo_file_version expected;
} ebpo_publish;

#define EBPO_PUBLISH_INIT                                                       \
    {                                                                           \
        NULL, NULL, NULL, NULL, NULL, NULL, -1, -1, -1, false, false, { false } \
    }

/* Creates the temporary file, exclusively. An existing regular file at `path` is replaced on
 * commit. The new file takes over the mode of the existing file and, where the system allows, its
 * owner and extended attributes, including the access control list; other hard links of the
 * replaced file keep the old content. If there is no such file, the mode is 0666 less the umask.
 * EBPO_E_IO: `path` is a folder, device or symbolic link, or its folder has no write permission. On
 * failure, no temporary file remains. Temporary files that killed processes left for the same
 * target are removed. EBPO_E_LIMIT: the process has EBPO_UNFINISHED_MAX outputs and locks
 * (io/file_lock.h) already. */
EBPO_MUST_USE ebpo_status ebpo_publish_begin(ebpo_publish *out, const char *path,
                                             ebpo_error *error);

/* Sets the expected version of the target, for an output that was made from this version. The
 * commit replaces only this version, and fails with EBPO_E_IO if another program has replaced the
 * target. Comparing and renaming happen under the target's lock (io/file_lock.h), which the caller
 * has taken if `locked` is true. */
void ebpo_publish_expect(ebpo_publish *publish, const ebpo_file_version *expected, bool locked);

/* Same as ebpo_publish_expect, for an output that replaces the file that `input` reads; does
 * nothing for other outputs. If the input reads a copy, the expected version is the current version
 * of the file at the path. */
void ebpo_publish_expect_input(ebpo_publish *publish, const ebpo_input *input);

/* Returns the absolute name of the temporary file, for libraries that open by name (truncating is
 * allowed). Valid until commit or abort. */
const char *ebpo_publish_path(const ebpo_publish *publish);

/* Returns a stream on the temporary file, opened at the first call; NULL when memory is short.
 * Commit and abort close it. */
FILE *ebpo_publish_stream(ebpo_publish *publish);

/* Flushes, syncs and renames. A caller that has opened the file by name must close it first. On
 * failure the temporary file is removed and the target is unchanged. Exception: if only the last
 * step, the sync of the folder, failed, the new file is in place. */
EBPO_MUST_USE ebpo_status ebpo_publish_commit(ebpo_publish *publish, ebpo_error *error);

/* Same as ebpo_publish_commit for two files that belong together: replaces both files, or, on
 * failure, none (unless only the sync of the folder failed). On file systems without atomic
 * exchange, the first file may be replaced although the second file cannot be. Two programs that
 * replace the same pair take turns, so the two files are always from the same program. */
EBPO_MUST_USE ebpo_status ebpo_publish_commit_pair(ebpo_publish *first, ebpo_publish *second,
                                                   ebpo_error *error);

/* Closes and removes the temporary file. Harmless on EBPO_PUBLISH_INIT and after a commit. */
void ebpo_publish_abort(ebpo_publish *publish);

#endif
