#include "embedded.h"

#include <math.h>

/* Upper bound of rounding errors of volume(). It is much larger than the sum of a dozen rounding
 * errors of products of coordinates up to 4, and much smaller than the value of volume() for a face
 * of a mesh with a billion faces. */
static const double slack = 1e-14;

typedef struct corners {
    double p[3][3];
} corners;

static corners corners_of(const ebpo_mesh *mesh, uint64_t face)
{
    corners c;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            c.p[i][k] =
                mesh->xyz32[3 * (uint64_t)mesh->faces[3 * face + (unsigned)i] + (unsigned)k];
    return c;
}

static double dot(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(double out[3], const double *a, const double *b)
{
    for (int k = 0; k < 3; k++)
        out[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
}

/* Returns six times the signed volume of the tetrahedron with the corners 0, a, b and c. */
static double volume(const double *a, const double *b, const double *c)
{
    double n[3];
    cross(n, a, b);
    return dot(n, c);
}

/* Returns 1 if the ray from `origin` crosses the face, and 0 if it does not. Returns -1 if the ray
 * is too close to an edge, or its origin is too close to the face's plane, to decide. */
static int crossed(const corners *c, const double origin[3], const double direction[3])
{
    double q[3][3], sides[3];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            q[i][k] = c->p[i][k] - origin[k];
    int left = 0, right = 0;
    for (int i = 0; i < 3; i++) {
        sides[i] = volume(direction, q[i], q[(i + 1) % 3]);
        left += sides[i] > slack;
        right += sides[i] < -slack;
    }
    if (left && right)
        return 0;
    /* the ray crosses the face at origin + ahead / sum * direction, so `ahead` and `sum` must have
     * the same sign */
    double ahead = volume(q[0], q[1], q[2]), sum = sides[0] + sides[1] + sides[2];
    if (left == 3 || right == 3)
        return fabs(ahead) <= slack ? -1 : (ahead > 0) == (sum > 0);
    return -1;
}

/* Returns true if the ray intersects exactly one face. */
static bool intersects_once(const ebpo_mesh *mesh, const double origin[3],
                            const double direction[3])
{
    uint64_t times = 0;
    for (uint64_t f = 0; f < mesh->face_count; f++) {
        corners c = corners_of(mesh, f);
        int meets = crossed(&c, origin, direction);
        if (meets < 0)
            return false;
        times += (unsigned)meets;
    }
    return times == 1;
}

bool ebpo_embedded_sphere(const ebpo_mesh *mesh)
{
    static const double centre[3] = { 0, 0, 0 }, oblique[3] = { 0.5407, 0.6131, 0.5760 };
    for (uint64_t f = 0; f < mesh->face_count; f++) {
        corners c = corners_of(mesh, f);
        if (!(volume(c.p[0], c.p[1], c.p[2]) > slack))
            return false;
    }
    return intersects_once(mesh, centre, oblique);
}

/* Returns true if the face faces away from the torus's central circle. For each point of the face,
 * take the nearest point of the circle. These nearest points are on an arc between the nearest
 * points of two of the face's corners. The arc must be below the plane of the face. To test this,
 * the greatest n . x over the arc is compared with the plane, where n is the face's normal. It is
 * at most the greatest n . x over the chord of the arc, plus a bound for the height of the arc
 * above the chord. This height is at most c^2 / 7 for a chord of length c <= 1. */
static bool faces_outwards(const corners *c)
{
    double centre[3][3], e[2][3], n[3], support = -INFINITY, longest = 0;
    for (int i = 0; i < 3; i++) {
        double r = hypot(c->p[i][0], c->p[i][1]);
        if (!(r > 1e-3))
            return false;
        centre[i][0] = c->p[i][0] / r, centre[i][1] = c->p[i][1] / r, centre[i][2] = 0;
    }
    for (int k = 0; k < 3; k++) {
        e[0][k] = c->p[1][k] - c->p[0][k];
        e[1][k] = c->p[2][k] - c->p[0][k];
    }
    cross(n, e[0], e[1]);
    for (int i = 0; i < 3; i++) {
        const double *a = centre[i], *b = centre[(i + 1) % 3];
        longest = fmax(longest, (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]));
        support = fmax(support, dot(n, a));
    }
    double rounding = slack * sqrt(dot(e[0], e[0]) * dot(e[1], e[1]));
    return longest <= 1 && dot(n, c->p[0]) - support > hypot(n[0], n[1]) * longest / 7 + rounding;
}

bool ebpo_embedded_torus(const ebpo_mesh *mesh)
{
    /* The ray begins on the circle and leads outwards and upwards, in a half plane that is bounded
     * by the axis. It does not leave this half plane. */
    const double x = 0.7431, y = sqrt(1 - x * x), origin[3] = { x, y, 0 },
                 oblique[3] = { 0.8 * x, 0.8 * y, 0.6 };
    for (uint64_t f = 0; f < mesh->face_count; f++) {
        corners c = corners_of(mesh, f);
        if (!faces_outwards(&c))
            return false;
    }
    return intersects_once(mesh, origin, oblique);
}
