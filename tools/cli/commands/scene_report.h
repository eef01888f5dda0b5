/* Implements `ebpo scene report`: finds contacts at each of several times. */
#ifndef EBPO_TOOLS_SCENE_REPORT_H
#define EBPO_TOOLS_SCENE_REPORT_H

#include "cli/commands/scene_run.h"

/* The results for one time. */
typedef struct scene_frame {
    ebpo_scene_frame cost;           /* the time, and the cost of computing the clashes */
    ebpo_scene_clash *found_clashes; /* [count] */
    uint64_t count;
} scene_frame;

/* Prints the clashes from v->from to v->to, and writes --output. path: of the scene. */

ebpo_status scene_report(const scene_values *v, const char *path, ebpo_scene *scene,
                         ebpo_error *error);

#endif
