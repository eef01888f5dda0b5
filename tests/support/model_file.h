/* Builds, writes and opens models in files; a failure ends the test with its message. */
#ifndef EBPO_TESTS_MODEL_FILE_H
#define EBPO_TESTS_MODEL_FILE_H

#include <ebpo/build.h>
#include <ebpo/file.h>

/* Ends the program unless the status is EBPO_OK; `what` names the operation. */
void model_must(ebpo_status status, const char *what, const ebpo_error *error);

/* Builds a tree of a mesh, which is consumed. NULL: default options. */
ebpo_tree model_build(ebpo_mesh mesh, const ebpo_build_options *options);
/* Builds a tree with this number of faces per leaf and these parts (ebpo_part bits). */
ebpo_tree model_build_parts(ebpo_mesh mesh, uint32_t leaf_faces, uint32_t parts);
/* Writes and frees the tree. NULL: default options. */
void model_write(ebpo_tree *tree, const char *path, const ebpo_write_options *options);
ebpo_file *model_open(const char *path);

#endif
