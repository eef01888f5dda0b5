/* Declares three inner loops (kernels): find_visible for convex hulls (hull_directions.c),
 * `highest` for supports (supports.h), and find_octants for faces and cells (triangle_cell.c).
 * They process four doubles at a time. sweep_kernels.c is compiled once for each instruction set.
 * All these variants do the same operations in the same order, so they give the same results. */
#ifndef EBPO_CONSTRUCT_SWEEP_H
#define EBPO_CONSTRUCT_SWEEP_H

#include "core/cpu.h"
#include <stdint.h>

enum {
    EBPO_STRETCH = 8,         /* a stretch is 8 consecutive groups of four points, with one box */
    EBPO_SWEEP_PLANES = 2048, /* maximum number of planes */
    /* number of directions of extreme points: three axes and four diagonals, both ways */
    EBPO_SWEEP_EXTREMES = 14
};

/* The plane n . x = d of a triangle; n has the length 1. `length` is the length of the cross
 * product of two edges: twice the area of the triangle. */
typedef struct ebpo_sweep_plane {
    double n[3], d, length;
} ebpo_sweep_plane;

/* Planes n . x = d as a structure of arrays. Their number is a multiple of four; if necessary, the
 * last planes are dummies, above which there is no point. */
typedef struct ebpo_sweep_planes {
    const double *nx, *ny, *nz, *d; /* [4 * fours] */
    int fours;                      /* number of groups of four planes */
} ebpo_sweep_planes;

/* Points in groups of four. A group has four x, four y, four z, and four values that are added to n
 * . x. If the last group has fewer than four points, it also has copies of one of them. */
typedef struct ebpo_sweep_points {
    const double (*point)[4][4]; /* [fours] */
    /* [stretch] three least and three greatest coordinates, and the greatest added value, of the
     * points of the stretch */
    const double (*box)[7];
    uint64_t fours; /* number of groups */
} ebpo_sweep_points;

/* A cell in the model's coordinates: lowest corner, centre and size. The last lane repeats the z
 * axis. */
typedef struct ebpo_sweep_cell {
    double low[4], centre[4], size[4];
} ebpo_sweep_cell;

/* The kernels, compiled for one instruction set. */
typedef struct ebpo_sweep {
    /* Finds the extreme point in each direction w: at[w] is its index, the first one if several
     * points are extreme. Directions 2 * w and 2 * w + 1 are opposite. Directions 0 to 5 are along
     * the axes, the others along the diagonals. */
    void (*find_extremes)(const double (*p)[3], int count, int at[EBPO_SWEEP_EXTREMES]);
    /* Computes the planes of `count` triangles with the corner `apex`. Edge i, from p[edge[i] >>
     * 16] to p[edge[i] & 0xffff], is the side of triangle i that is opposite to the apex. Corners
     * are counter-clockwise seen from the side to which n points. */
    void (*make_planes)(const double (*p)[3], const uint32_t *edge, int count, int apex,
                        ebpo_sweep_plane *out);
    /* The height of p above a plane is n . p - d. If the height above at least one plane is more
     * than `beyond`, finds all planes above which the height is more than `above`. Otherwise finds
     * none. Writes the indices of the first `capacity` planes found, and returns the number of all
     * planes found. */
    int (*find_visible)(const ebpo_sweep_planes *planes, const double p[3], double beyond,
                        double above, uint16_t *list, int capacity);
    /* The value of a point is n . x plus its added value. Raises *best to the greatest value of the
     * points; ends after a stretch when *best has reached `enough`. Returns the index of the first
     * point of the stretch that contains this value, or UINT64_MAX if *best was not raised. */
    uint64_t (*highest)(const ebpo_sweep_points *points, const double n[3], double enough,
                        double *best);
    /* Returns a mask of the octants of a cell that a face may touch. An octant is omitted only if
     * the face's bounding box or a plane certainly separates the face from it. */
    unsigned (*find_octants)(const ebpo_sweep_cell *cell, const double face[3][3]);
} ebpo_sweep;

EBPO_KERNELS(ebpo_sweep, ebpo_sweep)

#endif
