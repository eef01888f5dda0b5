/* Measures distance queries with a deadline: the width of the interval that certainly contains the
 * distance, and the time of the query. */
#include <stdio.h>
#include <stdlib.h>

#include "cli/bench/bench_run.h"
#include "cli/report/report_data.h"

typedef struct timing {
    double *width, *took; /* [points] widths of intervals, and times in nanoseconds */
    uint64_t exact, late; /* numbers of exact results, and of results after the deadline */
} timing;

static ebpo_status query_in_time(const comparison *c, ebpo_context *context, unsigned us,
                                 uint64_t clock_cost, timing *t, ebpo_error *error)
{
    ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
    options.deadline_ns = UINT64_C(1000) * us;
    options.unsigned_distance = true;
    options.warm = false; /* no query uses the result of the query before */
    t->exact = t->late = 0;
    for (uint64_t i = 0; i < c->points; i++) {
        ebpo_distance_result result;
        uint64_t begin = tool_clock();
        ebpo_status status = ebpo_distance(context, c->uniform + 3 * i, &options, &result, error);
        uint64_t took = tool_clock() - begin;
        if (status != EBPO_OK)
            return status;
        t->took[i] = took > clock_cost ? (double)(took - clock_cost) : 0;
        t->late += t->took[i] > 1e3 * us;
        t->exact += !isnan(result.distance);
        t->width[i] = isnan(result.distance) ? result.hi - result.lo : 0;
    }
    return EBPO_OK;
}

/* Sets the metrics of a deadline. */
static void set_metrics(const comparison *c, timing *t, double *f)
{
    double count = (double)c->points;
    f[METRIC_DEADLINE_EXACT] = (double)t->exact / count;
    f[METRIC_DEADLINE_LATE] = (double)t->late / count;
    f[METRIC_DEADLINE_WIDTH_MEDIAN] = quantile_of(t->width, c->points, 0.5);
    f[METRIC_DEADLINE_WIDTH_P99] = quantile_of(t->width, c->points, 0.99);
    f[METRIC_DEADLINE_TOOK_MEDIAN] = quantile_of(t->took, c->points, 0.5);
    f[METRIC_DEADLINE_TOOK_P99] = quantile_of(t->took, c->points, 0.99);
    f[METRIC_DEADLINE_TOOK_MAX] = t->took[c->points - 1]; /* quantile_of has sorted `took` */
}

ebpo_status report_deadlines(comparison *c, method *m, ebpo_model *model, int round,
                             ebpo_error *error)
{
    timing t = { .width = malloc(c->points * sizeof(double)),
                 .took = malloc(c->points * sizeof(double)) };
    uint64_t clock_cost = bench_clock_cost();
    ebpo_context *context = NULL;
    ebpo_status status = ebpo_context_new(model, &context, error);
    if (status == EBPO_OK && (!t.width || !t.took)) {
        snprintf(error->message, sizeof error->message,
                 "not enough memory for the points; use fewer --points");
        status = error->status = EBPO_E_MEMORY;
    }
    for (int i = 0; i < DEADLINES && status == EBPO_OK; i++) {
        if (c->progress.report)
            c->progress.report(c->progress.user, "deadlines", (uint64_t)i, DEADLINES);
        status = query_in_time(c, context, deadlines_us[i], clock_cost, &t, error);
        if (status == EBPO_OK)
            set_metrics(c, &t, m->round[round].deadline[i]);
    }
    free(t.width);
    free(t.took);
    ebpo_context_free(context);
    return method_note_missing(m, "deadlines", status, error);
}
