/* Measures the gain by kinds of leaves: bench_leaves FILE.ebpo.h5 [--points N] [--json]. Queries
 * uniform points of the model's box that are in leaves. Prints for each kind of leaf the
 * nanoseconds per point: with the planes of the kind, and with the same leaf treated as a general
 * leaf. Both values are the best of seven passes, which alternate in one run. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "query/query_model.h"

enum { KINDS = 5, LIMIT = 20000, PASSES = 7 };

static const char *const names[KINDS] = { "general", "one plane", "two planes", "convex set",
                                          "concave set" };

typedef struct bucket {
    double points[LIMIT][3];
    uint64_t count, seen;
    double ns, ns_as_general;
} bucket;

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double random_unit(uint64_t *state)
{
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (double)(*state >> 11) * 0x1p-53;
}

static void fail(const ebpo_error *error)
{
    fprintf(stderr, "bench_leaves: %s\n", error->message);
    exit(EXIT_FAILURE);
}

/* Prepares all leaves below a node, as many queries do. */
static void know_below(const ebpo_accel *s, const ebpo_node *node)
{
    for (int i = 0;
         i < EBPO_LEAF_KIND_QUERIES && ebpo_entry_kind_of(node->entry) == EBPO_ENTRY_LEAF; i++)
        (void)ebpo_leaf_query(s, &s->leaf[ebpo_entry_value(node->entry)], node->cell,
                              ebpo_inside_kernels_best()->cell_faces);
    for (unsigned octant = 0; octant < 8 && node->type == EBPO_GRAY && !node->pruned; octant++) {
        ebpo_node child = ebpo_accel_child(s, node, octant);
        know_below(s, &child);
    }
}

static void sort_points(const ebpo_model *m, uint64_t points, bucket *buckets)
{
    const ebpo_accel *s = m->whole;
    int fine = m->info->level_count - 1;
    uint64_t state = 1;
    for (uint64_t i = 0; i < points; i++) {
        double p[3];
        uint32_t at[3];
        for (int k = 0; k < 3; k++)
            p[k] = m->info->report.min[k] +
                   (m->info->report.max[k] - m->info->report.min[k]) * random_unit(&state);
        if (!ebpo_locate(&s->box, fine, p, at))
            continue;
        uint32_t entry = ebpo_descend(&s->nodes, fine, at).entry;
        if (ebpo_entry_kind_of(entry) != EBPO_ENTRY_LEAF)
            continue;
        bucket *b = &buckets[ebpo_leaf_kind_of(&s->leaf[ebpo_entry_value(entry)])];
        b->seen++;
        if (b->count < LIMIT)
            memcpy(b->points[b->count++], p, sizeof p);
    }
}

static double pass(ebpo_context *c, const bucket *b, ebpo_inside_result *out)
{
    ebpo_error error = EBPO_ERROR_INIT;
    double begin = now();
    for (uint64_t i = 0; i < b->count; i++)
        if (ebpo_inside(c, b->points[i], NULL, &out[i], &error) != EBPO_OK)
            fail(&error);
    return (now() - begin) / (double)b->count * 1e9;
}

static void measure(ebpo_context *c, bucket *b)
{
    static ebpo_inside_result with[LIMIT], without[LIMIT];
    ebpo_accel *s = c->model->whole;
    uint8_t *kinds = malloc(s->leaf_count);
    if (!kinds)
        exit(EXIT_FAILURE);
    b->ns = b->ns_as_general = 1e300;
    for (int i = 0; i < PASSES && b->count; i++) {
        double ns = pass(c, b, with);
        b->ns = ns < b->ns ? ns : b->ns;
        for (uint32_t k = 0; k < s->leaf_count; k++) {
            kinds[k] = s->leaf[k].kind;
            s->leaf[k].kind = EBPO_LEAF_GENERAL;
        }
        ns = pass(c, b, without);
        b->ns_as_general = ns < b->ns_as_general ? ns : b->ns_as_general;
        for (uint32_t k = 0; k < s->leaf_count; k++)
            s->leaf[k].kind = kinds[k];
        for (uint64_t k = 0; k < b->count; k++)
            if (with[k].where != without[k].where || with[k].winding != without[k].winding) {
                fprintf(stderr, "bench_leaves: results differ\n");
                exit(EXIT_FAILURE);
            }
    }
    free(kinds);
}

int main(int argc, char **argv)
{
    uint64_t points = 2000000;
    bool json = false;
    for (int i = 2; i < argc; i++)
        if (strcmp(argv[i], "--json") == 0)
            json = true;
        else if (strcmp(argv[i], "--points") == 0 && i + 1 < argc)
            points = strtoull(argv[++i], NULL, 10);
    if (argc < 2) {
        fprintf(stderr, "usage: bench_leaves FILE.ebpo.h5 [--points N] [--json]\n");
        return 2;
    }
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file;
    ebpo_model *model;
    ebpo_context *context;
    if (ebpo_open(argv[1], &file, &error) != EBPO_OK ||
        ebpo_model_new(file, NULL, &model, &error) != EBPO_OK ||
        ebpo_context_new(model, &context, &error) != EBPO_OK)
        fail(&error);
    bucket *buckets = calloc(KINDS, sizeof *buckets);
    if (!buckets)
        return EXIT_FAILURE;
    ebpo_node root = ebpo_accel_root(model->whole);
    know_below(model->whole, &root);
    sort_points(model, points, buckets);
    printf(json ? "[" : "%-12s %10s %10s %10s %14s\n", "kind", "leaves", "points", "ns",
           "ns as general");
    for (int k = 0; k < KINDS; k++) {
        bucket *b = &buckets[k];
        measure(context, b);
        if (!b->count)
            b->ns = b->ns_as_general = 0;
        printf(json ? "%s{\"kind\": \"%s\", \"leaves\": %" PRIu64 ", \"points\": %" PRIu64
                      ", \"ns\": %.1f, \"ns_as_general\": %.1f}"
                    : "%s%-12s %10" PRIu64 " %10" PRIu64 " %10.1f %14.1f\n",
               json && k ? ", " : "", names[k], atomic_load(&model->whole->kinds->of_kind[k]),
               b->seen, b->ns, b->ns_as_general);
    }
    if (json)
        printf(", {\"one_cell_face\": %" PRIu64 "}]\n",
               atomic_load(&model->whole->kinds->one_cell_face));
    free(buckets);
    ebpo_context_free(context);
    ebpo_model_free(model);
    ebpo_close(file);
    return 0;
}
