/* Faces that are connected over edges of two. */
#ifndef EBPO_COLLIDE_UNMET_PATCHES_H
#define EBPO_COLLIDE_UNMET_PATCHES_H

#include "extras/collide/around_face.h"
#include "geometry/pose.h"
#include "query/accel.h"

/* For each face of a whole model at a pose, by its number in the file, the first face of its patch:
 * those that are connected to it over edges (equal posed corners) that two faces with an area have,
 * no more and no less. One without area is alone. The caller frees it. */
EBPO_MUST_USE ebpo_status ebpo_edge_patches(const ebpo_accel *whole, const uint32_t *slots,
                                            const ebpo_posing *posing, uint32_t **out,
                                            ebpo_error *error);

/* Faces that meet none of the other model, a subtree after the other: which of them are connected,
 * and on which side of the other model all of a subtree's are. One thread. */

/* Subtrees of one of a question's models; a whole one is its only subtree. */
typedef struct ebpo_unmet_patches {
    const ebpo_collision *question;
    ebpo_two_models *two;
    int m;
    uint64_t subtrees;
    /* Of the subtree asked for last: its own faces, by numbers in the file, and for each the first
     * of its patch (face_patches.h), less `first`. */
    uint64_t first, count;
    uint32_t *patch;
} ebpo_unmet_patches;

void ebpo_unmet_patches_begin(ebpo_unmet_patches *u, const ebpo_collision *question,
                              ebpo_two_models *two, int m);
void ebpo_unmet_patches_end(ebpo_unmet_patches *u);

/* met: a bit for each face of the model. Loads the subtree, and lets go of it. */
EBPO_MUST_USE ebpo_status ebpo_unmet_patches_find(ebpo_unmet_patches *u, uint64_t subtree,
                                                  const uint64_t *met, ebpo_error *error);

/* Whether all own faces of the subtree that meet none of the other model, a solid, are in it (1),
 * or out of it (0); -1: not known without loading it. */
EBPO_MUST_USE ebpo_status ebpo_unmet_patches_side(const ebpo_unmet_patches *u, uint64_t subtree,
                                                  int *in, ebpo_error *error);

#endif
