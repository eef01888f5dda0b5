/* Measures distance queries under a memory budget. Under a budget, a model keeps only levels 0 to
 * its cut level in memory. From these levels alone, a query computes an interval that contains the
 * distance. For the exact distance, a query loads subtrees. */
#include <stdio.h>
#include <stdlib.h>

#include "cli/bench/bench_run.h"
#include "cli/report/report_data.h"

/* Maximum number of points; it is small because loading subtrees takes time. */
enum { BUDGET_POINTS = 500 };

/* Sets the metrics `f` of a budget. `cut_level`: cut level of the model; -1: the whole model is in
 * memory. */
static ebpo_status query_within_budget(const comparison *c, ebpo_model *model, int cut_level,
                                       double *f, ebpo_error *error)
{
    uint64_t count = c->points < BUDGET_POINTS ? c->points : BUDGET_POINTS;
    double *width = malloc(count * sizeof *width);
    ebpo_context *context = NULL;
    ebpo_model_stats before = EBPO_MODEL_STATS_INIT, after = EBPO_MODEL_STATS_INIT;
    ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT, cut_options = options;
    ebpo_status status = width ? ebpo_context_new(model, &context, error) : EBPO_E_MEMORY;
    options.unsigned_distance = cut_options.unsigned_distance = true;
    options.warm = cut_options.warm = false;
    cut_options.level = cut_level;
    for (uint64_t i = 0; i < count && status == EBPO_OK && cut_level >= 0; i++) {
        ebpo_distance_result result;
        status = ebpo_distance(context, c->uniform + 3 * i, &cut_options, &result, error);
        width[i] = result.hi - result.lo;
    }
    if (status == EBPO_OK)
        f[METRIC_BUDGET_WIDTH] = cut_level >= 0 ? quantile_of(width, count, 0.5) : 0;
    ebpo_model_get_stats(model, &before);
    uint64_t begin = tool_clock();
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        ebpo_distance_result result;
        status = ebpo_distance(context, c->uniform + 3 * i, &options, &result, error);
    }
    f[METRIC_BUDGET_NS] = (double)(tool_clock() - begin) / (double)count;
    ebpo_model_get_stats(model, &after);
    f[METRIC_BUDGET_LOADS] = (double)(after.loads - before.loads) / (double)count;
    f[METRIC_BUDGET_READ] = (double)(after.bytes_read - before.bytes_read) / (double)count;
    ebpo_context_free(context);
    free(width);
    return status;
}

/* Measures budget number i. */
static ebpo_status measure_budget(comparison *c, method *m, ebpo_file *file, int i,
                                  ebpo_error *error)
{
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    ebpo_model *model = NULL;
    double *f = m->budget[i];
    options.memory = budget_parts[i] == 1 ? 0 : (uint64_t)f[METRIC_BUDGET_BYTES];
    options.threads = (unsigned)c->v->threads;
    ebpo_status status = ebpo_model_new(file, &options, &model, error);
    if (status == EBPO_OK) {
        ebpo_model_get_stats(model, &stats);
        if (!stats.resident)
            f[METRIC_BUDGET_LEVEL] = stats.cut_level;
        status = query_within_budget(c, model, stats.resident ? -1 : stats.cut_level, f, error);
    }
    ebpo_model_free(model);
    return status;
}

/* Computes the memory of models that keep levels 0 to i, for each measured level i. */
static ebpo_status level_memory(comparison *c, method *m, ebpo_file *file, ebpo_error *error)
{
    for (int i = c->first; i <= method_last(c, m); i++) {
        ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
        ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
        ebpo_model *model = NULL;
        options.cut_level = i;
        options.threads = (unsigned)c->v->threads;
        ebpo_status status = ebpo_model_new(file, &options, &model, error);
        if (status == EBPO_OK) {
            ebpo_model_get_stats(model, &stats);
            m->level[i][METRIC_LEVEL_MEMORY] = (double)stats.memory;
        }
        ebpo_model_free(model);
        if (status == EBPO_E_IO || status == EBPO_E_CANCELLED)
            return status;
        if (status == EBPO_OK)
            continue;
        method_note(m, "memory of levels", error->message);
        *error = (ebpo_error)EBPO_ERROR_INIT;
        return EBPO_OK;
    }
    return EBPO_OK;
}

ebpo_status report_budgets(comparison *c, method *m, ebpo_file *file, ebpo_error *error)
{
    ebpo_status status = level_memory(c, m, file, error);
    if (status != EBPO_OK)
        return status;
    for (int i = 0; i < BUDGETS; i++)
        m->budget[i][METRIC_BUDGET_BYTES] = ceil(m->whole[METRIC_MEMORY_BYTES] / budget_parts[i]);
    for (int i = 0; i < BUDGETS; i++) {
        if (c->progress.report)
            c->progress.report(c->progress.user, "memory budgets", (uint64_t)i, BUDGETS);
        status = measure_budget(c, m, file, i, error);
        if (status == EBPO_OK)
            continue;
        if (status == EBPO_E_IO || status == EBPO_E_CANCELLED)
            return status;
        for (int k = METRIC_BUDGET_BYTES + 1; k < BUDGET_METRICS; k++)
            m->budget[i][k] = NAN;
        method_note(m, "memory budgets", error->message);
        *error = (ebpo_error)EBPO_ERROR_INIT;
        return EBPO_OK; /* the budget is too small, and each later budget is even smaller */
    }
    return EBPO_OK;
}
