/* Makes subsets for targets, and compares each subset with its target. A target is the greatest
 * error or the greatest size that a subset may have. */
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "cli/bench/bench_run.h"
#include "cli/report/report_data.h"
#include "cli/report/report_output.h"

static const double errors[] = { 10, 3, 1, 0.3 }; /* percent of the model's diagonal */
static const double sizes[] = { 3, 5, 10, 50 };   /* percent of the size of the first file */

/* Makes the subset for a viewer: envelopes without the mesh. */
static ebpo_status cut_subset(const comparison *c, ebpo_file *file, const target_result *target,
                              const char *path, ebpo_error *error)
{
    ebpo_subset_options options = EBPO_SUBSET_OPTIONS_INIT;
    options.parts = ebpo_profile_parts(EBPO_PROFILE_LOD);
    options.threads = (unsigned)c->v->threads;
    options.progress = c->progress;
    if (target->kind == TARGET_ERROR)
        options.max_error = target->requested;
    else
        options.target_bytes = (uint64_t)target->requested;
    return ebpo_subset(file, path, &options, error);
}

/* Sets the size and the error of the subset in the file `path`. `model`: the whole model. */
static ebpo_status measure_error(const comparison *c, ebpo_model *model, const char *path,
                                 target_result *target, ebpo_error *error)
{
    ebpo_error_bound_options options = EBPO_ERROR_BOUND_OPTIONS_INIT;
    options.queries = REPORT_QUERIES;
    ebpo_error_bound bound = EBPO_ERROR_BOUND_INIT;
    ebpo_file *file = NULL;
    options.samples = 0;
    options.tolerance = 0.01; /* a larger one could raise the upper bound above the target */
    options.threads = (unsigned)c->v->threads;
    options.progress = c->progress;
    ebpo_status status = ebpo_open(path, &file, error);
    if (status == EBPO_OK) {
        const ebpo_info *info = ebpo_file_info(file);
        target->metric[METRIC_SUBSET_BYTES] = (double)info->file_bytes;
        status =
            ebpo_level_error_bound(model, file, info->level_count - 1, &options, &bound, error);
    }
    if (status == EBPO_OK) {
        target->metric[METRIC_SUBSET_FAR_LO] = bound.lo;
        target->metric[METRIC_SUBSET_FAR_HI] = bound.hi;
    }
    ebpo_close(file);
    return status;
}

/* Sets *out to the error of the whole file; 0: not known. No subset has a smaller error, because
 * leaves cannot be refined. The error of the file is that of its last level. If --levels omits the
 * last level, this function computes the error. */
static ebpo_status find_file_error(const comparison *c, method *m, ebpo_file *file,
                                   ebpo_model *model, double *out, ebpo_error *error)
{
    ebpo_error_bound_options options = EBPO_ERROR_BOUND_OPTIONS_INIT;
    options.queries = REPORT_QUERIES;
    ebpo_error_bound bound = EBPO_ERROR_BOUND_INIT;
    *out = m->level[m->levels - 1][METRIC_FAR_HI];
    if (!isnan(*out))
        return EBPO_OK;
    options.samples = 0;
    options.threads = (unsigned)c->v->threads;
    options.progress = c->progress;
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < m->levels && status == EBPO_OK; i++) {
        status = ebpo_level_error_bound(model, file, i, &options, &bound, error);
        options.at_most = bound.hi;
    }
    *out = status == EBPO_OK ? bound.hi : 0;
    return method_note_missing(m, "Hausdorff distance", status, error);
}

static ebpo_status measure_target(comparison *c, method *m, ebpo_file *file, ebpo_model *model,
                                  target_kind kind, double requested, double file_error,
                                  ebpo_error *error)
{
    char path[sizeof c->folder + OUTPUT_NAME_MAX];
    target_result *target = &m->targets[m->target_count];
    *target = (target_result){ kind, requested, { NAN, NAN, NAN, NAN, NAN } };
    output_add_model(c->folder, "target", path, sizeof path);
    uint64_t begin = tool_clock();
    ebpo_status status = cut_subset(c, file, target, path, error);
    target->metric[METRIC_SUBSET_SECONDS] = 1e-9 * (double)(tool_clock() - begin);
    if (status == EBPO_OK)
        status = measure_error(c, model, path, target, error);
    unlink(path);
    target->metric[METRIC_SUBSET_RATIO] =
        kind == TARGET_ERROR ? target->metric[METRIC_SUBSET_FAR_HI] / fmax(requested, file_error)
                             : target->metric[METRIC_SUBSET_BYTES] / requested;
    if (status == EBPO_OK || status == EBPO_E_ABSENT)
        m->target_count++;
    return status;
}

/* Measures all targets. A target that cannot be met is omitted, with a note. */
ebpo_status report_targets(comparison *c, method *m, ebpo_file *file, ebpo_model *model,
                           ebpo_error *error)
{
    double file_error;
    ebpo_status status = find_file_error(c, m, file, model, &file_error, error);
    for (unsigned i = 0; i < TARGETS && status == EBPO_OK; i++) {
        bool by_error = i < TARGETS / 2;
        double requested =
            by_error ? errors[i] / 100 * c->diagonal
                     : floor(sizes[i - TARGETS / 2] / 100 * (double)c->methods[0].info.file_bytes);
        status = measure_target(c, m, file, model, by_error ? TARGET_ERROR : TARGET_SIZE, requested,
                                file_error, error);
        if (status == EBPO_E_MEMORY || status == EBPO_E_IO || status == EBPO_E_CANCELLED)
            return status;
        if (status != EBPO_OK)
            method_note(m, by_error ? "choosing by error" : "choosing by size", error->message);
        *error = (ebpo_error)EBPO_ERROR_INIT;
        status = EBPO_OK;
    }
    return status;
}
