/* Writes a model (ebpo_tree) into an existing or a temporary file, and repacks files. */
#ifndef EBPO_FORMAT_WRITE_FILE_H
#define EBPO_FORMAT_WRITE_FILE_H

#include <ebpo/file.h>

/* Writes the same bytes as ebpo_tree_write, but directly into `path`, an existing file that is
 * overwritten. Does not sync the file. On failure the file is incomplete. `shown`: name for
 * messages. */
EBPO_MUST_USE ebpo_status ebpo_tree_write_into(const ebpo_tree *tree, const char *path,
                                               const char *shown, const ebpo_write_options *options,
                                               ebpo_error *error);

/* Writes a tree to a temporary file in `folder`, and opens the file. libhdf5 needs a name for
 * writing, so the file first has a name that begins with `name`. This name is removed after the
 * file has been opened. */
EBPO_MUST_USE ebpo_status ebpo_tree_store(const ebpo_tree *tree, const char *folder,
                                          const char *name, const ebpo_write_options *options,
                                          ebpo_file **out, ebpo_error *error);

/* Callback of ebpo_repack_with: adds parts to the tree. The content checksum must not change, so
 * only parts with a separate checksum (colours, border, surface) may be added. `options` has the
 * number of threads and the progress. */
typedef ebpo_status ebpo_change_tree_fn(ebpo_tree *tree, const ebpo_write_options *options,
                                        ebpo_error *error);
/* Same as ebpo_file_repack, but calls `change` after reading the tree and before writing it.
 * `change` may be NULL. */
EBPO_MUST_USE ebpo_status ebpo_repack_with(const ebpo_file *file, const char *path,
                                           const ebpo_read_options *read,
                                           const ebpo_write_options *write,
                                           ebpo_change_tree_fn *change, ebpo_error *error);

#endif
