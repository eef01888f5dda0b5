/* Computes the exact relation of two faces: apart, touching, crossing or coplanar. */
#ifndef EBPO_GEOMETRY_TRIANGLE_PAIR_H
#define EBPO_GEOMETRY_TRIANGLE_PAIR_H

#include <stdbool.h>

#include <ebpo/pair.h>

/* Compares two points by x, then y, then z: -1, 0 or 1. */
static inline int ebpo_corner_order(const double p[3], const double q[3])
{
    for (int k = 0; k < 3; k++)
        if (p[k] != q[k])
            return p[k] < q[k] ? -1 : 1;
    return 0;
}

/* Returns the relation of two faces, exact for all finite doubles. docs/develop/collision.md
 * defines the kinds. The result does not depend on the order of the faces or of their corners. All
 * functions are pure and may be called by any thread. */

ebpo_pair_kind ebpo_triangle_pair(const double a[3][3], const double b[3][3]);

/* Two faces A and B whose planes intersect in a line that both faces reach, prepared for the tests
 * on that line. The corners are reordered so that a[0] is alone on the positive side of B's plane,
 * and b[0] is alone on the positive side of A's plane. To achieve this, the orientation of a plane
 * may be flipped. */
typedef struct ebpo_prepared_pair {
    int a[3], b[3]; /* indices of corners */
    /* side_a[i]: side of A's original corner i relative to B's plane, before the plane is flipped;
     * side_b: the same for B's corners and A's plane */
    int side_a[3], side_b[3];
    bool flipped_a, flipped_b; /* true: the plane of A (of B) is flipped */
} ebpo_prepared_pair;

/* Returns true if the planes intersect in a line that both faces reach. Otherwise sets *kind to the
 * relation of the faces. */
bool ebpo_prepare_pair(const double a[3][3], const double b[3][3], ebpo_prepared_pair *out,
                       ebpo_pair_kind *kind);

/* Compares the points where two edges intersect the common line of the planes: the edge from a[0]
 * to a[corner_a], and the edge from b[0] to b[corner_b]. Returns 1 if the point of B's edge is
 * farther along the line than the point of A's edge, -1 if it is less far, 0 if the edges
 * intersect. The orientations of the reordered faces define the direction of the line. */
int ebpo_compare_ends(const double a[3][3], const double b[3][3], const ebpo_prepared_pair *t,
                      int corner_a, int corner_b);

#endif
