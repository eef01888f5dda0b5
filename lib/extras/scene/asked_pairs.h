/* Pairs of instances that are asked about one after the other, by any thread. */
#ifndef EBPO_SCENE_ASKED_PAIRS_H
#define EBPO_SCENE_ASKED_PAIRS_H

#include <ebpo/collide.h>

#include "extras/scene/scene_parts.h"

typedef struct scene_pairs_list {
    ebpo_scene_pair *pairs; /* malloc's */
    uint64_t count;
} scene_pairs_list;

/* Those of ebpo_scene_pairs. On failure there is nothing to free. */
EBPO_MUST_USE ebpo_status scene_keep_pairs(const ebpo_scene *scene, double from, double to,
                                           scene_pairs_list *out, ebpo_error *error);
/* The same; their models are made. On failure there is nothing to free. */
EBPO_MUST_USE ebpo_status scene_list_pairs(ebpo_scene *scene, double from, double to,
                                           scene_pairs_list *out, ebpo_error *error);
/* One after the other: questions then share them. */
EBPO_MUST_USE ebpo_status scene_make_models(ebpo_scene *scene, const ebpo_scene_pair *pairs,
                                            uint64_t count, ebpo_error *error);
/* For one of these pairs. NULL: a file has no mesh; then scene_left_out counts all
 * of it. */
EBPO_MUST_USE ebpo_status scene_collider(const ebpo_scene *scene, const ebpo_scene_pair *pair,
                                         unsigned threads, ebpo_collider **out, ebpo_error *error);
/* Where both are at a time. */
EBPO_MUST_USE ebpo_status scene_pose_pair(const ebpo_scene *scene, const ebpo_scene_pair *pair,
                                          double time, ebpo_collide_options *out,
                                          ebpo_error *error);

#endif
