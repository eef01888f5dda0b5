/* The scene file of a packed scene: its source's, with other files and their digests. */
#ifndef EBPO_SCENE_PACKED_TEXT_H
#define EBPO_SCENE_PACKED_TEXT_H

#include "extras/scene/scene_parts.h"

/* Names in the folder: of the scene, of a file of scene->files, of a route's poses. */
#define SCENE_PACKED "packed.scene.json"
void scene_packed_name(uint64_t file, char name[40]);
void scene_packed_route(uint64_t route, char name[40]);

/* Writes the scene into the folder, and files of poses. files: [scene->files_count] */
EBPO_MUST_USE ebpo_status scene_write_packed(const ebpo_scene *scene,
                                             const ebpo_scene_packed *files, const char *folder,
                                             ebpo_error *error);

#endif
