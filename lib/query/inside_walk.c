/* Point in solid, node by node: EBP 2017, 4.2. */
#include "geom/strict_fp.h"

#include "base/error.h"
#include "octree/node_types.h"
#include "query/clock.h"
#include "query/inside.h"
#include "query/limited.h"
#include "query/locate.h"
#include "query/pruned.h"
#include "query/query_node.h"

static bool uses_envelopes(const ebpo_context *c, const ebpo_query_options *o)
{
    /* An envelope tells that a point is outside, not its winding number: with rules other than
     * nonzero that is no whole answer. */
    bool whole_answer =
        c->model->info->rule == EBPO_RULE_NONZERO || o->level >= 0 || o->deadline_ns;
    if (o->envelopes == EBPO_ENVELOPES_SKIP || !whole_answer)
        return false;
    return o->envelopes == EBPO_ENVELOPES_USE || !c->model->whole || o->level >= 0 ||
           o->deadline_ns;
}

static void maybe(const ebpo_model *m, const ebpo_spot *spot, ebpo_inside_result *out)
{
    *out = (ebpo_inside_result){ EBPO_MAYBE, 0, ebpo_spot_diagonal(m, spot) };
}

typedef struct asking {
    ebpo_context *context;
    const ebpo_query_options *options;
    ebpo_box box;
    bool envelopes;
    uint64_t deadline; /* 0: none */
    const double *p;
    uint32_t at[3]; /* p's cell at the deepest level */
} asking;

static bool outside_envelope(const asking *a, const ebpo_spot *spot)
{
    uint32_t count;
    const uint32_t *codes = a->envelopes ? ebpo_spot_planes(a->context->model, spot, &count) : NULL;
    return codes && ebpo_outside_planes(&a->box, spot->level, spot->at, codes, count, a->p);
}

static bool stops_here(const asking *a, const ebpo_spot *spot)
{
    const ebpo_model *m = a->context->model;
    if (a->options->level >= 0 && (spot->level >= a->options->level ||
                                   !ebpo_spot_is_gray(m, spot) || ebpo_spot_is_pruned(m, spot)))
        return true;
    return a->deadline && ebpo_clock() > a->deadline;
}

static ebpo_status walk_down(asking *a, ebpo_inside_result *out, ebpo_error *error)
{
    const ebpo_model *m = a->context->model;
    int fine = m->info->level_count - 1;
    ebpo_spot spot = ebpo_spot_root(m);
    for (;;) {
        if (ebpo_spot_is_uniform(&spot)) {
            ebpo_inside_uniform(a->context, spot.entry, out);
            return EBPO_OK;
        }
        if (outside_envelope(a, &spot)) {
            *out = (ebpo_inside_result){ EBPO_OUT, 0, 0 };
            return EBPO_OK;
        }
        if (stops_here(a, &spot)) {
            maybe(m, &spot, out);
            return EBPO_OK;
        }
        if (ebpo_spot_is_below(&spot)) {
            ebpo_status status = ebpo_spot_enter(a->context, &spot, error);
            if (status != EBPO_OK)
                return status;
            if (!a->envelopes && a->options->level < 0 && !a->deadline)
                return ebpo_inside_subtree(a->context, spot.subtree, a->at, a->p, out, error);
        }
        if (ebpo_entry_kind_of(spot.entry) == EBPO_ENTRY_LEAF)
            return ebpo_inside_leaf(a->context, spot.subtree, ebpo_entry_value(spot.entry),
                                    spot.level, spot.at, a->p, out, error);
        spot = ebpo_spot_child(m, &spot, ebpo_octant_at(a->at, fine - spot.level - 1));
    }
}

/* --- node by node from the file: only what lies on the way is read, nothing is kept but decoded
 * chunks --- */

static ebpo_status leaf_from_file(asking *a, const ebpo_place *place, ebpo_inside_result *out,
                                  ebpo_error *error)
{
    ebpo_model *m = a->context->model;
    ebpo_slice slice;
    ebpo_subtree *subtree;
    ebpo_status status = ebpo_model_has_room(m, place, error);
    if (status == EBPO_OK)
        status = ebpo_slice_read(&slice, m->chunks, place, error);
    if (status == EBPO_OK)
        status = ebpo_subtree_make(&subtree, &slice, m->info, false, 1, error);
    if (status == EBPO_OK) {
        status = ebpo_inside_leaf(a->context, subtree, ebpo_entry_value(subtree->nodes.root),
                                  place->level, place->at, a->p, out, error);
        ebpo_subtree_free(subtree);
    }
    return status;
}

static ebpo_status settled_from_file(asking *a, const ebpo_place *place, ebpo_inside_result *out,
                                     ebpo_error *error)
{
    int32_t winding;
    ebpo_status status = ebpo_place_winding(a->context->model->chunks, place, &winding, error);
    if (status == EBPO_OK)
        *out = (ebpo_inside_result){ ebpo_rule_inside(a->context->model->info->rule, winding)
                                         ? EBPO_IN
                                         : EBPO_OUT,
                                     winding, 0 };
    return status;
}

static ebpo_status step_down(const asking *a, ebpo_place *place, ebpo_error *error)
{
    uint16_t types;
    uint64_t ranks[4];
    ebpo_status status =
        ebpo_place_children(a->context->model->chunks, place, &types, ranks, error);
    if (status != EBPO_OK)
        return status;
    place->pruned = a->context->model->info->pruned && types == 0;
    if (place->pruned)
        return EBPO_OK;
    unsigned octant =
        ebpo_octant_at(a->at, a->context->model->info->level_count - 1 - place->level - 1);
    place->type = ebpo_group_type(types, octant);
    place->rank = ranks[place->type] + ebpo_group_count(types, place->type, octant);
    place->level++;
    for (int k = 0; k < 3; k++)
        place->at[k] = 2 * place->at[k] + (octant >> k & 1);
    return EBPO_OK;
}

/* From a spot BELOW on. */
static ebpo_status walk_file(asking *a, const ebpo_spot *spot, ebpo_inside_result *out,
                             ebpo_error *error)
{
    const ebpo_model *m = a->context->model;
    ebpo_place place = m->top->below[ebpo_entry_value(spot->entry)];
    ebpo_status status = EBPO_OK;
    while (place.type == EBPO_GRAY) {
        uint32_t codes[255], count = 0;
        if (a->envelopes)
            status = ebpo_place_planes(m->chunks, &place, codes, &count, error);
        if (status != EBPO_OK)
            return status;
        if (ebpo_outside_planes(&a->box, place.level, place.at, codes, count, a->p)) {
            *out = (ebpo_inside_result){ EBPO_OUT, 0, 0 };
            return EBPO_OK;
        }
        ebpo_spot here = { NULL, 0, place.level, { place.at[0], place.at[1], place.at[2] } };
        if ((a->options->level >= 0 && (place.level >= a->options->level || place.pruned)) ||
            (a->deadline && ebpo_clock() > a->deadline)) {
            maybe(m, &here, out);
            return EBPO_OK;
        }
        if (place.pruned)
            return ebpo_fail_pruned(m, place.level, place.at, error);
        status = step_down(a, &place, error);
        if (status != EBPO_OK)
            return status;
    }
    ebpo_spot here = { NULL, 0, place.level, { place.at[0], place.at[1], place.at[2] } };
    if (place.type == EBPO_LEAF &&
        (a->options->level >= 0 || (a->deadline && ebpo_clock() > a->deadline))) {
        maybe(m, &here, out);
        return EBPO_OK;
    }
    return place.type == EBPO_LEAF ? leaf_from_file(a, &place, out, error)
                                   : settled_from_file(a, &place, out, error);
}

static ebpo_status walk_nodes(asking *a, ebpo_inside_result *out, ebpo_error *error)
{
    const ebpo_model *m = a->context->model;
    int fine = m->info->level_count - 1;
    ebpo_spot spot = ebpo_spot_root(m);
    while (!ebpo_spot_is_below(&spot)) {
        if (ebpo_spot_is_uniform(&spot)) {
            ebpo_inside_uniform(a->context, spot.entry, out);
            return EBPO_OK;
        }
        if (outside_envelope(a, &spot)) {
            *out = (ebpo_inside_result){ EBPO_OUT, 0, 0 };
            return EBPO_OK;
        }
        if (stops_here(a, &spot)) {
            maybe(m, &spot, out);
            return EBPO_OK;
        }
        spot = ebpo_spot_child(m, &spot, ebpo_octant_at(a->at, fine - spot.level - 1));
    }
    return walk_file(a, &spot, out, error);
}

/* The subtree that is in the context's hands and holds p, or NULL; *entry: what the levels above
 * say, when they settle it. */
static const ebpo_subtree *held_around(const asking *a, uint32_t *entry)
{
    const ebpo_context *c = a->context;
    *entry = ebpo_entry(EBPO_ENTRY_BELOW, 0);
    if (c->model->whole)
        return c->model->whole;
    const ebpo_nodes *nodes = &c->model->top->nodes;
    int fine = c->model->info->level_count - 1, level = 0;
    *entry = nodes->root;
    while (ebpo_entry_kind_of(*entry) == EBPO_ENTRY_GRAY) {
        level++;
        *entry = nodes->group[ebpo_entry_value(*entry)][ebpo_octant_at(a->at, fine - level)];
    }
    bool below = ebpo_entry_kind_of(*entry) == EBPO_ENTRY_BELOW;
    return below && c->pinned && c->pinned_key == ebpo_entry_value(*entry) ? c->pinned : NULL;
}

/* True when everything that p needs is in the context's hands: then envelopes save nothing, and
 * only the faces of a leaf take time. */
static bool answer_at_hand(asking *a, ebpo_inside_result *out, ebpo_status *status,
                           ebpo_error *error)
{
    const ebpo_model *m = a->context->model;
    uint32_t entry;
    const ebpo_subtree *held = held_around(a, &entry);
    *status = EBPO_OK;
    if (ebpo_entry_kind_of(entry) == EBPO_ENTRY_UNIFORM) {
        ebpo_inside_uniform(a->context, entry, out);
        return true;
    }
    if (!held)
        return false;
    if (!a->deadline) {
        *status = ebpo_inside_subtree(a->context, held, a->at, a->p, out, error);
        return true;
    }
    int level, fine = m->info->level_count - 1;
    entry = ebpo_descend(&held->nodes, fine, a->at, &level);
    if (ebpo_entry_kind_of(entry) == EBPO_ENTRY_BELOW)
        return false; /* pruned: envelopes may tell */
    ebpo_spot spot = { held,
                       entry,
                       level,
                       { a->at[0] >> (fine - level), a->at[1] >> (fine - level),
                         a->at[2] >> (fine - level) } };
    if (ebpo_entry_kind_of(entry) == EBPO_ENTRY_UNIFORM)
        ebpo_inside_uniform(a->context, entry, out);
    else if (ebpo_clock() > a->deadline)
        maybe(m, &spot, out);
    else
        *status = ebpo_inside_leaf(a->context, held, ebpo_entry_value(entry), level, spot.at, a->p,
                                   out, error);
    return true;
}

ebpo_status ebpo_inside_pruned(ebpo_context *context, const double p[3], ebpo_inside_result *out,
                               ebpo_error *error)
{
    const ebpo_model *m = context->model;
    ebpo_query_options options = EBPO_QUERY_OPTIONS_INIT;
    asking a = {
        .context = context, .options = &options, .box = ebpo_model_box(m), .envelopes = true, .p = p
    };
    if (!ebpo_locate(&a.box, m->info->level_count - 1, p, a.at))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "a point outside the root cell has no node");
    ebpo_status status = walk_down(&a, out, error);
    if (status == EBPO_OK && out->where == EBPO_OUT &&
        m->info->rule != EBPO_RULE_NONZERO) /* outside, but the winding number is not known */
        return ebpo_fail_pruned(m, 0, (const uint32_t[3]){ 0, 0, 0 }, error);
    return status;
}

ebpo_status ebpo_inside_walk(ebpo_context *context, const double p[3],
                             const ebpo_query_options *options, ebpo_inside_result *out,
                             ebpo_error *error)
{
    const ebpo_model *m = context->model;
    asking a = { .context = context,
                 .options = options,
                 .box = ebpo_model_box(m),
                 .envelopes = uses_envelopes(context, options),
                 .p = p };
    if (options->deadline_ns)
        a.deadline = ebpo_clock() + options->deadline_ns;
    if (!ebpo_locate(&a.box, m->info->level_count - 1, p, a.at)) {
        *out = (ebpo_inside_result){ EBPO_OUT, 0, 0 };
        return EBPO_OK;
    }
    ebpo_status status;
    bool plain = options->envelopes != EBPO_ENVELOPES_USE && options->level < 0;
    if (plain && (m->whole || m->options.loading != EBPO_LOAD_NODES) &&
        answer_at_hand(&a, out, &status, error))
        return status;
    return !m->whole && m->options.loading == EBPO_LOAD_NODES ? walk_nodes(&a, out, error)
                                                              : walk_down(&a, out, error);
}
