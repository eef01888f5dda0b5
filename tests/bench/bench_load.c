/* Measures the cost of loading by stage: bench_load FILE.ebpo.h5 [--memory BYTES] [--count N]
 * [--faces | --planes] [--scattered] [--whole]. Without --whole it loads N subtrees below the cut
 * level, as queries under a budget do: one after another from the middle of the file, or with
 * --scattered in an order without neighbours. Prints how many chunks a load decodes. With --whole
 * it loads the whole model N times, on one thread. Prints the CPU time of this thread. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "query/query_model.h"

typedef struct stages {
    double read, make, release;
    uint64_t faces, bytes;
} stages;

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void check(ebpo_status status, const ebpo_error *error)
{
    if (status == EBPO_OK)
        return;
    fprintf(stderr, "bench_load: %s\n", error->message);
    exit(EXIT_FAILURE);
}

static void make_and_free(stages *t, ebpo_slice *slice, const ebpo_info *info,
                          ebpo_accel_content content)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_accel *s;
    double begin = now();
    t->faces += slice->mesh.face_count;
    check(ebpo_accel_make(&s, slice, info, content, 1, &error), &error);
    double made = now();
    t->bytes += s->bytes;
    ebpo_accel_free(s);
    t->make += made - begin;
    t->release += now() - made;
}

static void load_below(stages *t, ebpo_model *m, uint64_t count, ebpo_accel_content content,
                       bool scattered)
{
    enum { FAR = 10007 }; /* a prime, so that every subtree has its turn */
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_cache_stats before, after;
    uint64_t first = m->top->below_count > count ? (m->top->below_count - count) / 2 : 0;
    ebpo_chunks_get_stats(m->chunks, &before);
    for (uint64_t i = 0; i < count; i++) {
        ebpo_slice slice;
        double begin = now();
        check(ebpo_slice_read_parts(
                  &slice, m->chunks,
                  &m->top->below[(first + i * (scattered ? FAR : 1)) % m->top->below_count],
                  ebpo_subtree_needs(content), &error),
              &error);
        t->read += now() - begin;
        make_and_free(t, &slice, m->info, content);
    }
    ebpo_chunks_get_stats(m->chunks, &after);
    printf("%.1f chunks decoded in a load, %.1f found\n",
           (double)(after.loads - before.loads) / (double)count,
           (double)(after.hits - before.hits) / (double)count);
}

static void load_whole(stages *t, const ebpo_file *file, uint64_t count, ebpo_accel_content content)
{
    ebpo_error error = EBPO_ERROR_INIT;
    for (uint64_t i = 0; i < count; i++) {
        ebpo_slice slice;
        double begin = now();
        check(ebpo_slice_read_all(&slice, file, 1, &error), &error);
        t->read += now() - begin;
        make_and_free(t, &slice, ebpo_file_info(file), content);
    }
}

int main(int argc, char **argv)
{
    uint64_t count = 0, memory = UINT64_C(256) << 20;
    ebpo_accel_content content = EBPO_ACCEL_NODES;
    bool whole = false, scattered = false;
    for (int i = 2; i < argc; i++)
        if (strcmp(argv[i], "--planes") == 0)
            content = EBPO_ACCEL_PLANES;
        else if (strcmp(argv[i], "--faces") == 0)
            content = EBPO_ACCEL_FACES;
        else if (strcmp(argv[i], "--scattered") == 0)
            scattered = true;
        else if (strcmp(argv[i], "--whole") == 0)
            whole = true;
        else if (strcmp(argv[i], "--memory") == 0 && i + 1 < argc)
            memory = strtoull(argv[++i], NULL, 10);
        else if (strcmp(argv[i], "--count") == 0 && i + 1 < argc)
            count = strtoull(argv[++i], NULL, 10);
    if (argc < 2) {
        fprintf(stderr, "usage: bench_load FILE.ebpo.h5 [--memory BYTES] [--count N] "
                        "[--faces | --planes] [--scattered] [--whole]\n");
        return 2;
    }
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file;
    stages t = { 0 };
    check(ebpo_open(argv[1], &file, &error), &error);
    count = count ? count : whole ? 1 : 1000;
    if (whole) {
        load_whole(&t, file, count, EBPO_ACCEL_PLANES);
    } else {
        ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
        ebpo_model *m;
        options.memory = memory;
        check(ebpo_model_new(file, &options, &m, &error), &error);
        if (!m->top) {
            fprintf(stderr, "bench_load: the model fits into the memory; use --whole or a "
                            "smaller --memory\n");
            return EXIT_FAILURE;
        }
        load_below(&t, m, count, content, scattered);
        ebpo_model_free(m);
    }
    ebpo_close(file);
    double all = t.read + t.make + t.release, n = (double)count;
    printf("%" PRIu64 " loads: %.1f us each (read %.1f, make %.1f, free %.1f); %.0f faces, %.0f "
           "bytes; %.1f ns a face\n",
           count, all / n * 1e6, t.read / n * 1e6, t.make / n * 1e6, t.release / n * 1e6,
           (double)t.faces / n, (double)t.bytes / n, all / (double)t.faces * 1e9);
    return 0;
}
