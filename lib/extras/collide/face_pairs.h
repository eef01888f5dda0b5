/* Pairs of faces (triangles), each by itself: where they cross, their distance, their last contact
 * when one moves, and the filter that decides eight at a time in floats. For every finite double;
 * faces without area included. Pure functions, any thread; the results are the same with every
 * compiler and its flags. Bounds and proofs: docs/develop/collision.md. */
#ifndef EBPO_COLLIDE_FACE_PAIRS_H
#define EBPO_COLLIDE_FACE_PAIRS_H

#include <gmp.h>
#include <stdbool.h>
#include <stdint.h>

#include "core/cpu.h"
#include "geometry/distance.h"

/* An end of the common segment. Each coordinate is within 0.51 units in its last place, and 2^-60
 * of the greatest |coordinate| on that axis of the edge that pierces the other face, of the exact
 * one; corners are exact. */
typedef struct ebpo_contact_end {
    double point[3];
    ebpo_feature on_a, on_b; /* the lowest of each face that it is on; one is no interior */
} ebpo_contact_end;

/* The ends, in the direction of A's normal x B's. The faces are EBPO_PAIR_CROSSING; coordinates are
 * finite. Bits of `point` do not depend on which face is A, or on numbers of corners. */
void ebpo_triangle_contact(const double a[3][3], const double b[3][3], ebpo_contact_end out[2]);

/* --- distance: docs/develop/collision.md, "Distance of two faces" --- */

/* lo <= distance <= hi, certainly; of ordinary faces that are apart within 2^-42 of their sizes and
 * distance, of faces that meet hi may be far too great. point: of A and of B, at hi or less,
 * nearest ones as far as doubles tell. Overflow and underflow give wide bounds, never wrong ones.
 */
typedef struct ebpo_pair_distance_bounds {
    double lo, hi;
    double point[2][3];
    int feature[2]; /* that the points are on: 0 to 2 corners, 3 to 5 the edges after them, 6 inside
                     */
    bool certain;   /* the exact nearest points are on these, so their distance is the faces' */
} ebpo_pair_distance_bounds;
void ebpo_triangles_distance_bounds(const double a[3][3], const double b[3][3],
                                    ebpo_pair_distance_bounds *out);

/* True: the exact distances of both pairs are certainly equal, as they are those of the same
 * corners or edges, or of faces with the same corners, or of two planes across an axis. Faces
 * around an edge or corner often are so, and those of flat sides. */
bool ebpo_same_distance(const double a[3][3], const double b[3][3],
                        const ebpo_pair_distance_bounds *ab, const double c[3][3],
                        const double d[3][3], const ebpo_pair_distance_bounds *cd);

/* The double nearest to the exact distance, ties to even; 0 where the faces meet, INFINITY when it
 * overflows. Allocates through GMP. */
double ebpo_triangles_distance(const double a[3][3], const double b[3][3]);

/* Sign of distance(a, b) - distance(c, d), exact. */
int ebpo_triangles_distance_compare(const double a[3][3], const double b[3][3],
                                    const double c[3][3], const double d[3][3]);

/* Sign of distance(a, b) - distance, exact; distance >= 0 or INFINITY. */
int ebpo_triangles_distance_compare_to(const double a[3][3], const double b[3][3], double distance);

/* --- the last contact of a moving face: docs/develop/collision.md, "The way out" --- */

/* numerator / denominator * 2^unit, denominator > 0; or never. */
typedef struct ebpo_sweep_time {
    mpz_t numerator, denominator;
    int unit;
    bool ever;
} ebpo_sweep_time;

void ebpo_sweep_time_init(ebpo_sweep_time *t); /* never */
void ebpo_sweep_time_clear(ebpo_sweep_time *t);
/* Sign of x - y; never is less than all. */
int ebpo_sweep_time_compare(const ebpo_sweep_time *x, const ebpo_sweep_time *y);
/* The nearest double, ties to even; -INFINITY: never. */
double ebpo_sweep_time_round(const ebpo_sweep_time *t);

/* The greatest t, also less than 0, for which `a` moved by t * direction and `b` have a common
 * point. The direction is not 0. Allocates through GMP. */
void ebpo_sweep_last(const double a[3][3], const double b[3][3], const double direction[3],
                     ebpo_sweep_time *out);

/* At least the greatest such t within 0 .. limit; less than 0: certainly none is there. The
 * direction's greatest component is within 1/2 .. 2 in size; limit may be INFINITY. */
double ebpo_sweep_most(const double a[3][3], const double b[3][3], const double direction[3],
                       double limit);

/* --- the filter, compiled for several instruction sets with the same results --- */

/* A bit for each pair; those in neither are open. */
typedef struct ebpo_pair_masks {
    uint8_t apart;    /* EBPO_PAIR_APART */
    uint8_t crossing; /* EBPO_PAIR_CROSSING */
} ebpo_pair_masks;

/* Pairs of two blocks that are not certainly apart: lane of a, then lane of b << 3, and
 * EBPO_CERTAINLY_CROSSING; by the lane of b, then of a. */
enum { EBPO_CERTAINLY_CROSSING = 64 };
typedef struct ebpo_block_pairs {
    uint8_t pair[64];
    unsigned count;
} ebpo_block_pairs;

/* Faces are [9][8] floats: x, y, z of corner 0, of corner 1, of corner 2, of eight faces each. Each
 * is within `error` (0 or more) of the exact coordinate less that of a point, the same one for both
 * faces of a pair, and at most 2^36 in size. Lanes without a face may hold anything, and their bits
 * mean nothing. */
typedef struct ebpo_pair_kernels {
    /* One face, [9], with each of eight. */
    ebpo_pair_masks (*one)(const float *a, const float *b, float error);
    /* Lane i of a with lane i of b. */
    ebpo_pair_masks (*eight)(const float *a, const float *b, float error);
    /* Each face of a with each of b, where they are among `lanes`. */
    void (*blocks)(const float *a, unsigned lanes_a, const float *b, unsigned lanes_b, float error,
                   ebpo_block_pairs *out);
} ebpo_pair_kernels;

EBPO_KERNELS(ebpo_pair_kernels, ebpo_pair_kernels)

#endif
