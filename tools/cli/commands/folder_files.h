/* Finds the files of models below a folder. */
#ifndef EBPO_TOOLS_FOLDER_FILES_H
#define EBPO_TOOLS_FOLDER_FILES_H

#include <stdbool.h>
#include <stddef.h>

typedef struct folder_files {
    const char *command; /* for messages */
    char **path;         /* [count] paths relative to the folder, sorted by bytes */
    size_t count, capacity;
    size_t unread;  /* number of folders, or possible folders, that could not be read */
    bool no_memory; /* the search ended because there is not enough memory */
} folder_files;

/* Finds files whose names end in .h5 or .hdf5, except paint files and names that begin with a dot.
 * Follows links to files, not links to folders. Reports unreadable folders on standard error.
 * Returns false if the folder itself cannot be read, or if there is not enough memory
 * (`no_memory`). Call folder_files_free in any case. */
bool folder_files_find(folder_files *files, const char *command, const char *folder);
/* Returns a copy of the path for messages, with blanks instead of control characters, because names
 * are untrusted input. Returns NULL if there is not enough memory. */
char *folder_files_shown(const char *path);
void folder_files_free(folder_files *files);

#endif
