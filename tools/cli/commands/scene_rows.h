/* What a report of a scene prints of a meeting: JSON, CSV or words. */
#ifndef EBPO_TOOLS_SCENE_ROWS_H
#define EBPO_TOOLS_SCENE_ROWS_H

#include "cli/json.h"
#include "cli/commands/scene_run.h"

/* Until the scene is freed. */
const char *scene_instance_name(const ebpo_scene *scene, uint64_t instance);

void scene_row_json(json *j, const scene_values *v, const ebpo_scene *scene,
                    const ebpo_scene_meeting *m);

void scene_head_csv(const scene_values *v);
void scene_row_csv(const scene_values *v, const ebpo_scene *scene, double time,
                   const ebpo_scene_meeting *m);

void scene_row_words(const scene_values *v, const ebpo_scene *scene, double time,
                     const ebpo_scene_meeting *m);

#endif
