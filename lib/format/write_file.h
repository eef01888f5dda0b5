/* Writes a file into an existing file, and repacks files. */
#ifndef EBPO_FORMAT_WRITE_FILE_H
#define EBPO_FORMAT_WRITE_FILE_H

#include <ebpo/file.h>

/* Writes the same bytes as ebpo_tree_write, but directly into `path`, an existing file that is
 * overwritten. Does not sync the file. On failure the file is incomplete. `shown`: name for
 * messages. */
EBPO_MUST_USE ebpo_status ebpo_tree_write_into(const ebpo_tree *tree, const char *path,
                                               const char *shown, const ebpo_write_options *options,
                                               ebpo_error *error);

/* Writes a tree to a temporary file in `folder`, opens it, and then removes its name, which libhdf5
 * needs. The name begins with `name`. */
EBPO_MUST_USE ebpo_status ebpo_tree_store(const ebpo_tree *tree, const char *folder,
                                          const char *name, const ebpo_write_options *options,
                                          ebpo_file **out, ebpo_error *error);

/* Adds parts to the tree of ebpo_repack_with. The parts must have separate checksums (colours,
 * surface). */
typedef ebpo_status ebpo_change_tree_fn(ebpo_tree *tree, unsigned threads, ebpo_error *error);
/* Same as ebpo_file_repack, but calls `change` after reading the tree and before writing it.
 * `change` may be NULL. */
EBPO_MUST_USE ebpo_status ebpo_repack_with(const ebpo_file *file, const char *path,
                                           const ebpo_read_options *read,
                                           const ebpo_write_options *write,
                                           ebpo_change_tree_fn *change, ebpo_error *error);

#endif
