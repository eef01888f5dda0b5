/* Patches of connected faces, and the numbers of corners by which they are found. */
#ifndef EBPO_COLLIDE_FACE_PATCHES_H
#define EBPO_COLLIDE_FACE_PATCHES_H

#include <stdbool.h>
#include <stdint.h>

#include "geometry/pose.h"
#include "query/accel.h"

/* Numbers of corners: equal coordinates, equal numbers (0 and -0 are equal). Zero at first. */
typedef struct ebpo_corner_ids {
    double (*at)[3]; /* [count] */
    uint64_t count, capacity;
    uint32_t *table; /* open addressing: number and 1, 0: free */
    uint64_t table_size;
} ebpo_corner_ids;

/* False: no memory, or 2^32 - 2 corners. */
bool ebpo_corner_id(ebpo_corner_ids *ids, const double x[3], uint32_t *id);
void ebpo_corner_ids_free(ebpo_corner_ids *ids);

/* For each own face of a subtree, by its number in the file less first_face, the first face of its
 * patch: those that are connected to it by corners (equal coordinates) of own faces that are not
 * left out (a bit for each face of the file). One that is left out is alone. The caller frees it.
 */
EBPO_MUST_USE ebpo_status ebpo_face_patches(const ebpo_accel *subtree, const uint32_t *slots,
                                            const uint64_t *left_out, uint32_t **out,
                                            ebpo_error *error);

/* For each face of a whole model at a pose, by its number in the file, the first face of its patch:
 * those that are connected to it over edges (equal posed corners) that two faces with an area have,
 * no more and no less. One without area is alone. The caller frees it. */
EBPO_MUST_USE ebpo_status ebpo_edge_patches(const ebpo_accel *whole, const uint32_t *slots,
                                            const ebpo_posing *posing, uint32_t **out,
                                            ebpo_error *error);

#endif
