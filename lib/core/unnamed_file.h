/* Temporary files that no name leads to. */
#ifndef EBPO_CORE_UNNAMED_FILE_H
#define EBPO_CORE_UNNAMED_FILE_H

/* A descriptor; -1 and errno when it cannot be made. */
int ebpo_open_unnamed(const char *folder);

/* Removes the file that is being made just now, if it has a name: for signal handlers, just before
 * the process ends. */
void ebpo_workspace_abandon(void);

#endif
