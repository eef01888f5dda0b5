/* Planning, as packing does it too. */
#ifndef EBPO_SCENE_PLANNING_H
#define EBPO_SCENE_PLANNING_H

#include "extras/scene/scene_needs.h"

/* Takes the options; the scene and its times are right. */
EBPO_MUST_USE ebpo_status scene_plan_check(scene_needs *needs, const ebpo_plan_options *options);
/* Finds what is needed of each file. Free needs->files, also on failure. */
EBPO_MUST_USE ebpo_status scene_plan_needs(scene_needs *needs);
/* A need of each model; free it, also on failure. */
EBPO_MUST_USE ebpo_status scene_plan_list(const scene_needs *needs, ebpo_scene_need **out);

#endif
