/* Finds pairs of intersecting faces if at least one of two models is partly loaded. */
#ifndef EBPO_COLLIDE_SUBTREE_WALK_H
#define EBPO_COLLIDE_SUBTREE_WALK_H

#include "extras/collide/collider.h"

/* Finds all pairs, as ebpo_collide_all does, or, if `self`, as ebpo_collide_self does. Fails with
 * the errors of these functions. */
EBPO_MUST_USE ebpo_status ebpo_gather_parts(const ebpo_collision *collision, bool self,
                                            ebpo_pairs_fn take, void *user, ebpo_error *error);

/* Finds an intersecting pair, as ebpo_collide_first returns it. */
EBPO_MUST_USE ebpo_status ebpo_first_of_parts(const ebpo_collision *collision, ebpo_face_pair *out,
                                              int32_t *found, ebpo_error *error);

#endif
