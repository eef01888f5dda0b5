/* Compares corners by their coordinates: x, then y, then z. */
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

/* Two faces that have corners on both strict sides of each other's plane, or at least one there and
 * not all in it, turned for the tests on the common line: a[0] is alone on B's positive side, b[0]
 * on A's, after `flipped_b` and `flipped_a` have turned the planes. */
typedef struct ebpo_turned_pair {
    int a[3], b[3]; /* indices of corners */
    int side_a[3],
        side_b[3]; /* sides of corners by their own index: of the other's plane as given */
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
