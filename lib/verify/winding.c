/* Seen along the axis, a face winds around the ray once or not at all: the edges that cross a
 * half-line beside the point are counted. The half-line runs along the axis of the larger shift, so
 * that the smaller shift decides which end of an edge lies where, and the larger one every tie that
 * is left. */
#include "core/strict_fp.h"

#include "verify/winding.h"

#include "geometry/predicates.h"
#include "mesh/mesh_parts.h"

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

/* Turns of the face around p seen in the plane (u, v), counter-clockwise positive. */
static int turns(const double p[3], int u, int v, const ebpo_corners *face)
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

/* Side of the shifted p of the face's plane: a tie goes to the first component of the normal that
 * is not 0. */
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

static bool outside(const double p[3], int k, const ebpo_corners *face)
{
    double a = face->at[0][k], b = face->at[1][k], c = face->at[2][k];
    return (a > p[k] && b > p[k] && c > p[k]) || (a <= p[k] && b <= p[k] && c <= p[k]);
}

int ebpo_ray_hit(const double p[3], int axis, const ebpo_corners *face)
{
    int u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
    if (outside(p, u, face) || outside(p, v, face))
        return 0;
    double a = face->at[0][axis], b = face->at[1][axis], c = face->at[2][axis], x = p[axis];
    if (a <= x && b <= x && c <= x)
        return 0;
    int turn = turns(p, u, v, face);
    if (axis == 1)
        turn = -turn; /* (x, z) is left-handed seen along y */
    if (turn == 0 || (a > x && b > x && c > x))
        return turn;
    return shifted_side(p, face) == -turn ? turn : 0;
}
