/* The two inner loops of hulls and supports, four doubles at a time (sweep_kernels.c). They are
 * compiled once for each instruction set. Each variant does the same operations in the same order,
 * so the results are the same. */
#ifndef EBPO_CONSTRUCT_SWEEP_H
#define EBPO_CONSTRUCT_SWEEP_H

#include "core/cpu.h"
#include <stdint.h>

enum {
    EBPO_STRETCH = 8,        /* fours of points that share a box */
    EBPO_SWEEP_PLANES = 2048 /* maximum */
};

/* Planes n . x = d as a structure of arrays. The padding of the last four is a plane that no point
 * is above. */
typedef struct ebpo_sweep_planes {
    const double *nx, *ny, *nz, *d;
    int fours;
} ebpo_sweep_planes;

/* Points in fours: four x, four y, four z, and four values that are added to n . x. The padding of
 * the last four is a copy of a point. */
typedef struct ebpo_sweep_points {
    const double (*point)[4][4]; /* [fours] */
    /* for each stretch: least and greatest coordinates, greatest added value */
    const double (*box)[7];
    uint64_t fours;
} ebpo_sweep_points;

typedef struct ebpo_sweep {
    /* Finds all planes that p is above by more than `above`, but none if p is above no plane by
     * more than `beyond`. Writes the indices of the first `capacity` planes and returns the number
     * of all planes found. */
    int (*find_visible)(const ebpo_sweep_planes *planes, const double p[3], double beyond,
                        double above, uint16_t *list, int capacity);
    /* Raises *best to the greatest value among the points; ends when *best has reached `enough`.
     * Returns the index of the first point of the stretch with this value; UINT64_MAX when no value
     * is greater. */
    uint64_t (*highest)(const ebpo_sweep_points *points, const double n[3], double enough,
                        double *best);
} ebpo_sweep;

EBPO_KERNELS(ebpo_sweep, ebpo_sweep)

#endif
