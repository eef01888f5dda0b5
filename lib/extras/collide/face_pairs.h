/* Computes for a single pair of faces (triangles) the segment where the faces cross, their
 * distance, and their last contact when one face moves. Also declares the filter, which decides
 * eight pairs at a time in floats. Functions accept all finite coordinates. If no comment excludes
 * faces without area, functions accept them, too. All functions are pure and can be called from any
 * thread; results do not depend on compilers and their flags. Bounds and proofs:
 * docs/develop/collision.md. */
#ifndef EBPO_COLLIDE_FACE_PAIRS_H
#define EBPO_COLLIDE_FACE_PAIRS_H

#include <gmp.h>
#include <stdbool.h>
#include <stdint.h>

#include "core/cpu.h"
#include "geometry/distance.h"

/* An end of the segment that two crossing faces have in common. If the end is a corner of a face,
 * `point` is exact. Otherwise the end is the point where an edge of one face pierces the other
 * face. Then the error of each coordinate is at most 0.51 units in the last place, plus 2^-60 times
 * the greatest absolute value of the edge's coordinates on this axis. */
typedef struct ebpo_contact_end {
    double point[3];
    ebpo_feature on_a, on_b; /* for each face, the feature of lowest dimension that contains the
                              * end; at most one of both features is an interior */
} ebpo_contact_end;

/* Computes both ends of the common segment, in the order of the direction (normal of a) x (normal
 * of b). The pair must be EBPO_PAIR_CROSSING. The bits of `point` do not change when the faces are
 * swapped or their corners renumbered. */
void ebpo_triangle_contact(const double a[3][3], const double b[3][3], ebpo_contact_end out[2]);

/* --- distance: docs/develop/collision.md, "Distance of two faces" --- */

/* Bounds of the distance of two faces: certainly lo <= distance <= hi. For disjoint faces of
 * ordinary size, the bounds differ from the distance by at most 2^-42 times the sum of both faces'
 * sizes and the distance. For intersecting faces, hi may be far too great. Overflow and underflow
 * make the bounds wide, but never wrong. */
typedef struct ebpo_pair_distance_bounds {
    double lo, hi;
    double point[2][3]; /* points of A and of B at a distance of at most hi: the nearest points
                         * except for rounding */
    int feature[2];     /* features that contain the points; 0 to 2: the corner with this index;
                         * 3 to 5: the edge from corner feature - 3 to the next corner; 6: the
                         * interior */
    bool certain;       /* the features contain the exact nearest points, so the distance of the
                         * features is the distance of the faces */
} ebpo_pair_distance_bounds;
void ebpo_triangles_distance_bounds(const double a[3][3], const double b[3][3],
                                    ebpo_pair_distance_bounds *out);

/* Returns true if the exact distances of the pairs a, b and c, d are certainly equal for one of
 * three reasons. Both pairs have the same corners. Or both distances are distances of the same two
 * corners or edges. Or both distances are distances of the same two planes, which are perpendicular
 * to an axis. These cases are common around an edge or corner, and on flat sides of models. Returns
 * false if none of these reasons applies; the distances may still be equal. ab, cd: results of
 * ebpo_triangles_distance_bounds for the two pairs. */
bool ebpo_same_distance(const double a[3][3], const double b[3][3],
                        const ebpo_pair_distance_bounds *ab, const double c[3][3],
                        const double d[3][3], const ebpo_pair_distance_bounds *cd);

/* Returns the double nearest to the exact distance, ties to even; 0 if the faces intersect,
 * INFINITY if the distance overflows a double. Allocates through GMP. */
double ebpo_triangles_distance(const double a[3][3], const double b[3][3]);

/* Returns the exact sign of distance(a, b) - distance(c, d). */
int ebpo_triangles_distance_compare(const double a[3][3], const double b[3][3],
                                    const double c[3][3], const double d[3][3]);

/* Returns the exact sign of distance(a, b) - distance; distance >= 0 or INFINITY. */
int ebpo_triangles_distance_compare_to(const double a[3][3], const double b[3][3], double distance);

/* --- the last contact of a moving face: docs/develop/collision.md, "Separation distance along a
 * direction" --- */

/* The time t = numerator / denominator * 2^unit of a motion, with denominator > 0; or, if `ever` is
 * false, the value "never". */
typedef struct ebpo_sweep_time {
    mpz_t numerator, denominator;
    int unit;
    bool ever;
} ebpo_sweep_time;

/* Initialises a time, and sets it to "never". */
void ebpo_sweep_time_init(ebpo_sweep_time *t);
/* Frees the numbers of a time. */
void ebpo_sweep_time_clear(ebpo_sweep_time *t);
/* Returns the sign of x - y; "never" is less than all times. */
int ebpo_sweep_time_compare(const ebpo_sweep_time *x, const ebpo_sweep_time *y);
/* Returns the nearest double, ties to even; -INFINITY for "never". */
double ebpo_sweep_time_round(const ebpo_sweep_time *t);

/* Computes the greatest t, which may be negative, such that `a` moved by t * direction has a common
 * point with `b`; "never" if no t has this property. The direction must not be 0. Allocates through
 * GMP. */
void ebpo_sweep_last(const double a[3][3], const double b[3][3], const double direction[3],
                     ebpo_sweep_time *out);

/* Returns an upper bound of the times t in 0 .. limit at which `a`, moved by t * direction, has a
 * common point with `b`. Returns a negative number if there is certainly no such time. The greatest
 * component of the direction must have an absolute value of 1/2 to 2. `limit` may be INFINITY. */
double ebpo_sweep_max(const double a[3][3], const double b[3][3], const double direction[3],
                      double limit);

/* --- the filter, compiled for several instruction sets with the same results ---
 *
 * The filter decides most pairs in floats. Pairs that it leaves undecided get the exact test
 * (ebpo_triangle_pair). */

/* Bit i of a mask belongs to pair i; a pair in neither mask is undecided. */
typedef struct ebpo_pair_masks {
    uint8_t apart;    /* EBPO_PAIR_APART */
    uint8_t crossing; /* EBPO_PAIR_CROSSING */
} ebpo_pair_masks;

enum { EBPO_CERTAINLY_CROSSING = 64 }; /* a bit of an entry of ebpo_block_pairs */

/* The pairs of faces of two blocks a and b that are not certainly apart. A lane is the index 0 to 7
 * of a face in its block. */
typedef struct ebpo_block_pairs {
    /* [count] an entry is the lane in a, plus 8 times the lane in b, plus EBPO_CERTAINLY_CROSSING
     * if the pair certainly crosses. Entries are ordered by the lane in b, then by the lane in a.
     */
    uint8_t pair[64];
    unsigned count;
} ebpo_block_pairs;

/* The functions of the filter. Eight faces are given as [9][8] floats: x, y, z of corner 0, then of
 * corner 1, then of corner 2. Coordinates are relative to an origin, which is the same for both
 * faces of a pair. Each float differs from the exact value by at most `error` (0 or more), and its
 * absolute value is at most 2^36. Lanes without a face may have any values; the bits of these lanes
 * in the result have no meaning. */
typedef struct ebpo_pair_kernels {
    /* Compares one face ([9] floats) with each of the eight faces of b. */
    ebpo_pair_masks (*one)(const float *a, const float *b, float error);
    /* Compares lane i of a with lane i of b. */
    ebpo_pair_masks (*eight)(const float *a, const float *b, float error);
    /* Compares each face of a with each face of b, for the lanes whose bits are set. */
    void (*blocks)(const float *a, unsigned lanes_a, const float *b, unsigned lanes_b, float error,
                   ebpo_block_pairs *out);
} ebpo_pair_kernels;

EBPO_KERNELS(ebpo_pair_kernels, ebpo_pair_kernels)

#endif
