/* What is not finished yet, or never will be: outputs and locks that go with the process, and what
 * processes that were killed have left. */
#ifndef EBPO_IO_UNFINISHED_H
#define EBPO_IO_UNFINISHED_H

/* Names of files that go when this process is ended by a signal: outputs in the making, and locks.
 */

enum { EBPO_UNFINISHED_MOST = 32 }; /* at a time */

/* Returns a slot for one name; -1: all are taken. */
int ebpo_unfinished_reserve(void);

/* From here on the file goes; `path` has less than PATH_MAX bytes. */
void ebpo_unfinished_set(int slot, const char *path);

/* The file stays, the slot is still the caller's. */
void ebpo_unfinished_unset(int slot);

/* The file stays, and the slot is free. -1: nothing is done. */
void ebpo_unfinished_forget(int slot);

/* Removes all of them. Only calls unlink: allowed in a signal handler. */
void ebpo_unfinished_remove(void);

/* Temporary files of writers that were killed. */

/* Bytes of a target's name that its temporary files begin with: enough to recognise it, and few
 * enough to keep the sum below the usual limit of 255. */
enum { EBPO_TARGET_NAME_KEPT = 200 };

/* Removes temporary files for `name` in `folder` that nobody writes any more: their process is not
 * there, and nobody, of another machine either, holds their lock (flock). What cannot be looked at
 * or removed stays. */
void ebpo_remove_stale_files(const char *folder, const char *name);

#endif
