/* Makes models of the regions to which the result of a Boolean expression is cut: a box, and
 * half-spaces. */
#ifndef EBPO_BOOLEAN_REGION_MODEL_H
#define EBPO_BOOLEAN_REGION_MODEL_H

#include <ebpo/query.h>

/* A model in memory, and its file, which has no name in the file system. */
typedef struct ebpo_region_model {
    ebpo_file *file;
    ebpo_model *model;
} ebpo_region_model;

/* Makes the model of a box, given by its lower and its upper corner. temp_dir: folder for the
 * model's file; NULL: the default folder for temporary files. Fails with EBPO_E_ARGUMENT if a
 * coordinate is not finite, or if on an axis the lower corner is not below the upper corner. Must
 * be freed, also after a failure. */
EBPO_MUST_USE ebpo_status ebpo_region_box(ebpo_region_model *out, const double box[6],
                                          const char *temp_dir, ebpo_error *error);

/* Makes the model of the part of the half-space plane[0] x + plane[1] y + plane[2] z <= plane[3]
 * that is near a box. The model is a tetrahedron with one face in the plane. The corners of this
 * face are rounded to doubles: two coordinates of a corner are chosen, and the third coordinate is
 * the double nearest to the plane. For most planes with few digits, the corners are exactly in the
 * plane. A plane that is far from the box is moved towards the box, but still does not intersect
 * the box. Fails with EBPO_E_ARGUMENT if a number is not finite or the normal is 0, and with
 * EBPO_E_LIMIT if the box is too large. Must be freed, also after a failure. */
EBPO_MUST_USE ebpo_status ebpo_region_half_space(ebpo_region_model *out, const double plane[4],
                                                 const double box[6], const char *temp_dir,
                                                 ebpo_error *error);

void ebpo_region_model_free(ebpo_region_model *region);

#endif
