/* ebpo bench: measures query times, single and in batches, warm and after a cold start. */
#include <errno.h>
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/bench/bench_points.h"
#include "cli/bench/bench_run.h"
#include "cli/results.h"
#include "cli/model_stats.h"
#include "cli/command.h"
#include "cli/query_args.h"
#include "cli/words.h"
#include "cli/commands/commands.h"

typedef struct values {
    query_values q; /* must be the first member: shared options have offsets within it */
    int query;
    const char *points, *mode, *save_points, *save_results;
    int64_t count, seed, repeat;
    double rate;
} values;

static const char *const query_words[] = {
    "inside", "distance", "ray", "ray-any", "ray-all", NULL
};
enum { REPEAT_MAX = 99 };
/* Kinds of results of a distance or ray query. RESULT_NONE: there is no face within the maximum
 * distance, or no hit. RESULT_INTERVAL: the maximum level or the deadline allowed only an interval.
 */
enum { RESULT_NONE, RESULT_FOUND, RESULT_INTERVAL };

#include "cli/options/bench.inc"

/* All measurements. */
typedef struct results {
    uint64_t clock_ns;        /* time of reading the clock, in nanoseconds */
    double cold_pages;        /* share of the file that remained in the page cache; below 0: not
                               * known */
    double cold_open_seconds; /* cold start: time to open the model */
    double cold_seconds;      /* cold start: time to the first result */
    double open_seconds;      /* time to open the model again */
    uint64_t cold_bytes;      /* cold start: number of bytes read */
    uint64_t cold_reads;      /* cold start: number of reads */
    uint64_t peak;            /* maximum memory of the process in bytes; 0: not known */
    bench_metrics metrics;
    ebpo_model_stats model, model_end; /* after the first pass, and at the end */
    traffic traffic;                   /* traffic of the warm session */
    /* number of results of each kind. The index is an ebpo_where if the query is `inside`,
     * otherwise RESULT_NONE to RESULT_INTERVAL */
    uint64_t counts[4];
} results;

/* Sets the mode of the query from --mode. The valid words depend on the query. */
static bool set_mode(values *v)
{
    const char *const *words = v->query == BENCH_INSIDE ? inside_modes : distance_modes;
    if (!v->mode)
        return true;
    for (int i = 0; words[i] && v->query < BENCH_RAY; i++)
        if (strcmp(words[i], v->mode) == 0) {
            *(v->query == BENCH_INSIDE ? &v->q.inside_mode : &v->q.distance_mode) = i;
            return true;
        }
    fprintf(stderr, "ebpo bench: --mode: '%s' is not a mode of %s; 'ebpo %s --help' %s\n", v->mode,
            query_words[v->query], query_words[v->query],
            v->query >= BENCH_RAY ? "has no modes" : "lists the modes");
    return false;
}

/* --- measuring --- */

/* Measures the time from opening a file outside the page cache to the first result. */
static int cold_start(const bench_job *job, const char *path,
                      const ebpo_model_options *model_options, const remote_values *remote,
                      results *r)
{
    query_session s = QUERY_SESSION_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    r->cold_pages = bench_drop_file(path);
    uint64_t begin = tool_clock();
    int code = query_open(&s, "bench", path, model_options, job->inside.level, remote);
    r->cold_open_seconds = (double)(tool_clock() - begin) * 1e-9;
    if (code == EXIT_OK && bench_run_query(job, s.context, 0, &error) != EBPO_OK)
        code = command_failed("bench", &error);
    r->cold_seconds = (double)(tool_clock() - begin) * 1e-9;
    if (code == EXIT_OK) {
        ebpo_model_get_stats(s.model, &stats);
        r->cold_bytes = stats.bytes_read;
        r->cold_reads = stats.reads;
    }
    query_close(&s);
    return code;
}

/* Returns the element of f[count] whose mean is the median of all means. */
static bench_metrics median_by_mean(const bench_metrics *f, int count)
{
    for (int i = 0; i < count; i++) {
        int below = 0;
        for (int k = 0; k < count; k++)
            below += f[k].mean < f[i].mean || (!(f[i].mean < f[k].mean) && k < i);
        if (below == (count - 1) / 2)
            return f[i];
    }
    return f[0];
}

/* Returns the median of the batch times. */
static double median_batch(const bench_metrics *f, int count)
{
    bench_metrics by_batch[REPEAT_MAX];
    for (int i = 0; i < count; i++)
        by_batch[i] = (bench_metrics){ .mean = f[i].batch };
    return median_by_mean(by_batch, count).mean;
}

/* Refuses options without effect, which would make the results misleading. */
static bool options_fit(const values *v)
{
    char query_option[40];
    unsigned unused = QUERY_UNSIGNED | QUERY_MAX_DISTANCE | QUERY_NO_WARM;
    if (v->query >= BENCH_RAY)
        unused |= QUERY_LEVEL | QUERY_DEADLINE | QUERY_PREFETCH;
    snprintf(query_option, sizeof query_option, "--query %s", query_words[v->query]);
    if (isfinite(v->q.tmax) && v->query < BENCH_RAY) {
        command_usage("bench", "--tmax has no effect with %s; omit one of them", query_option);
        return false;
    }
    if (v->q.raw && bench_points_generated(v->points)) {
        fprintf(stderr,
                "ebpo bench: --raw has no effect with --points %s; omit one of them, or try "
                "'ebpo bench --help'\n",
                v->points);
        return false;
    }
    if (v->seed >= 0 && !bench_points_generated(v->points)) {
        fprintf(stderr,
                "ebpo bench: --seed has no effect with --points %s; omit one of them, or try "
                "'ebpo bench --help'\n",
                v->points);
        return false;
    }
    if (v->query == BENCH_DISTANCE)
        return query_distance_fits("bench", &v->q);
    return query_check_effect("bench", &v->q, unused, query_option) &&
           query_inside_fits("bench", &v->q);
}

/* Compares the bits of numbers, because NAN, which is a valid result, does not equal itself. */
static bool same_reals(const double *a, const double *b, int count)
{
    return memcmp(a, b, (size_t)count * sizeof *a) == 0;
}

static bool same_result(bench_query query, const void *one, const void *other, uint64_t i)
{
    if (query == BENCH_INSIDE) {
        const ebpo_inside_result *a = (const ebpo_inside_result *)one + i,
                                 *b = (const ebpo_inside_result *)other + i;
        return a->where == b->where && a->winding == b->winding &&
               same_reals(&a->doubt, &b->doubt, 1);
    }
    if (query == BENCH_DISTANCE) {
        const ebpo_distance_result *a = (const ebpo_distance_result *)one + i,
                                   *b = (const ebpo_distance_result *)other + i;
        return same_reals(&a->distance, &b->distance, 1) && same_reals(&a->lo, &b->lo, 1) &&
               same_reals(&a->hi, &b->hi, 1) && same_reals(a->point, b->point, 3) &&
               same_reals(a->normal, b->normal, 3) && a->face == b->face;
    }
    const ebpo_ray_hit *a = (const ebpo_ray_hit *)one + i, *b = (const ebpo_ray_hit *)other + i;
    return same_reals(&a->t, &b->t, 1) && a->face == b->face && a->side == b->side;
}

/* Checks that the results of the batch equal those of single queries. With a deadline, results
 * depend on time, and nothing is checked. Returns an exit code. */
static int compare_results(const bench_job *job, const void *batch)
{
    if (job->inside.deadline_ns)
        return EXIT_OK;
    for (uint64_t i = 0; i < job->count; i++)
        if (!same_result(job->query, job->result_values, batch, i)) {
            fprintf(stderr,
                    "ebpo bench: query %" PRIu64
                    " has different results alone and in a batch; please report this\n",
                    i);
            return EXIT_FAILED;
        }
    return EXIT_OK;
}

static int measure_rounds(const bench_job *job, query_session *s, int repeat, void *batch,
                          results *r)
{
    bench_metrics f[REPEAT_MAX] = { { 0 } };
    ebpo_error error = EBPO_ERROR_INIT;
    for (int i = 0; i < repeat; i++) {
        ebpo_status status = bench_each(job, s->context, r->clock_ns, &f[i], &error);
        if (status == EBPO_OK && i == 0)
            ebpo_model_get_stats(s->model, &r->model);
        if (status == EBPO_OK)
            status = bench_batch(job, s->context, batch, &f[i], &error);
        if (status != EBPO_OK)
            return command_failed("bench", &error);
    }
    ebpo_model_get_stats(s->model, &r->model_end);
    r->peak = bench_peak_memory();
    r->metrics = median_by_mean(f, repeat);
    r->metrics.batch = median_batch(f, repeat);
    return compare_results(job, batch);
}

static void count_results(const bench_job *job, results *r)
{
    const ebpo_inside_result *inside = job->result_values;
    const ebpo_distance_result *distance = job->result_values;
    const ebpo_ray_hit *hit = job->result_values;
    for (uint64_t i = 0; i < job->count; i++)
        if (job->query == BENCH_INSIDE)
            r->counts[inside[i].where & 3]++;
        else if (job->query == BENCH_DISTANCE)
            r->counts[isnan(distance[i].distance)   ? RESULT_INTERVAL
                      : isinf(distance[i].distance) ? RESULT_NONE
                                                    : RESULT_FOUND]++;
        else
            r->counts[hit[i].face != EBPO_NO_FACE ? RESULT_FOUND : RESULT_NONE]++;
}

static int save_results(const bench_job *job, const char *path)
{
    char *data = NULL;
    size_t size = 0;
    FILE *f = open_memstream(&data, &size);
    for (uint64_t i = 0; f && i < job->count; i++) {
        if (job->query == BENCH_INSIDE) {
            putc(((const ebpo_inside_result *)job->result_values)[i].where, f);
            continue;
        }
        const ebpo_distance_result *d = (const ebpo_distance_result *)job->result_values + i;
        const ebpo_ray_hit *h = (const ebpo_ray_hit *)job->result_values + i;
        raw_double(f, job->query == BENCH_DISTANCE ? d->distance : h->t);
        raw_u64(f, job->query == BENCH_DISTANCE ? d->face : h->face); /* EBPO_NO_FACE is -1 */
    }
    return bench_save(f, &data, &size, path);
}

/* Checks that the output files can be written. Call before the measurement. */
static int check_outputs(const values *v)
{
    ebpo_error error = EBPO_ERROR_INIT;
    const char *const paths[] = { v->save_points, v->save_results };
    for (int i = 0; i < 2; i++)
        if (paths[i] && ebpo_check_output(paths[i], &error) != EBPO_OK)
            return command_failed("bench", &error);
    return EXIT_OK;
}

/* --- output --- */

static const char *const inside_names[] = { "out", "in", "on", "maybe" }, *const other_names[] = {
    "not_found", "found", "interval"
};

static int result_kinds(const values *v)
{
    return v->query == BENCH_INSIDE ? 4 : v->query == BENCH_DISTANCE ? 3 : 2;
}

static void print_counts(const values *v, const results *r)
{
    int count = result_kinds(v);
    printf("\n%-12s", "results");
    for (int i = 0; i < count; i++)
        printf(" %11s", v->query == BENCH_INSIDE ? inside_names[i] : other_names[i]);
    printf("\n%-12s", "");
    for (int i = 0; i < count; i++)
        printf(" %11" PRIu64, r->counts[i]);
    putchar('\n');
}

static void print_opening(const results *r)
{
    char bytes[40];
    printf("\n%-12s %11s %11s %11s %11s\n", "opening", "seconds", "to result", "read", "reads");
    printf("%-12s %11.6f %11.6f %11s %11" PRIu64 "\n", "cold", r->cold_open_seconds,
           r->cold_seconds, words_bytes(bytes, sizeof bytes, r->cold_bytes), r->cold_reads);
    printf("%-12s %11.6f %11s %11s %11" PRIu64 "\n", "again", r->open_seconds, "",
           words_bytes(bytes, sizeof bytes, r->model.bytes_read), r->model.reads);
    if (r->cold_pages >= 0)
        printf("cold: %.0f %% of the file was still in the page cache; ", 100 * r->cold_pages);
    puts("to result: seconds to the first result");
}

static void print_results(const values *v, const char *path, uint64_t count, const results *r)
{
    const bench_metrics *f = &r->metrics;
    char bytes[40];
    printf("%s: %s, %s, %s\n\n", path, query_words[v->query], v->points,
           words_plural(bytes, sizeof bytes, count, "query", "queries"));
    printf("%-12s %11s %11s %11s %11s %11s\n", "ns/query", "mean", "p50", "p99", "p99.9", "max");
    printf("%-12s %11.1f %11" PRIu64 " %11" PRIu64 " %11" PRIu64 " %11" PRIu64 "\n", "single",
           f->mean, f->p50, f->p99, f->p999, f->max);
    printf("%-12s %11.1f\n", "batch", f->batch);
    printf("single: one query per call, without the %" PRIu64 " ns of the clock; batch: all in one "
           "call; one thread\n",
           r->clock_ns);
    print_opening(r);
    print_counts(v, r);
    printf("\n%-18s %15s %15s\n", "model", "after single", "at the end");
    stats_table(stdout, &r->model, &r->model_end);
    printf("%-18s %15s %15s\n", "process_peak", "",
           r->peak ? words_bytes(bytes, sizeof bytes, r->peak) : "unknown");
    remote_report(&r->traffic, &v->q.remote, false);
}

static void json_results(json *j, const values *v, const results *r)
{
    int count = result_kinds(v);
    json_object(j, "results");
    for (int i = 0; i < count; i++)
        json_uint(j, v->query == BENCH_INSIDE ? inside_names[i] : other_names[i], r->counts[i]);
    json_end(j);
}

static void json_metrics(json *j, const results *r)
{
    json_object(j, "ns");
    json_real(j, "mean", r->metrics.mean);
    json_uint(j, "p50", r->metrics.p50);
    json_uint(j, "p99", r->metrics.p99);
    json_uint(j, "p999", r->metrics.p999);
    json_uint(j, "max", r->metrics.max);
    json_end(j);
    json_real(j, "batch_ns", r->metrics.batch);
    json_uint(j, "clock_ns", r->clock_ns);
    json_real(j, "open_seconds", r->open_seconds);
    json_real(j, "cold_open_seconds", r->cold_open_seconds);
    json_real(j, "cold_first_result_seconds", r->cold_seconds);
    json_uint(j, "cold_bytes_read", r->cold_bytes);
    json_uint(j, "cold_reads", r->cold_reads);
    if (r->cold_pages >= 0)
        json_real(j, "cold_share_still_held", r->cold_pages);
    else
        json_null(j, "cold_share_still_held");
    json_uint(j, "bytes_read", r->model.bytes_read);
    if (r->peak)
        json_uint(j, "peak_memory_bytes", r->peak);
    else
        json_null(j, "peak_memory_bytes");
}

static void print_json(const values *v, const char *path, uint64_t count, const results *r)
{
    json j;
    json_begin(&j, stdout);
    json_object(&j, NULL);
    json_text(&j, "file", path);
    json_text(&j, "query", query_words[v->query]);
    if (v->query >= BENCH_RAY)
        json_null(&j, "mode");
    else
        json_text(&j, "mode",
                  v->query == BENCH_INSIDE ? inside_modes[v->q.inside_mode]
                                           : distance_modes[v->q.distance_mode]);
    json_int(&j, "level", v->q.level);
    json_text(&j, "points", v->points);
    json_uint(&j, "count", count);
    if (bench_points_generated(v->points))
        json_int(&j, "seed", v->seed);
    else
        json_null(&j, "seed");
    json_int(&j, "repeat", v->repeat);
    if (v->rate > 0)
        json_real(&j, "rate", v->rate);
    json_metrics(&j, r);
    json_results(&j, v, r);
    json_object(&j, "model");
    stats_json(&j, &r->model);
    json_end(&j);
    json_object(&j, "model_at_end");
    stats_json(&j, &r->model_end);
    json_end(&j);
    remote_json(&j, &r->traffic, &v->q.remote);
    json_finish(&j);
}

/* --- the command --- */

static int bench_model(bench_job *job, const values *v, const bench_points *p, const char *path,
                       const ebpo_model_options *model_options, void *batch)
{
    results r = { .clock_ns = bench_clock_cost(),
                  .model = EBPO_MODEL_STATS_INIT,
                  .model_end = EBPO_MODEL_STATS_INIT };
    query_session s = QUERY_SESSION_INIT;
    bench_reset_peak();
    int code = cold_start(job, path, model_options, &v->q.remote, &r);
    uint64_t begin = tool_clock();
    if (code == EXIT_OK)
        code = query_open(&s, "bench", path, model_options, job->inside.level, &v->q.remote);
    r.open_seconds = (double)(tool_clock() - begin) * 1e-9;
    if (code == EXIT_OK)
        code = measure_rounds(job, &s, (int)v->repeat, batch, &r);
    if (s.file)
        r.traffic = traffic_of(s.file);
    query_close(&s);
    if (code == EXIT_OK && v->save_points)
        code = bench_points_save(p, v->save_points);
    if (code == EXIT_OK && v->save_results)
        code = save_results(job, v->save_results);
    if (code != EXIT_OK)
        return code;
    count_results(job, &r);
    (v->q.json ? print_json : print_results)(v, remote_shown(path), job->count, &r);
    return EXIT_OK;
}

static int prepare_points(const values *v, const char *path, bench_points *p)
{
    points_kind kind = v->query >= BENCH_RAY ? POINTS_RAYS : POINTS;
    *p = (bench_points){ .rows = NULL };
    if (!command_requires_hdf5("bench", path) || check_outputs(v) != EXIT_OK)
        return EXIT_FAILED;
    return bench_points_make(p, kind, path, &v->q.remote, v->points, v->q.raw, (uint64_t)v->count,
                             (uint64_t)v->seed, v->q.tmax);
}

static const values standard = {
    .q = QUERY_VALUES_INIT, .points = "uniform", .seed = -1, .repeat = 1
};

static int run_bench(void *given, const char **operand)
{
    values *v = given;
    ebpo_model_options model_options;
    bench_job job = { .result_values = NULL };
    bench_points p;
    if (!set_mode(v) || !options_fit(v) ||
        !query_options_from("bench", &v->q, &model_options, &job.inside, &job.distance))
        return EXIT_USAGE;
    if (v->seed < 0)
        v->seed = 1;
    int code = prepare_points(v, operand[0], &p);
    job.query = (bench_query)v->query;
    job.rows = p.rows;
    job.width = points_width(p.kind);
    job.count = p.count;
    job.rate = v->rate;
    size_t bytes = bench_result_bytes(job.query);
    void *batch = calloc(p.count + 1, bytes);
    job.result_values = calloc(p.count + 1, bytes);
    job.ns = calloc(p.count + 1, sizeof *job.ns);
    if (code == EXIT_OK && (!batch || !job.result_values || !job.ns)) {
        code = command_no_memory("bench");
    }
    if (code == EXIT_OK)
        code = bench_model(&job, v, &p, operand[0], &model_options, batch);
    free(batch);
    free(job.result_values);
    free(job.ns);
    bench_points_free(&p);
    return code;
}

const command command_bench = { &spec, sizeof standard, &standard, run_bench };
