#include "core/strict_fp.h"

#include "extras/collide/neighbours.h"

#include <string.h>

#include "geometry/predicates.h"
#include "geometry/corner_order.h"
#include "geometry/triangle_pair.h"

/* The edge against corner i, as a face without area. */
static void opposite(const double a[3][3], int i, double out[3][3])
{
    memcpy(out[0], a[(i + 1) % 3], sizeof out[0]);
    memcpy(out[1], a[(i + 2) % 3], sizeof out[1]);
    memcpy(out[2], out[1], sizeof out[2]);
}

static bool edge_meets(const double a[3][3], int i, const double b[3][3])
{
    double edge[3][3];
    opposite(a, i, edge);
    return ebpo_triangle_pair((const double(*)[3])edge, b) != EBPO_PAIR_APART;
}

/* Two convex sets with one corner in common have more if, going from there to another common point
 * and on, one comes to an edge against that corner while still in the other face. */
static ebpo_pair_kind one_corner(const double a[3][3], int i, const double b[3][3], int k)
{
    ebpo_pair_kind kind = ebpo_triangle_pair(a, b);
    if (kind == EBPO_PAIR_TOUCHING && !edge_meets(a, i, b) && !edge_meets(b, k, a))
        return EBPO_PAIR_APART;
    return kind;
}

/* With an edge in common, planes that differ have no other point. */
static ebpo_pair_kind one_edge(const double a[3][3], const double b[3][3])
{
    for (int k = 0; k < 3; k++)
        if (ebpo_orient3d(a[0], a[1], a[2], b[k]) != 0)
            return EBPO_PAIR_APART;
    return ebpo_triangle_pair(a, b) == EBPO_PAIR_COPLANAR ? EBPO_PAIR_COPLANAR : EBPO_PAIR_APART;
}

ebpo_pair_kind ebpo_neighbours(const double a[3][3], const double b[3][3])
{
    int shared = 0, in_a = 0, in_b = 0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            if (ebpo_corner_order(a[i], b[k]) == 0) {
                shared++;
                in_a = i;
                in_b = k;
            }
    if (shared == 0)
        return ebpo_triangle_pair(a, b);
    return shared == 1 ? one_corner(a, in_a, b, in_b) : one_edge(a, b);
}
