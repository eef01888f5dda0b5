/* All pairs of faces that meet, of models that are loaded in parts: the same as of whole ones. */
#ifndef EBPO_COLLIDE_SUBTREE_WALK_H
#define EBPO_COLLIDE_SUBTREE_WALK_H

#include "extras/collide/collider.h"

/* Errors are those of ebpo_collide_all. */
EBPO_MUST_USE ebpo_status ebpo_gather_parts(const ebpo_collision *question, bool self,
                                            ebpo_pairs_fn take, void *user, ebpo_error *error);

/* A pair that meets, as ebpo_collide_first tells it. */
EBPO_MUST_USE ebpo_status ebpo_first_of_parts(const ebpo_collision *question, ebpo_face_pair *out,
                                              int32_t *found, ebpo_error *error);

#endif
