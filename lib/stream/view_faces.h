/* The faces of leaves in a view stream. */
#ifndef EBPO_STREAM_VIEW_FACES_H
#define EBPO_STREAM_VIEW_FACES_H

#include <ebpo/view.h>

#include "container/group.h"
#include "container/slice.h"

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

/* Groups of siblings whose nodes and faces will be wanted: `parent` is an octcode, 0 of the root's
 * group. */
typedef struct ebpo_view_group {
    ebpo_group_number number;
    uint64_t parent;
} ebpo_view_group;

/* True when the file is far away and not all of that is in memory. */
bool ebpo_view_leaves_are_far(ebpo_chunks *chunks, const ebpo_view_group *group, unsigned wanted);

/* For files far away: fetches what the first group and the faces of its leaves take and is not in
 * memory, and announces with it what the others take. EBPO_E_LIMIT as ebpo_group_read. */
EBPO_MUST_USE ebpo_status ebpo_view_leaves_fetch(ebpo_chunks *chunks, const ebpo_view_group *groups,
                                                 unsigned count, unsigned wanted,
                                                 ebpo_error *error);

/* The faces of all leaves of a group that has been read. On failure there are none. */
EBPO_MUST_USE ebpo_status ebpo_view_leaves_read(ebpo_view_leaves *leaves, ebpo_chunks *chunks,
                                                const ebpo_view_group *group,
                                                const ebpo_group *read, ebpo_error *error);

/* From now on `now` is about the node of this octant, which has been given with that. */
void ebpo_view_leaves_give(ebpo_view_leaves *leaves, unsigned octant);
/* About no node. */
void ebpo_view_leaves_give_none(ebpo_view_leaves *leaves);

#endif
