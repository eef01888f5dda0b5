/* The nearest faces of two models, of which subtrees are loaded as they may matter. One thread. */
#ifndef EBPO_COLLIDE_SUBTREE_DISTANCE_H
#define EBPO_COLLIDE_SUBTREE_DISTANCE_H

#include "extras/collide/collider.h"
#include "extras/collide/nearest_pair.h"

/* Goes on with `n` in two more accels of the question's models. `may_meet`: the walk for the first
 * contact comes first, as bounds say little where faces meet. */
EBPO_MUST_USE ebpo_status ebpo_distance_of_accels(const ebpo_collision *question,
                                                  const ebpo_accel *const accel[2], bool may_meet,
                                                  ebpo_nearest_pair *n, ebpo_error *error);

/* Goes on with `n` in all pairs of subtrees whose envelopes are not farther apart than what has
 * been found, the nearest first: the same as of whole models. */
EBPO_MUST_USE ebpo_status ebpo_distance_of_parts(const ebpo_collision *question,
                                                 ebpo_nearest_pair *n, ebpo_error *error);

#endif
