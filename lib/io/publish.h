/* Output files that appear whole or not at all: temporary name in the same folder, fsync, rename,
 * fsync of the folder.
 *
 *     ebpo_publish out = EBPO_PUBLISH_INIT;
 *     status = ebpo_publish_begin(&out, path, error);
 *     ... write through ebpo_publish_stream(&out), or let a library open ebpo_publish_path(&out) by
 * name ... status = ebpo_publish_commit(&out, error); done: ebpo_publish_abort(&out);      (nothing
 * is left to do after a commit)
 */
#ifndef EBPO_IO_PUBLISH_H
#define EBPO_IO_PUBLISH_H

#include <stdbool.h>
#include <stdio.h>
#include <sys/types.h>
#include <time.h>

#include <ebpo/base.h>

#include "io/byte_source.h"

/* Which version of a file is at a path. */
typedef struct ebpo_file_version {
    bool there; /* false: no file; the rest does not count */
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
    char *target; /* absolute, so that a change of the working folder does no harm */
    char *folder; /* of the target; ends with '/' */
    char *temporary;
    FILE *stream; /* NULL until asked for */
    char *buffer; /* of the stream */
    int fd;       /* of the temporary file */
    int slot;     /* in the registry of temporary files */
    int mode;     /* of the file that was there at the beginning; -1: there was none */
    bool expects; /* that `expected` is still what is at the target when it is replaced */
    bool locked;  /* by the caller */
    ebpo_file_version expected;
} ebpo_publish;

#define EBPO_PUBLISH_INIT                                                       \
    {                                                                           \
        NULL, NULL, NULL, NULL, NULL, NULL, -1, -1, -1, false, false, { false } \
    }

/* Creates the temporary file, exclusively. An existing regular file at `path` is replaced on
 * commit; the new one takes over its mode and, where the system allows, its owner, its extended
 * attributes and with these its access control list; other names that it has (hard links) keep the
 * old file. Where there is none, the mode is 0666 less the umask. A folder, device or symbolic link
 * at `path` is EBPO_E_IO, so is a folder that cannot be written. On failure nothing is left behind.
 * Temporary files for the same target that killed processes have left are removed.
 * EBPO_E_LIMIT: the process has EBPO_UNFINISHED_MOST outputs and locks (io/file_lock.h) already. */
EBPO_MUST_USE ebpo_status ebpo_publish_begin(ebpo_publish *out, const char *path,
                                             ebpo_error *error);

/* For an output that was made from what is at its target: the commit replaces that version, or
 * nothing, and fails with EBPO_E_IO where another program has put another version there. The two
 * steps are under the target's lock (io/file_lock.h), which the caller has if `locked`. */
void ebpo_publish_expect(ebpo_publish *publish, const ebpo_file_version *expected, bool locked);

/* The same for an output that takes the place of `input`; does nothing for others. What is there
 * now counts as the version where the input reads a copy. */
void ebpo_publish_expect_input(ebpo_publish *publish, const ebpo_input *input);

/* Absolute name of the temporary file, for libraries that open by name (truncating is fine). Lent
 * until commit or abort. */
const char *ebpo_publish_path(const ebpo_publish *publish);

/* A stream on the temporary file, opened at the first call; NULL when memory is short. Commit and
 * abort close it. */
FILE *ebpo_publish_stream(ebpo_publish *publish);

/* Flushes, syncs and renames. The caller has closed the file if it opened it by name. On failure
 * the temporary file is removed and the target is as it was (but when only the last step failed,
 * the sync of the folder: then the new file is in place). */
EBPO_MUST_USE ebpo_status ebpo_publish_commit(ebpo_publish *publish, ebpo_error *error);

/* The same for two files that belong together: both, or, on failure, neither (but when only the
 * sync of the folder failed). Where one cannot be exchanged for the other at once, as on some file
 * systems, the first may be in place when the second cannot be. Two programs that do this at once
 * take turns: the files that are then there are of one of them. */
EBPO_MUST_USE ebpo_status ebpo_publish_commit_pair(ebpo_publish *first, ebpo_publish *second,
                                                   ebpo_error *error);

/* Closes and removes the temporary file. Harmless on EBPO_PUBLISH_INIT and after a commit. */
void ebpo_publish_abort(ebpo_publish *publish);

#endif
