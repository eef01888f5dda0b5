/* A piece's nodes and its leaves' lists of faces. */
#ifndef EBPO_CONSTRUCT_PARTITION_H
#define EBPO_CONSTRUCT_PARTITION_H

#include "construct/builder.h"

ebpo_status ebpo_build_partition(ebpo_builder *b, ebpo_branch *s, ebpo_error *error);
bool ebpo_build_is_leaf(const ebpo_builder *b, int level, uint64_t count);
/* EBPO_E_LIMIT when there are more leaves, or more faces listed in them, than a mesh of that many
 * faces may have. */
ebpo_status ebpo_build_check_lists(uint64_t face_count, uint64_t leaves, uint64_t entries,
                                   ebpo_error *error);
/* Notes which of the faces list[0 .. count) (places in the branch's list, or faces) are not wholly
 * inside. False: out of memory. */
bool ebpo_build_crossing(const ebpo_builder *b, ebpo_branch *s, ebpo_cell cell,
                         const uint32_t *list, uint64_t count, ebpo_build_detail *detail);

/* The top of the tree, and the lists of faces of the pieces below it. */

ebpo_status ebpo_build_split(ebpo_builder *b, ebpo_error *error);

#endif
