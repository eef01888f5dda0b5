/* Builds one mesh with painted faces from placed instances of a scene. */
#ifndef EBPO_TOOLS_PAINTED_MESH_H
#define EBPO_TOOLS_PAINTED_MESH_H

#include <ebpo/scene.h>

/* Initialize with zeros. */
typedef struct painted_mesh {
    ebpo_mesh mesh; /* xyz64 */
    uint8_t *paint; /* values of raster.h, for each face */
} painted_mesh;

void painted_free(painted_mesh *p);

/* Finds intersecting faces of two instances at a time: bytes by face index in the files, which the
 * caller frees. */
EBPO_MUST_USE ebpo_status painted_find_red(ebpo_scene *scene, uint64_t a, uint64_t b, double time,
                                           unsigned threads, uint8_t *red[2], ebpo_error *error);

/* `red`: bytes of red faces, or NULL. */
EBPO_MUST_USE ebpo_status painted_add(painted_mesh *p, const ebpo_scene *scene, uint64_t instance,
                                      double time, const uint8_t *red, uint8_t paint,
                                      ebpo_error *error);

/* Adds the bounding box of the instance's model instead of its faces. */
EBPO_MUST_USE ebpo_status painted_add_box(painted_mesh *p, const ebpo_scene *scene,
                                          uint64_t instance, double time, uint8_t paint,
                                          ebpo_error *error);

/* Removes faces that are farther than `reach` from `middle` on some axis. */
void painted_crop(painted_mesh *p, const double middle[3], double reach);

#endif
