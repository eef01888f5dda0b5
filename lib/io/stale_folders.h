/* Names of folders in the making, and those that killed writers left. */
#ifndef EBPO_IO_STALE_FOLDERS_H
#define EBPO_IO_STALE_FOLDERS_H

/* "FOLDER.part-SYSTEM-PROCESS-XXXXXX" for mkdtemp, where SYSTEM says to whom the process's number
 * means anything; of a long name the beginning. Freed by free(); NULL: no memory. */
char *ebpo_making_name(const char *folder);

/* Gives the folder that was made under that name the one with its inode in place of XXXXXX: where
 * another folder is put there in exchange, it is not taken for the one that was made. */
void ebpo_making_settle(char **made);

/* Removes folders in the making for `folder`, with what is in them, that nobody fills any more:
 * they are of this user and of a process of this system that is not there. What cannot be looked at
 * or removed stays. */
void ebpo_remove_stale_folders(const char *folder);

#endif
