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

/* Finds intersecting faces of two instances at a time: sets byte i of red[k] to 1 for each such
 * face i in the file of instance k. The caller frees the arrays. */
EBPO_MUST_USE ebpo_status painted_find_red(ebpo_scene *scene, uint64_t a, uint64_t b, double time,
                                           unsigned threads, uint8_t *red[2], ebpo_error *error);

/* Adds the faces of the instance's model. red: the bytes of painted_find_red, or NULL. */
EBPO_MUST_USE ebpo_status painted_add(painted_mesh *p, const ebpo_scene *scene, uint64_t instance,
                                      double time, const uint8_t *red, uint8_t paint,
                                      ebpo_error *error);

/* Adds the bounding box of the instance's model instead of its faces. */
EBPO_MUST_USE ebpo_status painted_add_box(painted_mesh *p, const ebpo_scene *scene,
                                          uint64_t instance, double time, uint8_t paint,
                                          ebpo_error *error);

/* Removes faces outside the cube with centre `middle` and side 2 * half_side. */
void painted_crop(painted_mesh *p, const double middle[3], double half_side);

#endif
