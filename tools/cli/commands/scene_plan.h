/* Implements `ebpo scene plan`, which lists the parts of models that a scene can need, and `ebpo
 * scene pack`, which writes these parts to a folder. */
#ifndef EBPO_TOOLS_SCENE_PLAN_H
#define EBPO_TOOLS_SCENE_PLAN_H

#include "cli/commands/scene_run.h"

/* Both functions take the path of the scene, for messages, and the loaded scene. */
ebpo_status scene_plan(const scene_values *v, const char *path, ebpo_scene *scene,
                       ebpo_error *error);

ebpo_status scene_pack(const scene_values *v, const char *path, ebpo_scene *scene,
                       ebpo_error *error);

#endif
