/* Removes unfinished files: outputs and locks when a signal ends the process, and files that killed
 * processes have left. */
#ifndef EBPO_IO_UNFINISHED_H
#define EBPO_IO_UNFINISHED_H

/* The registry: names of files that are removed when a signal ends this process, namely unfinished
 * outputs and locks. */

enum { EBPO_UNFINISHED_MAX = 32 }; /* greatest number of files at one time */

/* Returns a slot for one name; -1: all slots are in use. */
int ebpo_unfinished_reserve(void);

/* Registers a file for removal; `path` has less than PATH_MAX bytes. */
void ebpo_unfinished_set(int slot, const char *path);

/* Unregisters the file; the caller keeps the slot. */
void ebpo_unfinished_unset(int slot);

/* Unregisters the file and frees the slot. Does nothing if the slot is -1. */
void ebpo_unfinished_forget(int slot);

/* Removes all registered files. Calls only unlink, so a signal handler may call this function. */
void ebpo_unfinished_remove(void);

/* Number of bytes of a target's name that the names of its temporary files contain: enough to
 * recognise the target, and few enough to keep names below the common limit of 255. */
enum { EBPO_TARGET_NAME_KEPT = 200 };

/* Removes abandoned temporary files for `name` in `folder`: their process does not exist, and no
 * process on any machine holds their lock (flock). Files that cannot be examined or removed stay.
 */
void ebpo_remove_stale_files(const char *folder, const char *name);

#endif
