/* Functions on single pairs of faces (triangles): where they cross, their distance, their last
 * contact when one moves, and the filter that decides eight at a time in floats. All finite doubles
 * and faces without area are supported. Pure functions, any thread; the results are the same with
 * every compiler and its flags. Bounds and proofs: docs/develop/collision.md. */
#ifndef EBPO_COLLIDE_FACE_PAIRS_H
#define EBPO_COLLIDE_FACE_PAIRS_H

#include <gmp.h>
#include <stdbool.h>
#include <stdint.h>

#include "core/cpu.h"
#include "geometry/distance.h"

/* An end of the common segment. Each coordinate differs from the exact one by at most 0.51 units in
 * its last place, and 2^-60 of the greatest |coordinate| on that axis of the edge that pierces the
 * other face; corners are exact. */
typedef struct ebpo_contact_end {
    double point[3];
    ebpo_feature on_a, on_b; /* the lowest-dimensional feature of each face that contains it; one is
                              * no interior */
} ebpo_contact_end;

/* Computes the ends, in the direction of A's normal x B's. The faces must be EBPO_PAIR_CROSSING
 * with finite coordinates. Bits of `point` do not depend on which face is A, or on numbers of
 * corners. */
void ebpo_triangle_contact(const double a[3][3], const double b[3][3], ebpo_contact_end out[2]);

/* --- distance: docs/develop/collision.md, "Distance of two faces" --- */

/* Certainly lo <= distance <= hi. For ordinary faces that are apart the bounds are within 2^-42 of
 * their sizes and distance; for intersecting faces hi may be far too great. point: points of A and
 * of B at a distance of at most hi, the nearest ones up to rounding. Overflow and underflow give
 * wide bounds, never wrong ones. */
typedef struct ebpo_pair_distance_bounds {
    double lo, hi;
    double point[2][3];
    int feature[2]; /* features that contain the points: 0 to 2 corners, 3 to 5 the edges after
                     * them, 6 inside */
    bool certain;   /* the exact nearest points are on these, so their distance is the faces'
                     * distance */
} ebpo_pair_distance_bounds;
void ebpo_triangles_distance_bounds(const double a[3][3], const double b[3][3],
                                    ebpo_pair_distance_bounds *out);

/* Returns true if the exact distances of both pairs are certainly equal: between the same corners
 * or edges, between faces with the same corners, or between two planes across an axis. This is
 * common for faces around an edge or corner, and for faces of flat sides. */
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

/* The time numerator / denominator * 2^unit, denominator > 0; or never. */
typedef struct ebpo_sweep_time {
    mpz_t numerator, denominator;
    int unit;
    bool ever;
} ebpo_sweep_time;

void ebpo_sweep_time_init(ebpo_sweep_time *t); /* never */
void ebpo_sweep_time_clear(ebpo_sweep_time *t);
/* Returns the sign of x - y; never is less than all. */
int ebpo_sweep_time_compare(const ebpo_sweep_time *x, const ebpo_sweep_time *y);
/* Returns the nearest double, ties to even; -INFINITY: never. */
double ebpo_sweep_time_round(const ebpo_sweep_time *t);

/* Computes the greatest t, which may be negative, for which `a` moved by t * direction and `b` have
 * a common point. The direction must not be 0. Allocates through GMP. */
void ebpo_sweep_last(const double a[3][3], const double b[3][3], const double direction[3],
                     ebpo_sweep_time *out);

/* Returns an upper bound of the greatest such t within 0 .. limit; negative: there is certainly
 * none. The direction's greatest component is within 1/2 .. 2 in size; limit may be INFINITY. */
double ebpo_sweep_max(const double a[3][3], const double b[3][3], const double direction[3],
                      double limit);

/* --- the filter, compiled for several instruction sets with the same results --- */

/* A bit for each pair; pairs in neither are open. */
typedef struct ebpo_pair_masks {
    uint8_t apart;    /* EBPO_PAIR_APART */
    uint8_t crossing; /* EBPO_PAIR_CROSSING */
} ebpo_pair_masks;

/* Pairs of two blocks that are not certainly apart: lane of a, then lane of b << 3, and
 * EBPO_CERTAINLY_CROSSING; ordered by the lane of b, then of a. */
enum { EBPO_CERTAINLY_CROSSING = 64 };
typedef struct ebpo_block_pairs {
    uint8_t pair[64];
    unsigned count;
} ebpo_block_pairs;

/* Faces are [9][8] floats: x, y, z of corner 0, of corner 1, of corner 2, of eight faces each.
 * Coordinates are relative to an origin, the same one for both faces of a pair. Each float is
 * within `error` (0 or more) of the exact value and at most 2^36 in size. Lanes without a face may
 * hold anything, and their bits mean nothing. */
typedef struct ebpo_pair_kernels {
    /* Compares one face, [9], with each of eight. */
    ebpo_pair_masks (*one)(const float *a, const float *b, float error);
    /* Compares lane i of a with lane i of b. */
    ebpo_pair_masks (*eight)(const float *a, const float *b, float error);
    /* Compares each face of a with each of b, for lanes in `lanes`. */
    void (*blocks)(const float *a, unsigned lanes_a, const float *b, unsigned lanes_b, float error,
                   ebpo_block_pairs *out);
} ebpo_pair_kernels;

EBPO_KERNELS(ebpo_pair_kernels, ebpo_pair_kernels)

#endif
