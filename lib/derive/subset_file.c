/* A subset becomes a file. */
#include "core/strict_fp.h"

#include "core/fp_env.h"
#include "core/sized.h"
#include "format/write_file.h"
#include "io/publish.h"
#include "derive/subset_parts.h"

uint64_t ebpo_subset_memory(uint64_t face_count, uint32_t leaf_faces)
{
    /* bytes a face, measured: the mesh and what is known of it, and that of leaves, the more of
     * them the smaller they are */
    enum { OF_MESH = 130, OF_LEAVES = 1800, OF_LEAVES_MOST = 430, ANYHOW = 16 << 20 };
    double leaves = OF_LEAVES / (double)leaf_faces;
    return (uint64_t)((double)face_count *
                          (OF_MESH + (leaves < OF_LEAVES_MOST ? leaves : OF_LEAVES_MOST)) +
                      ANYHOW);
}

ebpo_status ebpo_subset(const ebpo_file *file, const char *path, const ebpo_subset_options *options,
                        ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_subset_options wanted = EBPO_SUBSET_OPTIONS_INIT;
    ebpo_publish out = EBPO_PUBLISH_INIT;
    ebpo_tree tree;
    ebpo_status status = EBPO_TAKE(ebpo_subset_options, &wanted, options, error);
    if (status != EBPO_OK)
        return status;
    if (wanted.target_bytes)
        return ebpo_subset_fit(file, path, &wanted, error);
    status = ebpo_subset_tree(&tree, file, &wanted, error);
    if (status != EBPO_OK)
        return status;
    ebpo_write_options write = ebpo_subset_write_options(&wanted);
    status = ebpo_publish_begin(&out, path, error);
    if (status == EBPO_OK) {
        ebpo_publish_expect_input(&out, &file->in);
        status = ebpo_tree_write_into(&tree, ebpo_publish_path(&out), path, &write, error);
    }
    ebpo_tree_free(&tree);
    if (status == EBPO_OK)
        status = ebpo_publish_commit(&out, error);
    ebpo_publish_abort(&out);
    return status;
}

ebpo_status ebpo_subset_of_tree(ebpo_tree *tree, const char *path,
                                const ebpo_subset_options *options, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_subset_options wanted = EBPO_SUBSET_OPTIONS_INIT;
    ebpo_publish whole = EBPO_PUBLISH_INIT;
    ebpo_file *file = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_subset_options, &wanted, options, error);
    ebpo_write_options write = ebpo_subset_write_options(&wanted);
    if (status == EBPO_OK)
        status = ebpo_publish_begin(&whole, path, error);
    if (status == EBPO_OK)
        status = ebpo_tree_write_into(tree, ebpo_publish_path(&whole), path, &write, error);
    ebpo_tree_free(tree);
    if (status == EBPO_OK)
        status = ebpo_open_own(ebpo_publish_path(&whole), &file, error);
    if (status == EBPO_OK)
        status = ebpo_subset(file, path, &wanted, error);
    ebpo_close(file);
    ebpo_publish_abort(&whole);
    return status;
}
