/* A pair of instances at one time after the other: how far apart, and how far they go. */
#ifndef EBPO_SCENE_PAIR_LOOKS_H
#define EBPO_SCENE_PAIR_LOOKS_H

#include "scene/asked_pairs.h"

typedef struct scene_looks {
    const ebpo_scene *scene;
    const ebpo_scene_pair *pair;
    ebpo_collider *collider; /* of scene_collider */
    double tolerance;        /* of a look */
    double gap;              /* at the last one, as scene_left_out tells it, */
    uint64_t lacking;        /* and of which */
} scene_looks;

/* Bounds of the distance of their faces at a time, of those that were left out too. */
EBPO_MUST_USE ebpo_status scene_look(scene_looks *looks, double time, double *lo, double *hi,
                                     ebpo_error *error);

/* How far both go at most. */
EBPO_MUST_USE ebpo_status scene_pair_motion(const ebpo_scene *scene, const ebpo_scene_pair *pair,
                                            double from, double to, double *out, ebpo_error *error);

/* The next time at which a route of theirs has a key; `to` if that comes first. */
double scene_pair_next(const ebpo_scene *scene, const ebpo_scene_pair *pair, double from,
                       double to);

/* With the usual number of looks. EBPO_E_ARGUMENT: the tolerance is not above 0. */
EBPO_MUST_USE ebpo_status scene_take_way_options(ebpo_scene_way_options *own,
                                                 const ebpo_scene_way_options *options,
                                                 ebpo_error *error);

#endif
