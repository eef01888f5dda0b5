/* Determines exactly if a face touches a cell, if the part of a face in a cell is in the
 * half-spaces of the node's planes, and how a ray crosses a face. Floating point with error bounds
 * decides most cases; rational arithmetic (GMP) decides the other cases. Only the exact predicates
 * are shared with the builder.
 *
 * The methods, in the order of this file:
 * - clipping in rationals (Sutherland and Hodgman, "Reentrant polygon clipping", 1974)
 * - separating axes (Gottschalk, Lin and Manocha, "OBBTree", 1996)
 * - winding numbers by rays
 * - containment by weak duality */
#include "core/strict_fp.h"

#include <gmp.h>
#include <math.h>

#include "geometry/predicates.h"
#include "mesh/mesh_parts.h"
#include "verify/verify_geometry.h"

enum {
    CORNERS = 9
}; /* maximum number of corners: a clipped face has three, and at most one more for each of six cell
    * faces */

typedef struct polygon {
    int count;
    mpq_t at[CORNERS][3]; /* in coordinates of the box, 0 to 1 */
} polygon;

static void polygon_init(polygon *g)
{
    g->count = 0;
    for (int i = 0; i < CORNERS; i++)
        for (int k = 0; k < 3; k++)
            mpq_init(g->at[i][k]);
}

static void polygon_clear(polygon *g)
{
    for (int i = 0; i < CORNERS; i++)
        for (int k = 0; k < 3; k++)
            mpq_clear(g->at[i][k]);
}

static void set_triangle(polygon *g, const double low[3], const double high[3],
                         const ebpo_corners *face)
{
    mpq_t first, size;
    mpq_inits(first, size, NULL);
    g->count = 3;
    for (int k = 0; k < 3; k++) {
        mpq_set_d(first, low[k]);
        mpq_set_d(size, high[k]);
        mpq_sub(size, size, first);
        for (int i = 0; i < 3; i++) {
            mpq_set_d(g->at[i][k], face->at[i][k]);
            mpq_sub(g->at[i][k], g->at[i][k], first);
            mpq_div(g->at[i][k], g->at[i][k], size);
        }
    }
    mpq_clears(first, size, NULL);
}

/* Returns true if a coordinate is on the inner side of a cell face. cell_face: 0 (x must be at
 * least 0) or 1 (x must be at most 1). */
static bool exact_within(const mpq_t x, int cell_face)
{
    return cell_face == 0 ? mpq_sgn(x) >= 0 : mpq_cmp_ui(x, 1, 1) <= 0;
}

/* Appends the point at which the segment from a to b crosses the cell face. Exactly one of a and b
 * is on the inner side. */
static void append_crossing(polygon *out, mpq_t a[3], mpq_t b[3], int axis, int cell_face)
{
    mpq_t t, part;
    mpq_inits(t, part, NULL);
    mpq_set_si(t, cell_face, 1);
    mpq_sub(t, t, a[axis]);
    mpq_sub(part, b[axis], a[axis]);
    mpq_div(t, t, part);
    for (int k = 0; k < 3; k++) {
        mpq_sub(part, b[k], a[k]);
        mpq_mul(part, part, t);
        mpq_add(out->at[out->count][k], a[k], part);
    }
    mpq_set_si(out->at[out->count][axis], cell_face, 1);
    out->count++;
    mpq_clears(t, part, NULL);
}

static void exact_clip(polygon *out, polygon *in, int axis, int cell_face)
{
    out->count = 0;
    for (int i = 0; i < in->count; i++) {
        int j = i + 1 < in->count ? i + 1 : 0;
        bool first_within = exact_within(in->at[i][axis], cell_face),
             second_within = exact_within(in->at[j][axis], cell_face);
        if (first_within) {
            for (int k = 0; k < 3; k++)
                mpq_set(out->at[out->count][k], in->at[i][k]);
            out->count++;
        }
        if (first_within != second_within)
            append_crossing(out, in->at[i], in->at[j], axis, cell_face);
    }
}

/* Stores the intersection of face and box in *g. */
static void clip_to_box(polygon *g, const double low[3], const double high[3],
                        const ebpo_corners *face)
{
    polygon other;
    polygon_init(&other);
    set_triangle(g, low, high, face);
    for (int axis = 0; axis < 3; axis++) {
        exact_clip(&other, g, axis, 0);
        exact_clip(g, &other, axis, 1);
    }
    polygon_clear(&other);
}

bool ebpo_exact_touches(const double low[3], const double high[3], const ebpo_corners *face)
{
    polygon g;
    polygon_init(&g);
    clip_to_box(&g, low, high, face);
    bool touches = g.count > 0;
    polygon_clear(&g);
    return touches;
}

static bool corner_satisfies(mpq_t at[3], const int32_t n[3], int32_t d)
{
    mpq_t sum, part;
    mpq_inits(sum, part, NULL);
    for (int k = 0; k < 3; k++) {
        mpq_set_si(part, n[k], 1);
        mpq_mul_2exp(part, part, 12);
        mpq_mul(part, part, at[k]);
        mpq_add(sum, sum, part);
    }
    bool holds = mpq_cmp_si(sum, d, 1) <= 0;
    mpq_clears(sum, part, NULL);
    return holds;
}

bool ebpo_exact_half_space(const double low[3], const double high[3], const ebpo_corners *face,
                           const int32_t n[3], int32_t d)
{
    polygon g;
    polygon_init(&g);
    clip_to_box(&g, low, high, face);
    bool holds = true;
    for (int i = 0; i < g.count && holds; i++)
        holds = corner_satisfies(g.at[i], n, d);
    polygon_clear(&g);
    return holds;
}

/* Separating axes (Gottschalk, Lin and Manocha, "OBBTree", 1996): a box and a triangle are apart if
 * their projections on some axis are apart. The following axes are sufficient, also for a face
 * without area: the normals of the box, the normal of the face, and the cross products of an edge
 * of the box with an edge of the face. */

static const double eps = 0x1p-53;
static const double slack = 0x1p-900; /* upper bound of errors by underflow */

/* Corners of a face in cell coordinates. The error of each coordinate is at most 4 * 2^-53 of its
 * absolute value (plus 2^-1000). */
typedef struct local_face {
    double at[3][3];
    double largest[3];  /* largest absolute coordinate on each axis, at least 1 */
    unsigned contained; /* bit i: corner i is in the closed cell (exact) */
} local_face;

/* The relation of a face and a cell on the axes tested so far. UNSURE: floating point cannot
 * decide. */
typedef enum verdict { APART, INTERSECT, UNSURE } verdict;

ebpo_frame ebpo_frame_make(const ebpo_box *box, ebpo_cell cell)
{
    ebpo_frame frame;
    for (int k = 0; k < 3; k++) {
        frame.low[k] = ebpo_cell_face(box, k, cell.level, cell.at[k]);
        frame.high[k] = ebpo_cell_face(box, k, cell.level, cell.at[k] + 1);
        frame.inverse[k] = 1 / (frame.high[k] - frame.low[k]);
    }
    return frame;
}

static void local_make(local_face *out, const ebpo_frame *frame, const ebpo_corners *face)
{
    out->contained = 0;
    for (int k = 0; k < 3; k++)
        out->largest[k] = 1;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            double x = (face->at[i][k] - frame->low[k]) * frame->inverse[k];
            out->at[i][k] = x;
            out->largest[k] = fabs(x) > out->largest[k] ? fabs(x) : out->largest[k];
        }
        out->contained |= (unsigned)ebpo_corner_in_cell(frame, face->at[i]) << i;
    }
}

/* Compares the intervals [a, b] of the face and [low, high] of the box on an axis. `error`: upper
 * bound of the rounding error of each end. Returns UNSURE if a value is NaN. */
static verdict compare_intervals(double a, double b, double low, double high, double error)
{
    if (a > high + error || b < low - error)
        return APART;
    if (a <= high - error && b >= low + error)
        return INTERSECT;
    return UNSURE;
}

/* Returns (b - a) * inverse. The result is 0 only when a and b are equal. If the value is too small
 * for the error bounds, returns NaN, so that compare_intervals returns UNSURE. */
static double scaled_difference(double a, double b, double inverse)
{
    double x = (b - a) * inverse;
    return a != b && fabs(x) < 0x1p-400 ? NAN : x;
}

/* Compares the intervals of face and box on one axis: the cross product of an edge of the face and
 * the unit vector k. The edge begins at corner i of the face; corner l is opposite to the edge. */
static verdict edge_axis(const local_face *p, const double edge[3], int i, int l, int k)
{
    int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
    double eu = edge[u], ev = edge[v];
    if (eu == 0 && ev == 0)
        return INTERSECT; /* the edge is parallel to k, so the cross product is no axis */
    double a = ev * p->at[i][u] - eu * p->at[i][v];
    double b = ev * p->at[l][u] - eu * p->at[l][v];
    double low = (ev < 0 ? ev : 0) - (eu > 0 ? eu : 0),
           high = (ev > 0 ? ev : 0) - (eu < 0 ? eu : 0);
    double error = 32 * eps * (fabs(ev) * p->largest[u] + fabs(eu) * p->largest[v]) + slack;
    return compare_intervals(a < b ? a : b, a < b ? b : a, low, high, error);
}

/* Compares the intervals of face and box on the normal of the face. */
static verdict normal_axis(const local_face *p, double edge[3][3])
{
    double value = 0, low = 0, high = 0, error = slack;
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        double left = edge[0][u] * edge[1][v], right = edge[0][v] * edge[1][u];
        double n = left - right;
        value += n * p->at[0][k];
        low += n < 0 ? n : 0;
        high += n > 0 ? n : 0;
        error += 32 * eps * (fabs(left) + fabs(right)) * p->largest[k];
    }
    return compare_intervals(value, value, low, high, error);
}

/* Compares the intervals of face and box on all axes except the normals of the box. On these, the
 * caller has compared the intervals exactly. */
static verdict separating_axes(const ebpo_frame *frame, const ebpo_corners *face)
{
    local_face p;
    local_make(&p, frame, face);
    double edge[3][3];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            edge[i][k] =
                scaled_difference(face->at[i][k], face->at[(i + 1) % 3][k], frame->inverse[k]);
    verdict all = normal_axis(&p, edge);
    for (int i = 0; i < 3 && all != APART; i++)
        for (int k = 0; k < 3 && all != APART; k++) {
            verdict one = edge_axis(&p, edge[i], i, (i + 2) % 3, k);
            all = one == APART || all == INTERSECT ? one : all;
        }
    return all;
}

bool ebpo_face_touches(const ebpo_frame *frame, const ebpo_corners *face, ebpo_tally *tally)
{
    for (int k = 0; k < 3; k++) {
        double a = face->at[0][k], b = face->at[1][k], c = face->at[2][k];
        if ((a < frame->low[k] && b < frame->low[k] && c < frame->low[k]) ||
            (a > frame->high[k] && b > frame->high[k] && c > frame->high[k]))
            return false;
    }
    for (int i = 0; i < 3; i++)
        if (ebpo_corner_in_cell(frame, face->at[i]))
            return true;
    verdict result = separating_axes(frame, face);
    if (result != UNSURE)
        return result == INTERSECT;
    tally->exact_touches++;
    return ebpo_exact_touches(frame->low, frame->high, face);
}

/* Winding numbers by rays. In a projection along the axis of the ray, the ray is a point, and a
 * face winds around this point once or not at all. To decide which, the edges of the face are
 * counted that cross a half-line from the point. The point is shifted by infinitely small amounts
 * along both axes of the projection (verify_geometry.h). The half-line is parallel to the axis with
 * the larger shift. So the smaller shift decides on which side of the half-line an end of an edge
 * is, and the larger shift decides all remaining ties. */

void ebpo_face_corners(const ebpo_mesh *mesh, uint64_t face, ebpo_corners *out)
{
    for (uint64_t i = 0; i < 3; i++)
        ebpo_mesh_position(mesh, mesh->faces[3 * face + i], out->at[i]);
}

static int orient_in(int u, int v, const double a[3], const double b[3], const double c[3])
{
    return ebpo_orient2d((double[2]){ a[u], a[v] }, (double[2]){ b[u], b[v] },
                         (double[2]){ c[u], c[v] });
}

/* Returns 1 if the face, projected to the plane of the axes u and v, winds around p
 * counter-clockwise, -1 if it winds around p clockwise, and 0 otherwise. */
static int turns_around(const double p[3], int u, int v, const ebpo_corners *face)
{
    int sum = 0;
    for (int i = 0; i < 3; i++) {
        const double *s = face->at[i], *t = face->at[i == 2 ? 0 : i + 1];
        bool start_above = s[v] > p[v], end_above = t[v] > p[v];
        if (start_above == end_above)
            continue;
        int side = orient_in(u, v, s, t, p);
        if (end_above)
            sum += side > 0;
        else
            sum -= side < 0;
    }
    return sum;
}

/* Returns the sign of the orientation of the face's corners and the shifted point p. If p is in the
 * face's plane, the first nonzero component of the normal decides. */
static int shifted_side(const double p[3], const ebpo_corners *face)
{
    const double *a = face->at[0], *b = face->at[1], *c = face->at[2];
    int side = ebpo_orient3d(a, b, c, p);
    if (side == 0)
        side = orient_in(1, 2, a, b, c);
    if (side == 0)
        side = orient_in(2, 0, a, b, c);
    return side != 0 ? side : orient_in(0, 1, a, b, c);
}

/* Returns true if the shifted p is outside the face's extent on axis k. */
static bool is_outside(const double p[3], int k, const ebpo_corners *face)
{
    double a = face->at[0][k], b = face->at[1][k], c = face->at[2][k];
    return (a > p[k] && b > p[k] && c > p[k]) || (a <= p[k] && b <= p[k] && c <= p[k]);
}

int ebpo_ray_hit(const double p[3], int axis, const ebpo_corners *face)
{
    int u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
    if (is_outside(p, u, face) || is_outside(p, v, face))
        return 0;
    double a = face->at[0][axis], b = face->at[1][axis], c = face->at[2][axis], x = p[axis];
    if (a <= x && b <= x && c <= x)
        return 0;
    int turn = turns_around(p, u, v, face);
    if (axis == 1)
        turn = -turn; /* the projection (x, z) along y is left-handed */
    if (turn == 0 || (a > x && b > x && c > x))
        return turn;
    return shifted_side(p, face) == -turn ? turn : 0;
}

/* Containment. The greatest n . x over the part of a face in its cell is the value of a linear
 * program. By weak duality, every vector m gives an upper bound:
 *
 *     n . x <= (max of (n - m) . v over the face's corners v) + (max of m . y over the unit cube)
 *
 * For at least one of the following vectors m, the bound is equal to the maximum: m = 0; a vector m
 * along one axis for which n - m is perpendicular to an edge of the face; a vector m along two axes
 * for which n - m is normal to the face. A rounded m also gives a valid bound, so most faces need
 * not be clipped. If no bound decides, the face is clipped in rationals. */

void ebpo_node_planes_of(ebpo_node_planes *out, const ebpo_reference_tree *view,
                         const ebpo_reference_node *node)
{
    uint32_t count;
    const uint32_t *codes = ebpo_reference_planes(view, node, &count);
    out->count = 0;
    for (uint32_t i = 0; i < count; i++) {
        int at = out->count;
        if (!ebpo_plane_decode(codes[i], out->normal[at], &out->d[at]))
            continue;
        for (int k = 0; k < 3; k++)
            out->n[at][k] = out->normal[at][k];
        out->bound[at] = out->d[at] / 4096.0;
        out->number[at] = i;
        out->count++;
    }
}

static double dot_product(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double highest_corner(const local_face *face, const double n[3])
{
    double a = dot_product(n, face->at[0]), b = dot_product(n, face->at[1]),
           c = dot_product(n, face->at[2]);
    return fmax(a, fmax(b, c));
}

/* Returns true if the upper bound of n . x that the vector m gives, including rounding errors, is
 * at most `bound`. */
static bool is_certified(const local_face *face, const double n[3], const double m[3], double bound)
{
    double difference[3], cube = 0, size = 0;
    for (int k = 0; k < 3; k++) {
        difference[k] = n[k] - m[k];
        cube += m[k] > 0 ? m[k] : 0;
        size += (fabs(n[k]) + fabs(m[k])) * face->largest[k];
    }
    return highest_corner(face, difference) + cube + 16 * eps * size <= bound;
}

/* Tries vectors m along one axis for which n - m is perpendicular to an edge of the face. */
static bool certified_by_cell_face(const local_face *face, const double n[3], double bound)
{
    for (int i = 0; i < 3; i++) {
        const double *a = face->at[i], *b = face->at[(i + 1) % 3];
        double edge[3] = { b[0] - a[0], b[1] - a[1], b[2] - a[2] };
        double rise = dot_product(n, edge);
        for (int k = 0; k < 3; k++) {
            double m[3] = { 0, 0, 0 };
            m[k] = rise / edge[k];
            if (edge[k] != 0 && is_certified(face, n, m, bound))
                return true;
        }
    }
    return false;
}

/* Tries vectors m along two axes for which n - m is normal to the face. */
static bool certified_by_two_cell_faces(const local_face *face, const double n[3], double bound)
{
    double p[3], q[3], normal[3];
    for (int k = 0; k < 3; k++) {
        p[k] = face->at[1][k] - face->at[0][k];
        q[k] = face->at[2][k] - face->at[0][k];
    }
    for (int k = 0; k < 3; k++)
        normal[k] = p[(k + 1) % 3] * q[(k + 2) % 3] - p[(k + 2) % 3] * q[(k + 1) % 3];
    for (int j = 0; j < 3; j++) {
        double m[3], factor = n[j] / normal[j];
        for (int k = 0; k < 3; k++)
            m[k] = k == j ? 0 : n[k] - factor * normal[k];
        if (normal[j] != 0 && is_certified(face, n, m, bound))
            return true;
    }
    return false;
}

/* Returns true if a corner of the face is in the cell and certainly beyond the plane. */
static bool corner_beyond(const local_face *face, const double n[3], double bound, double error)
{
    for (int i = 0; i < 3; i++)
        if ((face->contained >> i & 1) && dot_product(n, face->at[i]) > bound + error)
            return true;
    return false;
}

/* Returns true if plane i cuts off no point of the face in the cell. (511 in the error bound is the
 * sum of the absolute components of n.) */
static bool face_keeps(ebpo_tally *tally, const ebpo_node_planes *planes, int i,
                       const ebpo_frame *frame, const ebpo_corners *face, const local_face *local)
{
    const double *n = planes->n[i];
    double bound = planes->bound[i],
           error =
               16 * eps * 511 * fmax(local->largest[0], fmax(local->largest[1], local->largest[2]));
    if (highest_corner(local, n) <= bound - error)
        return true;
    if (corner_beyond(local, n, bound, error))
        return false;
    if (certified_by_cell_face(local, n, bound) || certified_by_two_cell_faces(local, n, bound))
        return true;
    tally->exact_half_spaces++;
    return ebpo_exact_half_space(frame->low, frame->high, face, planes->normal[i], planes->d[i]);
}

void ebpo_check_face_contained(ebpo_tally *tally, const ebpo_node_planes *planes,
                               const ebpo_reference_node *node, const ebpo_frame *frame,
                               const ebpo_corners *face, uint64_t number)
{
    local_face local;
    local_make(&local, frame, face);
    tally->checks[EBPO_VERIFY_CONTAINMENT] += (uint64_t)planes->count;
    for (int i = 0; i < planes->count; i++)
        if (!face_keeps(tally, planes, i, frame, face, &local))
            ebpo_tally_violation(tally, EBPO_VERIFY_CONTAINMENT,
                                 &(ebpo_verify_place){ node->code, number, planes->number[i] },
                                 "the plane cuts off a part of the face in the cell");
}

void ebpo_check_corners_contained(ebpo_tally *tally, const ebpo_node_planes *planes,
                                  const ebpo_reference_node *node, unsigned corners)
{
    for (int i = 0; i < planes->count; i++)
        for (unsigned corner = 0; corner < 8; corner++) {
            if (!(corners >> corner & 1))
                continue;
            const int32_t *n = planes->normal[i];
            int32_t value = 0;
            for (int k = 0; k < 3; k++)
                value += corner >> k & 1 ? n[k] : 0;
            tally->checks[EBPO_VERIFY_CONTAINMENT]++;
            if (4096 * value > planes->d[i])
                ebpo_tally_violation(
                    tally, EBPO_VERIFY_CONTAINMENT,
                    &(ebpo_verify_place){ node->code, EBPO_NO_FACE, planes->number[i] },
                    "the plane cuts off corner %u of the cell, which is in the solid", corner);
        }
}
