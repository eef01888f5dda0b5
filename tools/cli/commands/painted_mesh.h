/* Instances of a scene at their places, as one mesh with painted faces. */
#ifndef EBPO_TOOLS_PAINTED_MESH_H
#define EBPO_TOOLS_PAINTED_MESH_H

#include <ebpo/scene.h>

/* Zero at first. */
typedef struct painted_mesh {
    ebpo_mesh mesh; /* xyz64 */
    uint8_t *paint; /* of raster.h, of each face */
} painted_mesh;

void painted_free(painted_mesh *p);

/* Which faces of two instances meet at a time: bytes by numbers in the files, to be freed. */
EBPO_MUST_USE ebpo_status painted_find_red(ebpo_scene *scene, uint64_t a, uint64_t b, double time,
                                           unsigned threads, uint8_t *red[2], ebpo_error *error);

/* `red`: bytes of faces that are red, or NULL. */
EBPO_MUST_USE ebpo_status painted_add(painted_mesh *p, const ebpo_scene *scene, uint64_t instance,
                                      double time, const uint8_t *red, uint8_t paint,
                                      ebpo_error *error);

/* The box of its model instead. */
EBPO_MUST_USE ebpo_status painted_add_box(painted_mesh *p, const ebpo_scene *scene,
                                          uint64_t instance, double time, uint8_t paint,
                                          ebpo_error *error);

/* Leaves faces out that are farther than `reach` from `middle` on some axis. */
void painted_crop(painted_mesh *p, const double middle[3], double reach);

#endif
