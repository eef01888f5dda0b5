/* Coordinates as float32, for the formats that hold no more. */
#ifndef EBPO_DERIVE_FLOATS_H
#define EBPO_DERIVE_FLOATS_H

#include <ebpo/export.h>

/* Vertices less the origin, [vertex_count][3] to be freed, NULL on failure (EBPO_E_MEMORY;
 * EBPO_E_LIMIT: a coordinate beyond float32). *largest_change becomes the largest change of a
 * coordinate, when that is more than it was. */
EBPO_MUST_USE ebpo_status ebpo_mesh_floats(float **out, const ebpo_mesh *mesh,
                                           const double origin[3], double *largest_change,
                                           ebpo_error *error);

#endif
