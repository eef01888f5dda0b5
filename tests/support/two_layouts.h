/* Writes the same model to two files: with contiguous subtrees, and level by level. */
#ifndef EBPO_TESTS_TWO_LAYOUTS_H
#define EBPO_TESTS_TWO_LAYOUTS_H

#include <ebpo/subtree.h>

typedef struct two_layouts {
    const char *packed, *plain; /* paths in the program's scratch folder */
    ebpo_file *with, *without;  /* the open files, with and without contiguous subtrees */
} two_layouts;

/* Write both files of a tree, or of the tree that is built of a mesh; consume the tree or mesh.
 * Abort on failure. `parts`: ebpo_part bits. */
void two_layouts_write(two_layouts *out, ebpo_tree *tree, uint32_t parts, ebpo_codec codec,
                       uint64_t subtree_faces);
void two_layouts_build(two_layouts *out, ebpo_mesh mesh, uint32_t leaf_faces, uint32_t parts,
                       ebpo_codec codec, uint64_t subtree_faces);
void two_layouts_close(two_layouts *l);

/* Returns a checksum of all data of the subtree of an octcode, including faces and corners; *status
 * is the result of opening it. */
uint64_t subtree_sum(const ebpo_file *file, uint64_t octcode, ebpo_status *status);

/* Returns octcodes of the gray nodes and leaves of a level, from the types of the levels alone;
 * *count is their number. The caller frees them. Pruned nodes are omitted. */
uint64_t *octcodes_of_level(const ebpo_file *file, int level, uint64_t *count);

#endif
