/* Names of files that go when this process is ended by a signal: outputs in the making, and locks.
 */
#ifndef EBPO_IO_UNFINISHED_H
#define EBPO_IO_UNFINISHED_H

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

#endif
