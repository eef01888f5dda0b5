/* What is within hosts that are not crowded. */
#ifndef EBPO_MESH_SHELL_PROBES_H
#define EBPO_MESH_SHELL_PROBES_H

#include "mesh/shells.h"

/* Each face is shown to the samples that are near it; adds to the depths. */
EBPO_MUST_USE ebpo_status ebpo_nesting_probe(nesting *n, ebpo_error *error);

/* Whether a line in direction x from somewhere in the box may meet the triangle; if so, true. */
bool ebpo_face_may_meet_lines(const double t[3][3], const point_box *box);

#endif
