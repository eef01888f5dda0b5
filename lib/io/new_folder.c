/* Folders that appear whole or not at all: made beside their places, and renamed. */
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <stdio.h>

#include <ebpo/base.h>

#include "core/error.h"
#include "io/stale_folders.h"

ebpo_status ebpo_folder_begin(const char *folder, char **making, ebpo_error *error)
{
    struct stat st;
    *making = NULL;
    if (stat(folder, &st) == 0)
        return ebpo_fail_file(error, EBPO_E_IO, folder,
                              "is there already; what is written has to be a new folder");
    ebpo_remove_stale_folders(folder);
    char *path = ebpo_making_name(folder);
    if (!path)
        return ebpo_fail_memory(error, strlen(folder));
    if (mkdtemp(path)) {
        ebpo_making_settle(&path);
        *making = path;
        return EBPO_OK;
    }
    free(path);
    return ebpo_fail_errno(error, folder, "the folder cannot be made");
}

ebpo_status ebpo_folder_publish(const char *making, const char *folder, ebpo_error *error)
{
    mode_t mask = umask(0);
    umask(mask);
    if (chmod(making, 0777 & ~mask) != 0 || rename(making, folder) != 0)
        return ebpo_fail_errno(error, folder, "the folder cannot be put in its place");
    return EBPO_OK;
}
