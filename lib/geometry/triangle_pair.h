/* The relation of two faces: apart, touching, crossing or coplanar. Exact. */
#ifndef EBPO_GEOMETRY_TRIANGLE_PAIR_H
#define EBPO_GEOMETRY_TRIANGLE_PAIR_H

#include <stdbool.h>

#include <ebpo/pair.h>

static inline int ebpo_corner_order(const double p[3], const double q[3])
{
    for (int k = 0; k < 3; k++)
        if (p[k] != q[k])
            return p[k] < q[k] ? -1 : 1;
    return 0;
}

/* Returns the relation of two faces, exact for every finite double; docs/develop/collision.md
 * defines the kinds. Swapping the faces or renumbering corners changes nothing. Pure functions, any
 * thread. */

ebpo_pair_kind ebpo_triangle_pair(const double a[3][3], const double b[3][3]);

/* Two faces A and B whose planes intersect in a line that both faces reach, prepared for the tests
 * on that line. The corners are turned so that a[0] is alone on the positive side of B's plane, and
 * b[0] alone on that of A's plane. `flipped_b` and `flipped_a` say whether the orientation of B's
 * and A's plane was reversed for this. */
typedef struct ebpo_turned_pair {
    int a[3], b[3]; /* indices of corners */
    /* side of each corner, by its index in its face, relative to the other face's plane before it
     * is flipped */
    int side_a[3], side_b[3];
    bool flipped_a, flipped_b;
} ebpo_turned_pair;

/* Returns true if the planes intersect in a line that both faces reach; otherwise sets *kind. */
bool ebpo_turn_pair(const double a[3][3], const double b[3][3], ebpo_turned_pair *out,
                    ebpo_pair_kind *kind);

/* Returns the sign of (end of B's edge b[0], b[v]) - (end of A's edge a[0], a[q]) on the common
 * line, directed by the orientation of a[0] a[1] a[2] and b[0] b[1] b[2]; 0: the edges intersect.
 */
int ebpo_compare_ends(const double a[3][3], const double b[3][3], const ebpo_turned_pair *t, int q,
                      int v);

#endif
