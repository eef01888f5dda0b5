/* Proofs: docs/develop/collision.md, "Kinds of pairs", 3 and 4. */
#include "core/strict_fp.h"

#include "geometry/flat_pair.h"

#include <stdbool.h>
#include <string.h>

#include "geometry/predicates.h"
#include "geometry/corner_order.h"

/* --- figures in a plane, seen along an axis --- */

/* Points of one plane, corners in turn; two are a segment, whose both sides are outer ones. */
typedef struct figure {
    double corner[3][2];
    int corners;
} figure;

static figure seen_along(int axis, const double (*corner)[3], int corners)
{
    const int to[2] = { axis == 2 ? 0 : axis + 1, axis == 0 ? 2 : axis - 1 };
    figure f = { .corners = corners };
    for (int i = 0; i < corners; i++)
        for (int k = 0; k < 2; k++)
            f.corner[i][k] = corner[i][to[k]];
    return f;
}

static int turn_of(const figure *f)
{
    return ebpo_orient2d(f->corner[0], f->corner[1], f->corner[2]);
}

/* An axis along which the corners are seen as a triangle; -1: they have no area. */
static int axis_of(const double corner[3][3])
{
    for (int k = 0; k < 3; k++) {
        figure f = seen_along(k, corner, 3);
        if (turn_of(&f) != 0)
            return k;
    }
    return -1;
}

/* How an edge parts two figures: 2: the other one is strictly beyond it, 1: not strictly, 0: not.
 */
static int parted_by(const double from[2], const double to[2], int outer, const figure *other)
{
    int parted = 2;
    for (int i = 0; i < other->corners; i++) {
        int side = ebpo_orient2d(from, to, other->corner[i]) * outer;
        if (side < 0)
            return 0;
        parted = side == 0 ? 1 : parted;
    }
    return parted;
}

static int parted_by_edges(const figure *f, const figure *other)
{
    int most = 0, edges = f->corners == 3 ? 3 : 2, inner = f->corners == 3 ? turn_of(f) : 1;
    for (int i = 0; i < edges; i++) {
        int parted = parted_by(f->corner[i], f->corner[i + 1 == edges ? 0 : i + 1], -inner, other);
        most = parted > most ? parted : most;
    }
    return most;
}

/* 2: no common point, 1: no common inner point, 0: neither. */
static int parted(const figure *f, const figure *g)
{
    int by_f = parted_by_edges(f, g), by_g = parted_by_edges(g, f);
    return by_f > by_g ? by_f : by_g;
}

/* --- faces without area: the segment between their least and greatest corners --- */

typedef struct ends {
    double at[2][3];
    bool point;
} ends;

static ends ends_of(const double corner[3][3])
{
    int least = 0, greatest = 0;
    for (int i = 1; i < 3; i++) {
        least = ebpo_corner_order(corner[i], corner[least]) < 0 ? i : least;
        greatest = ebpo_corner_order(corner[i], corner[greatest]) > 0 ? i : greatest;
    }
    ends e;
    memcpy(e.at[0], corner[least], sizeof e.at[0]);
    memcpy(e.at[1], corner[greatest], sizeof e.at[1]);
    e.point = ebpo_corner_order(e.at[0], e.at[1]) == 0;
    return e;
}

static bool point_on_segment(const double p[3], const ends *s)
{
    return ebpo_point_on_triangle(p, s->at[0], s->at[1], s->at[1]);
}

/* Inner points of two segments meet in one point. */
static bool segments_cross(const ends *s, const ends *t)
{
    double corner[3][3];
    if (ebpo_orient3d(s->at[0], s->at[1], t->at[0], t->at[1]) != 0)
        return false;
    memcpy(corner, s->at, sizeof s->at);
    memcpy(corner[2], t->at[0], sizeof corner[2]);
    int axis = axis_of((const double(*)[3])corner);
    if (axis < 0)
        return false;
    figure f = seen_along(axis, (const double(*)[3])s->at, 2),
           g = seen_along(axis, (const double(*)[3])t->at, 2);
    int side[2][2];
    for (int i = 0; i < 2; i++) {
        side[0][i] = ebpo_orient2d(f.corner[0], f.corner[1], g.corner[i]);
        side[1][i] = ebpo_orient2d(g.corner[0], g.corner[1], f.corner[i]);
    }
    return side[0][0] * side[0][1] < 0 && side[1][0] * side[1][1] < 0;
}

static bool segments_meet(const ends *s, const ends *t)
{
    for (int i = 0; i < 2; i++)
        if (point_on_segment(s->at[i], t) || point_on_segment(t->at[i], s))
            return true;
    return segments_cross(s, t);
}

/* The triangle has an area. */
static bool segment_meets_triangle(const ends *s, const double t[3][3], int axis)
{
    int side[2], around[3];
    for (int i = 0; i < 2; i++)
        side[i] = ebpo_orient3d(t[0], t[1], t[2], s->at[i]);
    if (side[0] * side[1] > 0)
        return false;
    if (side[0] == 0 && side[1] == 0 && !s->point) {
        figure f = seen_along(axis, t, 3), g = seen_along(axis, (const double(*)[3])s->at, 2);
        return parted(&f, &g) != 2;
    }
    for (int i = 0; i < 2; i++)
        if (side[i] == 0)
            return ebpo_point_on_triangle(s->at[i], t[0], t[1], t[2]);
    for (int i = 0; i < 3; i++)
        around[i] = ebpo_orient3d(s->at[0], s->at[1], t[i], t[i == 2 ? 0 : i + 1]);
    bool left = around[0] >= 0 && around[1] >= 0 && around[2] >= 0;
    return left || (around[0] <= 0 && around[1] <= 0 && around[2] <= 0);
}

ebpo_pair_kind ebpo_flat_pair(const double a[3][3], const double b[3][3])
{
    int axis_a = axis_of(a), axis_b = axis_of(b);
    if (axis_a >= 0 && axis_b >= 0) {
        static const ebpo_pair_kind kinds[] = { EBPO_PAIR_COPLANAR, EBPO_PAIR_TOUCHING,
                                                EBPO_PAIR_APART };
        figure f = seen_along(axis_a, a, 3), g = seen_along(axis_a, b, 3);
        return kinds[parted(&f, &g)];
    }
    ends s = ends_of(axis_a < 0 ? a : b);
    bool meet;
    if (axis_a < 0 && axis_b < 0) {
        ends t = ends_of(b);
        meet = segments_meet(&s, &t);
    } else {
        meet = segment_meets_triangle(&s, axis_a < 0 ? b : a, axis_a < 0 ? axis_b : axis_a);
    }
    return meet ? EBPO_PAIR_TOUCHING : EBPO_PAIR_APART;
}
