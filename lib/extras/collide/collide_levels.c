/* What levels tell of two models at poses. */
#include "core/strict_fp.h"

#include <math.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "extras/collide/level_search.h"

static int32_t last_level(const ebpo_model *m, int level)
{
    int last = m->whole ? m->info->level_count - 1 : m->top->cut_level;
    return level < 0 || level > last ? last : level;
}

static void tell(const ebpo_collision *q, const ebpo_level_search *g, ebpo_level_result *out)
{
    double lo = fmin(g->lo, g->hi);
    int32_t figure = isinf(lo)                 ? EBPO_FIGURE_EXACT
                     : lo == 0 || isinf(g->hi) ? EBPO_FIGURE_BOUND
                                               : EBPO_FIGURE_INTERVAL;
    out->distance = (ebpo_certain){ lo, g->hi, figure, 0 };
    out->common = g->meets ? 1 : g->may_meet ? -1 : 0;
    out->contact = g->open_pairs ? -1 : 0;
    out->open_pairs = g->open_pairs;
    out->level_a = last_level(q->model[q->turned], q->options.level);
    out->level_b = last_level(q->model[!q->turned], q->options.level);
}

ebpo_status ebpo_collide_levels(ebpo_collider *c, const ebpo_collide_options *options,
                                ebpo_level_result *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_collision q;
    ebpo_level_search g = { .open_pairs = 0 };
    *out = (ebpo_level_result){ .common = -1, .contact = -1 };
    ebpo_status status = ebpo_collision_begin(&q, c, options, error);
    if (status == EBPO_OK)
        status = ebpo_level_search_run(&g, &q, error);
    if (status == EBPO_OK)
        tell(&q, &g, out);
    ebpo_level_search_free(&g);
    return status;
}
