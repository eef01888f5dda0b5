/* Two models at poses by brute force: every pair of faces whose boxes are near enough, judged in
 * rational arithmetic (pair_twin.h). Written apart from the library: nothing of it is called here,
 * only its declarations are used. */
#ifndef EBPO_TESTS_MODELS_TWIN_H
#define EBPO_TESTS_MODELS_TWIN_H

#include <stdbool.h>
#include <stdint.h>

#include <ebpo/collide.h>

#include "query_kit.h"

/* --- poses --- */

enum { TWIN_POSES = 16, TWIN_TURNED_APART = 14 };
const char *twin_pose_name(int kind);
/* Of a and b as meshes of sizes `size`: identical, quarter turns, half a size along axes, boxes
 * that touch, 1e-9 of the size, slight and deep ones, straight and turned about, one small within
 * the other, apart by 0.01, 0.05 and 0.2, far from the origin. */
void twin_pose(int kind, double size, uint64_t *state, ebpo_pose *a, ebpo_pose *b);

/* --- faces --- */

typedef struct twin_faces {
    double (*corner)[3][3];
    uint64_t count;
    uint32_t *order; /* by the least x */
} twin_faces;
/* At a pose, by its definition; the mesh has [vertices][3] floats or doubles. */
void twin_faces_make(twin_faces *out, const query_model *m, const ebpo_pose *pose);
void twin_faces_free(twin_faces *f);

/* Pairs that meet, by a's face, then b's: numbers in the files and kinds. */
typedef struct twin_met {
    uint64_t a, b;
    int kind;
} twin_met;
/* Returns how many; *out is the caller's to free. */
uint64_t twin_pairs(const twin_faces *a, const twin_faces *b, twin_met **out);

/* NULL: no two faces are nearer to each other than the double below `distance`, those at a and b
 * not farther than the one above, in exact arithmetic. Else what is not so. */
const char *twin_models_distance(const twin_faces *a, const twin_faces *b, double distance,
                                 uint64_t at_a, uint64_t at_b);

#endif
