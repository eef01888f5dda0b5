/* Faces that are connected over edges of two. */
#ifndef EBPO_COLLIDE_EDGE_PATCHES_H
#define EBPO_COLLIDE_EDGE_PATCHES_H

#include "query/accel.h"
#include "geometry/pose.h"

/* For each face of a whole model at a pose, by its number in the file, the first face of its patch:
 * those that are connected to it over edges (equal posed corners) that two faces with an area have,
 * no more and no less. One without area is alone. The caller frees it. */
EBPO_MUST_USE ebpo_status ebpo_edge_patches(const ebpo_accel *whole, const uint32_t *slots,
                                            const ebpo_posing *posing, uint32_t **out,
                                            ebpo_error *error);

#endif
