/* Opening a file that lies below a folder, whatever happens to names meanwhile. */
#ifndef EBPO_IO_OPEN_BELOW_H
#define EBPO_IO_OPEN_BELOW_H

/* A descriptor for reading, which does not wait for pipes; -1: as errno says, EXDEV where the name
 * leads out of the folder. Links are followed while they stay below it; where the system cannot
 * tell that at the moment of opening (Linux before 5.6), links are not followed at all. Any thread.
 */
int ebpo_open_below(const char *folder, const char *name);

#endif
