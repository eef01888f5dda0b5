/* Reads lines "x y z". Prints for each point whether it is inside, and its distance from the
 * surface.
 *
 *     query MODEL.ebpo.h5 <points.txt
 *     cc query.c $(pkg-config --cflags --libs ebpo) */
#include <ebpo/ebpo.h>
#include <inttypes.h>
#include <stdio.h>

static const char *const words[] = { "OUT", "IN", "ON", "MAYBE" };

static bool print_results(ebpo_context *context, const double point[3], ebpo_error *error)
{
    ebpo_inside_result where;
    ebpo_distance_result nearest;
    ebpo_status status = ebpo_inside(context, point, NULL, &where, error);
    /* a surface whose file has no border can only return distances */
    bool solid = status != EBPO_E_NOT_SOLID;
    if ((solid && status != EBPO_OK) ||
        ebpo_distance(context, point, NULL, &nearest, error) != EBPO_OK)
        return false;
    printf("%s, %.17g from face %" PRIu64 " at %.17g %.17g %.17g\n",
           solid ? words[where.where] : "surface", nearest.distance, nearest.face, nearest.point[0],
           nearest.point[1], nearest.point[2]);
    return true;
}

int main(int argc, char **argv)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    /* completely in memory; ebpo_model_options can limit the memory */
    ebpo_model *model = NULL;
    ebpo_context *context = NULL; /* each thread needs one */
    char line[1000];
    double p[3];
    if (argc != 2)
        return fputs("usage: query MODEL.ebpo.h5 <points.txt\n", stderr), 2;
    bool ok = ebpo_open(argv[1], &file, &error) == EBPO_OK &&
              ebpo_model_new(file, NULL, &model, &error) == EBPO_OK &&
              ebpo_context_new(model, &context, &error) == EBPO_OK;
    for (long number = 1; ok && fgets(line, sizeof line, stdin); number++) {
        int end = 0, count = sscanf(line, "%lf %lf %lf %n", &p[0], &p[1], &p[2], &end);
        if (count == EOF) /* an empty line */
            continue;
        ok = count == 3 && line[end] == 0;
        if (ok)
            ok = print_results(context, p, &error);
        else
            snprintf(error.message, sizeof error.message, "line %ld: expected three numbers",
                     number);
    }
    if (!ok)
        fprintf(stderr, "query: %s\n", error.message);
    ok = fflush(stdout) == 0 && !ferror(stdout) && ok; /* fflush detects a full disk */
    if (ferror(stdout))
        perror("query: standard output");
    ebpo_context_free(context);
    ebpo_model_free(model);
    ebpo_close(file);
    return !ok;
}
