/* Finds the part of each model's file that a scene needs. */
#ifndef EBPO_SCENE_SCENE_NEEDS_H
#define EBPO_SCENE_SCENE_NEEDS_H

#include "extras/scene/instance_pair.h"

typedef struct ebpo_scene_file_need {
    uint64_t users;          /* number of pairs, or of cameras that may see the file's models */
    bool any;                /* a part is needed; false: only the root is */
    ebpo_scene_bounds box;   /* part that collisions and inside tests need */
    ebpo_scene_bounds whole; /* box of all faces */
    int last_level;          /* last level that views need; otherwise -1 */
    uint32_t parts;
} ebpo_scene_file_need;

typedef struct ebpo_scene_needs {
    ebpo_scene *scene;
    ebpo_plan_options how;
    double from, to;
    ebpo_scene_file_need *files; /* [scene->files_count], from malloc */
    ebpo_error *error;
} ebpo_scene_needs;

/* Allocates and initialises `files`. The other members are set, and the options have been checked.
 * Free `files`, also on failure. */
EBPO_MUST_USE ebpo_status ebpo_scene_begin_needs(ebpo_scene_needs *needs);

/* Adds the parts of models that other instances of pairs come near. */
EBPO_MUST_USE ebpo_status ebpo_scene_add_near(ebpo_scene_needs *needs);

/* Completes the needs: of files to which no need was added, only the root is needed. */
void ebpo_scene_end_needs(ebpo_scene_needs *needs);

/* Returns the need of a file as options for a subset. */
ebpo_subset_options ebpo_scene_need_options(const ebpo_scene_needs *needs, uint64_t file);

/* Sets *out to the need of one model, with the bytes and subtrees that it takes. */
EBPO_MUST_USE ebpo_status ebpo_scene_report_need(const ebpo_scene_needs *needs, uint64_t model,
                                                 ebpo_scene_need *out);

/* Adds the parts of files that the scene's cameras can see. */

EBPO_MUST_USE ebpo_status ebpo_scene_add_views(ebpo_scene_needs *needs);

#endif
