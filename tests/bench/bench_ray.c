/* Processor time for one ray or box against one triangle, the best of many rounds: bench_ray. */
#include <math.h>
#include <stdio.h>
#include <time.h>

#include "exact_twin.h"
#include "geom/ray_triangle.h"

enum { COUNT = 4096, ROUNDS = 500 };

static double triangles[COUNT][3][3], box_min[COUNT][3], box_max[COUNT][3];
static ebpo_segment rays[COUNT];

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

/* aim: 0 at random, 1 at the triangle's middle, 2 at a corner. */
static void prepare(int aim, uint64_t *state)
{
    for (int n = 0; n < COUNT; n++) {
        rays[n].t_max = 1e9;
        for (int k = 0; k < 3; k++) {
            for (int i = 0; i < 3; i++)
                triangles[n][i][k] = (float)twin_uniform(state);
            double middle = (triangles[n][0][k] + triangles[n][1][k] + triangles[n][2][k]) / 3;
            rays[n].origin[k] = 3 * twin_uniform(state);
            rays[n].direction[k] =
                aim == 0 ? twin_uniform(state)
                         : (aim == 1 ? middle : triangles[n][0][k]) - rays[n].origin[k];
            box_min[n][k] = middle + .4 * twin_uniform(state);
            box_max[n][k] = box_min[n][k] + .1;
        }
    }
}

static void time_rays(const char *name, int aim, int rounds, uint64_t *state)
{
    long hits = 0;
    double best = 1e30;
    prepare(aim, state);
    for (int r = 0; r < rounds; r++) {
        double begin = now();
        hits = 0;
        for (int n = 0; n < COUNT; n++) {
            ebpo_ray_meeting m;
            ebpo_ray_triangle(&rays[n], (const double(*)[3])triangles[n], &m);
            hits += m.meets;
        }
        best = fmin(best, (now() - begin) / COUNT);
    }
    printf("%-18s %8.1f ns  %5.1f %% meet\n", name, best, 100.0 * (double)hits / COUNT);
}

static void time_boxes(int rounds, uint64_t *state)
{
    long hits = 0;
    double best = 1e30;
    prepare(0, state);
    for (int r = 0; r < rounds; r++) {
        double begin = now();
        hits = 0;
        for (int n = 0; n < COUNT; n++)
            hits +=
                ebpo_triangle_meets_box((const double(*)[3])triangles[n], box_min[n], box_max[n]);
        best = fmin(best, (now() - begin) / COUNT);
    }
    printf("%-18s %8.1f ns  %5.1f %% meet\n", "box", best, 100.0 * (double)hits / COUNT);
}

int main(void)
{
    uint64_t state = 1;
    time_rays("ray at random", 0, ROUNDS, &state);
    time_rays("ray at the middle", 1, ROUNDS, &state);
    time_rays("ray at a corner", 2, ROUNDS / 50, &state);
    time_boxes(ROUNDS, &state);
    return 0;
}
