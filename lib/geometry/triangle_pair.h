/* Corners in the order of their coordinates: x, then y, then z. */
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

/* How two faces lie to each other, exact for every finite double; what the kinds mean is defined in
 * docs/develop/collision.md. Swapping the faces or renumbering corners changes nothing. Pure
 * functions, any thread. */

ebpo_pair_kind ebpo_triangle_pair(const double a[3][3], const double b[3][3]);

/* Two faces that have corners on both strict sides of each other's plane, or at least one there and
 * not all in it, turned for the tests on the common line: a[0] is alone on B's positive side, b[0]
 * on A's, after `flipped_b` and `flipped_a` have turned the planes. */
typedef struct ebpo_turned_pair {
    int a[3], b[3];           /* numbers of corners */
    int side_a[3], side_b[3]; /* of corners by their own number: of the other's plane as given */
    bool flipped_a, flipped_b;
} ebpo_turned_pair;

/* True: the planes meet in a line, which both faces reach. Else *kind is known. */
bool ebpo_turn_pair(const double a[3][3], const double b[3][3], ebpo_turned_pair *out,
                    ebpo_pair_kind *kind);

/* Sign of (end of B's edge b[0], b[v]) - (end of A's edge a[0], a[q]) on the common line, in the
 * direction in which a[0] a[1] a[2] and b[0] b[1] b[2] have theirs; 0: the edges meet. */
int ebpo_compare_ends(const double a[3][3], const double b[3][3], const ebpo_turned_pair *t, int q,
                      int v);

#endif
