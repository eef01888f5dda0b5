/* The whole tree as a slice. */
#include <stdlib.h>
#include <string.h>

#include "core/error.h"
#include "core/arrays.h"
#include "format/reader.h"
#include "format/slice.h"

/* What a slice does not have. */
static void drop_arrays(ebpo_level *level)
{
    ebpo_level_drop(level, EBPO_NEEDS_LEAF_PLANES);
    level->leaf_plane_count = 0;
    level->gray_volume = level->leaf_volume = 0;
}

ebpo_status ebpo_slice_read_all(ebpo_slice *out, const ebpo_file *file, unsigned threads,
                                ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    if (!(file->info.parts & EBPO_PART_MESH))
        return ebpo_fail_file(error, EBPO_E_ABSENT, file->in.shown,
                              "the file was written without its mesh; build it again with it");
    ebpo_tree tree;
    ebpo_read_options read = ebpo_read_threads(threads);
    ebpo_status status = ebpo_file_read_tree(file, &read, &tree, error);
    if (status != EBPO_OK)
        return status;
    out->level_count = file->info.level_count;
    out->pruned = file->info.pruned;
    for (int i = 0; i < out->level_count; i++) {
        drop_arrays(&tree.level[i]);
        out->level[i] = tree.level[i];
        memset(&tree.level[i], 0, sizeof tree.level[i]);
    }
    out->root.type = (ebpo_node_type)out->level[0].types[0];
    out->face_count = tree.mesh.face_count;
    out->mesh = tree.mesh;
    memset(&tree.mesh, 0, sizeof tree.mesh);
    out->face_source = tree.face_source;
    tree.face_source = NULL;
    ebpo_tree_free(&tree);
    return EBPO_OK;
}
