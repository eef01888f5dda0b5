/* Measures nanoseconds for each orient3d call, by kind of input. Not a test: prints a table. */
#include <stdio.h>
#include <time.h>

#include "exact_reference.h"
#include "geometry/predicates.h"

enum { SETS = 4096, ROUNDS = 50 };

typedef int orient3d_function(const double a[3], const double b[3], const double c[3],
                              const double d[3]);

static double p[SETS][12];

static double now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

static double ns_per_call(orient3d_function *orient3d, int rounds, int *zeros)
{
    static volatile int sink;
    *zeros = 0;
    for (int i = 0; i < SETS; i++)
        *zeros += orient3d(p[i], p[i] + 3, p[i] + 6, p[i] + 9) == 0;
    double start = now_ns();
    for (int round = 0; round < rounds; round++)
        for (int i = 0; i < SETS; i++)
            sink += orient3d(p[i], p[i] + 3, p[i] + 6, p[i] + 9);
    (void)sink; /* avoids the clang warning about a variable that is set and not used */
    return (now_ns() - start) / ((double)rounds * SETS);
}

static void report(const char *name)
{
    int zeros;
    double fast = ns_per_call(ebpo_orient3d, ROUNDS, &zeros);
    double exact = ns_per_call(ebpo_orient3d_exact, 1, &zeros);
    printf("%-42s %5.1f %% zero   orient3d %8.1f ns   integers only %8.1f ns\n", name,
           100.0 * zeros / SETS, fast, exact);
}

/* Fills single-precision points of a slanted plane, or of an axis-parallel plane. */
static void fill_plane(int slanted, uint64_t *state)
{
    for (int i = 0; i < SETS; i++)
        for (int k = 0; k < 4; k++) {
            double x = (double)reference_integer(state, -(1 << 23), 1 << 23) * 0x1p-24;
            double y = (double)reference_integer(state, -(1 << 23), 1 << 23) * 0x1p-24;
            p[i][3 * k] = x;
            p[i][3 * k + 1] = y;
            p[i][3 * k + 2] = slanted ? x * 0.5 + y * 2 + 1 : 0.75;
        }
}

int main(void)
{
    uint64_t state = 1;
    for (int kind = 0; kind < REFERENCE_KINDS; kind++) {
        for (int i = 0; i < SETS; i++)
            reference_points(p[i], 3, kind, &state);
        report(reference_kind_name(kind));
    }
    fill_plane(0, &state);
    report("coplanar, axis-parallel, single precision");
    fill_plane(1, &state);
    report("coplanar, slanted, single precision");
    return 0;
}
