/* Runs COUNT random queries of one kind on one thread, and prints a hash of the results:
 *
 *     query_counts MODEL.ebpo.h5 ray|distance|inside COUNT
 *
 * instructions.sh counts its instructions on ARM. The hash must be the same on every machine. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

static ebpo_error error = EBPO_ERROR_INIT;
static uint64_t random_state = 1, hash = UINT64_C(1469598103934665603);

static void require(bool ok, const char *what)
{
    if (ok)
        return;
    fprintf(stderr, "query_counts: %s: %s\n", what, error.message);
    exit(1);
}

static double random_unit(void)
{
    random_state = random_state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (double)(random_state >> 40) * 0x1p-24;
}

static void random_point(const ebpo_info *info, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = info->box_origin[k] + info->box_size[k] * random_unit();
}

static void add(const void *at, size_t bytes)
{
    for (size_t i = 0; i < bytes; i++)
        hash = (hash ^ ((const uint8_t *)at)[i]) * UINT64_C(1099511628211);
}

static void cast_ray(ebpo_context *context, const ebpo_info *info)
{
    ebpo_ray ray = { .t_max = INFINITY };
    ebpo_ray_hit hit;
    random_point(info, ray.origin);
    for (int k = 0; k < 3; k++)
        ray.direction[k] = random_unit() - 0.5;
    require(ebpo_ray_first_many(context, &ray, 1, NULL, &hit, &error) == EBPO_OK, "ray");
    add(&hit.face, sizeof hit.face);
    if (hit.face != EBPO_NO_FACE)
        add(&hit.t, sizeof hit.t);
}

static void measure_distance(ebpo_context *context, const ebpo_info *info)
{
    double point[3];
    ebpo_distance_result result;
    random_point(info, point);
    require(ebpo_distance_many(context, point, 1, NULL, &result, &error) == EBPO_OK, "distance");
    add(&result.distance, sizeof result.distance);
    add(&result.face, sizeof result.face);
}

static void locate(ebpo_context *context, const ebpo_info *info)
{
    double point[3];
    ebpo_inside_result result;
    random_point(info, point);
    require(ebpo_inside_many(context, point, 1, NULL, &result, &error) == EBPO_OK, "inside");
    add(&result.where, sizeof result.where);
}

int main(int argc, char **argv)
{
    ebpo_file *file;
    ebpo_model *model;
    ebpo_context *context;
    require(argc == 4, "usage: query_counts MODEL.ebpo.h5 ray|distance|inside COUNT");
    require(ebpo_open(argv[1], &file, &error) == EBPO_OK, argv[1]);
    require(ebpo_model_new(file, NULL, &model, &error) == EBPO_OK, argv[1]);
    require(ebpo_context_new(model, &context, &error) == EBPO_OK, argv[1]);
    void (*run)(ebpo_context *, const ebpo_info *) = strcmp(argv[2], "ray") == 0 ? cast_ray
                                                     : strcmp(argv[2], "distance") == 0
                                                         ? measure_distance
                                                         : locate;
    for (uint64_t left = strtoull(argv[3], NULL, 10); left; left--)
        run(context, ebpo_file_info(file));
    printf("%016" PRIx64 "\n", hash);
    ebpo_context_free(context);
    ebpo_model_free(model);
    ebpo_close(file);
    return 0;
}
