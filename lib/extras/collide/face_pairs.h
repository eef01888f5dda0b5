/* Functions on single pairs of faces (triangles): where two faces cross, their distance, their last
 * contact when one of them moves, and the filter that decides eight pairs at a time in floats. All
 * finite coordinates are supported, also faces without area. All functions are pure and can be
 * called from any thread; results do not depend on compilers and their flags. Bounds and proofs:
 * docs/develop/collision.md. */
#ifndef EBPO_COLLIDE_FACE_PAIRS_H
#define EBPO_COLLIDE_FACE_PAIRS_H

#include <gmp.h>
#include <stdbool.h>
#include <stdint.h>

#include "core/cpu.h"
#include "geometry/distance.h"

/* An end of the common segment. If it is a corner of a face, `point` is exact. Otherwise the error
 * of each coordinate is at most 0.51 units in its last place, plus 2^-60 times the greatest
 * |coordinate|, on that axis, of the edge that pierces the other face. */
typedef struct ebpo_contact_end {
    double point[3];
    ebpo_feature on_a, on_b; /* for each face, the feature of lowest dimension that contains the
                              * end; at most one of them is an interior */
} ebpo_contact_end;

/* Computes the ends, in the direction of the cross product of A's and B's normals. The faces must
 * be EBPO_PAIR_CROSSING with finite coordinates. The bits of `point` do not change when the faces
 * are swapped or their corners renumbered. */
void ebpo_triangle_contact(const double a[3][3], const double b[3][3], ebpo_contact_end out[2]);

/* --- distance: docs/develop/collision.md, "Distance of two faces" --- */

/* Bounds of the distance of two faces: certainly lo <= distance <= hi. For disjoint faces of
 * ordinary size the bounds differ from the distance by at most 2^-42 of the sum of the faces' sizes
 * and the distance. For intersecting faces hi may be far too great. Overflow and underflow give
 * wide bounds, never wrong ones. */
typedef struct ebpo_pair_distance_bounds {
    double lo, hi;
    double point[2][3]; /* points of A and of B at a distance of at most hi: the nearest points
                         * except for rounding */
    int feature[2];     /* features that contain the points: 0 to 2: a corner, 3 to 5: the edge from
                         * corner 0 to 2 to the next one, 6: the interior */
    bool certain;       /* these features contain the exact nearest points, so the distance of the
                         * features is that of the faces */
} ebpo_pair_distance_bounds;
void ebpo_triangles_distance_bounds(const double a[3][3], const double b[3][3],
                                    ebpo_pair_distance_bounds *out);

/* Returns true if the exact distances of the pairs a, b and c, d are certainly equal: both are
 * between the same corners or edges, between faces with the same corners, or between the same two
 * planes perpendicular to an axis. This is common for faces around an edge or corner, and for faces
 * of flat sides. ab, cd: results of ebpo_triangles_distance_bounds. */
bool ebpo_same_distance(const double a[3][3], const double b[3][3],
                        const ebpo_pair_distance_bounds *ab, const double c[3][3],
                        const double d[3][3], const ebpo_pair_distance_bounds *cd);

/* Returns the double nearest to the exact distance, ties to even; 0 where the faces intersect,
 * INFINITY when it overflows. Allocates through GMP. */
double ebpo_triangles_distance(const double a[3][3], const double b[3][3]);

/* Returns the exact sign of distance(a, b) - distance(c, d). */
int ebpo_triangles_distance_compare(const double a[3][3], const double b[3][3],
                                    const double c[3][3], const double d[3][3]);

/* Returns the exact sign of distance(a, b) - distance; distance >= 0 or INFINITY. */
int ebpo_triangles_distance_compare_to(const double a[3][3], const double b[3][3], double distance);

/* --- the last contact of a moving face: docs/develop/collision.md, "Separation distance along a
 * direction" --- */

/* The time numerator / denominator * 2^unit, with denominator > 0. If `ever` is false, it is
 * "never". */
typedef struct ebpo_sweep_time {
    mpz_t numerator, denominator;
    int unit;
    bool ever;
} ebpo_sweep_time;

void ebpo_sweep_time_init(ebpo_sweep_time *t); /* never */
void ebpo_sweep_time_clear(ebpo_sweep_time *t);
/* Returns the sign of x - y; never is less than all times. */
int ebpo_sweep_time_compare(const ebpo_sweep_time *x, const ebpo_sweep_time *y);
/* Returns the nearest double, ties to even; -INFINITY: never. */
double ebpo_sweep_time_round(const ebpo_sweep_time *t);

/* Computes the greatest t, which may be negative, such that `a` moved by t * direction has a common
 * point with `b`; never: there is none. The direction must not be 0. Allocates through GMP. */
void ebpo_sweep_last(const double a[3][3], const double b[3][3], const double direction[3],
                     ebpo_sweep_time *out);

/* Returns an upper bound of the t of ebpo_sweep_last if that is in 0 .. limit; a negative number:
 * certainly no t in 0 .. limit gives a common point. The greatest component of the direction must
 * have an absolute value of 1/2 to 2; limit may be INFINITY. */
double ebpo_sweep_max(const double a[3][3], const double b[3][3], const double direction[3],
                      double limit);

/* --- the filter, compiled for several instruction sets with the same results --- */

/* A bit for each pair; pairs in neither mask are undecided. */
typedef struct ebpo_pair_masks {
    uint8_t apart;    /* EBPO_PAIR_APART */
    uint8_t crossing; /* EBPO_PAIR_CROSSING */
} ebpo_pair_masks;

/* The pairs of faces of two blocks that are not certainly apart. An entry is the lane of a, plus 8
 * times the lane of b, plus EBPO_CERTAINLY_CROSSING if the pair certainly crosses. Entries are
 * ordered by the lane of b, then by that of a. */
enum { EBPO_CERTAINLY_CROSSING = 64 };
typedef struct ebpo_block_pairs {
    uint8_t pair[64];
    unsigned count;
} ebpo_block_pairs;

/* Eight faces are [9][8] floats: x, y, z of corner 0, of corner 1, of corner 2. Coordinates are
 * relative to an origin, which is the same for both faces of a pair. Each float is within `error`
 * (0 or more) of the exact value, and its absolute value is at most 2^36. Lanes without a face may
 * have any values; their bits have no meaning. */
typedef struct ebpo_pair_kernels {
    /* Compares one face, [9], with each of the eight faces of b. */
    ebpo_pair_masks (*one)(const float *a, const float *b, float error);
    /* Compares lane i of a with lane i of b. */
    ebpo_pair_masks (*eight)(const float *a, const float *b, float error);
    /* Compares each face of a with each face of b, for the given lanes. */
    void (*blocks)(const float *a, unsigned lanes_a, const float *b, unsigned lanes_b, float error,
                   ebpo_block_pairs *out);
} ebpo_pair_kernels;

EBPO_KERNELS(ebpo_pair_kernels, ebpo_pair_kernels)

#endif
