/* Point in solid, node by node: EBP 2017, 4.2. */
#include "core/strict_fp.h"

#include "core/error.h"
#include "core/clock.h"
#include "geometry/cursor.h"
#include "geometry/node_types.h"
#include "query/inside.h"
#include "query/limited.h"
#include "query/query_node.h"

static bool uses_envelopes(const ebpo_context *c, const ebpo_inside_options *o)
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

typedef struct asking {
    ebpo_context *context;
    const ebpo_inside_options *options;
    ebpo_box box;
    bool envelopes;
    uint64_t deadline; /* 0: none */
    const double *p;
    ebpo_position place;
} asking;

static void maybe(const asking *a, ebpo_cell cell, ebpo_inside_result *out)
{
    *out = (ebpo_inside_result){ EBPO_MAYBE, 0, ebpo_cell_diagonal(&a->box, cell) };
}

static bool outside_envelope(const asking *a, const ebpo_node *node)
{
    uint32_t count;
    const uint32_t *codes =
        a->envelopes ? ebpo_model_planes(a->context->model, node, &count) : NULL;
    return codes && ebpo_outside_planes(&a->box, node->cell, codes, count, a->p);
}

static bool stops_here(const asking *a, const ebpo_node *node)
{
    if (a->options->level >= 0 &&
        (node->cell.level >= a->options->level || node->type != EBPO_GRAY || node->pruned))
        return true;
    return a->deadline && ebpo_clock() > a->deadline;
}

static ebpo_status walk_down(asking *a, ebpo_inside_result *out, ebpo_error *error)
{
    const ebpo_model *m = a->context->model;
    int fine = m->info->level_count - 1;
    ebpo_node node = ebpo_model_root(m);
    for (;;) {
        if (ebpo_node_is_uniform(&node)) {
            ebpo_inside_uniform(a->context, node.entry, out);
            return EBPO_OK;
        }
        if (outside_envelope(a, &node)) {
            *out = (ebpo_inside_result){ EBPO_OUT, 0, 0 };
            return EBPO_OK;
        }
        if (stops_here(a, &node)) {
            maybe(a, node.cell, out);
            return EBPO_OK;
        }
        if (ebpo_node_is_below(&node)) {
            ebpo_status status = ebpo_model_enter(a->context, &node, error);
            if (status != EBPO_OK)
                return status;
            if (!a->envelopes && a->options->level < 0 && !a->deadline)
                return ebpo_inside_subtree(a->context, node.subtree, &a->place, a->p, out, error);
        }
        if (ebpo_entry_kind_of(node.entry) == EBPO_ENTRY_LEAF)
            return ebpo_inside_leaf(a->context, node.subtree, ebpo_entry_value(node.entry),
                                    node.cell.level, &a->place, a->p, out, error);
        node = ebpo_model_child(m, &node, ebpo_octant_at(a->place.at, fine - node.cell.level - 1));
    }
}

/* --- node by node from the file: only what lies on the way is read, nothing is kept but decoded
 * chunks --- */

static ebpo_status leaf_from_file(asking *a, const ebpo_node *leaf, ebpo_inside_result *out,
                                  ebpo_error *error)
{
    ebpo_model *m = a->context->model;
    ebpo_slice slice;
    ebpo_accel *subtree;
    ebpo_status status = ebpo_model_has_room(m, leaf, error);
    if (status == EBPO_OK)
        status = ebpo_slice_read(&slice, m->chunks, leaf, error);
    if (status == EBPO_OK)
        status = ebpo_accel_make(&subtree, &slice, m->info, false, 1, error);
    if (status == EBPO_OK) {
        ebpo_model_count_leaves(m, subtree, 1);
        status = ebpo_inside_leaf(a->context, subtree, ebpo_entry_value(subtree->nodes.root),
                                  leaf->cell.level, &a->place, a->p, out, error);
        ebpo_model_count_leaves(m, subtree, -1);
        ebpo_accel_free(subtree);
    }
    return status;
}

static ebpo_status uniform_from_file(asking *a, const ebpo_node *node, ebpo_inside_result *out,
                                     ebpo_error *error)
{
    int32_t winding;
    ebpo_status status = ebpo_chunks_winding(a->context->model->chunks, node, &winding, error);
    if (status == EBPO_OK)
        *out = (ebpo_inside_result){ ebpo_rule_inside(a->context->model->info->rule, winding)
                                         ? EBPO_IN
                                         : EBPO_OUT,
                                     winding, 0 };
    return status;
}

static bool is_late(const asking *a) { return a->deadline && ebpo_clock() > a->deadline; }

/* A gray node on the way; *done when it answers. Whether it is pruned is known once its
 * children have been asked for. */
static ebpo_status pass_gray(asking *a, ebpo_cursor *c, bool *done, ebpo_inside_result *out,
                             ebpo_error *error)
{
    const ebpo_model *m = a->context->model;
    const ebpo_node *node = ebpo_cursor_node(c), *child;
    uint32_t codes[EBPO_NODE_PLANES];
    unsigned count = 0;
    ebpo_status status = EBPO_OK;
    *done = true;
    if (a->envelopes)
        status = ebpo_cursor_planes(c, codes, &count, error);
    if (status != EBPO_OK)
        return status;
    if (ebpo_outside_planes(&a->box, node->cell, codes, count, a->p)) {
        *out = (ebpo_inside_result){ EBPO_OUT, 0, 0 };
        return EBPO_OK;
    }
    bool limited = a->options->level >= 0;
    if ((limited && (node->cell.level >= a->options->level || node->pruned)) || is_late(a)) {
        maybe(a, node->cell, out);
        return EBPO_OK;
    }
    status = ebpo_cursor_children(c, &child, error);
    if (status != EBPO_OK)
        return status;
    *done = !child;
    if (child)
        ebpo_cursor_down(c,
                         ebpo_octant_at(a->place.at, m->info->level_count - 2 - node->cell.level));
    else if (limited || is_late(a))
        maybe(a, node->cell, out);
    else
        status = ebpo_fail_pruned(m, node->cell, error);
    return status;
}

/* From a node BELOW on. */
static ebpo_status walk_file(asking *a, const ebpo_node *below, ebpo_inside_result *out,
                             ebpo_error *error)
{
    const ebpo_model *m = a->context->model;
    ebpo_cursor c;
    ebpo_cursor_begin(&c, &ebpo_chunks_source, m->chunks,
                      m->top->below[ebpo_entry_value(below->entry)]);
    while (ebpo_cursor_node(&c)->type == EBPO_GRAY) {
        bool done;
        ebpo_status status = pass_gray(a, &c, &done, out, error);
        if (status != EBPO_OK || done)
            return status;
    }
    const ebpo_node *node = ebpo_cursor_node(&c);
    if (node->type == EBPO_LEAF && (a->options->level >= 0 || is_late(a))) {
        maybe(a, node->cell, out);
        return EBPO_OK;
    }
    return node->type == EBPO_LEAF ? leaf_from_file(a, node, out, error)
                                   : uniform_from_file(a, node, out, error);
}

static ebpo_status walk_nodes(asking *a, ebpo_inside_result *out, ebpo_error *error)
{
    const ebpo_model *m = a->context->model;
    int fine = m->info->level_count - 1;
    ebpo_node node = ebpo_model_root(m);
    while (!ebpo_node_is_below(&node)) {
        if (ebpo_node_is_uniform(&node)) {
            ebpo_inside_uniform(a->context, node.entry, out);
            return EBPO_OK;
        }
        if (outside_envelope(a, &node)) {
            *out = (ebpo_inside_result){ EBPO_OUT, 0, 0 };
            return EBPO_OK;
        }
        if (stops_here(a, &node)) {
            maybe(a, node.cell, out);
            return EBPO_OK;
        }
        node = ebpo_model_child(m, &node, ebpo_octant_at(a->place.at, fine - node.cell.level - 1));
    }
    return walk_file(a, &node, out, error);
}

/* The subtree that is in the context's hands and holds p, or NULL; *entry: what the levels above
 * say, when they decide it. */
static const ebpo_accel *held_around(const asking *a, uint32_t *entry)
{
    const ebpo_context *c = a->context;
    *entry = ebpo_entry(EBPO_ENTRY_BELOW, 0);
    if (c->model->whole)
        return c->model->whole;
    *entry =
        ebpo_descend(&c->model->top->nodes, c->model->info->level_count - 1, a->place.at).entry;
    bool below = ebpo_entry_kind_of(*entry) == EBPO_ENTRY_BELOW;
    return below && ebpo_context_has_pinned(c, ebpo_entry_value(*entry)) ? c->pinned : NULL;
}

/* True when everything that p needs is in the context's hands: then envelopes save nothing, and
 * only the faces of a leaf take time. */
static bool answer_at_hand(asking *a, ebpo_inside_result *out, ebpo_status *status,
                           ebpo_error *error)
{
    const ebpo_model *m = a->context->model;
    uint32_t entry;
    const ebpo_accel *held = held_around(a, &entry);
    *status = EBPO_OK;
    if (ebpo_entry_kind_of(entry) == EBPO_ENTRY_UNIFORM) {
        ebpo_inside_uniform(a->context, entry, out);
        return true;
    }
    if (!held)
        return false;
    if (!a->deadline) {
        *status = ebpo_inside_subtree(a->context, held, &a->place, a->p, out, error);
        return true;
    }
    int fine = m->info->level_count - 1;
    ebpo_descent d = ebpo_descend(&held->nodes, fine, a->place.at);
    if (ebpo_entry_kind_of(d.entry) == EBPO_ENTRY_BELOW)
        return false; /* pruned: envelopes may tell */
    ebpo_cell cell = ebpo_descent_cell(&d, fine, a->place.at);
    if (ebpo_entry_kind_of(d.entry) == EBPO_ENTRY_UNIFORM)
        ebpo_inside_uniform(a->context, d.entry, out);
    else if (ebpo_clock() > a->deadline)
        maybe(a, cell, out);
    else
        *status = ebpo_inside_leaf(a->context, held, ebpo_entry_value(d.entry), d.level, &a->place,
                                   a->p, out, error);
    return true;
}

ebpo_status ebpo_inside_pruned(ebpo_context *context, const double p[3], ebpo_inside_result *out,
                               ebpo_error *error)
{
    const ebpo_model *m = context->model;
    ebpo_inside_options options = EBPO_INSIDE_OPTIONS_INIT;
    asking a = {
        .context = context, .options = &options, .box = ebpo_model_box(m), .envelopes = true, .p = p
    };
    if (!ebpo_locator_find(&m->locator, p, &a.place))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "a point outside the root cell has no node");
    ebpo_status status = walk_down(&a, out, error);
    if (status == EBPO_OK && out->where == EBPO_OUT &&
        m->info->rule != EBPO_RULE_NONZERO) /* outside, but the winding number is not known */
        return ebpo_fail_pruned(m, (ebpo_cell){ 0, { 0, 0, 0 } }, error);
    return status;
}

ebpo_status ebpo_inside_walk(ebpo_context *context, const double p[3],
                             const ebpo_inside_options *options, ebpo_inside_result *out,
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
    if (!ebpo_locator_find(&m->locator, p, &a.place)) {
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
