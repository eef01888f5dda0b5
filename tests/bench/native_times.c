/* Times queries natively for web.mjs: native_times MODEL INPUTS ROUNDS. INPUTS: doubles: n, n points
 * [3], n rays [6]. Prints the least time of the rounds as JSON, in microseconds per item, on one
 * thread. */
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
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int main(int argc, char **argv)
{
    double count, least[3] = { INFINITY, INFINITY, INFINITY };
    ebpo_file *file;
    ebpo_model *model;
    ebpo_context *context;
    ebpo_ray_options ray_options = EBPO_RAY_OPTIONS_INIT;
    ebpo_distance_options distance_options = EBPO_DISTANCE_OPTIONS_INIT;
    require(argc == 4, "usage: native_times MODEL INPUTS ROUNDS");
    FILE *in = fopen(argv[2], "rb");
    require(in && fread(&count, sizeof count, 1, in) == 1, argv[2]);
    uint64_t n = (uint64_t)count;
    double *points = malloc(n * 3 * sizeof *points), *lines = malloc(n * 6 * sizeof *lines);
    ebpo_ray *rays = malloc(n * sizeof *rays);
    ebpo_ray_hit *hits = malloc(n * sizeof *hits);
    ebpo_distance_result *distances = malloc(n * sizeof *distances);
    ebpo_inside_result *insides = malloc(n * sizeof *insides);
    require(points && lines && rays && hits && distances && insides, "memory");
    require(fread(points, 24, n, in) == n && fread(lines, 48, n, in) == n, argv[2]);
    fclose(in);
    for (uint64_t i = 0; i < n; i++)
        for (uint64_t k = 0; k < 3; k++) {
            rays[i].origin[k] = lines[6 * i + k];
            rays[i].direction[k] = lines[6 * i + 3 + k];
            rays[i].t_max = INFINITY;
        }
    ray_options.threads = 1;
    distance_options.unsigned_distance = true;
    require(ebpo_open(argv[1], &file, &error) == EBPO_OK, argv[1]);
    require(ebpo_model_new(file, NULL, &model, &error) == EBPO_OK, argv[1]);
    require(ebpo_context_new(model, &context, &error) == EBPO_OK, argv[1]);
    for (int round = 0; round < atoi(argv[3]); round++) {
        double t[4] = { read_clock() };
        require(ebpo_ray_first_many(context, rays, n, &ray_options, hits, &error) == EBPO_OK, "rays");
        t[1] = read_clock();
        require(ebpo_distance_many(context, points, n, &distance_options, distances, &error) ==
                    EBPO_OK,
                "distances");
        t[2] = read_clock();
        require(ebpo_inside_many(context, points, n, NULL, insides, &error) == EBPO_OK, "points");
        t[3] = read_clock();
        for (int k = 0; k < 3; k++)
            least[k] = fmin(least[k], t[k + 1] - t[k]);
    }
    printf("{\"first hit\":%g,\"nearest\":%g,\"inside\":%g}\n", 1e6 * least[0] / count,
           1e6 * least[1] / count, 1e6 * least[2] / count);
    ebpo_context_free(context);
    ebpo_model_free(model);
    ebpo_close(file);
    free(points);
    free(lines);
    free(rays);
    free(hits);
    free(distances);
    free(insides);
    return 0;
}
