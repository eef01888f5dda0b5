/* The distance from a face, a convex set, is a convex function along a line: where it falls,
 * tangents lie below it, so that Newton's steps towards a distance never go too far. That finds
 * when a ball touches a face, whichever of its features it is. */
#include "core/strict_fp.h"

#include "extras/haptic/face_near.h"

#include <math.h>

#include "geometry/predicates_expansion.h"
#include "extras/haptic/vectors.h"

typedef struct nearest {
    double square, offset[3]; /* from the nearest point to p */
    int edge;                 /* k to k + 1 */
    double part;              /* of it */
} nearest;

static void try_edge(const double p[3], const double face[3][3], int k, nearest *best)
{
    const double *a = face[k], *b = face[(k + 1) % 3];
    double e[3], d[3], part = 0;
    difference(b, a, e);
    difference(p, a, d);
    double length = dot(e, e);
    if (length > 0)
        part = fmin(fmax(dot(d, e) / length, 0), 1);
    for (int i = 0; i < 3; i++)
        d[i] -= part * e[i];
    double square = dot(d, d);
    if (square < best->square) {
        *best = (nearest){ .square = square, .edge = k, .part = part };
        for (int i = 0; i < 3; i++)
            best->offset[i] = d[i];
    }
}

/* Where p is above the inside of the face. */
static bool near_inside(const double p[3], const double face[3][3], ebpo_face_near *out)
{
    double e[3], f[3], n[3], d[3], c[3];
    difference(face[1], face[0], e);
    difference(face[2], face[0], f);
    difference(p, face[0], d);
    cross(e, f, n);
    double area = dot(n, n);
    if (!(area > 0))
        return false;
    cross(d, f, c);
    double u = dot(c, n) / area;
    cross(e, d, c);
    double v = dot(c, n) / area;
    if (!(u >= 0 && v >= 0 && u + v <= 1))
        return false;
    double length = sqrt(area), height = dot(d, n) / length;
    out->distance = fabs(height);
    for (int i = 0; i < 3; i++)
        out->away[i] = height > 0 ? n[i] / length : height < 0 ? -n[i] / length : 0;
    out->weight[0] = 1 - u - v;
    out->weight[1] = u;
    out->weight[2] = v;
    return true;
}

void ebpo_face_nearest(const double p[3], const double face[3][3], ebpo_face_near *out)
{
    if (near_inside(p, face, out))
        return;
    nearest best = { .square = INFINITY };
    for (int k = 0; k < 3; k++)
        try_edge(p, face, k, &best);
    out->distance = sqrt(best.square);
    for (int i = 0; i < 3; i++) {
        out->away[i] = out->distance > 0 ? best.offset[i] / out->distance : 0;
        out->weight[i] = 0;
    }
    out->weight[best.edge] = 1 - best.part;
    out->weight[(best.edge + 1) % 3] = best.part;
}

enum { STEPS = 24 };

double ebpo_ball_meets(const ebpo_ball_way *w, const double face[3][3], double away[3])
{
    double part = 0;
    for (int step = 0; step < STEPS; step++) {
        double x[3];
        ebpo_face_near near;
        for (int i = 0; i < 3; i++)
            x[i] = w->from[i] + part * w->way[i];
        ebpo_face_nearest(x, face, &near);
        double gap = near.distance - w->reach, slope = dot(near.away, w->way);
        for (int i = 0; i < 3; i++)
            away[i] = near.away[i];
        if (slope >= -(gap > 0 ? w->slack : w->least_slack))
            return 2;
        if (gap <= w->band)
            return part;
        part -= gap / slope;
        if (!(part <= 1))
            return 2;
    }
    return part;
}

static int volume_sign(const double a[3], const double b[3], const double c[3], const double d[3])
{
    double u[3], v[3], w[3], value = 0, sum = 0, last = 0;
    difference(b, a, u);
    difference(c, a, v);
    difference(d, a, w);
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        double l = u[j] * v[k], r = u[k] * v[j];
        value += (l - r) * w[i];
        sum += (fabs(l) + fabs(r)) * fabs(w[i]);
        last += fabs(w[i]);
    }
    /* the bound of ebpo_orient3d; that function may take memory where expansions do not do */
    double bound = 0x1p-50 * sum + 0x1p-960 * (1 + last);
    return value > bound ? 1 : value < -bound ? -1 : ebpo_orient3d_expansion(a, b, c, d);
}

/* In the face's plane, seen along an axis: no line along an edge or along pq parts them. */
static bool meets_in_plane(const double p[3], const double q[3], const double face[3][3], int axis)
{
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    double a[2] = { p[u], p[v] }, b[2] = { q[u], q[v] }, corner[3][2];
    int turn[3];
    for (int k = 0; k < 3; k++) {
        corner[k][0] = face[k][u];
        corner[k][1] = face[k][v];
        turn[k] = ebpo_orient2d_expansion(a, b, corner[k]);
    }
    int way = ebpo_orient2d_expansion(corner[0], corner[1], corner[2]);
    if (way != 1 && way != -1)
        return way != 0;
    if (turn[0] == turn[1] && turn[1] == turn[2] && (turn[0] == 1 || turn[0] == -1))
        return false;
    for (int k = 0; k < 3; k++)
        if (ebpo_orient2d_expansion(corner[k], corner[(k + 1) % 3], a) == -way &&
            ebpo_orient2d_expansion(corner[k], corner[(k + 1) % 3], b) == -way)
            return false;
    /* on the line of a flat view: along it, too */
    for (int i = 0; i < 2; i++)
        if (fmax(a[i], b[i]) < fmin(corner[0][i], fmin(corner[1][i], corner[2][i])) ||
            fmin(a[i], b[i]) > fmax(corner[0][i], fmax(corner[1][i], corner[2][i])))
            return false;
    return true;
}

/* Along each axis in which the face is not a line; without area it is one along all. */
static bool meets_flat(const double p[3], const double q[3], const double face[3][3])
{
    for (int axis = 0; axis < 3; axis++) {
        int u = (axis + 1) % 3, v = (axis + 2) % 3;
        const double c[3][2] = { { face[0][u], face[0][v] },
                                 { face[1][u], face[1][v] },
                                 { face[2][u], face[2][v] } };
        if (ebpo_orient2d_expansion(c[0], c[1], c[2]) != 0)
            return meets_in_plane(p, q, face, axis);
    }
    return false;
}

bool ebpo_segment_may_meet(const double p[3], const double q[3], const double face[3][3])
{
    for (int i = 0; i < 3; i++)
        if (fmax(p[i], q[i]) < fmin(face[0][i], fmin(face[1][i], face[2][i])) ||
            fmin(p[i], q[i]) > fmax(face[0][i], fmax(face[1][i], face[2][i])))
            return false;
    int at_p = volume_sign(face[0], face[1], face[2], p);
    int at_q = volume_sign(face[0], face[1], face[2], q);
    if (at_p == at_q && (at_p == 1 || at_p == -1))
        return false;
    if (at_p == 0 && at_q == 0)
        return meets_flat(p, q, face);
    bool left = false, right = false;
    for (int k = 0; k < 3; k++) {
        int sign = volume_sign(p, q, face[k], face[(k + 1) % 3]);
        left |= sign == 1;
        right |= sign == -1;
    }
    return !(left && right);
}

int ebpo_segment_crosses(const double p[3], const double q[3], const double face[3][3])
{
    if (!ebpo_segment_may_meet(p, q, face))
        return 0;
    int at_p = volume_sign(face[0], face[1], face[2], p);
    int at_q = volume_sign(face[0], face[1], face[2], q);
    if (at_p * at_q != -1)
        return EBPO_CROSSES_BADLY;
    for (int k = 0; k < 3; k++) {
        int sign = volume_sign(p, q, face[k], face[(k + 1) % 3]);
        if (sign != 1 && sign != -1)
            return EBPO_CROSSES_BADLY;
    }
    return at_p; /* from its outer side */
}
