/* Leaves whose faces' planes alone decide.
 *
 * Let P be the set of points of the cell below all planes of the leaf's faces. If every face
 * lies in P (all its corners below all planes), then each face lies on the boundary of P, so the
 * winding number is constant within P's interior; and it is constant in each component of the rest
 * of the cell. Every such component contains a corner of the cell: a point above plane i can move
 * to the corner that is farthest along that plane's normal and stays above. So when all corners of
 * the cell that do not lie in P's closure have the same winding number, and one point of P's
 * interior is known, the planes decide. The same holds with "above" for "below" (concave). */
#include "core/strict_fp.h"

#include <math.h>

#include "geometry/min_max.h"
#include "geometry/predicates.h"
#include "geometry/cells.h"
#include "query/accel_parts.h"

enum { FACES_MAX = 64 };

/* The leaf in its cell's coordinates (0 .. 1), rounded: corners of faces whose box meets the cell.
 */
typedef struct leaf_faces {
    int count;
    double p[FACES_MAX][3][3];
    uint32_t slot[FACES_MAX];
    double low[3], size[3], inverse[3];
} leaf_faces;

static bool meets_cell(const double t[3][3], const double low[3], const double high[3])
{
    for (int k = 0; k < 3; k++)
        if (ebpo_min3(t[0][k], t[1][k], t[2][k]) > high[k] ||
            ebpo_max3(t[0][k], t[1][k], t[2][k]) < low[k])
            return false;
    return true;
}

static void add_face(uint32_t slot, const double t[3][3], leaf_faces *f)
{
    for (int i = 0; i < 9; i++)
        f->p[f->count][i / 3][i % 3] = (t[i / 3][i % 3] - f->low[i % 3]) * f->inverse[i % 3];
    f->slot[f->count++] = slot;
}

/* Gathers the faces whose boxes meet the cell. False when they are not to be had: too many, or a
 * cell too small for what follows. */
static bool gather(const ebpo_accel *s, const ebpo_accel_leaf *leaf, ebpo_cell cell, leaf_faces *f)
{
    double low[3], high[3];
    ebpo_cell_bounds(&s->box, cell, low, high);
    f->count = 0;
    for (int k = 0; k < 3; k++) {
        f->low[k] = low[k];
        f->size[k] = high[k] - low[k];
        f->inverse[k] = 1 / f->size[k];
        if (!(f->size[k] > 0x1p-900))
            return false;
    }
    for (const ebpo_listed_block *at = s->list + leaf->list;; at++) {
        uint64_t listed = ebpo_listed(at);
        for (unsigned lanes = ebpo_listed_lanes(listed); lanes; lanes &= lanes - 1) {
            uint32_t slot =
                ebpo_listed_number(listed) * EBPO_BLOCK + (unsigned)__builtin_ctz(lanes);
            double t[3][3];
            ebpo_accel_triangle(s, slot, t);
            if (!meets_cell((const double(*)[3])t, low, high))
                continue;
            if (f->count == FACES_MAX)
                return false;
            add_face(slot, (const double(*)[3])t, f);
        }
        if (listed & EBPO_LISTED_LAST)
            return true;
    }
}

int32_t ebpo_leaf_crossings(const ebpo_accel *s, const ebpo_accel_leaf *leaf, const double from[3],
                            double to, int axis, uint64_t beside)
{
    int32_t sum = 0;
    for (const ebpo_listed_block *at = s->list + leaf->list;; at++) {
        uint64_t listed = ebpo_listed(at);
        for (unsigned lanes = listed & beside ? 0 : ebpo_listed_lanes(listed); lanes;
             lanes &= lanes - 1) {
            double t[3][3];
            ebpo_accel_triangle(
                s, ebpo_listed_number(listed) * EBPO_BLOCK + (unsigned)__builtin_ctz(lanes), t);
            sum += ebpo_axis_crossing(from, to, axis, t[0], t[1], t[2]);
        }
        if (listed & EBPO_LISTED_LAST)
            return sum;
    }
}

/* At any shifted point of the cell: from the lowest corner, axis by axis. */
static int32_t winding_at(const ebpo_accel *s, const ebpo_accel_leaf *leaf, const double low[3],
                          const double p[3])
{
    double from[3] = { low[0], low[1], low[2] };
    int32_t winding = leaf->winding;
    for (int axis = 0; axis < 3; axis++) {
        if (p[axis] > from[axis])
            winding += ebpo_leaf_crossings(s, leaf, from, p[axis], axis, 0);
        from[axis] = p[axis];
    }
    return winding;
}

/* The plane of a face in the cell's coordinates, 1-norm 1. False when rounding could have touched
 * it: a sliver, or corners far outside the cell. */
static bool face_plane(const ebpo_accel *s, const leaf_faces *f, int face, ebpo_leaf_plane *out)
{
    const double(*p)[3] = (const double(*)[3])f->p[face];
    double t[3][3], e[3], g[3], norm = 0, products = 0, reach = 0;
    ebpo_accel_triangle(s, f->slot[face], t);
    for (int k = 0; k < 3; k++) { /* of the corners as they are: those in the cell's coordinates are
                                     rounded, which short edges do not stand */
        e[k] = (t[1][k] - t[0][k]) * f->inverse[k];
        g[k] = (t[2][k] - t[0][k]) * f->inverse[k];
    }
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        double a = e[u] * g[v], b = e[v] * g[u];
        out->n[k] = a - b;
        norm += fabs(a - b);
        products += fabs(a) + fabs(b);
        reach = ebpo_max3(reach, ebpo_max3(fabs(p[0][k]), fabs(p[1][k]), fabs(p[2][k])), 0);
    }
    /* n is right to 2^-50 of the products, so to 2^-40 of its norm, and n . xi to 2^-33 for every
     * corner: less than what sides_of calls certain. */
    if (!(norm > products * 0x1p-10) || !(products > 0x1p-900) || !(reach < 64))
        return false;
    out->d = 0;
    for (int k = 0; k < 3; k++) {
        out->n[k] /= norm;
        out->d += out->n[k] * p[0][k];
    }
    return true;
}

/* Exact side of a corner of face j with regard to the plane of face i: -1 below, 1 above. */
static int exact_side(const ebpo_accel *s, uint32_t plane_slot, uint32_t point_slot, int corner)
{
    double a[3][3], b[3][3];
    ebpo_accel_triangle(s, plane_slot, a);
    ebpo_accel_triangle(s, point_slot, b);
    for (int i = 0; i < 3; i++) /* neighbours share corners */
        if (a[i][0] == b[corner][0] && a[i][1] == b[corner][1] && a[i][2] == b[corner][2])
            return 0;
    return ebpo_orient3d(a[0], a[1], a[2], b[corner]);
}

/* Adds up on which sides of plane i the faces lie: bit 0 some corner above, bit 1 some corner
 * below. */
static unsigned sides_of(const ebpo_accel *s, const leaf_faces *f, int i, const ebpo_leaf_plane *q,
                         unsigned wanted)
{
    unsigned sides = 0;
    for (int j = 0; j < f->count; j++)
        for (int c = 0; c < 3 && j != i; c++) {
            double value =
                q->n[0] * f->p[j][c][0] + q->n[1] * f->p[j][c][1] + q->n[2] * f->p[j][c][2] - q->d;
            int side = value > 0x1p-26 ? 1 : value < -0x1p-26 ? -1 : 0;
            if (side == 0)
                side = exact_side(s, f->slot[i], f->slot[j], c);
            sides |= side > 0 ? 1 : side < 0 ? 2 : 0;
            if ((sides & wanted) == wanted)
                return sides;
        }
    return sides;
}

static bool same_plane(const ebpo_accel *s, const leaf_faces *f, int i, int j)
{
    for (int c = 0; c < 3; c++)
        if (exact_side(s, f->slot[i], f->slot[j], c) != 0)
            return false;
    return true;
}

/* Whether they may be one plane, seen from one side. */
static bool turned_alike(const ebpo_leaf_plane *a, const ebpo_leaf_plane *b)
{
    return fabs(a->d - b->d) < 0x1p-20 &&
           a->n[0] * b->n[0] + a->n[1] * b->n[1] + a->n[2] * b->n[2] > 0;
}

/* All distinct planes of the leaf when it is convex (`flip` 1) or concave (-1, planes turned).
 * False when it is neither, or they are too many. */
static bool collect_planes(const ebpo_accel *s, const leaf_faces *f, ebpo_deciding_planes *out)
{
    int of_face[EBPO_KIND_PLANES_MAX];
    unsigned allowed = 3; /* bit 0: convex is still possible, bit 1: concave */
    out->count = 0;
    for (int i = 0; i < f->count; i++) {
        ebpo_leaf_plane q;
        if (!face_plane(s, f, i, &q))
            return false;
        unsigned sides = sides_of(s, f, i, &q, 3);
        allowed &= (sides & 1 ? 2u : 3u) & (sides & 2 ? 1u : 3u);
        if (!allowed)
            return false;
        bool known = false;
        for (int k = 0; k < out->count && !known; k++)
            known = turned_alike(&out->plane[k], &q) && same_plane(s, f, of_face[k], i);
        if (known)
            continue;
        if (out->count == EBPO_KIND_PLANES_MAX)
            return false;
        of_face[out->count] = i;
        out->plane[out->count++] = q;
    }
    out->flip = allowed & 1 ? 1 : -1;
    return true;
}

static bool below_all(const ebpo_deciding_planes *planes, const double xi[3], bool *certain)
{
    bool below = true;
    *certain = true;
    for (int i = 0; i < planes->count; i++) {
        const ebpo_leaf_plane *q = &planes->plane[i];
        double value = planes->flip * (q->n[0] * xi[0] + q->n[1] * xi[1] + q->n[2] * xi[2] - q->d);
        if (value > 0x1p-18)
            return *certain = true, false;
        *certain = *certain && value < -0x1p-18;
    }
    return below;
}

static double within_cell(double x) { return x < 0 ? 0 : x > 1 ? 1 : x; }

/* Winding numbers in P and in the rest of the cell, from the cell's corners and, if none of them is
 * in P, from a point near the middle of the faces. False when that does not decide it. */
static bool find_windings(const ebpo_accel *s, const ebpo_accel_leaf *leaf, const leaf_faces *f,
                          ebpo_deciding_planes *out)
{
    bool have_inner = false, have_outer = false, certain;
    for (unsigned corner = 0; corner < 8; corner++) {
        double xi[3] = { corner & 1, corner >> 1 & 1, corner >> 2 }, p[3];
        bool below = below_all(out, xi, &certain);
        if (!certain)
            return false;
        for (int k = 0; k < 3; k++)
            p[k] = f->low[k] + xi[k] * f->size[k];
        int32_t w = winding_at(s, leaf, f->low, p);
        int32_t *known = below ? &out->inner : &out->outer;
        bool *have = below ? &have_inner : &have_outer;
        if (*have && *known != w)
            return false;
        *known = w;
        *have = true;
    }
    if (!have_inner) {
        double xi[3] = { 0, 0, 0 }, p[3];
        for (int k = 0; k < 3; k++) {
            for (int i = 0; i < f->count; i++)
                xi[k] += (within_cell(f->p[i][0][k]) + within_cell(f->p[i][1][k]) +
                          within_cell(f->p[i][2][k])) /
                         (3 * f->count);
            p[k] = f->low[k] + xi[k] * f->size[k];
            /* in a cell of a few ulps the point has moved */
            xi[k] = (p[k] - f->low[k]) / f->size[k];
        }
        if (!below_all(out, xi, &certain) || !certain)
            return false;
        out->inner = winding_at(s, leaf, f->low, p);
    }
    return have_outer;
}

bool ebpo_leaf_find_planes(const ebpo_accel *s, const ebpo_accel_leaf *leaf, ebpo_cell cell,
                           ebpo_deciding_planes *out)
{
    leaf_faces f;
    return gather(s, leaf, cell, &f) && f.count && collect_planes(s, &f, out) &&
           find_windings(s, leaf, &f, out);
}
