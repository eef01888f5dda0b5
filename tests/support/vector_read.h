/* Reads a whole vector file, and returns the result as two lines: status, message. The message
 * omits the folder. */
#ifndef VECTOR_READ_H
#define VECTOR_READ_H
#include "read_by.h"

#include <stdio.h>
#include <string.h>

#include <ebpo/file.h>

static inline ebpo_status vector_read(const char *path, ebpo_tree *tree, ebpo_error *error)
{
    ebpo_file *file;
    ebpo_status status = ebpo_open(path, &file, error);
    if (status != EBPO_OK)
        return status;
    status = ebpo_file_read_tree(file, READ_BY(1), tree, error);
    if (status == EBPO_OK)
        status = ebpo_file_check_content(file, READ_BY(1), error);
    if (status != EBPO_OK)
        ebpo_tree_free(tree);
    ebpo_close(file);
    return status;
}

static inline void vector_outcome(const char *path, const ebpo_error *error, char *text,
                                  size_t size)
{
    const char *name = strrchr(path, '/') ? strrchr(path, '/') + 1 : path;
    const char *rest = strncmp(error->message, path, strlen(path)) == 0
                           ? error->message + strlen(path)
                           : error->message;
    snprintf(text, size, "%s\n%s%s\n", ebpo_status_name(error->status), name, rest);
}

#endif
