/* Writing a file without publishing it. */
#ifndef EBPO_FORMAT_WRITE_FILE_H
#define EBPO_FORMAT_WRITE_FILE_H

#include <ebpo/file.h>

/* ebpo_tree_write straight into `path`, a file of the caller's that is overwritten: the same bytes,
 * not synced, and left half written on failure. `shown`: for messages. */
EBPO_MUST_USE ebpo_status ebpo_tree_write_into(const ebpo_tree *tree, const char *path,
                                               const char *shown, const ebpo_write_options *options,
                                               ebpo_error *error);

#endif
