/* The scene that a haptic device touches, at the first time of the scene. */
#ifndef EBPO_TOOLS_HAPTIC_SCENE_H
#define EBPO_TOOLS_HAPTIC_SCENE_H

#include <ebpo/haptic.h>
#include <ebpo/scene.h>

#include "cli/commands/haptic_paints.h"

typedef struct haptic_scene {
    const char *name; /* path of the scene file */
    ebpo_scene *scene;
    ebpo_haptic_instance *instances; /* [instance_count] */
    ebpo_pose *poses;                /* [instance_count] of the instances */
    uint64_t *surface_of;            /* [instance_count] index in `surfaces` */
    uint64_t instance_count;
    haptic_surface *surfaces; /* [surface_count] files of models that have instances */
    char **paths;             /* [surface_count] paths of these files */
    char **paint_paths;       /* [surface_count] paths of their paint files; NULL: none */
    uint64_t surface_count;
    double low[3], size[3]; /* box of all instances */
} haptic_scene;

/* Opens a scene and its models. load: memory and max_expansion. Fails with EBPO_E_ARGUMENT if it
 * has no instances. Call haptic_scene_close in any case. */
ebpo_status haptic_scene_open(haptic_scene *out, const char *name, const ebpo_load_options *load,
                              ebpo_error *error);

/* Returns true, after an error message, if a record would overwrite a model of the scene, or a file
 * that is not a record: it may have the poses of a route. */
bool haptic_scene_overwrites(const haptic_scene *s, const char *record);

/* Makes the folder if it does not exist, and sets the paths of the paint files in it to
 * NAME.paint.h5, by the names of the models. record: NULL or a path that they must not have. */
ebpo_status haptic_scene_paint_in(haptic_scene *s, const char *folder, const char *record,
                                  ebpo_error *error);

/* Returns the text of a scene file for the page of the viewer: the instances at their poses, and
 * models by their addresses models/NUMBER/FILE. NULL without memory. The caller frees it. */
char *haptic_scene_text(const haptic_scene *s);

void haptic_scene_close(haptic_scene *s);

#endif
