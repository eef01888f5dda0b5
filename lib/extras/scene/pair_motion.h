/* How far two instances go, seen from each other. */
#ifndef EBPO_SCENE_PAIR_MOTION_H
#define EBPO_SCENE_PAIR_MOTION_H

#include "extras/scene/scene_parts.h"

/* Both ride on what moves along one route, or along two of the same keys: all that changes between
 * them is what rounding does, and their size where the route's scale does. */
bool scene_pair_rides(const ebpo_scene *scene, const ebpo_scene_pair *pair);

/* What rounding may do to their distance on all their ways, of the order of it; 0: neither moves.
 */
double scene_pair_rounding(const ebpo_scene *scene, const ebpo_scene_pair *pair);

/* Their distance changes by no more than *out on its way between two times, INFINITY over a jump.
 * rides: as scene_pair_rides says. */
EBPO_MUST_USE ebpo_status scene_pair_motion(const ebpo_scene *scene, const ebpo_scene_pair *pair,
                                            bool rides, double from, double to, double *out,
                                            ebpo_error *error);

/* The next time at which a route of theirs has a key; `to` if that comes first. */
double scene_pair_next(const ebpo_scene *scene, const ebpo_scene_pair *pair, double from,
                       double to);

#endif
