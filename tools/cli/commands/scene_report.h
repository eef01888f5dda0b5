/* `ebpo scene report`: who meets, time after time; `ebpo scene approach`: when they first come
 * near. */
#ifndef EBPO_TOOLS_SCENE_REPORT_H
#define EBPO_TOOLS_SCENE_REPORT_H

#include "cli/commands/scene_run.h"

/* What was asked at a time. */
typedef struct scene_frame {
    ebpo_scene_frame cost;
    ebpo_scene_meeting *meetings;
    uint64_t count;
} scene_frame;

ebpo_status scene_report(const scene_values *v, const char *path, ebpo_scene *scene,
                         ebpo_error *error);

#endif
