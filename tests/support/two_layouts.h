/* The same model in two files: with subtrees that lie together, and level after level. */
#ifndef EBPO_TESTS_TWO_LAYOUTS_H
#define EBPO_TESTS_TWO_LAYOUTS_H

#include <ebpo/subtree.h>

typedef struct two_layouts {
    const char *packed, *plain; /* paths in the program's scratch folder */
    ebpo_file *with, *without;  /* the two, open */
} two_layouts;

/* Takes the tree, or builds one of the mesh, which it takes. Aborts when that fails. `parts`: bits
 * of ebpo_part. */
void two_layouts_write(two_layouts *out, ebpo_tree *tree, uint32_t parts, ebpo_codec codec,
                       uint64_t subtree_faces);
void two_layouts_build(two_layouts *out, ebpo_mesh mesh, uint32_t leaf_faces, uint32_t parts,
                       ebpo_codec codec, uint64_t subtree_faces);
void two_layouts_close(two_layouts *l);

/* A sum over everything that the subtree of an octcode holds, its faces and corners included; what
 * opening it gives in *status. */
uint64_t subtree_sum(const ebpo_file *file, uint64_t octcode, ebpo_status *status);

/* Octcodes of the gray nodes and leaves of a level, by the levels' types alone; *count of them. The
 * caller's to free. Pruned nodes are left out. */
uint64_t *octcodes_of_level(const ebpo_file *file, int level, uint64_t *count);

#endif
