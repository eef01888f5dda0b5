/* Models in files: built, written, opened; whatever fails ends the test with its message. */
#ifndef EBPO_TESTS_MODEL_FILE_H
#define EBPO_TESTS_MODEL_FILE_H

#include <ebpo/build.h>
#include <ebpo/file.h>

/* Ends the program unless the status is EBPO_OK; `what` was being done. */
void model_must(ebpo_status status, const char *what, const ebpo_error *error);

/* Of a mesh, which it takes. NULL: the usual options. */
ebpo_tree model_build(ebpo_mesh mesh, const ebpo_build_options *options);
/* With so many faces a leaf and these parts (bits of ebpo_part). */
ebpo_tree model_build_parts(ebpo_mesh mesh, uint32_t leaf_faces, uint32_t parts);
/* Frees the tree. NULL: the usual options. */
void model_write(ebpo_tree *tree, const char *path, const ebpo_write_options *options);
ebpo_file *model_open(const char *path);

#endif
