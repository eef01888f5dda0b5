/* The closed components of a mesh, and what a rule makes of the winding numbers on both sides of
 * each. */
#ifndef EBPO_CONSTRUCT_SOLID_SHELLS_H
#define EBPO_CONSTRUCT_SOLID_SHELLS_H

#include <ebpo/file.h>
#include <ebpo/repair.h>

#include "mesh/shell_nesting.h"

typedef struct ebpo_solid_shells {
    const ebpo_mesh *mesh; /* borrowed */
    uint32_t *closed; /* of ebpo_mesh_find_shells; the nesting's components have it as `of_face` */
    ebpo_nesting nesting;
    uint32_t *shell_of; /* [components] among the shells; EBPO_NO_INDEX: without a volume */
    bool apart;         /* every component is closed, and no faces of two have a common point */
} ebpo_solid_shells;

/* Finds the components, their nesting and whether they are apart. Time: that of
 * ebpo_mesh_count_shells. `out` is to be freed on failure as well. */
EBPO_MUST_USE ebpo_status ebpo_solid_shells_find(ebpo_solid_shells *out, const ebpo_mesh *mesh,
                                                 unsigned threads, const ebpo_progress *progress,
                                                 ebpo_error *error);
/* Fills in all of `out`. */
void ebpo_solid_shells_count(const ebpo_solid_shells *shells, ebpo_shells *out);
void ebpo_solid_shells_free(ebpo_solid_shells *shells);

/* Returns how often the faces of a component bound the solid with their orientation: 1, 0 or -1;
 * of components that are apart. Integrals over all faces, each counted so, are those of the
 * solid. */
int ebpo_component_times(const ebpo_solid_shells *shells, uint32_t component, ebpo_rule rule);

#endif
