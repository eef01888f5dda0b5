#include "check_main.h"
#include "reference_error_bound.h"

#include <math.h>

#include "solids.h"

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void minus(const double a[3], const double b[3], double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = a[k] - b[k];
}

static void cross(const double a[3], const double b[3], double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
}

static double to_segment(const double p[3], const double a[3], const double b[3])
{
    double u[3], v[3], w[3];
    minus(b, a, u);
    minus(p, a, v);
    double length = dot(u, u), t = length > 0 ? fmin(1, fmax(0, dot(u, v) / length)) : 0;
    for (int k = 0; k < 3; k++)
        w[k] = v[k] - t * u[k];
    return sqrt(dot(w, w));
}

/* Returns the distance to the plane if the projection of the point is in the triangle, else to the
 * sides. */
static double to_triangle(const double p[3], const double t[3][3])
{
    double u[3], v[3], n[3], w[3],
        best = fmin(to_segment(p, t[0], t[1]),
                    fmin(to_segment(p, t[1], t[2]), to_segment(p, t[2], t[0])));
    minus(t[1], t[0], u);
    minus(t[2], t[0], v);
    cross(u, v, n);
    double area = sqrt(dot(n, n));
    bool over = area > 0;
    for (int i = 0; i < 3 && over; i++) {
        double side[3], to[3], c[3];
        minus(t[(i + 1) % 3], t[i], side);
        minus(p, t[i], to);
        cross(side, to, c);
        over = dot(c, n) >= 0;
    }
    minus(p, t[0], w);
    return over ? fmin(best, fabs(dot(w, n)) / area) : best;
}

/* Returns the solid angle of a triangle (van Oosterom, Strackee 1983). */
static double solid_angle(const double p[3], const double t[3][3])
{
    double r[3][3], length[3], c[3];
    for (int i = 0; i < 3; i++) {
        minus(t[i], p, r[i]);
        length[i] = sqrt(dot(r[i], r[i]));
    }
    cross(r[1], r[2], c);
    double below = length[0] * length[1] * length[2] + dot(r[0], r[1]) * length[2] +
                   dot(r[1], r[2]) * length[0] + dot(r[2], r[0]) * length[1];
    return 2 * atan2(dot(r[0], c), below);
}

double reference_distance(const ebpo_mesh *mesh, bool solid, const double p[3])
{
    double best = INFINITY, angle = 0;
    for (uint64_t i = 0; i < mesh->face_count; i++) {
        double t[3][3];
        for (int c = 0; c < 3; c++)
            ebpo_test_point(mesh, mesh->faces[3 * i + (uint64_t)c], t[c]);
        best = fmin(best, to_triangle(p, (const double(*)[3])t));
        angle += solid ? solid_angle(p, (const double(*)[3])t) : 0;
    }
    return fabs(angle) > 6.28 ? 0 : best;
}

double reference_max_distance(ebpo_file *file, int level, const ebpo_mesh *mesh, bool solid,
                              uint64_t points, uint64_t seed)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh lod;
    ebpo_lod_nodes nodes;
    double greatest = 0;
    ck_assert_msg(ebpo_lod_level_nodes(file, level, NULL, &lod, &nodes, NULL, &error) == EBPO_OK,
                  "%s", error.message);
    for (uint64_t i = 0; i < points && lod.face_count; i++) {
        const uint32_t *face = lod.faces + 3 * (ebpo_test_random(&seed) % lod.face_count);
        double a = ebpo_test_random_unit(&seed), b = ebpo_test_random_unit(&seed) * (1 - a), p[3];
        if (i % 4 == 0) /* most maxima are at corners */
            a = b = 0;
        for (int k = 0; k < 3; k++)
            p[k] = a * lod.xyz64[3 * face[1] + (uint32_t)k] +
                   b * lod.xyz64[3 * face[2] + (uint32_t)k] +
                   (1 - a - b) * lod.xyz64[3 * face[0] + (uint32_t)k];
        if (i % 2) { /* a point between this corner and another corner of the same node */
            uint64_t node = 0, first = 0;
            while (first + nodes.nodes[node].vertex_count <= face[0])
                first += nodes.nodes[node++].vertex_count;
            uint64_t other = first + ebpo_test_random(&seed) % nodes.nodes[node].vertex_count;
            double t = ebpo_test_random_unit(&seed);
            for (uint64_t k = 0; k < 3; k++)
                p[k] += t * (lod.xyz64[3 * other + k] - p[k]);
        }
        greatest = fmax(greatest, reference_distance(mesh, solid, p));
    }
    ebpo_mesh_free(&lod);
    ebpo_lod_nodes_free(&nodes);
    return greatest;
}
