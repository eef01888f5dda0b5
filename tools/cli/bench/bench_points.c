#include "cli/bench/bench_points.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/results.h"
#include "cli/bench/bench_rays.h"
#include "cli/bench/bench_walk.h"
#include "cli/command.h"

enum { DEFAULT_COUNT = 100000 };

/* Words that select a generator of query rows. */
typedef enum generator { UNIFORM, PATH, CAMERA, SEGMENTS, DEGENERATE, NO_GENERATOR } generator;
static const char *const generators[] = { "uniform", "path", "camera", "segments", "degenerate" };

/* Allocates memory for `count` rows. Returns an exit code. */
static int reserve_space(bench_points *out, uint64_t count)
{
    uint64_t bytes;
    if (__builtin_mul_overflow(count, sizeof(double) * (unsigned)points_width(out->kind), &bytes))
        return command_no_memory("bench");
    double *rows = realloc(out->rows, bytes ? bytes : 1);
    if (!rows)
        return command_no_memory("bench");
    out->rows = rows;
    return EXIT_OK;
}

static void fill_uniform(bench_points *out, const bench_scene *scene, uint64_t seed)
{
    for (uint64_t i = 0; i < 3 * out->count; i++) {
        uint64_t k = i % 3;
        out->rows[i] = scene->low[k] + bench_random_unit(&seed) * (scene->high[k] - scene->low[k]);
    }
}

/* Generates points from the mesh: a path, or degenerate rays. */
static int fill_from_mesh(bench_points *out, ebpo_file *file, const bench_scene *scene,
                          uint64_t seed)
{
    const ebpo_mesh_report *report = &ebpo_file_info(file)->report;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh mesh = { 0 };
    double square = 0;
    if (out->kind != POINTS_RAYS && !(report->area > 0)) {
        fputs("ebpo bench: no face of the model has an area, so there is no path on it; give "
              "--points uniform\n",
              stderr);
        return EXIT_FAILED;
    }
    if (ebpo_file_read_mesh(file, NULL, &mesh, &error) != EBPO_OK)
        return command_failed("bench", &error);
    for (int k = 0; k < 3; k++)
        square += (report->max[k] - report->min[k]) * (report->max[k] - report->min[k]);
    bool made = true;
    if (out->kind == POINTS_RAYS)
        bench_rays_degenerate(scene, &mesh, seed, out->count, out->rows);
    else
        made = bench_walk(&mesh, report->mean_edge, sqrt(square), seed, out->count, out->rows);
    ebpo_mesh_free(&mesh);
    return made ? EXIT_OK : command_no_memory("bench");
}

static int fill_rows(bench_points *out, ebpo_file *file, generator what, uint64_t seed)
{
    const ebpo_mesh_report *report = &ebpo_file_info(file)->report;
    bench_scene scene;
    memcpy(scene.low, report->min, sizeof scene.low);
    memcpy(scene.high, report->max, sizeof scene.high);
    switch (what) {
    case PATH:
    case DEGENERATE: return fill_from_mesh(out, file, &scene, seed);
    case CAMERA: bench_rays_camera(&scene, seed, out->count, out->rows); break;
    case SEGMENTS: bench_rays_segments(&scene, seed, out->count, out->rows); break;
    default:
        if (out->kind == POINTS_RAYS)
            bench_rays_uniform(&scene, seed, out->count, out->rows);
        else
            fill_uniform(out, &scene, seed);
    }
    return EXIT_OK;
}

static int generate_rows(bench_points *out, const char *model, const remote_values *remote,
                         generator what, uint64_t seed, double tmax)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    int code = reserve_space(out, out->count);
    if (code == EXIT_OK && remote_open(&file, model, remote, &error) != EBPO_OK)
        code = command_failed("bench", &error);
    if (code == EXIT_OK)
        code = fill_rows(out, file, what, seed);
    if (code == EXIT_OK && out->kind == POINTS_RAYS)
        for (uint64_t i = 0; i < out->count; i++)
            out->rows[7 * i + 6] = fmin(out->rows[7 * i + 6], tmax);
    ebpo_close(file);
    return code;
}

/* Reads the rows of the input, but at most `most` rows. Returns an exit code. */
static int read_all(bench_points *out, points *in, uint64_t most)
{
    uint64_t capacity = 0, row_count = 1;
    while (row_count && out->count < most) {
        if (capacity < out->count + POINTS_BATCH) {
            capacity = 2 * capacity + POINTS_BATCH;
            if (reserve_space(out, capacity) != EXIT_OK)
                return EXIT_FAILED;
        }
        row_count = points_next(in, out->rows + out->count * (uint64_t)points_width(out->kind));
        out->count += row_count;
    }
    if (in->failed)
        return EXIT_FAILED;
    if (out->count > most)
        out->count = most;
    if (out->count == 0)
        fprintf(stderr, "ebpo bench: %s: has no points\n", in->name);
    return out->count ? EXIT_OK : EXIT_FAILED;
}

static generator generator_of(const char *what)
{
    int i = 0;
    while (i < NO_GENERATOR && strcmp(what, generators[i]) != 0)
        i++;
    return (generator)i;
}

bool bench_points_generated(const char *what) { return generator_of(what) != NO_GENERATOR; }

int bench_points_make(bench_points *out, points_kind kind, const char *model,
                      const remote_values *remote, const char *what, bool raw, uint64_t count,
                      uint64_t seed, double tmax)
{
    generator by = generator_of(what);
    *out = (bench_points){ .kind = kind, .count = count ? count : DEFAULT_COUNT };
    if (by == PATH && kind == POINTS_RAYS)
        return command_usage(
            "bench", "--points path makes points; for rays, give --points uniform or a file");
    if (by > PATH && by < NO_GENERATOR && kind != POINTS_RAYS)
        return command_usage("bench", "--points %s makes rays; add --query ray", what);
    if (by != NO_GENERATOR)
        return generate_rows(out, model, remote, by, seed, tmax);
    points in;
    out->count = 0;
    int code = EXIT_FAILED;
    bool opened = points_open(&in, "bench", what, kind, raw, tmax);
    in.no_header = true;
    if (opened)
        code = read_all(out, &in, count ? count : UINT64_MAX);
    points_close(&in);
    return code;
}

void bench_points_free(bench_points *p)
{
    free(p->rows);
    *p = (bench_points){ .rows = NULL };
}

int bench_save(FILE *stream, char *const *data, const size_t *size, const char *path)
{
    ebpo_error error = EBPO_ERROR_INIT;
    bool complete = stream && !ferror(stream);
    if (stream && fclose(stream) != 0)
        complete = false;
    int code = !complete ? command_no_memory("bench")
               : ebpo_write_file(path, *data, *size, &error) == EBPO_OK
                   ? EXIT_OK
                   : command_failed("bench", &error);
    free(*data);
    return code;
}

int bench_points_save(const bench_points *p, const char *path)
{
    char *data = NULL;
    size_t size = 0;
    FILE *f = open_memstream(&data, &size);
    int width = points_width(p->kind), written_width = points_raw_width(p->kind);
    for (uint64_t i = 0; f && i < p->count; i++)
        for (int k = 0; k < written_width; k++)
            raw_double(f, p->rows[i * (uint64_t)width + (unsigned)k]);
    return bench_save(f, &data, &size, path);
}
