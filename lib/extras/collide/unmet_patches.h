/* Faces that meet none of the other model, a subtree after the other: which of them are connected,
 * and on which side of the other model all of a subtree's are. One thread. */
#ifndef EBPO_COLLIDE_UNMET_PATCHES_H
#define EBPO_COLLIDE_UNMET_PATCHES_H

#include "extras/collide/around_face.h"

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
