/* A small convex hull, for directions only: what it gets wrong costs volume, never containment. */
#ifndef EBPO_CONSTRUCT_LEAF_PLANES_H
#define EBPO_CONSTRUCT_LEAF_PLANES_H

#include <stdint.h>

enum { EBPO_HULL_POINTS = 8192, EBPO_HULL_FACETS = 2048 };

typedef struct ebpo_hull_facet {
    uint16_t corner[3]; /* of the points, counter-clockwise seen from outside */
    double n[3], d;     /* unit normal outward: n . x <= d for the hull */
    double area;
} ebpo_hull_facet;

/* Triangles of the hull of points [count], at most EBPO_HULL_POINTS of them, of the order of 1;
 * returns how many, 0 when the points lie (nearly) in a plane. `facets` has room for `capacity`; a
 * hull of n points has 2 n - 4, but rounding may make more of them, and what does not fit is left
 * out. Points nearer than `tolerance` (1e-9 at least, or rounding makes facets) to the hull found
 * so far are left out. */
int ebpo_hull_facets(const double (*points)[3], int count, double tolerance,
                     ebpo_hull_facet *facets, int capacity);

/* For qsort: largest first; facets of equal area by their corners, so that the order is the same
 * everywhere. */
int ebpo_hull_by_area(const void *a, const void *b);

#endif
