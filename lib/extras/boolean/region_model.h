/* Makes models of the regions to which a result is cut: a box, and half-spaces. */
#ifndef EBPO_BOOLEAN_REGION_MODEL_H
#define EBPO_BOOLEAN_REGION_MODEL_H

#include <ebpo/query.h>

/* A model in memory, and its file, which has no name. */
typedef struct ebpo_region_model {
    ebpo_file *file;
    ebpo_model *model;
} ebpo_region_model;

/* Makes a box: low[3], then high[3]. Fails with EBPO_E_ARGUMENT if a coordinate is not finite or a
 * low is not below its high. Must be freed, also after a failure. */
EBPO_MUST_USE ebpo_status ebpo_region_box(ebpo_region_model *out, const double box[6],
                                          ebpo_error *error);

/* Makes the part of the half-space plane[0] x + plane[1] y + plane[2] z <= plane[3] that is near a
 * box: a tetrahedron with one face in the plane. The corners of this face are rounded to doubles.
 * Each is in the plane but for the rounding of one coordinate, and exactly for most planes of short
 * numbers. A plane that is far from the box is moved towards it, but stays outside. Fails with
 * EBPO_E_ARGUMENT if a number is not finite or the normal is 0. Must be freed, also after a
 * failure. */
EBPO_MUST_USE ebpo_status ebpo_region_half_space(ebpo_region_model *out, const double plane[4],
                                                 const double box[6], ebpo_error *error);

void ebpo_region_model_free(ebpo_region_model *region);

#endif
