/* Faces that are connected by corners. */
#ifndef EBPO_COLLIDE_FACE_PATCHES_H
#define EBPO_COLLIDE_FACE_PATCHES_H

#include "query/accel.h"

/* For each own face of a subtree, by its number in the file less first_face, the first face of its
 * patch: those that are connected to it by corners (equal coordinates) of own faces that are not
 * left out (a bit for each face of the file). One that is left out is alone. The caller frees it.
 */
EBPO_MUST_USE ebpo_status ebpo_face_patches(const ebpo_accel *subtree, const uint32_t *slots,
                                            const uint64_t *left_out, uint32_t **out,
                                            ebpo_error *error);

#endif
