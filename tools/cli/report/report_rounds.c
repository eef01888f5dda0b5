/* Measures the times of reading a level, of queries to a level, and of queries with a deadline. The
 * measurements are made in rounds, in which the methods take turns. */
#include <stdio.h>

#include "cli/bench/bench_run.h"
#include "cli/report/report_data.h"

/* --- reading a level --- */

/* Opens the file and reads levels 0 to `level`, after the file was dropped from the page cache. */
static ebpo_status read_level(const comparison *c, const method *m, int level, double *seconds,
                              traffic *t, ebpo_error *error)
{
    ebpo_stream_options stream_options = EBPO_STREAM_OPTIONS_INIT;
    ebpo_stream_level reported;
    ebpo_stream *stream = NULL;
    ebpo_file *file = NULL;
    bool has_more = true;
    if (!ebpo_is_url(m->path))
        bench_drop_file(m->path);
    stream_options.threads = (unsigned)c->v->threads;
    uint64_t begin = tool_clock();
    ebpo_status status = remote_open(&file, m->path, &c->v->remote, error);
    if (status == EBPO_OK) {
        ebpo_file_prefetch_levels(file, 0, level);
        status = ebpo_stream_new(file, &stream_options, &stream, error);
    }
    for (int i = 0; i <= level && status == EBPO_OK; i++)
        status = ebpo_stream_next_level(stream, &reported, &has_more, error);
    *seconds = 1e-9 * (double)(tool_clock() - begin);
    if (status == EBPO_OK)
        *t = traffic_of(file);
    ebpo_stream_free(stream);
    ebpo_close(file);
    return status;
}

static ebpo_status time_reading(comparison *c, method *m, int round, ebpo_error *error)
{
    traffic t = { 0 };
    for (int i = c->first; i <= method_last(c, m); i++) {
        ebpo_status status = read_level(c, m, i, &m->round[round].reading[i], &t, error);
        if (status != EBPO_OK)
            return status;
        m->level[i][METRIC_READ_BYTES] = (double)t.bytes;
        m->level[i][METRIC_READS] = (double)t.reads;
    }
    return EBPO_OK;
}

/* --- one round --- */

ebpo_status report_round(comparison *c, method *m, int round, ebpo_error *error)
{
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    ebpo_file *file = NULL;
    ebpo_model *model = NULL;
    ebpo_status status = time_reading(c, m, round, error);
    options.threads = (unsigned)c->v->threads;
    if (status == EBPO_OK)
        status = remote_open(&file, m->path, &c->v->remote, error);
    if (status == EBPO_OK)
        status = ebpo_model_new(file, &options, &model, error);
    if (status == EBPO_OK) {
        ebpo_model_get_stats(model, &stats);
        m->round[round].open = stats.open_seconds;
        status = report_limited(c, m, model, round, error);
    }
    if (status == EBPO_OK)
        status = report_deadlines(c, m, model, round, error);
    ebpo_model_free(model);
    ebpo_close(file);
    return status;
}

/* --- medians --- */

#define MEDIAN(field) median_of_rounds(m->round[0].field, m->round[1].field, m->round[2].field)

/* Returns the median; NAN if one of the values is NAN (not available). */
static double median_of_rounds(double a, double b, double c)
{
    double v[ROUNDS] = { a, b, c };
    return isnan(a) || isnan(b) || isnan(c) ? NAN : quantile_of(v, ROUNDS, 0.5);
}

void report_medians(const comparison *c, method *m)
{
    for (int i = c->first; i <= method_last(c, m); i++) {
        m->level[i][METRIC_READING_SECONDS] = MEDIAN(reading[i]);
        m->level[i][METRIC_INSIDE_NS] = MEDIAN(inside[i]);
        m->level[i][METRIC_DISTANCE_NS] = MEDIAN(distance[i]);
    }
    m->whole[METRIC_OPEN_SECONDS] = MEDIAN(open);
    m->whole[METRIC_EXACT_INSIDE_NS] = MEDIAN(exact_inside);
    m->whole[METRIC_EXACT_DISTANCE_NS] = MEDIAN(exact_distance);
    for (int i = 0; i < DEADLINES; i++)
        for (int k = 0; k < DEADLINE_METRICS; k++)
            m->deadline[i][k] = MEDIAN(deadline[i][k]);
}
