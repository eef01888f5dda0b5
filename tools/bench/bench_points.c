#include "bench/bench_points.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/answers.h"
#include "bench/bench_walk.h"
#include "cli/command.h"

enum { USUAL_COUNT = 100000 };

static int make_room(bench_points *out, uint64_t count)
{
    uint64_t bytes;
    if (__builtin_mul_overflow(count, sizeof(double) * (unsigned)points_width(out->kind), &bytes))
        return command_no_memory("bench");
    double *rows = realloc(out->rows, bytes ? bytes : 1);
    if (!rows)
        return command_no_memory("bench");
    out->rows = rows;
    return EXIT_FINE;
}

/* Of any length but about 1, uniform over the sphere: by rejection, which takes no functions that
 * differ between systems. */
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

static void fill_uniform(bench_points *out, const ebpo_info *info, uint64_t seed)
{
    const double *low = info->report.min, *high = info->report.max;
    int width = points_width(out->kind);
    for (uint64_t i = 0; i < out->count; i++) {
        double *row = out->rows + i * (uint64_t)width;
        for (int k = 0; k < 3; k++)
            row[k] = low[k] + bench_random_unit(&seed) * (high[k] - low[k]);
        if (out->kind == POINTS_RAYS) {
            random_direction(&seed, row + 3);
            row[6] = INFINITY;
        }
    }
}

static int fill_path(bench_points *out, ebpo_file *file, uint64_t seed)
{
    const ebpo_mesh_report *report = &ebpo_file_info(file)->report;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh mesh = { 0 };
    double square = 0;
    if (ebpo_file_read_mesh(file, NULL, &mesh, &error) != EBPO_OK)
        return command_failed("bench", &error);
    for (int k = 0; k < 3; k++)
        square += (report->max[k] - report->min[k]) * (report->max[k] - report->min[k]);
    bool good = bench_walk(&mesh, report->mean_edge, sqrt(square), seed, out->count, out->rows);
    ebpo_mesh_free(&mesh);
    return good ? EXIT_FINE : command_no_memory("bench");
}

static int generate(bench_points *out, const char *model, const remote_values *remote, bool path,
                    uint64_t seed)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    int code = make_room(out, out->count);
    if (code == EXIT_FINE && remote_open(&file, model, remote, &error) != EBPO_OK)
        code = command_failed("bench", &error);
    if (code == EXIT_FINE && path)
        code = fill_path(out, file, seed);
    else if (code == EXIT_FINE)
        fill_uniform(out, ebpo_file_info(file), seed);
    ebpo_close(file);
    return code;
}

static int read_all(bench_points *out, points *in, uint64_t most)
{
    uint64_t capacity = 0, got = 1;
    while (got && out->count < most) {
        if (capacity < out->count + POINTS_BATCH) {
            capacity = 2 * capacity + POINTS_BATCH;
            if (make_room(out, capacity) != EXIT_FINE)
                return EXIT_FAILED;
        }
        got = points_next(in, out->rows + out->count * (uint64_t)points_width(out->kind));
        out->count += got;
    }
    if (in->failed)
        return EXIT_FAILED;
    if (out->count > most)
        out->count = most;
    if (out->count == 0)
        fprintf(stderr, "ebpo bench: %s: holds no points\n", in->name);
    return out->count ? EXIT_FINE : EXIT_FAILED;
}

int bench_points_make(bench_points *out, points_kind kind, const char *model,
                      const remote_values *remote, const char *what, bool raw, uint64_t count,
                      uint64_t seed)
{
    bool path = strcmp(what, "path") == 0;
    *out = (bench_points){ .kind = kind, .count = count ? count : USUAL_COUNT };
    if (path && kind == POINTS_RAYS)
        return command_usage("bench",
                             "a path has points; for rays give --points uniform or a file");
    if (path || strcmp(what, "uniform") == 0)
        return generate(out, model, remote, path, seed);
    points in;
    out->count = 0;
    int code = EXIT_FAILED;
    if (points_open(&in, "bench", what, kind, raw, INFINITY))
        code = read_all(out, &in, count ? count : UINT64_MAX);
    points_close(&in);
    return code;
}

void bench_points_free(bench_points *p)
{
    free(p->rows);
    *p = (bench_points){ .rows = NULL };
}

int bench_points_save(const bench_points *p, const char *path)
{
    FILE *f = fopen(path, "wb");
    bool good = f != NULL;
    int width = points_width(p->kind), kept = points_raw_width(p->kind);
    for (uint64_t i = 0; i < p->count && good; i++)
        for (int k = 0; k < kept; k++)
            raw_double(f, p->rows[i * (uint64_t)width + (unsigned)k]);
    good = good && !ferror(f);
    if (f && fclose(f) != 0)
        good = false;
    if (!good)
        fprintf(stderr, "ebpo bench: %s: cannot be written: %s\n", path, strerror(errno));
    return good ? EXIT_FINE : EXIT_FAILED;
}
