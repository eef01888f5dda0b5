/* Finds the files of models below a folder. */
#ifndef EBPO_TOOLS_FOLDER_FILES_H
#define EBPO_TOOLS_FOLDER_FILES_H

#include <stdbool.h>
#include <stddef.h>

typedef struct folder_files {
    const char *command; /* for messages */
    char **path;         /* [count] below the folder, without its name, sorted by bytes */
    size_t count, capacity;
    size_t unread; /* folders, or possible folders, that could not be read, which was reported */
    bool no_memory;
} folder_files;

/* Finds files whose names end in .h5 or .hdf5, except paint files and names that begin with a dot.
 * Follows links to files, not links to folders. Returns false if the folder itself cannot be read
 * (reported on stderr), or if there is not enough memory (`no_memory`). Call folder_files_free in
 * any case. */
bool folder_files_find(folder_files *files, const char *command, const char *folder);
/* Returns a copy of the path without control characters, as in errors of the library: names are
 * untrusted input. Returns NULL if there is not enough memory. */
char *folder_files_shown(const char *path);
void folder_files_free(folder_files *files);

#endif
