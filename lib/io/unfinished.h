/* Removes unfinished files: outputs and lock files of this process when a signal ends the process,
 * and temporary files that killed processes have left. */
#ifndef EBPO_IO_UNFINISHED_H
#define EBPO_IO_UNFINISHED_H

/* The functions ebpo_unfinished_... use the registry: the names of the files that are removed when
 * a signal ends this process. */

enum { EBPO_UNFINISHED_MAX = 32 }; /* number of slots for names */

/* Reserves and returns a slot for one name. Returns -1 if all slots are in use. */
int ebpo_unfinished_reserve(void);

/* Registers a file for removal; `path` has less than PATH_MAX bytes. */
void ebpo_unfinished_set(int slot, const char *path);

/* Unregisters the file; the caller keeps the slot. */
void ebpo_unfinished_unset(int slot);

/* Unregisters the file and frees the slot. Does nothing if the slot is -1. */
void ebpo_unfinished_forget(int slot);

/* Removes all registered files. Calls only unlink, so a signal handler may call this function. */
void ebpo_unfinished_remove(void);

/* Names of temporary files contain at most this number of bytes of the output's name. This is
 * enough to recognise the output, and keeps the names below the common limit of 255 bytes. */
enum { EBPO_TARGET_NAME_KEPT = 200 };

/* Removes abandoned temporary files of the output `name` in `folder`. A file is abandoned if the
 * process that made it does not exist, and no process on any machine holds its lock (flock). Files
 * that cannot be examined or removed stay. */
void ebpo_remove_stale_files(const char *folder, const char *name);

#endif
