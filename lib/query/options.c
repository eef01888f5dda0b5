#include "core/strict_fp.h"

#include "query/query_model.h"

#include <inttypes.h>
#include <math.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "core/sized.h"
#include "format/reader.h"
#include "query/load_ahead.h"
#include "query/inside.h"
#include "query/limited.h"

ebpo_status ebpo_check_query_level(int level, ebpo_error *error)
{
    if (level < -1 || level >= EBPO_LEVELS_MAX)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "level %d: give 0 to %d, or -1 for all", level,
                         EBPO_LEVELS_MAX - 1);
    return EBPO_OK;
}

ebpo_status ebpo_fail_value(ebpo_error *error)
{
    return ebpo_fail(error, EBPO_E_ARGUMENT,
                     "the query options contain a value that is not one of its kind");
}

ebpo_status ebpo_check_points(const double *points, uint64_t count, ebpo_error *error)
{
    for (uint64_t i = 0; i < 3 * count; i++)
        if (!isfinite(points[i]))
            return ebpo_fail(error, EBPO_E_ARGUMENT,
                             "point %" PRIu64 " has a coordinate that is not a finite number",
                             i / 3);
    return EBPO_OK;
}

ebpo_status ebpo_check_mesh(const ebpo_model *model, ebpo_error *error)
{
    if (model->info->parts & EBPO_PART_MESH)
        return EBPO_OK;
    return ebpo_fail_file(
        error, EBPO_E_ABSENT, model->file->in.shown,
        "the file was written without its mesh: exact answers need it; ask with a "
        "level, or use a file that has it (`ebpo subset`, `ebpo fetch` or "
        "`ebpo convert` with --profile collision or full)");
}

ebpo_status ebpo_check_solid(const ebpo_model *model, ebpo_error *error)
{
    if (model->info->solid)
        return EBPO_OK;
    return ebpo_fail(error, EBPO_E_NOT_SOLID,
                     "the model is a surface: it has no inside; 'ebpo check' on its source tells "
                     "which repairs leave a solid, and 'ebpo convert --repair' does them");
}

ebpo_status ebpo_inside_many(ebpo_context *context, const double *points, uint64_t count,
                             const ebpo_inside_options *options, ebpo_inside_result *out,
                             ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_inside_options wanted = EBPO_INSIDE_OPTIONS_INIT;
    const ebpo_inside_options *o = &wanted;
    const ebpo_model *m = context->model;
    ebpo_status status = EBPO_TAKE(ebpo_inside_options, &wanted, options, error);
    if (status == EBPO_OK)
        status = ebpo_check_query_level(o->level, error);
    if (status == EBPO_OK && o->envelopes > EBPO_ENVELOPES_SKIP)
        status = ebpo_fail_value(error);
    if (status == EBPO_OK)
        status = ebpo_check_solid(m, error);
    if (status == EBPO_OK)
        status = ebpo_check_points(points, count, error);
    if (status == EBPO_OK && o->level < 0)
        status = ebpo_check_mesh(m, error);
    if (status == EBPO_OK && m->whole && o->level < 0 && !o->deadline_ns &&
        o->envelopes != EBPO_ENVELOPES_USE)
        return ebpo_inside_whole(context, points, count, out, error);
    context->planes =
        o->level >= 0 || o->deadline_ns || o->envelopes == EBPO_ENVELOPES_USE || m->info->pruned;
    ebpo_batch batch = { .count = 0 };
    if (status == EBPO_OK)
        ebpo_batch_begin(&batch, context, points, o->deadline_ns || o->level >= 0 ? 0 : count,
                         false);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        uint64_t k = batch.count ? ebpo_batch_next(&batch, i) : i;
        status = ebpo_inside_walk(context, points + 3 * k, o, &out[k], error);
        if (status == EBPO_OK && ebpo_model_prefetches(m) &&
            (o->level < 0 || o->level > m->top->cut_level))
            ebpo_context_prefetch(context, points + 3 * k, 0);
    }
    ebpo_batch_end(&batch);
    return status;
}

/* Nothing to be checked but the point, and all in memory. */
static inline bool is_plain(const ebpo_context *context, const ebpo_inside_options *o)
{
    return context->model->answers_inside &&
           (!o || (o->struct_size == sizeof *o && o->level == EBPO_LEVEL_ALL &&
                   o->envelopes == EBPO_ENVELOPES_AUTO && !o->deadline_ns));
}

static ebpo_status inside_plain(ebpo_context *context, const double point[3],
                                ebpo_inside_result *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_position place;
    if (ebpo_locator_find(&context->model->locator, point, &place))
        return ebpo_inside_subtree(context, context->model->whole, &place, point, out, error);
    *out = (ebpo_inside_result){ EBPO_OUT, 0, 0 };
    return ebpo_check_points(point, 1, error);
}

ebpo_status ebpo_inside(ebpo_context *context, const double point[3],
                        const ebpo_inside_options *options, ebpo_inside_result *out,
                        ebpo_error *error)
{
    return is_plain(context, options) ? inside_plain(context, point, out, error)
                                      : ebpo_inside_many(context, point, 1, options, out, error);
}
