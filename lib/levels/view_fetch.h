/* What a view stream needs of a file far away: asked for together, and ahead. */
#ifndef EBPO_LEVELS_VIEW_FETCH_H
#define EBPO_LEVELS_VIEW_FETCH_H

#include "levels/frontier.h"
#include "levels/partial_tree.h"
#include "levels/view_faces.h"

/* To which level the view goes below a node, at most. */
typedef struct ebpo_view_depth {
    int (*level)(const void *user, uint64_t octcode);
    const void *user;
} ebpo_view_depth;

/* For files far away, when not all is in memory: fetches what the group (EBPO_GROUP_...) and with
 * `faces` those of its leaves take and is not in memory, and announces with it what the next groups
 * of the frontier take: where the file has a table of subtrees, all of the subtrees in which they
 * are. Counted chunks: EBPO_E_LIMIT as ebpo_group_read. */
EBPO_MUST_USE ebpo_status ebpo_view_fetch(ebpo_chunks *chunks, const ebpo_partial *partial,
                                          const ebpo_frontier *frontier,
                                          const ebpo_view_group *group, unsigned wanted, bool faces,
                                          const ebpo_view_depth *depth, ebpo_error *error);

/* The children of a node that waits to be refined. */
ebpo_view_group ebpo_view_children(const ebpo_waiting *waiting);

#endif
