/* Proofs: docs/develop/collision.md, "Kinds of pairs". Source of the test on the common line:
 * Devillers and Guigue, "Faster Triangle-Triangle Intersection Tests", 2002. */
#include "core/strict_fp.h"

#include "geometry/triangle_pair.h"

#include "geometry/min_max.h"
#include "geometry/predicates.h"
#include "geometry/flat_pair.h"

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

static bool one_side(const int side[3])
{
    return side[0] != 0 && side[0] == side[1] && side[1] == side[2];
}

static bool within_plane(const int side[3]) { return !(side[0] | side[1] | side[2]); }

/* Only where two corners are on one strict side and the third is not beyond: the face touches. */
static bool has_both(const int side[3])
{
    bool above = side[0] > 0 || side[1] > 0 || side[2] > 0;
    return above && (side[0] < 0 || side[1] < 0 || side[2] < 0);
}

/* The corner that is alone on a strict side, the others being on the other one or in the plane; or
 * in the plane, while both others are on one side. Prefers the positive side. */
static int alone(const int side[3])
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

/* Turns the corners so that the one that is alone comes first. True: it is not above the others. */
static bool turn(const int side[3], int corner[3])
{
    corner[0] = alone(side);
    corner[1] = corner[0] == 2 ? 0 : corner[0] + 1;
    corner[2] = corner[0] == 0 ? 2 : corner[0] - 1;
    return side[corner[0]] < side[corner[1]] || side[corner[0]] < side[corner[2]];
}

static void swap(int *x, int *y)
{
    int z = *x;
    *x = *y;
    *y = z;
}

bool ebpo_turn_pair(const double a[3][3], const double b[3][3], ebpo_turned_pair *out,
                    ebpo_pair_kind *kind)
{
    *kind = EBPO_PAIR_APART;
    sides_of_plane(a, b, out->side_b);
    if (one_side(out->side_b))
        return false;
    sides_of_plane(b, a, out->side_a);
    if (one_side(out->side_a))
        return false;
    if (within_plane(out->side_a) || within_plane(out->side_b)) {
        *kind = ebpo_flat_pair(a, b);
        return false;
    }
    out->flipped_b = turn(out->side_a, out->a);
    out->flipped_a = turn(out->side_b, out->b);
    if (out->flipped_b)
        swap(&out->b[1], &out->b[2]);
    if (out->flipped_a)
        swap(&out->a[1], &out->a[2]);
    return true;
}

int ebpo_compare_ends(const double a[3][3], const double b[3][3], const ebpo_turned_pair *t, int q,
                      int v)
{
    return ebpo_orient3d(a[t->a[0]], a[t->a[q]], b[t->b[0]], b[t->b[v]]);
}

ebpo_pair_kind ebpo_triangle_pair(const double a[3][3], const double b[3][3])
{
    ebpo_turned_pair t;
    ebpo_pair_kind kind;
    if (boxes_apart(a, b))
        return EBPO_PAIR_APART;
    if (!ebpo_turn_pair(a, b, &t, &kind))
        return kind;
    int lower = ebpo_compare_ends(a, b, &t, 1, 1);
    if (lower > 0)
        return EBPO_PAIR_APART;
    int upper = ebpo_compare_ends(a, b, &t, 2, 2);
    if (upper < 0)
        return EBPO_PAIR_APART;
    bool through = has_both(t.side_a) && has_both(t.side_b);
    return through && lower < 0 && upper > 0 ? EBPO_PAIR_CROSSING : EBPO_PAIR_TOUCHING;
}
