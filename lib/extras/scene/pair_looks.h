/* A pair of instances at one time after the other: how far apart, and how far they go. */
#ifndef EBPO_SCENE_PAIR_LOOKS_H
#define EBPO_SCENE_PAIR_LOOKS_H

#include "extras/scene/asked_pairs.h"
#include "extras/scene/pair_motion.h"

typedef struct scene_looks {
    const ebpo_scene *scene;
    const ebpo_scene_pair *pair;
    ebpo_collider *collider; /* of scene_collider; to be freed */
    double tolerance;        /* of a look */
    bool rides;              /* as scene_pair_rides */
    double gap;              /* at the last one, as scene_left_out tells it, */
    uint64_t lacking;        /* and of which */
} scene_looks;

/* `tolerance`: of what is asked for; looks take a quarter of it, or what rounding leaves. Free the
 * collider, also on failure. */
EBPO_MUST_USE ebpo_status scene_looks_begin(scene_looks *looks, const ebpo_scene *scene,
                                            const ebpo_scene_pair *pair, double tolerance,
                                            ebpo_error *error);

/* scene_pair_motion of the pair. */
EBPO_MUST_USE ebpo_status scene_looks_motion(const scene_looks *looks, double from, double to,
                                             double *out, ebpo_error *error);

/* Bounds of the distance of their faces at a time, of those that were left out too. */
EBPO_MUST_USE ebpo_status scene_look(scene_looks *looks, double time, double *lo, double *hi,
                                     ebpo_error *error);

/* Whether `hi` is no more than the tolerance above `lo`, in real numbers. */
bool scene_is_within(double hi, double lo, double tolerance);

/* With the usual number of looks. EBPO_E_ARGUMENT: the tolerance is not above 0. */
EBPO_MUST_USE ebpo_status scene_take_way_options(ebpo_scene_way_options *own,
                                                 const ebpo_scene_way_options *options,
                                                 ebpo_error *error);

#endif
