/* Prints docs/measured/stiff.md: what was measured of each stiff case, beside a tame model of as
 * many faces.
 *
 *     stiff_table [TEXT] > docs/measured/stiff.md        TEXT: only the cases whose name holds it
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "stiff.h"

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

/* A torus of about as many faces. */
static stiff_case tame_like(uint64_t faces)
{
    uint32_t m = 3;
    while ((uint64_t)4 * m * m < faces)
        m++;
    uint32_t n = (uint32_t)(faces / 2 / m);
    stiff_case c = { "tame", stiff_ring, .a = { 2, 0.7, n < 3 ? 3 : n, m } };
    return c;
}

static double build_seconds(const stiff_case *c)
{
    ebpo_mesh mesh = c->make(c);
    ebpo_tree tree;
    double begin = now();
    if (stiff_build(c, &mesh, &tree, NULL) != EBPO_OK)
        return NAN;
    double seconds = now() - begin;
    ebpo_tree_free(&tree);
    return seconds;
}

static double distance_seconds(const stiff_case *c)
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

/* The two take turns. */
static double build_ratio(const stiff_case *c, const stiff_case *tame)
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

static void put(const char *format, double x)
{
    if (isnan(x))
        printf(" |");
    else
        printf(format, x);
}

static void row(const stiff_case *c, bool *fine)
{
    stiff_result r;
    fprintf(stderr, "%s\n", c->name);
    ebpo_mesh mesh = c->make(c);
    uint64_t faces = mesh.face_count;
    ebpo_mesh_free(&mesh);
    stiff_run(c, faces < 500 ? 1000 : faces < 15000 ? 200 : faces < 150000 ? 40 : 10, &r);
    *fine &= r.fault[0] == 0;
    if (r.fault[0])
        fprintf(stderr, "not stable: %s\n", r.fault);
    printf("| %s | %llu |", c->name, (unsigned long long)r.faces);
    if (r.status != EBPO_OK) {
        printf(" | %s `%s` | | | | | | | | | |\n",
               r.fault[0] ? "**fails**" : "refused:", r.message);
        return;
    }
    stiff_case tame = tame_like(faces);
    printf(" %d | %s | %llu | %llu | %llu |", r.levels,
           r.fault[0]   ? "**not stable**"
           : c->surface ? "surface"
                        : "solid",
           (unsigned long long)r.violations, (unsigned long long)r.asked,
           (unsigned long long)r.wrong);
    put(" %.1g |", r.has_volume ? r.volume_error : NAN);
    put(" %.3g |", r.has_volume ? 100 * r.excess : NAN);
    put(" %.1g |", r.has_volume && r.levels > 1 ? r.rise : NAN);
    put(" %.2g |", build_ratio(c, &tame));
    put(" %.2g |", distance_seconds(c) / distance_seconds(&tame));
    printf(" %.0f |\n", r.bytes_per_face);
    fflush(stdout);
}

static const char introduction[] =
    "# Stiff and extreme cases\n\n"
    "Made by `ninja -C build tests/bench/stiff_table && build/tests/bench/stiff_table > "
    "docs/measured/stiff.md`; "
    "nothing here was typed in. The cases are one line each in `tests/support/stiff_cases.c`; "
    "`meson "
    "test "
    "stiff` holds\n"
    "every one to its limits. A new case is a new line there.\n\n"
    "*Stable* means, for each case: it converts; `ebpo verify` (with the source to compare with) "
    "finds 0 violations; 0 answers are wrong; or converting fails with the status and the message "
    "that the line names.\n"
    "Asked are inside, signed distance with nearest face, nearest point and normal, and rays; the "
    "points lie on vertices, edges, faces and cell walls, next to them, between them and far away; "
    "the judge is brute force in rational\n"
    "arithmetic (`tests/support/oracle.h`). Besides:\n\n"
    "- *volume error*: of `ebpo measure` against the exact volume of the mesh, relative; at most "
    "1e-15 where a line does not say otherwise. Empty where there is no volume, or none that is a "
    "normal double. Where a formula gives the volume, the mesh must have\n"
    "  it up to the rounding of its coordinates.\n"
    "- *excess*: of the last level's envelopes over the solid, in percent of it; every level's "
    "volume is at least the solid's (up to 1e-9). Empty where shells overlap and the solid's "
    "volume is not known.\n"
    "- *rise*: the greatest of V(level + 1) / V(level) - 1; levels lie in one another, so it is at "
    "most 0 but for rounding (1e-9).\n"
    "- *build* and *distance*: time for it over that of a torus of about as many faces, medians of "
    "up to 5 runs on one thread. They are printed only: conditioning may cost time, never "
    "answers.\n"
    "- *bytes*: of the file for each face; files of few faces are mostly headers.\n\n"
    "| case | faces | levels | outcome | violations | asked | wrong | volume error | excess % | "
    "rise | build | distance | bytes |\n"
    "|---|---|---|---|---|---|---|---|---|---|---|---|---|\n";

int main(int argc, char **argv)
{
    bool fine = true;
    fputs(introduction, stdout);
    for (int i = 0; i < stiff_case_count; i++)
        if (argc < 2 || strstr(stiff_cases[i].name, argv[1]))
            row(&stiff_cases[i], &fine);
    return fine ? 0 : 1;
}
