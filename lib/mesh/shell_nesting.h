/* How many closed components each is within. */
#ifndef EBPO_MESH_SHELL_NESTING_H
#define EBPO_MESH_SHELL_NESTING_H

#include "mesh/shells.h"

/* Zeroed to begin with; to be freed on failure as well. `closed`: of ebpo_mesh_find_shells,
 * borrowed until then, and changed. */
EBPO_MUST_USE ebpo_status ebpo_nesting_find(nesting *n, const ebpo_mesh *mesh, uint32_t *closed,
                                            unsigned threads, const ebpo_progress *progress,
                                            ebpo_error *error);
void ebpo_nesting_free(nesting *n, const ebpo_mesh *mesh);

#endif
