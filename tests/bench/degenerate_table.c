/* Prints docs/measured/degenerate.md: the results of each degenerate or ill-conditioned case,
 * compared with a well-conditioned model of about as many faces.
 *
 *     degenerate_table [TEXT] > docs/measured/degenerate.md
 *
 * TEXT: only the cases whose name contains it.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "degenerate.h"

enum { RUNS = 5, POINTS = 200 };

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *x, int count)
{
    qsort(x, (size_t)count, sizeof *x, ascending);
    return x[count / 2];
}

/* Returns a torus of about this many faces. */
static degenerate_case tame_like(uint64_t faces)
{
    uint32_t m = 3;
    while ((uint64_t)4 * m * m < faces)
        m++;
    uint32_t n = (uint32_t)(faces / 2 / m);
    degenerate_case c = { "tame", degenerate_ring, .a = { 2, 0.7, n < 3 ? 3 : n, m } };
    return c;
}

static double build_seconds(const degenerate_case *c)
{
    ebpo_mesh mesh = c->make(c);
    ebpo_tree tree;
    double begin = now();
    if (degenerate_build(c, &mesh, &tree, NULL) != EBPO_OK)
        return NAN;
    double seconds = now() - begin;
    ebpo_tree_free(&tree);
    return seconds;
}

static double distance_seconds(const degenerate_case *c)
{
    query_model m;
    query_variant v = { "table", c->leaf ? c->leaf : 16, c->levels ? c->levels - 1 : -1, c->rule,
                        0 };
    ebpo_error error;
    double points[POINTS][3], seconds[RUNS];
    ebpo_distance_result out[POINTS];
    if (query_model_try(&m, c->name, c->make(c), &v, &error) != EBPO_OK)
        return NAN;
    query_make_points(&m, POINTS, 1, points[0]);
    int run = 0;
    for (double all = 0; run < RUNS && (run < 1 || all < 10); run++) {
        double begin = now();
        if (ebpo_distance_many(m.context, points[0], POINTS, NULL, out, &error) != EBPO_OK)
            return NAN;
        all += seconds[run] = now() - begin;
    }
    query_model_free(&m);
    return median(seconds, run);
}

/* Returns the ratio of the build times; the two builds alternate. */
static double build_ratio(const degenerate_case *c, const degenerate_case *tame)
{
    double ours[RUNS], theirs[RUNS];
    int run = 0;
    for (double all = 0; run < RUNS && (run < 3 || all < 5); run++) {
        ours[run] = build_seconds(c);
        theirs[run] = build_seconds(tame);
        all += ours[run] + theirs[run];
    }
    return median(ours, run) / median(theirs, run);
}

typedef struct totals {
    int cases, refused, unstable;
    uint64_t violations, wrong;
} totals;

static void put(FILE *out, const char *format, double x)
{
    if (isnan(x))
        fputs(" |", out);
    else
        fprintf(out, format, x);
}

static void row(const degenerate_case *c, FILE *out, totals *sum)
{
    degenerate_result r;
    fprintf(stderr, "%s\n", c->name);
    ebpo_mesh mesh = c->make(c);
    uint64_t faces = mesh.face_count;
    ebpo_mesh_free(&mesh);
    degenerate_run(c, faces < 500 ? 1000 : faces < 15000 ? 200 : faces < 150000 ? 40 : 10, &r);
    sum->cases++;
    sum->refused += r.status != EBPO_OK;
    sum->unstable += r.fault[0] != 0;
    sum->violations += r.violations;
    sum->wrong += r.wrong;
    if (r.fault[0])
        fprintf(stderr, "not stable: %s\n", r.fault);
    fprintf(out, "| %s |", c->name);
    if (r.status != EBPO_OK) {
        fprintf(out, " %s `%s` | | | |\n", r.fault[0] ? "**fails**" : "refused:", r.message);
        return;
    }
    degenerate_case tame = tame_like(faces);
    fputs(r.fault[0] ? " **not stable**" : c->surface ? " surface" : "", out);
    if (r.has_volume && r.volume_error != 0)
        fprintf(out, " volume error %.1g", r.volume_error);
    fputs(" |", out);
    put(out, " %.3g |", r.has_volume ? 100 * r.excess : NAN);
    put(out, " %.2g |", build_ratio(c, &tame));
    put(out, " %.2g |", distance_seconds(c) / distance_seconds(&tame));
    fputc('\n', out);
}

static const char introduction[] =
    "## Measurement\n"
    "\n"
    "Made by `ninja -C build tests/bench/degenerate_table && build/tests/bench/degenerate_table >\n"
    "docs/measured/degenerate.md`. Each case is one line of `tests/support/degenerate_cases.c` "
    "(test suite `degenerate`).\n"
    "\n"
    "A case is stable when it converts, `ebpo verify` finds 0 violations and 0 query results are "
    "wrong, or when it is\n"
    "refused with the expected status and message. The queries are inside, signed distance with "
    "the nearest face,\n"
    "point and normal, and rays. Their points are on vertices, edges, faces and cell faces, near "
    "these, and far away. A\n"
    "case has 23 to 2,251 queries, the more the fewer faces it has. Rational arithmetic over all "
    "faces\n"
    "(`tests/support/oracle.h`) gives the correct results.\n"
    "\n"
    "- *outcome*: a solid, unless the column says otherwise.\n"
    "- *volume error*: relative error of `ebpo measure` where the exact volume is a normal double "
    "and the error is\n"
    "  not 0; at most 1e-15 unless the case allows more.\n"
    "- *excess %*: excess volume of the last level's envelopes, in percent of the solid. Empty "
    "where shells overlap.\n"
    "- *build*, *distance*: time divided by that of a torus of about as many faces, median of up "
    "to 5 runs on one\n"
    "  thread.\n"
    "\n"
    "| case | outcome | excess % | build | distance |\n"
    "|---|---|---|---|---|\n";

int main(int argc, char **argv)
{
    char *rows = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&rows, &size);
    if (out == NULL)
        return 1;
    totals sum = { 0 };
    for (int i = 0; i < degenerate_case_count; i++)
        if (argc < 2 || strstr(degenerate_cases[i].name, argv[1]))
            row(&degenerate_cases[i], out, &sum);
    fclose(out);
    printf("# Degenerate and ill-conditioned inputs\n\n"
           "- %d of %d cases are stable: denormal and huge coordinates, slivers, overlapping "
           "shells, non-manifold edges.\n"
           "- `ebpo verify` finds %llu violations; exact arithmetic contradicts %llu query "
           "results.\n"
           "- %d cases are refused with a message. Ill-conditioned inputs cost time.\n\n",
           sum.cases - sum.unstable, sum.cases, (unsigned long long)sum.violations,
           (unsigned long long)sum.wrong, sum.refused);
    fputs(introduction, stdout);
    fputs(rows, stdout);
    free(rows);
    return sum.unstable ? 1 : 0;
}
