/* Reference implementation for two models at poses, by brute force: every pair of faces with near
 * boxes, in rational arithmetic (pair_reference.h). Independent of the library: uses only its
 * declarations. */
#ifndef EBPO_TESTS_MODELS_REFERENCE_H
#define EBPO_TESTS_MODELS_REFERENCE_H

#include <stdbool.h>
#include <stdint.h>

#include <ebpo/collide.h>

#include "query_support.h"

/* --- poses --- */

enum { REFERENCE_POSES = 16, REFERENCE_TURNED_APART = 14 };
const char *reference_pose_name(int kind);
/* Makes poses of a and b, two meshes of size `size`. The kinds are:
 * - identical poses, quarter turns, half a size along axes
 * - touching boxes, overlaps of 1e-9 of the size
 * - slight and deep overlaps, straight and rotated
 * - a small model inside the other
 * - apart by 0.01, 0.05 and 0.2
 * - far from the origin */
void reference_pose(int kind, double size, uint64_t *state, ebpo_pose *a, ebpo_pose *b);

/* --- faces --- */

typedef struct reference_faces {
    double (*corner)[3][3];
    uint64_t count;
    uint32_t *order; /* sorted by the least x */
} reference_faces;
/* Computes faces at a pose, by definition; the mesh has [vertices][3] floats or doubles. */
void reference_faces_make(reference_faces *out, const query_model *m, const ebpo_pose *pose);
void reference_faces_free(reference_faces *f);

/* Intersecting pairs, by a's face, then b's: indices in the files and kinds. */
typedef struct reference_found {
    uint64_t a, b;
    int kind;
} reference_found;
/* Returns the number of pairs; the caller frees *out. */
uint64_t reference_pairs(const reference_faces *a, const reference_faces *b, reference_found **out);

/* Checks a distance in exact arithmetic: no two faces are nearer than the double below `distance`,
 * and the faces at_a and at_b are not farther than the double above. Returns NULL, or a description
 * of the error. */
const char *reference_models_distance(const reference_faces *a, const reference_faces *b,
                                      double distance, uint64_t at_a, uint64_t at_b);

#endif
