/* Times queries natively for web.mjs: native_times MODEL INPUTS. INPUTS: doubles: a count n, the
 * number of rounds, and for each round n points [3] and n rays [6]. Prints the medians of the
 * rounds without the first one as JSON, in microseconds of processor time per item. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include <ebpo/ebpo.h>

static ebpo_error error = EBPO_ERROR_INIT;

static void require(bool ok, const char *what)
{
    if (ok)
        return;
    fprintf(stderr, "native_times: %s: %s\n", what, error.message);
    exit(1);
}

static double read_clock(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

typedef struct inputs {
    uint64_t n;
    FILE *file;
    double *points, *lines;
    ebpo_ray *rays;
} inputs;

static void *allocate(uint64_t count, size_t size)
{
    void *out = calloc(count, size);
    require(out != NULL, "memory");
    return out;
}

static void read_round(inputs *in)
{
    require(fread(in->points, 24, in->n, in->file) == in->n &&
                fread(in->lines, 48, in->n, in->file) == in->n,
            "inputs");
    for (uint64_t i = 0; i < in->n; i++)
        for (uint64_t k = 0; k < 3; k++) {
            in->rays[i].origin[k] = in->lines[6 * i + k];
            in->rays[i].direction[k] = in->lines[6 * i + 3 + k];
            in->rays[i].t_max = INFINITY;
        }
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

enum { MAX_ROUNDS = 100 };
static double times[3][MAX_ROUNDS];

static void time_rounds(ebpo_context *context, inputs *in, int rounds)
{
    ebpo_ray_options rays = EBPO_RAY_OPTIONS_INIT;
    ebpo_distance_options distances = EBPO_DISTANCE_OPTIONS_INIT;
    ebpo_ray_hit *hits = allocate(in->n, sizeof *hits);
    ebpo_distance_result *near = allocate(in->n, sizeof *near);
    ebpo_inside_result *where = allocate(in->n, sizeof *where);
    rays.threads = 1;
    distances.unsigned_distance = true;
    for (int round = 0; round < rounds; round++) {
        read_round(in);
        double t[4] = { read_clock() };
        require(ebpo_ray_first_many(context, in->rays, in->n, &rays, hits, &error) == EBPO_OK,
                "rays");
        t[1] = read_clock();
        require(ebpo_distance_many(context, in->points, in->n, &distances, near, &error) == EBPO_OK,
                "distances");
        t[2] = read_clock();
        require(ebpo_inside_many(context, in->points, in->n, NULL, where, &error) == EBPO_OK,
                "points");
        t[3] = read_clock();
        for (int k = 0; k < 3; k++)
            times[k][round] = 1e6 * (t[k + 1] - t[k]) / (double)in->n;
    }
    for (int k = 0; k < 3; k++)
        qsort(times[k] + 1, (size_t)rounds - 1, sizeof times[k][0], compare_doubles);
    free(hits);
    free(near);
    free(where);
}

int main(int argc, char **argv)
{
    double head[2];
    ebpo_file *file;
    ebpo_model *model;
    ebpo_context *context;
    require(argc == 3, "usage: native_times MODEL INPUTS");
    inputs in = { .file = fopen(argv[2], "rb") };
    require(in.file && fread(head, sizeof head, 1, in.file) == 1 && head[1] >= 2 &&
                head[1] <= MAX_ROUNDS,
            argv[2]);
    in.n = (uint64_t)head[0];
    in.points = allocate(in.n, 24);
    in.lines = allocate(in.n, 48);
    in.rays = allocate(in.n, sizeof *in.rays);
    require(ebpo_open(argv[1], &file, &error) == EBPO_OK, argv[1]);
    require(ebpo_model_new(file, NULL, &model, &error) == EBPO_OK, argv[1]);
    require(ebpo_context_new(model, &context, &error) == EBPO_OK, argv[1]);
    int rounds = (int)head[1], middle = (rounds - 1) / 2;
    time_rounds(context, &in, rounds);
    printf("{\"first hit\":%g,\"nearest\":%g,\"inside\":%g}\n", times[0][1 + middle],
           times[1][1 + middle], times[2][1 + middle]);
    ebpo_context_free(context);
    ebpo_model_free(model);
    ebpo_close(file);
    fclose(in.file);
    free(in.points);
    free(in.lines);
    free(in.rays);
    return 0;
}
