/* The files of models below a folder. */
#ifndef EBPO_TOOLS_FOLDER_FILES_H
#define EBPO_TOOLS_FOLDER_FILES_H

#include <stdbool.h>
#include <stddef.h>

typedef struct folder_files {
    const char *command; /* for messages */
    char **path;         /* [count] below the folder, without its name, sorted by bytes */
    size_t count, capacity;
    size_t unread; /* folders, or what may be some, that could not be read, which has been said */
    bool no_memory;
} folder_files;

/* Names that end in .h5 or .hdf5; not those that begin with a dot, nor paint. Links to files are
 * followed, links to folders are not. False: the folder itself cannot be read (said on stderr), or
 * `no_memory`. folder_files_free in any case. */
bool folder_files_find(folder_files *files, const char *command, const char *folder);
/* A copy without control characters, as errors of the library have it: strangers chose the names.
 * NULL: no memory. */
char *folder_files_shown(const char *path);
void folder_files_free(folder_files *files);

#endif
