/* The faces of leaves in a view stream. */
#ifndef EBPO_LEVELS_VIEW_FACES_H
#define EBPO_LEVELS_VIEW_FACES_H

#include <ebpo/view.h>

#include "format/file_nodes.h"
#include "format/slice.h"

/* Of the siblings that are being delivered, and which faces have been. */
typedef struct ebpo_view_leaves {
    const ebpo_info *info;
    ebpo_slice slice[8]; /* of the leaves among them */
    uint8_t *given;      /* a bit for each face of the file */
    /* What is lent of the leaf given last. */
    double (*corners)[3][3];
    uint32_t *numbers;
    uint8_t *repeated;
    uint64_t capacity[3];
    ebpo_view_faces now;
} ebpo_view_leaves;

EBPO_MUST_USE ebpo_status ebpo_view_leaves_new(ebpo_view_leaves **out, const ebpo_file *file,
                                               ebpo_error *error);
void ebpo_view_leaves_free(ebpo_view_leaves *leaves);

/* A group of siblings; `parent` is an octcode, 0 of the root's group. */
typedef struct ebpo_view_group {
    ebpo_group_number number;
    uint64_t parent;
} ebpo_view_group;

/* The node of an octant of a group that has been read, if it is a leaf. */
bool ebpo_view_leaf_of(const ebpo_view_group *group, const ebpo_group *read, unsigned octant,
                       ebpo_node *out);

/* The faces of all leaves of a group that has been read. On failure there are none. */
EBPO_MUST_USE ebpo_status ebpo_view_leaves_read(ebpo_view_leaves *leaves, ebpo_chunks *chunks,
                                                const ebpo_view_group *group,
                                                const ebpo_group *read, ebpo_error *error);

/* From now on `now` is about the node of this octant, which has been given with that. */
void ebpo_view_leaves_give(ebpo_view_leaves *leaves, unsigned octant);
/* About no node. */
void ebpo_view_leaves_give_none(ebpo_view_leaves *leaves);

#endif
