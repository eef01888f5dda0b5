/* Groups of faces that a file has names for. */
#ifndef EBPO_MESH_NAMED_GROUPS_H
#define EBPO_MESH_NAMED_GROUPS_H

#include <ebpo/groups.h>

#include "core/text.h"

struct ebpo_mesh_groups {
    ebpo_mesh_group *list; /* [count] those with faces first, in the order of these */
    uint64_t count, with_faces, face_count;
    char *names;
    uint64_t *run_end; /* [run_count] the number after its last face, ascending */
    uint32_t *run_group;
    uint64_t run_count;
};

/* Runs of one name are one group; "" and "default" are one name. The first run's name is told only
 * if it has faces. EBPO_E_LIMIT, EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_mesh_groups_new(const ebpo_named_run *runs, uint64_t count,
                                               ebpo_mesh_groups **out, ebpo_error *error);

/* The group of a face by its number in the source; EBPO_NO_INDEX: it is in none. */
uint32_t ebpo_mesh_group_of(const ebpo_mesh_groups *groups, uint64_t face);

#endif
