/* Double-double arithmetic for rays, compiled twice on x86-64 as distance_pairs.h is: for any
 * processor, and for those with FMA. Either's error bounds hold, so decisions are the same. Pure
 * functions. */
#ifndef EBPO_GEOMETRY_RAY_PAIRS_H
#define EBPO_GEOMETRY_RAY_PAIRS_H

#include "core/cpu.h"
#include "geometry/expansion.h"
#include "geometry/ray.h"

/* A value, at most `error` off. */
typedef struct ebpo_bounded {
    ebpo_pair x;
    double error;
} ebpo_bounded;

/* Where a line meets a triangle's plane: t = numerator / denominator, which is 0 when they are
 * parallel. */
typedef struct ebpo_plane_pairs {
    ebpo_bounded numerator, denominator;
    /* As ebpo_pair_quotient gives it, where it can. */
    bool has_quotient;
    double quotient[2];
} ebpo_plane_pairs;

typedef struct ebpo_ray_pairs {
    void (*plane)(const ebpo_segment *ray, const double triangle[3][3], ebpo_plane_pairs *out);
    /* d . (a x e), e = to - from */
    void (*edge)(const double d[3], const ebpo_pair a[3], const double from[3], const double to[3],
                 ebpo_bounded *out);
} ebpo_ray_pairs;

EBPO_KERNELS(ebpo_ray_pairs, ebpo_ray_pairs)

/* Far above every underflow error (2^-1075 each), and normal: arithmetic on denormals is slow. */
#define EBPO_RAY_SLACK 0x1p-960

#endif
