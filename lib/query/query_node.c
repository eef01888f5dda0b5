/* Goes from a node of a model to its children, in the top of the tree (levels 0 to the cut level)
 * and in subtrees. Computes bounds of distances with the envelopes of nodes.
 *
 * Cursors (geometry/cursor.h) get nodes from an accel (the nodes of one subtree, accel.h) or from a
 * context (the nodes of the model; a context loads subtrees on demand). Nodes of a subtree are
 * valid until the context enters another subtree.
 *
 * In a subset, nodes may be pruned: the file omits their children. A query that needs an omitted
 * part fails with EBPO_E_ABSENT, and the message gives the position and how the file was cut. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/error.h"
#include "format/reader.h"
#include "query/accel.h"
#include "query/query_node.h"

/* Returns the node of a subtree for an entry of its table. */
static ebpo_node accel_node_of(const ebpo_accel *s, uint32_t entry, ebpo_cell cell)
{
    ebpo_node node = ebpo_entry_node(entry, cell, (ebpo_rule)s->rule);
    node.subtree = s;
    return node;
}

ebpo_node ebpo_accel_root(const ebpo_accel *s)
{
    return accel_node_of(s, s->nodes.root, s->root.cell);
}

ebpo_node ebpo_accel_child(const ebpo_accel *s, const ebpo_node *gray, unsigned octant)
{
    return accel_node_of(s, ebpo_table_child(&s->nodes, gray->entry, octant),
                         ebpo_cell_child(gray->cell, octant));
}

/* Returns the codes of a gray node's planes, if the subtree has kept them. */
static const uint32_t *accel_planes(const ebpo_accel *s, const ebpo_node *node, unsigned *count)
{
    uint32_t group = ebpo_entry_value(node->entry);
    *count = 0;
    if (node->type != EBPO_GRAY || !s->gray_first)
        return NULL;
    *count = s->gray_first[group + 1] - s->gray_first[group];
    return s->gray_planes + s->gray_first[group];
}

/* --- nodes of a subtree, for cursors --- */

static ebpo_status accel_children(void *holder, ebpo_node *gray, ebpo_node child[8],
                                  ebpo_error *error)
{
    (void)error;
    for (unsigned octant = 0; octant < 8 && !gray->pruned; octant++)
        child[octant] = ebpo_accel_child(holder, gray, octant);
    return EBPO_OK;
}

static ebpo_status copy_accel_planes(void *holder, const ebpo_node *node,
                                     uint32_t codes[EBPO_NODE_PLANES], unsigned *count,
                                     ebpo_error *error)
{
    (void)error;
    const uint32_t *from = accel_planes(holder, node, count);
    if (*count)
        memcpy(codes, from, *count * sizeof *codes);
    return EBPO_OK;
}

static ebpo_status uniform_winding(void *holder, const ebpo_node *uniform, int32_t *out,
                                   ebpo_error *error)
{
    (void)holder;
    (void)error;
    *out = ebpo_entry_winding(uniform->entry);
    return EBPO_OK;
}

const ebpo_node_source ebpo_accel_source = { accel_children, copy_accel_planes, uniform_winding };

/* Returns the node for an entry of the table of the tree's top. */
static ebpo_node top_node_of(const ebpo_model *model, uint32_t entry, ebpo_cell cell)
{
    ebpo_node node = ebpo_entry_node(entry, cell, model->info->rule);
    if (ebpo_node_is_subtree_root(&node)) {
        const ebpo_node *below = &model->top->below[ebpo_entry_value(entry)];
        node.type = below->type;
        node.pruned = below->pruned;
    }
    return node;
}

ebpo_node ebpo_model_root(const ebpo_model *model)
{
    return model->whole ? ebpo_accel_root(model->whole)
                        : top_node_of(model, model->top->nodes.root, (ebpo_cell){ 0, { 0, 0, 0 } });
}

ebpo_node ebpo_model_child(const ebpo_model *model, const ebpo_node *gray, unsigned octant)
{
    return gray->subtree
               ? ebpo_accel_child(gray->subtree, gray, octant)
               : top_node_of(model, ebpo_table_child(&model->top->nodes, gray->entry, octant),
                             ebpo_cell_child(gray->cell, octant));
}

ebpo_status ebpo_model_enter(ebpo_context *context, ebpo_node *node, ebpo_error *error)
{
    ebpo_accel *subtree;
    if (node->pruned)
        return ebpo_fail_pruned(context->model, node->cell, error);
    ebpo_status status =
        ebpo_context_subtree(context, ebpo_entry_value(node->entry), &subtree, error);
    if (status != EBPO_OK)
        return status;
    node->subtree = subtree;
    node->entry = subtree->nodes.root;
    /* In the table of a loaded subtree, the kind SUBTREE_ROOT marks pruned nodes. */
    if (ebpo_node_is_subtree_root(node))
        return ebpo_fail_pruned(context->model, node->cell, error);
    return EBPO_OK;
}

const uint32_t *ebpo_model_planes(const ebpo_model *model, const ebpo_node *node, uint32_t *count)
{
    uint32_t value = ebpo_entry_value(node->entry);
    bool below = ebpo_node_is_subtree_root(node);
    *count = 0;
    if (node->subtree)
        return accel_planes(node->subtree, node, count);
    if (!below && node->type != EBPO_GRAY)
        return NULL;
    ebpo_top_planes planes = below ? model->top->below_planes[value] : model->top->gray[value];
    *count = planes.count;
    return model->top->planes + planes.first;
}

double ebpo_rank_cell(const ebpo_ranking *r, ebpo_cell cell, const uint32_t *codes, uint32_t count,
                      double enough)
{
    return r->far ? ebpo_far_envelope(r->far, &r->box, cell, codes, count, enough)
                  : ebpo_envelope_distance(&r->box, cell, codes, count, r->p, enough);
}

double ebpo_rank_cell_end(const ebpo_ranking *r, ebpo_cell cell)
{
    return r->far ? ebpo_far_cell_end(r->far, &r->box, cell) : ebpo_cell_far(&r->box, cell, r->p);
}

/* Does the same as ebpo_rank_node, but once a bound is beyond `enough`, no better bound is searched
 * for. */
static double bound_until(const ebpo_ranking *r, const ebpo_node *node, double parent,
                          double enough)
{
    uint32_t count;
    const uint32_t *codes = ebpo_model_planes(r->model, node, &count);
    return fmax(parent, ebpo_rank_cell(r, node->cell, codes, count, enough));
}

double ebpo_rank_node(const ebpo_ranking *r, const ebpo_node *node, double parent)
{
    return bound_until(r, node, parent, INFINITY);
}

double ebpo_rank_root(const ebpo_ranking *r)
{
    ebpo_node root = ebpo_model_root(r->model);
    return ebpo_rank_node(r, &root, r->far ? -INFINITY : 0);
}

int ebpo_rank_children(const ebpo_ranking *ranking, const ebpo_node *gray, double parent,
                       double limit, ebpo_ranked out[8])
{
    const ebpo_model *m = ranking->model;
    const ebpo_node_table *table = gray->subtree ? &gray->subtree->nodes : &m->top->nodes;
    int count = 0;
    for (unsigned octant = 0; octant < 8; octant++) {
        /* Most children are white or black. No ebpo_node is made for these. */
        if (ebpo_entry_kind_of(ebpo_table_child(table, gray->entry, octant)) == EBPO_ENTRY_UNIFORM)
            continue;
        ebpo_ranked r = { ebpo_model_child(m, gray, octant), 0, 0 };
        r.lower = bound_until(ranking, &r.node, parent, limit);
        if (r.lower > limit)
            continue;
        int at = count++;
        for (; at > 0 && out[at - 1].lower > r.lower; at--)
            out[at] = out[at - 1];
        out[at] = r;
    }
    return count;
}

/* --- nodes of a model, for cursors --- */

static ebpo_status model_children(void *holder, ebpo_node *gray, ebpo_node child[8],
                                  ebpo_error *error)
{
    ebpo_context *context = holder;
    ebpo_status status = EBPO_OK;
    if (gray->pruned)
        return EBPO_OK;
    context->content = EBPO_ACCEL_PLANES; /* cursors may request planes */
    if (ebpo_node_is_subtree_root(gray))
        status = ebpo_model_enter(context, gray, error);
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++)
        child[octant] = ebpo_model_child(context->model, gray, octant);
    return status;
}

static ebpo_status copy_model_planes(void *holder, const ebpo_node *node,
                                     uint32_t codes[EBPO_NODE_PLANES], unsigned *count,
                                     ebpo_error *error)
{
    const ebpo_context *context = holder;
    (void)error;
    const uint32_t *from = ebpo_model_planes(context->model, node, count);
    if (*count)
        memcpy(codes, from, *count * sizeof *codes);
    return EBPO_OK;
}

const ebpo_node_source ebpo_context_source = { model_children, copy_model_planes, uniform_winding };

/* Describes in words how the subset was made. */
static void describe_cut(const ebpo_info *info, char *out, size_t capacity)
{
    const double *b = info->kept_box;
    size_t used = 0;
    out[0] = 0;
    if (info->cut_levels)
        used = (size_t)snprintf(out, capacity, "the file was cut to levels 0 to %d",
                                info->cut_levels - 1);
    if (info->boxed && used < capacity)
        snprintf(out + used, capacity - used, "%s %.9g,%.9g,%.9g to %.9g,%.9g,%.9g",
                 used ? " and to the box" : "the file was cut to the box", b[0], b[1], b[2], b[3],
                 b[4], b[5]);
    used = strlen(out);
    if (info->kept_error > 0 && used < capacity)
        snprintf(out + used, capacity - used, "%s %.9g",
                 used ? " and to an error of" : "the file was cut to an error of",
                 info->kept_error);
    if (!out[0])
        snprintf(out, capacity, "the file is a part of another file");
}

ebpo_status ebpo_fail_pruned(const ebpo_model *model, ebpo_cell cell, ebpo_error *error)
{
    char cut[200];
    ebpo_box box = ebpo_model_box(model);
    describe_cut(model->info, cut, sizeof cut);
    return ebpo_fail(
        error, EBPO_E_ABSENT,
        "%.120s: the file omits nodes that the query needs, below level %d at %.6g %.6g %.6g "
        "(%s); query with a level (--max-level), or make a larger part of the original "
        "with `ebpo subset` or `ebpo fetch`",
        model->file->in.shown, cell.level, ebpo_cell_face(&box, 0, cell.level, cell.at[0]),
        ebpo_cell_face(&box, 1, cell.level, cell.at[1]),
        ebpo_cell_face(&box, 2, cell.level, cell.at[2]), cut);
}

/* The arguments of ebpo_check_pruned. */
typedef struct checking {
    ebpo_context *context;
    ebpo_matters_fn matters;
    void *user;
    ebpo_box box;
} checking;

/* Visits `node` and its descendants. Does not visit the descendants of a node for which `matters`
 * is false. Fails at the first pruned node. */
static ebpo_status check_below(const checking *k, ebpo_node node, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    if (ebpo_node_is_uniform(&node) || node.type != EBPO_GRAY ||
        !k->matters(k->user, &k->box, &node))
        return EBPO_OK;
    if (ebpo_node_is_subtree_root(&node)) /* ebpo_model_enter fails if the node is pruned */
        status = ebpo_model_enter(k->context, &node, error);
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++)
        status = check_below(k, ebpo_model_child(k->context->model, &node, octant), error);
    return status;
}

ebpo_status ebpo_check_pruned(ebpo_context *context, ebpo_matters_fn matters, void *user,
                              ebpo_error *error)
{
    if (!context->model->info->pruned)
        return EBPO_OK;
    checking k = { context, matters, user, ebpo_model_box(context->model) };
    return check_below(&k, ebpo_model_root(context->model), error);
}
