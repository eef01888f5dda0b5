/* Boxes of instances in each other's coordinates: what of a model another one can come near, and
 * what a model that is a part of another lacks of that. Bounds hold for posed coordinates. */
#ifndef EBPO_SCENE_LEFT_OUT_H
#define EBPO_SCENE_LEFT_OUT_H

#include "extras/scene/scene_parts.h"

typedef struct scene_space {
    double min[3], max[3];
} scene_space;

/* One instance in another's coordinates. */
typedef struct scene_seen {
    scene_space box;
    double rounding; /* how far the box was widened for it */
    double unit;     /* how long one of these coordinates is in the world, at least */
} scene_seen;

/* A box in the coordinates of the instance `of` that holds the box of `other` at a time.
 * EBPO_E_ARGUMENT: a pose. */
EBPO_MUST_USE ebpo_status scene_seen_from(const ebpo_scene *scene, uint64_t of, uint64_t other,
                                          double time, scene_seen *out, ebpo_error *error);

/* The distance of two boxes, rounded down. */
double scene_space_gap(const scene_space *a, const scene_space *b);

/* Of a pair at a time: no two faces of which one has been left out of its model's file are nearer
 * than this; INFINITY: nothing has been left out. *lacking: an instance whose file lacks some. */
EBPO_MUST_USE ebpo_status scene_left_out(const ebpo_scene *scene, const ebpo_scene_pair *pair,
                                         double time, double *gap, uint64_t *lacking,
                                         ebpo_error *error);

/* EBPO_E_ABSENT: what this instance's file lacks may come nearer than the question allows; or be
 * around the other one, where solids are asked about. */
ebpo_status scene_lacks(const ebpo_scene *scene, const ebpo_scene_pair *pair, uint64_t lacking,
                        double time, bool solids, ebpo_error *error);

#endif
