/* Finds pairs of intersecting faces of two models if at least one of them is partly loaded. */
#ifndef EBPO_COLLIDE_SUBTREE_WALK_H
#define EBPO_COLLIDE_SUBTREE_WALK_H

#include "extras/collide/collider.h"

/* Finds all pairs, as ebpo_collide_all does. self: as ebpo_collide_self does; both models are the
 * same model at the same pose. Fails with the errors of these functions. */
EBPO_MUST_USE ebpo_status ebpo_gather_parts(const ebpo_collision *collision, bool self,
                                            ebpo_pairs_fn take, void *user, ebpo_error *error);

/* Finds an intersecting pair, and sets *out and *found as ebpo_collide_first does. */
EBPO_MUST_USE ebpo_status ebpo_first_of_parts(const ebpo_collision *collision, ebpo_face_pair *out,
                                              int32_t *found, ebpo_error *error);

#endif
