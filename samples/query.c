/* Which points are inside, and how far away is the surface? Reads lines "x y z" and answers each.
 *
 *     query MODEL.ebpo.h5 <points.txt
 *     cc query.c $(pkg-config --cflags --libs ebpo) */
#include <ebpo/ebpo.h>
#include <inttypes.h>
#include <stdio.h>

static const char *const words[] = { "OUT", "IN", "ON", "MAYBE" };

static ebpo_status answer(ebpo_context *context, bool solid, const double point[3], ebpo_error *error)
{
    ebpo_inside_result where = { EBPO_MAYBE, 0, 0 }; /* a surface has no inside, but distances */
    ebpo_distance_result nearest;
    ebpo_status status = solid ? ebpo_inside(context, point, NULL, &where, error) : EBPO_OK;
    if (status == EBPO_OK)
        status = ebpo_distance(context, point, NULL, &nearest, error);
    if (status == EBPO_OK)
        printf("%s, %.17g from face %" PRIu64 " at %.17g %.17g %.17g\n", solid ? words[where.where] : "surface", nearest.distance, nearest.face,
               nearest.point[0], nearest.point[1], nearest.point[2]);
    return status;
}

int main(int argc, char **argv)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT; /* options.memory = 64 << 20 holds it to 64 MB */
    ebpo_file *file = NULL;
    ebpo_model *model = NULL;
    ebpo_context *context = NULL; /* one for each thread */
    double p[3];
    if (argc != 2) {
        fprintf(stderr, "usage: query MODEL.ebpo.h5 <points.txt\n");
        return 2;
    }
    ebpo_status status = ebpo_open(&file, argv[1], &error);
    if (status == EBPO_OK)
        status = ebpo_model_open(&model, file, &options, &error);
    if (status == EBPO_OK)
        status = ebpo_context_new(&context, model, &error);
    while (status == EBPO_OK && scanf("%lf %lf %lf", &p[0], &p[1], &p[2]) == 3)
        status = answer(context, ebpo_file_info(file)->solid, p, &error);
    if (status != EBPO_OK)
        fprintf(stderr, "query: %s\n", error.message);
    ebpo_context_free(context);
    ebpo_model_close(model);
    ebpo_close(file);
    return status != EBPO_OK;
}
