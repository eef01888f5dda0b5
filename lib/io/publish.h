/* Replaces output files atomically. The output is written under a temporary name in the same
 * folder, synced, and renamed to the target (the path that the caller has named); then the folder
 * is synced.
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

/* Returns the version of an open file. While the descriptor is open, no other file can get the same
 * inode. */
ebpo_file_version ebpo_file_version_of(int fd);

typedef struct ebpo_publish {
    char *shown;     /* the target as the caller named it, for messages */
    char *target;    /* absolute path, so that changing the working folder does no harm */
    char *folder;    /* folder of the target; ends with '/' */
    char *temporary; /* absolute path of the temporary file; NULL: there is none */
    FILE *stream;    /* NULL until first used */
    char *buffer;    /* buffer of the stream */
    int fd;          /* descriptor of the temporary file */
    int slot;        /* index in the registry of unfinished files (unfinished.h) */
    int mode;        /* mode of the target when ebpo_publish_begin was called; -1: no such file */
    bool expects;    /* true: the target must still have the version `expected` at the commit */
    bool locked;     /* true: the caller holds the target's lock (file_lock.h) */
    bool unsynced;   /* true: the commit does not wait for the disk */
    ebpo_file_version expected;
} ebpo_publish;

#define EBPO_PUBLISH_INIT                                                              \
    {                                                                                  \
        NULL, NULL, NULL, NULL, NULL, NULL, -1, -1, -1, false, false, false, { false } \
    }

/* Creates the temporary file. The commit replaces an existing regular file at `path`. The new file
 * then gets the mode of the replaced file. If the system allows this, the new file also gets the
 * owner and the extended attributes, including the access control list. Other hard links of the
 * replaced file keep the old content. If no file exists at `path`, the mode is 0666 without the
 * bits of the umask. EBPO_E_IO: `path` is a folder, device or symbolic link, or its folder has no
 * write permission. On failure, no temporary file remains. Also removes temporary files that killed
 * processes have left for the same target. EBPO_E_LIMIT: the process already has
 * EBPO_UNFINISHED_MAX outputs and locks (io/file_lock.h). */
EBPO_MUST_USE ebpo_status ebpo_publish_begin(ebpo_publish *out, const char *path,
                                             ebpo_error *error);

/* Sets the expected version of the target, for an output that was made from this version. The
 * commit replaces only this version, and fails with EBPO_E_IO if another program has replaced the
 * target. The commit compares and renames under the target's lock (io/file_lock.h). `locked`: true
 * if the caller already holds this lock. */
void ebpo_publish_expect(ebpo_publish *publish, const ebpo_file_version *expected, bool locked);

/* If the output replaces the file that `input` reads, same as ebpo_publish_expect with the version
 * of this file; otherwise does nothing. If the input reads a copy of the named file, the expected
 * version is the current version of the file at the target's path. */
void ebpo_publish_expect_input(ebpo_publish *publish, const ebpo_input *input);

/* Returns the absolute name of the temporary file, for libraries that open by name (truncating is
 * allowed). Valid until commit or abort. */
const char *ebpo_publish_path(const ebpo_publish *publish);

/* Returns a stream on the temporary file. The first call opens the stream; commit and abort close
 * it. Returns NULL when memory is short. */
FILE *ebpo_publish_stream(ebpo_publish *publish);

/* Flushes and syncs the temporary file, and renames it to the target. A caller that has opened the
 * file by name must close it first. On failure the temporary file is removed and the target is
 * unchanged. Exception: if only the last step, the sync of the folder, fails, the target is
 * replaced.
 */
EBPO_MUST_USE ebpo_status ebpo_publish_commit(ebpo_publish *publish, ebpo_error *error);

/* Releases the lock that showed that the temporary file was in use. Needed if a copy of publish.fd
 * stays open after the commit, because readers that lock files, such as the HDF5 library, could not
 * open the published file. */
void ebpo_publish_unlock(int fd);

/* Same as ebpo_publish_commit for two files that belong together. On success, both files are
 * replaced. On failure, no file is replaced, with two exceptions. If only the sync of a folder
 * fails, both files are replaced. On file systems without atomic exchange, the first file may be
 * replaced although the second file cannot be replaced. Two programs that replace the same pair
 * take turns, so the two files are always from the same program. */
EBPO_MUST_USE ebpo_status ebpo_publish_commit_pair(ebpo_publish *first, ebpo_publish *second,
                                                   ebpo_error *error);

/* Closes and removes the temporary file. Does nothing on EBPO_PUBLISH_INIT and after a commit. */
void ebpo_publish_abort(ebpo_publish *publish);

#endif
