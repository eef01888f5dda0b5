/* Finds the shells of a mesh (its closed components with a volume), and which of them bound the
 * solid. A winding rule defines which winding numbers count as inside the solid. */
#ifndef EBPO_CONSTRUCT_SOLID_SHELLS_H
#define EBPO_CONSTRUCT_SOLID_SHELLS_H

#include <ebpo/file.h>
#include <ebpo/repair.h>

#include "mesh/shell_nesting.h"

typedef struct ebpo_solid_shells {
    const ebpo_mesh *mesh; /* borrowed */
    /* result of ebpo_mesh_find_shells; the nesting uses it as `of_face` of its components */
    uint32_t *closed;
    ebpo_nesting nesting; /* how many shells are around each shell */
    /* [component] index of its shell; EBPO_NO_INDEX: the component is open or has no volume */
    uint32_t *shell_of;
    /* every component is closed, and faces of two different shells have no common point */
    bool apart;
} ebpo_solid_shells;

/* Finds the components and their nesting, and sets `apart`. Takes as long as
 * ebpo_mesh_count_shells. The caller frees `out`, also on failure. */
EBPO_MUST_USE ebpo_status ebpo_solid_shells_find(ebpo_solid_shells *out, const ebpo_mesh *mesh,
                                                 unsigned threads, const ebpo_progress *progress,
                                                 ebpo_error *error);
/* Sets all fields of `out`: counts of shells, and differences of volumes. */
void ebpo_solid_shells_count(const ebpo_solid_shells *shells, ebpo_shells *out);
void ebpo_solid_shells_free(ebpo_solid_shells *shells);

/* Returns 1 if the faces of a component bound the solid, -1 if they bound the solid with the
 * opposite orientation, and 0 if they do not bound it. Returns 1 for a component without volume.
 * `apart` must be true. An integral over the solid's surface is the sum of the integrals over the
 * components, each multiplied by this factor. */
int ebpo_component_times(const ebpo_solid_shells *shells, uint32_t component, ebpo_rule rule);

#endif
