/* Builds one mesh with painted faces from instances of a scene, at their poses at a time. */
#ifndef EBPO_TOOLS_PAINTED_MESH_H
#define EBPO_TOOLS_PAINTED_MESH_H

#include <ebpo/scene.h>

/* Initialize with zeros. */
typedef struct painted_mesh {
    ebpo_mesh mesh; /* coordinates are in xyz64 */
    uint8_t *paint; /* [face_count] RASTER_PLAIN, RASTER_RED, ..., see raster.h */
} painted_mesh;

void painted_free(painted_mesh *p);

/* Finds intersecting faces of the instances a and b at a time. Sets red[0][i] to 1 if face i in the
 * file of `a` intersects `b`, and red[1][i] likewise for `b`. Allocates the arrays that are NULL;
 * the caller frees them. */
EBPO_MUST_USE ebpo_status painted_find_red(ebpo_scene *scene, uint64_t a, uint64_t b, double time,
                                           unsigned threads, uint8_t *red[2], ebpo_error *error);

/* Adds the faces of the instance's model. red: an array of painted_find_red, or NULL. paint: the
 * paint of faces that are not red. */
EBPO_MUST_USE ebpo_status painted_add(painted_mesh *p, const ebpo_scene *scene, uint64_t instance,
                                      double time, const uint8_t *red, uint8_t paint,
                                      ebpo_error *error);

/* Adds the bounding box of the instance's model instead of its faces. */
EBPO_MUST_USE ebpo_status painted_add_box(painted_mesh *p, const ebpo_scene *scene,
                                          uint64_t instance, double time, uint8_t paint,
                                          ebpo_error *error);

/* Removes faces whose boxes are outside the cube with centre `middle` and side 2 * half_side. */
void painted_crop(painted_mesh *p, const double middle[3], double half_side);

#endif
