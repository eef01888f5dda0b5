/* The faces in a box, accel by accel. */
#ifndef EBPO_QUERY_BOX_WALK_H
#define EBPO_QUERY_BOX_WALK_H

#include "query/query_node.h"

typedef struct ebpo_box_walk ebpo_box_walk;

struct ebpo_box_walk {
    ebpo_context *context;
    const double *min, *max;
    /* In the accel at hand, the faces that meet the box: their slots, ascending, which is the order
     * of the file. */
    uint32_t *slot;
    uint64_t count, capacity;
    ebpo_node below; /* in whose place it stands, when it is not the whole tree */
    bool no_memory, enough;
    /* Of a file far away: what the walk will enter, in its order, and how many it has. */
    uint32_t *ahead;
    uint64_t ahead_count, ahead_capacity, entered;
    /* Called for each accel that the box meets, depth first; *enough ends the walk. */
    ebpo_status (*take)(ebpo_box_walk *walk, const ebpo_accel *s, ebpo_error *error);
};

/* EBPO_E_ARGUMENT: no box. */
EBPO_MUST_USE ebpo_status ebpo_check_box(const double min[3], const double max[3],
                                         ebpo_error *error);

/* EBPO_E_ABSENT: what a subset has left out meets the box. */
EBPO_MUST_USE ebpo_status ebpo_box_walk_check(ebpo_box_walk *walk, ebpo_error *error);

/* The whole walk. The list of slots is freed. */
EBPO_MUST_USE ebpo_status ebpo_box_walk_run(ebpo_box_walk *walk, ebpo_error *error);

/* The triangle, which meets the box, is to be taken in the accel at hand and in no other, so that a
 * walk that takes it where this is true takes each once. `own`: the accel has it as its own. */
bool ebpo_box_walk_is_first(const ebpo_box_walk *walk, bool own, const double triangle[3][3]);

#endif
