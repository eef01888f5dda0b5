/* The nearest faces of a point, one after the other. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "core/sized.h"
#include "query/near_band.h"
#include "query/nearest.h"
#include "query/query_model.h"
#include "query/load_ahead.h"
#include "query/query_node.h"

/* The first band is small, for those who soon have enough; each one is some times larger, so that
 * beginning anew costs little. */
enum { FIRST_BAND = 256, BAND_GROWTH = 8, BAND_MOST = 1 << 16 };

typedef struct within {
    ebpo_context *context;
    const ebpo_within_options *options;
    ebpo_near_band band;
    uint64_t given;
    bool ahead;         /* lists_ahead */
    uint64_t announced; /* subtrees that were, and were not entered since */
    ebpo_near_fn take;
    void *user;
} within;

/* --- not everything in memory: the nearest of what is left, until it is beyond the limit --- */

/* Of a file far away: all subtrees within a radius will be entered, so they are listed at once, and
 * asked for together. Of the nearest so many faces nobody knows. */
static bool lists_ahead(const within *w)
{
    const ebpo_model *m = w->context->model;
    return !w->options->most && isfinite(w->band.radius) && !m->whole &&
           m->options.loading == EBPO_LOAD_CACHE && ebpo_input_expects(&m->file->in);
}

static ebpo_status put_children(within *w, const ebpo_box *box, const ebpo_ranked *r,
                                ebpo_error *error);

/* Of what a subtree lists: by what was kept of it, if it has been loaded before. */
static double known_bound(const within *w, uint32_t below)
{
    const ebpo_skeleton *k = ebpo_skeletons_find(w->context->model->skeletons, below);
    if (!k)
        return 0;
    ebpo_skeleton_bounds b = ebpo_skeleton_lower_bounds(k, w->band.p, w->band.limit);
    return fmin(b.own, b.outer);
}

/* What a subset has left out is looked at when the band is known. */
static ebpo_status put(within *w, const ebpo_box *box, const ebpo_ranked *r, ebpo_error *error)
{
    if (ebpo_node_is_uniform(&r->node) || r->node.pruned || r->lower > w->band.limit ||
        ebpo_near_band_is_past(&w->band, ebpo_cell_far(box, r->node.cell, w->band.p)))
        return EBPO_OK;
    if (!ebpo_node_is_below(&r->node))
        return w->ahead ? put_children(w, box, r, error) : ebpo_queue_push(w->context, r, error);
    ebpo_ranked below = *r;
    below.lower = fmax(r->lower, known_bound(w, ebpo_entry_value(r->node.entry)));
    return below.lower > w->band.limit ? EBPO_OK : ebpo_queue_push(w->context, &below, error);
}

/* Before a subtree is entered: with the first of each window some of those behind it. */
static void announce(within *w, const ebpo_ranked *next)
{
    const ebpo_context *c = w->context;
    uint32_t below[EBPO_ANNOUNCED_MOST];
    uint64_t count = 0;
    if (!w->ahead || w->announced) {
        w->announced -= w->announced > 0;
        return;
    }
    below[count++] = ebpo_entry_value(next->node.entry);
    for (uint64_t i = 0; i < c->queue_count && count < EBPO_ANNOUNCED_MOST; i++)
        if (c->queue[i].lower <= w->band.limit)
            below[count++] = ebpo_entry_value(c->queue[i].node.entry);
    ebpo_context_announce(c, below, count);
    w->announced = count - 1;
}

static ebpo_status search_below(within *w, ebpo_ranked *r, ebpo_error *error)
{
    if (w->band.count > w->band.most) /* it may not be needed */
        ebpo_near_band_settle(&w->band);
    if (r->lower > w->band.limit)
        return EBPO_OK;
    announce(w, r);
    ebpo_status status = ebpo_model_enter(w->context, &r->node, error);
    if (status == EBPO_OK)
        ebpo_near_band_search(&w->band, r->node.subtree);
    return status;
}

static ebpo_status put_children(within *w, const ebpo_box *box, const ebpo_ranked *r,
                                ebpo_error *error)
{
    ebpo_ranked child[8];
    ebpo_ranking ranking = ebpo_ranking_of(w->context->model, w->band.p, NULL);
    int count = ebpo_rank_children(&ranking, &r->node, r->lower, w->band.limit, child);
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < count && status == EBPO_OK; i++)
        status = put(w, box, &child[i], error);
    return status;
}

static ebpo_status search_parts(within *w, ebpo_error *error)
{
    ebpo_context *c = w->context;
    ebpo_box box = ebpo_model_box(c->model);
    ebpo_ranked root = { ebpo_model_root(c->model), 0, 0 };
    c->queue_count = 0;
    ebpo_status status = put(w, &box, &root, error);
    while (status == EBPO_OK && c->queue_count) {
        ebpo_ranked r = ebpo_queue_pop(c);
        if (r.lower > w->band.limit)
            break;
        status = ebpo_node_is_below(&r.node) ? search_below(w, &r, error)
                                             : put_children(w, &box, &r, error);
    }
    return status;
}

/* --- band by band --- */

static bool node_matters(void *user, const ebpo_box *box, const ebpo_node *node)
{
    const within *w = user;
    ebpo_ranking ranking = ebpo_ranking_of(w->context->model, w->band.p, NULL);
    (void)box;
    return ebpo_rank_node(&ranking, node, 0) <= w->band.limit;
}

static ebpo_status search_band(within *w, uint64_t most, ebpo_error *error)
{
    const ebpo_model *m = w->context->model;
    ebpo_status status = EBPO_OK;
    ebpo_near_band_begin(&w->band, most);
    if (m->whole)
        ebpo_near_band_search(&w->band, m->whole);
    else
        status = search_parts(w, error);
    if (status == EBPO_OK && w->band.no_memory)
        status = ebpo_fail_memory(error, (w->band.count + 1) * sizeof *w->band.near);
    if (status != EBPO_OK)
        return status;
    ebpo_near_band_settle(&w->band);
    return ebpo_check_pruned(w->context, node_matters, w, error);
}

/* False: enough. */
static bool give(within *w, const ebpo_near *n)
{
    ebpo_triangle_nearest exact;
    ebpo_near_face out = { .normal = { NAN, NAN, NAN },
                           .face = n->source_face,
                           .file_face = n->file_face };
    ebpo_triangle_nearest_exact(n->p, (const double(*)[3])n->triangle, &n->bounds,
                                w->options->normals ? out.normal : NULL, &exact);
    out.distance = exact.distance;
    memcpy(out.point, exact.point, sizeof out.point);
    w->given++;
    return w->take(w->user, &out);
}

static bool give_band(within *w)
{
    for (uint64_t i = 0; i < w->band.count; i++)
        if (!give(w, &w->band.near[i]))
            return false;
    if (!w->band.cut)
        return false;
    w->band.has_after = true;
    w->band.after = w->band.near[w->band.count - 1];
    return true;
}

static ebpo_status stream(within *w, ebpo_error *error)
{
    uint64_t wanted = w->options->most ? w->options->most : UINT64_MAX,
             most = w->options->most ? BAND_MOST : FIRST_BAND;
    bool more = true;
    ebpo_status status = EBPO_OK;
    while (more && w->given < wanted && status == EBPO_OK) {
        uint64_t left = wanted - w->given;
        status = search_band(w, left < most ? left : most, error);
        more = status == EBPO_OK && give_band(w);
        most = most < BAND_MOST / BAND_GROWTH ? most * BAND_GROWTH : BAND_MOST;
    }
    return status;
}

ebpo_status ebpo_distance_within(ebpo_context *context, const double point[3],
                                 const ebpo_within_options *options, ebpo_near_fn take, void *user,
                                 ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_within_options wanted = EBPO_WITHIN_OPTIONS_INIT;
    within w = { .context = context, .options = &wanted, .take = take, .user = user };
    ebpo_status status = EBPO_TAKE(ebpo_within_options, &wanted, options, error);
    if (status == EBPO_OK && !(wanted.radius >= 0))
        status = ebpo_fail(error, EBPO_E_ARGUMENT, "radius %g: give 0 or more", wanted.radius);
    if (status == EBPO_OK)
        status = ebpo_check_points(point, 1, error);
    if (status == EBPO_OK)
        status = ebpo_check_mesh(context->model, error);
    if (status != EBPO_OK)
        return status;
    context->planes = context->model->info->pruned; /* as in ebpo_distance */
    memcpy(w.band.p, point, sizeof w.band.p);
    w.band.radius = wanted.radius;
    w.ahead = lists_ahead(&w);
    status = stream(&w, error);
    free(w.band.near);
    return status;
}
