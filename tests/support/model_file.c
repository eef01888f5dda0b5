#include "model_file.h"

#include <stdio.h>
#include <stdlib.h>

/* Does not use ck_assert, because programs without Check also call this function. */
void model_must(ebpo_status status, const char *what, const ebpo_error *error)
{
    if (status == EBPO_OK)
        return;
    fprintf(stderr, "%s: %s\n", what, error->message);
    abort();
}

ebpo_tree model_build(ebpo_mesh mesh, const ebpo_build_options *options)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh_report report;
    ebpo_repair_record repair_record = { 0 };
    ebpo_build_options standard = EBPO_BUILD_OPTIONS_INIT;
    ebpo_tree tree;
    model_must(ebpo_mesh_check(&mesh, 1, standard.progress, &report, &error), "checking", &error);
    model_must(ebpo_build(&mesh, &report, &repair_record, options ? options : &standard, &tree,
                          &error),
               "building", &error);
    return tree;
}

ebpo_tree model_build_parts(ebpo_mesh mesh, uint32_t leaf_faces, uint32_t parts)
{
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    options.leaf_faces = leaf_faces;
    options.parts = parts;
    return model_build(mesh, &options);
}

void model_write(ebpo_tree *tree, const char *path, const ebpo_write_options *options)
{
    ebpo_error error = EBPO_ERROR_INIT;
    model_must(ebpo_tree_write(tree, path, options, &error), "writing", &error);
    ebpo_tree_free(tree);
}

ebpo_file *model_open(const char *path)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    model_must(ebpo_open(path, &file, &error), "opening", &error);
    return file;
}
