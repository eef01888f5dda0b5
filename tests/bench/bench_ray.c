/* Measures the processor time of one ray or box against one triangle: bench_ray. Prints the best of
 * many rounds. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "exact_reference.h"
#include "geometry/ray.h"

enum { COUNT = 4096, ROUNDS = 30 };

static double triangles[COUNT][3][3], box_min[COUNT][3], box_max[COUNT][3];
static double others[COUNT][3][3]; /* neighbours of the triangles */
static ebpo_segment rays[COUNT];

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

typedef enum aim {
    AT_RANDOM,
    AT_THE_MIDDLE,
    AT_A_CORNER, /* as exactly as the rounding of the direction permits */
    AT_A_CORNER_EXACTLY,
    AT_AN_EDGE_EXACTLY,
    FROM_A_CORNER,
    FROM_AN_EDGE,
    FROM_THE_FACE, /* from the face, within rounding */
    TO_THE_FACE,   /* ends at the face, within rounding */
    TO_A_CORNER,
    ALONG_AN_AXIS, /* along an axis through a corner */
    WITHIN_THE_PLANE
} aim;

/* Returns a coordinate with few bits, so that differences are exact. */
static double coarse(uint64_t *state)
{
    return (double)(float)(0x1p-20 * (double)reference_integer(state, -(1 << 20), 1 << 20));
}

static void make_triangles(int n, aim a, uint64_t *state)
{
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++)
            triangles[n][i][k] = coarse(state);
    if (a == WITHIN_THE_PLANE)
        for (int i = 0; i < 3; i++)
            triangles[n][i][2] = 0.5;
    memcpy(others[n], triangles[n], sizeof others[n]);
    for (int k = 0; k < 3; k++)
        others[n][2][k] = coarse(state);
}

static void make_ray(int n, aim a, uint64_t *state)
{
    const double(*t)[3] = (const double(*)[3])triangles[n];
    bool exact = a == AT_A_CORNER_EXACTLY || a == AT_AN_EDGE_EXACTLY || a == TO_A_CORNER;
    for (int k = 0; k < 3; k++) {
        double middle = (t[0][k] + t[1][k] + t[2][k]) / 3, edge = (t[0][k] + t[1][k]) / 2,
               from = exact ? 4 * coarse(state) : 3 * reference_uniform(state),
               to = a == AT_THE_MIDDLE || a == TO_THE_FACE ? middle
                    : a == AT_AN_EDGE_EXACTLY              ? edge
                    : a == AT_RANDOM || (a >= FROM_A_CORNER && a <= FROM_THE_FACE)
                        ? 9 * reference_uniform(state)
                        : t[0][k];
        from = a == FROM_A_CORNER ? t[0][k] : a == FROM_AN_EDGE ? edge : from;
        from = a == FROM_THE_FACE ? middle : from;
        rays[n].origin[k] = a == ALONG_AN_AXIS && k != 1 ? t[0][k] : from;
        rays[n].direction[k] = a == ALONG_AN_AXIS ? (k == 1 ? 1 : 0) : to - from;
        if (a == WITHIN_THE_PLANE) {
            rays[n].origin[k] = k == 2 ? 0.5 : from;
            rays[n].direction[k] = k == 2 ? 0 : middle - from;
        }
    }
    rays[n].t_max = a == TO_THE_FACE || a == TO_A_CORNER ? 1 : 1e9;
    if (a == ALONG_AN_AXIS)
        rays[n].origin[1] = -9;
}

static void prepare(aim a, uint64_t *state)
{
    for (int n = 0; n < COUNT; n++) {
        make_triangles(n, a, state);
        make_ray(n, a, state);
        for (int k = 0; k < 3; k++) {
            box_min[n][k] = triangles[n][0][k] + .4 * reference_uniform(state);
            box_max[n][k] = box_min[n][k] + .1;
        }
    }
}

/* Measures one ray against a triangle. Also measures the comparison of the hits of two neighbours,
 * for rays that hit both. */
static void time_rays(const char *name, aim a, uint64_t *state)
{
    static ebpo_ray_intersection intersected[2][COUNT];
    long hits = 0, both = 0, ties = 0;
    double best = 1e30, best_order = 1e30;
    prepare(a, state);
    for (int r = 0; r < ROUNDS; r++) {
        double begin = now();
        hits = both = ties = 0;
        for (int n = 0; n < COUNT; n++) {
            ebpo_ray_triangle(&rays[n], (const double(*)[3])triangles[n], &intersected[0][n]);
            hits += intersected[0][n].intersects;
        }
        best = fmin(best, (now() - begin) / COUNT);
        for (int n = 0; n < COUNT; n++)
            ebpo_ray_triangle(&rays[n], (const double(*)[3])others[n], &intersected[1][n]);
        begin = now();
        for (int n = 0; n < COUNT; n++) {
            if (!intersected[0][n].intersects || !intersected[1][n].intersects)
                continue;
            both++;
            ties += ebpo_ray_compare(&rays[n], (const double(*)[3])triangles[n], &intersected[0][n],
                                     (const double(*)[3])others[n], &intersected[1][n]) == 0;
        }
        best_order = fmin(best_order, (now() - begin) / (double)(both ? both : 1));
    }
    printf("%-22s %8.1f ns  %5.1f %% hit; %8.1f ns to compare %4ld pairs, %4ld ties\n", name, best,
           100.0 * (double)hits / COUNT, both ? best_order : 0.0, both, ties);
}

static void time_boxes(uint64_t *state)
{
    long hits = 0;
    double best = 1e30;
    prepare(AT_RANDOM, state);
    for (int r = 0; r < ROUNDS; r++) {
        double begin = now();
        hits = 0;
        for (int n = 0; n < COUNT; n++)
            hits += ebpo_triangle_intersects_box((const double(*)[3])triangles[n], box_min[n],
                                                 box_max[n]);
        best = fmin(best, (now() - begin) / COUNT);
    }
    printf("%-22s %8.1f ns  %5.1f %% hit\n", "box", best, 100.0 * (double)hits / COUNT);
}

int main(void)
{
    uint64_t state = 1;
    static const char *const names[] = {
        "at random",           "at the middle", "at a corner",   "at a corner, exactly",
        "at an edge, exactly", "from a corner", "from an edge",  "from the face",
        "to the face",         "to a corner",   "along an axis", "within the plane"
    };
    for (int a = AT_RANDOM; a <= WITHIN_THE_PLANE; a++)
        time_rays(names[a], (aim)a, &state);
    time_boxes(&state);
    return 0;
}
