/* Computes the relation of two faces: apart, touching, crossing or coplanar. The result is exact
 * for all finite doubles.
 *
 * If the planes of the faces intersect in a line, the corners of each face are reordered so that
 * the first corner is alone on its side of the other plane. Each face intersects the line in an
 * interval. Two orientation tests (ebpo_orient3d) compare the ends of the intervals (Devillers and
 * Guigue, "Faster Triangle-Triangle Intersection Tests", 2002). Faces in one plane are projected
 * along an axis and compared in two dimensions. A face without area is the segment between its
 * least and greatest corners. Proofs: docs/develop/collision.md, "Kinds of pairs". */
#include "core/strict_fp.h"

#include <stdbool.h>
#include <string.h>

#include <ebpo/pair.h>

#include "geometry/triangle_pair.h"
#include "geometry/vec3.h"
#include "geometry/predicates.h"

/* --- faces and segments in one plane, projected along an axis --- */

/* The projected corners of a face or segment, in order. A segment has two corners. Both sides of a
 * segment count as outer sides. */
typedef struct projection {
    double corner[3][2];
    int corners;
} projection;

static projection project_along(int axis, const double (*corner)[3], int corners)
{
    const int to[2] = { axis == 2 ? 0 : axis + 1, axis == 0 ? 2 : axis - 1 };
    projection f = { .corners = corners };
    for (int i = 0; i < corners; i++)
        for (int k = 0; k < 2; k++)
            f.corner[i][k] = corner[i][to[k]];
    return f;
}

static int orientation_of(const projection *f)
{
    return ebpo_orient2d(f->corner[0], f->corner[1], f->corner[2]);
}

/* Returns an axis along which the projected face has an area, or -1 if the face has no area. */
static int projection_axis(const double corner[3][3])
{
    for (int k = 0; k < 3; k++) {
        projection f = project_along(k, corner, 3);
        if (orientation_of(&f) != 0)
            return k;
    }
    return -1;
}

/* Compares the projection `other` with the edge from - to of another projection. `outer`: the sign
 * of ebpo_orient2d on the outer side of this edge. Returns 2 if `other` is completely on the outer
 * side of the edge's line, 1 if `other` also touches the line, otherwise 0. */
static int separated_by_edge(const double from[2], const double to[2], int outer,
                             const projection *other)
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

/* Returns the greatest result of separated_by_edge for the edges of f. */
static int separated_by_edges(const projection *f, const projection *other)
{
    int most = 0, edges = f->corners == 3 ? 3 : 2, inner = f->corners == 3 ? orientation_of(f) : 1;
    for (int i = 0; i < edges; i++) {
        int parted =
            separated_by_edge(f->corner[i], f->corner[i + 1 == edges ? 0 : i + 1], -inner, other);
        most = parted > most ? parted : most;
    }
    return most;
}

/* Returns 2 if the projections have no common point, 1 if they have common points but no common
 * inner point, otherwise 0. */
static int projections_separated(const projection *f, const projection *g)
{
    int by_f = separated_by_edges(f, g), by_g = separated_by_edges(g, f);
    return by_f > by_g ? by_f : by_g;
}

/* --- faces without area: the segment between their least and greatest corners --- */

/* The ends of a segment. */
typedef struct ends {
    double at[2][3];
    bool point; /* both ends are equal */
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

/* Returns true if two segments have exactly one common point, which is not an end of either. */
static bool segments_cross(const ends *s, const ends *t)
{
    double corner[3][3];
    if (ebpo_orient3d(s->at[0], s->at[1], t->at[0], t->at[1]) != 0)
        return false;
    memcpy(corner, s->at, sizeof s->at);
    memcpy(corner[2], t->at[0], sizeof corner[2]);
    int axis = projection_axis((const double(*)[3])corner);
    if (axis < 0)
        return false;
    projection f = project_along(axis, (const double(*)[3])s->at, 2),
               g = project_along(axis, (const double(*)[3])t->at, 2);
    int side[2][2];
    for (int i = 0; i < 2; i++) {
        side[0][i] = ebpo_orient2d(f.corner[0], f.corner[1], g.corner[i]);
        side[1][i] = ebpo_orient2d(g.corner[0], g.corner[1], f.corner[i]);
    }
    return side[0][0] * side[0][1] < 0 && side[1][0] * side[1][1] < 0;
}

static bool segments_intersect(const ends *s, const ends *t)
{
    for (int i = 0; i < 2; i++)
        if (point_on_segment(s->at[i], t) || point_on_segment(t->at[i], s))
            return true;
    return segments_cross(s, t);
}

/* Returns true if the segment intersects the triangle. `axis`: an axis along which the projected
 * triangle has an area. */
static bool segment_intersects_triangle(const ends *s, const double t[3][3], int axis)
{
    int side[2], around[3];
    for (int i = 0; i < 2; i++)
        side[i] = ebpo_orient3d(t[0], t[1], t[2], s->at[i]);
    if (side[0] * side[1] > 0)
        return false;
    if (side[0] == 0 && side[1] == 0 && !s->point) {
        projection f = project_along(axis, t, 3),
                   g = project_along(axis, (const double(*)[3])s->at, 2);
        return projections_separated(&f, &g) != 2;
    }
    for (int i = 0; i < 2; i++)
        if (side[i] == 0)
            return ebpo_point_on_triangle(s->at[i], t[0], t[1], t[2]);
    for (int i = 0; i < 3; i++)
        around[i] = ebpo_orient3d(s->at[0], s->at[1], t[i], t[i == 2 ? 0 : i + 1]);
    bool all_left = around[0] >= 0 && around[1] >= 0 && around[2] >= 0;
    return all_left || (around[0] <= 0 && around[1] <= 0 && around[2] <= 0);
}

/* Classifies a pair in which a face has no area or both faces are in one plane. */
static ebpo_pair_kind classify_flat(const double a[3][3], const double b[3][3])
{
    int axis_a = projection_axis(a), axis_b = projection_axis(b);
    if (axis_a >= 0 && axis_b >= 0) {
        static const ebpo_pair_kind kinds[] = { EBPO_PAIR_COPLANAR, EBPO_PAIR_TOUCHING,
                                                EBPO_PAIR_APART };
        projection f = project_along(axis_a, a, 3), g = project_along(axis_a, b, 3);
        return kinds[projections_separated(&f, &g)];
    }
    ends s = ends_of(axis_a < 0 ? a : b);
    bool intersect;
    if (axis_a < 0 && axis_b < 0) {
        ends t = ends_of(b);
        intersect = segments_intersect(&s, &t);
    } else {
        intersect =
            segment_intersects_triangle(&s, axis_a < 0 ? b : a, axis_a < 0 ? axis_b : axis_a);
    }
    return intersect ? EBPO_PAIR_TOUCHING : EBPO_PAIR_APART;
}

/* --- pairs of faces in general --- */

static bool boxes_apart(const double a[3][3], const double b[3][3])
{
    for (int k = 0; k < 3; k++)
        if (ebpo_max3(a[0][k], a[1][k], a[2][k]) < ebpo_min3(b[0][k], b[1][k], b[2][k]) ||
            ebpo_max3(b[0][k], b[1][k], b[2][k]) < ebpo_min3(a[0][k], a[1][k], a[2][k]))
            return true;
    return false;
}

static void sides_of_plane(const double plane[3][3], const double corner[3][3], int side[3])
{
    for (int i = 0; i < 3; i++)
        side[i] = ebpo_orient3d(plane[0], plane[1], plane[2], corner[i]);
}

static bool all_on_one_side(const int side[3])
{
    return side[0] != 0 && side[0] == side[1] && side[1] == side[2];
}

static bool all_in_plane(const int side[3]) { return !(side[0] | side[1] | side[2]); }

/* Returns true if corners are strictly on both sides of the plane. If not, the face at most touches
 * the plane. */
static bool on_both_sides(const int side[3])
{
    bool above = side[0] > 0 || side[1] > 0 || side[2] > 0;
    return above && (side[0] < 0 || side[1] < 0 || side[2] < 0);
}

/* Returns the corner that is alone on its side of the plane. Tries in this order: the only corner
 * on the positive side, the only corner on the negative side, the only corner in the plane. Returns
 * the first corner that is found. */
static int corner_alone(const int side[3])
{
    static const int order[] = { 1, -1, 0 };
    for (int s = 0; s < 3; s++)
        for (int i = 0; i < 3; i++) {
            int next = side[i == 2 ? 0 : i + 1], last = side[i == 0 ? 2 : i - 1];
            if (side[i] == order[s] && next != side[i] && last != side[i])
                return i;
        }
    return 0;
}

/* Reorders the corners cyclically so that the corner that is alone on its side of the other face's
 * plane comes first. Returns true if the plane of the other face must be flipped, so that this
 * corner is on its positive side. side[i]: side of corner i. */
static bool reorder_corners(const int side[3], int corner[3])
{
    corner[0] = corner_alone(side);
    corner[1] = corner[0] == 2 ? 0 : corner[0] + 1;
    corner[2] = corner[0] == 0 ? 2 : corner[0] - 1;
    return side[corner[0]] < side[corner[1]] || side[corner[0]] < side[corner[2]];
}

static void swap_corners(int *x, int *y)
{
    int z = *x;
    *x = *y;
    *y = z;
}

bool ebpo_prepare_pair(const double a[3][3], const double b[3][3], ebpo_prepared_pair *out,
                       ebpo_pair_kind *kind)
{
    *kind = EBPO_PAIR_APART;
    sides_of_plane(a, b, out->side_b);
    if (all_on_one_side(out->side_b))
        return false;
    sides_of_plane(b, a, out->side_a);
    if (all_on_one_side(out->side_a))
        return false;
    if (all_in_plane(out->side_a) || all_in_plane(out->side_b)) {
        *kind = classify_flat(a, b);
        return false;
    }
    /* side_a is relative to B's plane, so the corners of A determine if B's plane is flipped */
    out->flipped_b = reorder_corners(out->side_a, out->a);
    out->flipped_a = reorder_corners(out->side_b, out->b);
    if (out->flipped_b)
        swap_corners(&out->b[1], &out->b[2]);
    if (out->flipped_a)
        swap_corners(&out->a[1], &out->a[2]);
    return true;
}

int ebpo_compare_ends(const double a[3][3], const double b[3][3], const ebpo_prepared_pair *t,
                      int corner_a, int corner_b)
{
    return ebpo_orient3d(a[t->a[0]], a[t->a[corner_a]], b[t->b[0]], b[t->b[corner_b]]);
}

ebpo_pair_kind ebpo_triangle_pair(const double a[3][3], const double b[3][3])
{
    ebpo_prepared_pair t;
    ebpo_pair_kind kind;
    if (boxes_apart(a, b))
        return EBPO_PAIR_APART;
    if (!ebpo_prepare_pair(a, b, &t, &kind))
        return kind;
    int lower = ebpo_compare_ends(a, b, &t, 1, 1);
    if (lower > 0)
        return EBPO_PAIR_APART;
    int upper = ebpo_compare_ends(a, b, &t, 2, 2);
    if (upper < 0)
        return EBPO_PAIR_APART;
    bool through = on_both_sides(t.side_a) && on_both_sides(t.side_b);
    return through && lower < 0 && upper > 0 ? EBPO_PAIR_CROSSING : EBPO_PAIR_TOUCHING;
}
