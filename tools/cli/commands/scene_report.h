/* Implements `ebpo scene report`: finds contacts at each of several times. */
#ifndef EBPO_TOOLS_SCENE_REPORT_H
#define EBPO_TOOLS_SCENE_REPORT_H

#include "cli/commands/scene_run.h"

/* The cost and the clashes of one time. */
typedef struct scene_frame {
    ebpo_scene_frame cost;
    ebpo_scene_clash *found_clashes;
    uint64_t count;
} scene_frame;

ebpo_status scene_report(const scene_values *v, const char *path, ebpo_scene *scene,
                         ebpo_error *error);

#endif
