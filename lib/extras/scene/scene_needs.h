/* Finds the content of each model's file that the queries of a scene need: a box of faces, or
 * levels of the octree. */
#ifndef EBPO_SCENE_SCENE_NEEDS_H
#define EBPO_SCENE_SCENE_NEEDS_H

#include "extras/scene/instance_pair.h"

/* The needed content of a file. */
typedef struct ebpo_scene_file_need {
    uint64_t users; /* number of pairs of instances that need the file; for views, the number of the
                       scene's cameras */
    bool any;       /* false: so far only the root node is needed */
    ebpo_scene_bounds
        box; /* needed box: contains the faces that collisions and inside tests need */
    ebpo_scene_bounds whole; /* box of all faces */
    int last_level;          /* last level that views need; -1: all levels */
    uint32_t parts;          /* needed parts of the file, as EBPO_PART_... bits */
} ebpo_scene_file_need;

/* The needs of all files in the interval of time from .. to. */
typedef struct ebpo_scene_needs {
    ebpo_scene *scene;
    ebpo_plan_options options;
    double from, to;
    ebpo_scene_file_need *files; /* [scene->files_count], from malloc */
    ebpo_error *error;
} ebpo_scene_needs;

/* Allocates and initialises `files`. All other members must be set, and the options checked. The
 * caller frees `files`, even on failure. */
EBPO_MUST_USE ebpo_status ebpo_scene_begin_needs(ebpo_scene_needs *needs);

/* Adds the needs of all pairs of instances that may come near each other (ebpo_scene_pairs). For
 * each pair, extends the needed box of each model by the model's points that may be near the other
 * instance. */
EBPO_MUST_USE ebpo_status ebpo_scene_add_near(ebpo_scene_needs *needs);

/* Completes the needs after all needs have been added. If no need was added for a file, only its
 * root is needed. */
void ebpo_scene_end_needs(ebpo_scene_needs *needs);

/* Returns the need of a file as options for a subset. */
ebpo_subset_options ebpo_scene_need_options(const ebpo_scene_needs *needs, uint64_t file);

/* Sets *out to the need of a model, with the numbers of bytes and subtrees that must be read. */
EBPO_MUST_USE ebpo_status ebpo_scene_report_need(const ebpo_scene_needs *needs, uint64_t model,
                                                 ebpo_scene_need *out);

/* Adds the levels of files whose cells the scene's cameras can resolve. */
EBPO_MUST_USE ebpo_status ebpo_scene_add_views(ebpo_scene_needs *needs);

#endif
