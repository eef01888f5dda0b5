/* Which part of each model's file a scene can call for. */
#ifndef EBPO_SCENE_SCENE_NEEDS_H
#define EBPO_SCENE_SCENE_NEEDS_H

#include "extras/scene/instance_pair.h"

typedef struct ebpo_scene_file_need {
    uint64_t askers;        /* pairs, or cameras that may see it */
    bool any;               /* something is asked for; else nothing but the root */
    ebpo_scene_space box;   /* collide, inside */
    ebpo_scene_space whole; /* of all faces */
    int last_level;         /* view; else -1 */
    uint32_t parts;
} ebpo_scene_file_need;

typedef struct ebpo_scene_needs {
    ebpo_scene *scene;
    ebpo_plan_options how;
    double from, to;
    ebpo_scene_file_need *files; /* [scene->files_count], malloc's */
    ebpo_error *error;
} ebpo_scene_needs;

/* Begins `files`; the options have been checked. Free `files`, also on failure. */
EBPO_MUST_USE ebpo_status ebpo_scene_begin_needs(ebpo_scene_needs *needs);

/* What pairs come near. */
EBPO_MUST_USE ebpo_status ebpo_scene_add_near(ebpo_scene_needs *needs);

/* Of files that nothing has been added to only the root is needed. */
void ebpo_scene_end_needs(ebpo_scene_needs *needs);

/* As options for a subset; its file. */
ebpo_subset_options ebpo_scene_need_options(const ebpo_scene_needs *needs, uint64_t file);

/* Of one model, as the caller gets it. */
EBPO_MUST_USE ebpo_status ebpo_scene_tell_need(const ebpo_scene_needs *needs, uint64_t model,
                                               ebpo_scene_need *out);

/* What of each file the scene's cameras can see. */

EBPO_MUST_USE ebpo_status ebpo_scene_add_views(ebpo_scene_needs *needs);

#endif
