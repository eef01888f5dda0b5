/* Declares the two inner loops (kernels) of convex hulls (hull_directions.c) and supports
 * (supports.h). They process four doubles at a time. sweep_kernels.c is compiled once for each
 * instruction set. Each variant does the same operations in the same order, so the results are the
 * same. */
#ifndef EBPO_CONSTRUCT_SWEEP_H
#define EBPO_CONSTRUCT_SWEEP_H

#include "core/cpu.h"
#include <stdint.h>

enum {
    EBPO_STRETCH = 8,        /* a stretch is 8 consecutive fours of points, with one box */
    EBPO_SWEEP_PLANES = 2048 /* maximum number of planes */
};

/* Planes n . x = d as a structure of arrays. The last four is padded with planes that no point is
 * above. */
typedef struct ebpo_sweep_planes {
    const double *nx, *ny, *nz, *d; /* [4 * fours] */
    int fours;                      /* number of planes / 4, rounded up */
} ebpo_sweep_planes;

/* Points in fours: four x, four y, four z, and four values that are added to n . x. The last four
 * is padded with copies of a point. */
typedef struct ebpo_sweep_points {
    const double (*point)[4][4]; /* [fours] */
    /* [stretch] three least and three greatest coordinates, greatest added value */
    const double (*box)[7];
    uint64_t fours; /* number of points / 4, rounded up */
} ebpo_sweep_points;

/* The kernels of a variant. */
typedef struct ebpo_sweep {
    /* If p is above some plane by more than `beyond`, finds all planes that p is above by more than
     * `above`; if not, finds none. Writes the indices of the first `capacity` planes found, and
     * returns the number of all. */
    int (*find_visible)(const ebpo_sweep_planes *planes, const double p[3], double beyond,
                        double above, uint16_t *list, int capacity);
    /* Raises *best to the greatest value of the points (n . x plus the added value); ends after a
     * stretch when *best has reached `enough`. Returns the index of the first point of the stretch
     * that contains this value, or UINT64_MAX if no value is greater than *best was. */
    uint64_t (*highest)(const ebpo_sweep_points *points, const double n[3], double enough,
                        double *best);
} ebpo_sweep;

EBPO_KERNELS(ebpo_sweep, ebpo_sweep)

#endif
