#include "cli/bench/bench_rays.h"

#include <math.h>
#include <string.h>

#include "cli/bench/bench_walk.h"

enum { RAY_WIDTH = 7 };

static double scene_diagonal(const bench_scene *s)
{
    double square = 0;
    for (int k = 0; k < 3; k++)
        square += (s->high[k] - s->low[k]) * (s->high[k] - s->low[k]);
    return sqrt(square);
}

static void random_point(const bench_scene *s, uint64_t *random, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = s->low[k] + bench_random_unit(random) * (s->high[k] - s->low[k]);
}

/* Generates a direction that is uniform over the sphere, by rejection sampling. This method uses no
 * functions, such as sin, whose results differ between systems. */
static void random_direction(uint64_t *random, double out[3])
{
    double square;
    do {
        square = 0;
        for (int k = 0; k < 3; k++) {
            out[k] = 2 * bench_random_unit(random) - 1;
            square += out[k] * out[k];
        }
    } while (square > 1 || square < 0.01);
    double length = sqrt(square);
    for (int k = 0; k < 3; k++)
        out[k] /= length;
}

void bench_rays_uniform(const bench_scene *s, uint64_t seed, uint64_t count, double *rows)
{
    for (double *row = rows; row < rows + RAY_WIDTH * count; row += RAY_WIDTH) {
        random_point(s, &seed, row);
        random_direction(&seed, row + 3);
        row[6] = INFINITY;
    }
}

void bench_rays_segments(const bench_scene *s, uint64_t seed, uint64_t count, double *rows)
{
    double length = scene_diagonal(s) / 20;
    bench_rays_uniform(s, seed, count, rows);
    for (double *row = rows; row < rows + RAY_WIDTH * count; row += RAY_WIDTH) {
        for (int k = 3; k < 6; k++)
            row[k] *= length;
        row[6] = 1;
    }
}

/* Computes two unit vectors perpendicular to `along`. */
static void make_basis(const double along[3], double right[3], double up[3])
{
    int axis = 0;
    for (int k = 1; k < 3; k++)
        axis = fabs(along[k]) < fabs(along[axis]) ? k : axis;
    double length = sqrt(1 - along[axis] * along[axis]);
    for (int k = 0; k < 3; k++)
        right[k] = ((k == axis) - along[axis] * along[k]) / length;
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        up[k] = along[u] * right[v] - along[v] * right[u];
    }
}

void bench_rays_camera(const bench_scene *s, uint64_t seed, uint64_t count, double *rows)
{
    double along[3], right[3], up[3], size = scene_diagonal(s);
    uint64_t side = (uint64_t)ceil(sqrt((double)count));
    random_direction(&seed, along);
    make_basis(along, right, up);
    for (uint64_t i = 0; i < count; i++) {
        double *row = rows + RAY_WIDTH * i, x = ((double)(i % side) + 0.5) / (double)side - 0.5,
               y = ((double)(i / side) + 0.5) / (double)side - 0.5;
        for (int k = 0; k < 3; k++) {
            row[k] = (s->low[k] + s->high[k]) / 2 - 1.5 * size * along[k];
            row[3 + k] = 1.5 * along[k] + x * right[k] + y * up[k];
        }
        row[6] = INFINITY;
    }
}

static void corner_of(const ebpo_mesh *mesh, uint64_t face, int i, double out[3])
{
    uint64_t vertex = mesh->faces[3 * face + (uint64_t)i];
    for (int k = 0; k < 3; k++)
        out[k] = mesh->xyz32 ? mesh->xyz32[3 * vertex + (uint64_t)k]
                             : mesh->xyz64[3 * vertex + (uint64_t)k];
}

static void aim_at(double row[7], const double target[3])
{
    for (int k = 0; k < 3; k++) {
        row[k] = (float)row[k];
        row[3 + k] = target[k] - row[k];
    }
}

void bench_rays_degenerate(const bench_scene *s, const ebpo_mesh *mesh, uint64_t seed,
                           uint64_t count, double *rows)
{
    for (uint64_t i = 0; i < count; i++) {
        double *row = rows + RAY_WIDTH * i, a[3], b[3];
        uint64_t face = bench_random(&seed) % mesh->face_count;
        corner_of(mesh, face, 0, a);
        corner_of(mesh, face, 1, b);
        random_point(s, &seed, row);
        random_direction(&seed, row + 3);
        row[6] = INFINITY;
        if (i % 4 == 1)
            for (int k = 0; k < 3; k++)
                a[k] = (a[k] + b[k]) / 2;
        if (i % 4 < 2)
            aim_at(row, a);
        else
            memcpy(row, a, sizeof a);
        if (i % 4 == 3) {
            unsigned axis = (unsigned)(bench_random(&seed) % 3);
            row[axis] = (float)(s->low[axis] - 0.1 * scene_diagonal(s));
            for (unsigned k = 0; k < 3; k++)
                row[3 + k] = k == axis;
        }
    }
}
