/* Writes a file without publishing it. */
#ifndef EBPO_FORMAT_WRITE_FILE_H
#define EBPO_FORMAT_WRITE_FILE_H

#include <ebpo/file.h>

/* Writes the same bytes as ebpo_tree_write, but directly into `path`, an existing file that is
 * overwritten. Does not sync the file. On failure the file is incomplete. `shown`: name for
 * messages. */
EBPO_MUST_USE ebpo_status ebpo_tree_write_into(const ebpo_tree *tree, const char *path,
                                               const char *shown, const ebpo_write_options *options,
                                               ebpo_error *error);

#endif
