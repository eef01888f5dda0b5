/* Prints the memory of a whole model by kind as JSON, before any query: memory_kinds FILE.ebpo.h5
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "query/query_model.h"

static uint64_t reported;

static void report(const char *kind, uint64_t bytes)
{
    printf("%s\"%s\": %" PRIu64, reported ? ", " : "{", kind, bytes);
    reported += bytes;
}

static void fail(const ebpo_error *error)
{
    fprintf(stderr, "memory_kinds: %s\n", error->message);
    exit(EXIT_FAILURE);
}

int main(int argc, char **argv)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    ebpo_model *model = NULL;
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    if (argc != 2) {
        fprintf(stderr, "usage: memory_kinds FILE.ebpo.h5\n");
        return 2;
    }
    if (ebpo_open(argv[1], &file, &error) != EBPO_OK ||
        ebpo_model_new(file, NULL, &model, &error) != EBPO_OK ||
        ebpo_model_get_stats(model, &stats) != EBPO_OK)
        fail(&error);
    const ebpo_accel *s = model->whole;
    report("faces", s->units * EBPO_MESHLET_UNIT);
    report("boxes", s->bound_count * sizeof *s->bound);
    report("cylinders", s->bound_count * sizeof *s->cylinder);
    report("leaves", s->leaf_count * sizeof *s->leaf);
    report("leaves' blocks", s->list_count * sizeof *s->list);
    report("numbers in the source", s->face_source ? s->face_count * sizeof *s->face_source : 0);
    report("nodes and the rest", stats.memory - reported);
    printf("}\n");
    ebpo_model_free(model);
    ebpo_close(file);
    return 0;
}
