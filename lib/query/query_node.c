#include "core/strict_fp.h"

#include "query/query_node.h"

#include <math.h>
#include <string.h>


/* A node of the top. */
static ebpo_node node_of(const ebpo_model *model, uint32_t entry, ebpo_cell cell)
{
    ebpo_node node = ebpo_entry_node(entry, cell, model->info->rule);
    if (ebpo_node_is_below(&node)) {
        const ebpo_node *below = &model->top->below[ebpo_entry_value(entry)];
        node.type = below->type;
        node.pruned = below->pruned;
    }
    return node;
}

ebpo_node ebpo_model_root(const ebpo_model *model)
{
    return model->whole ? ebpo_accel_root(model->whole)
                        : node_of(model, model->top->nodes.root, (ebpo_cell){ 0, { 0, 0, 0 } });
}

ebpo_node ebpo_model_child(const ebpo_model *model, const ebpo_node *gray, unsigned octant)
{
    return gray->subtree ? ebpo_accel_child(gray->subtree, gray, octant)
                         : node_of(model, ebpo_table_child(&model->top->nodes, gray->entry, octant),
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
    if (ebpo_node_is_below(node)) /* a file whose counts do not tell of it */
        return ebpo_fail_pruned(context->model, node->cell, error);
    return EBPO_OK;
}

const uint32_t *ebpo_model_planes(const ebpo_model *model, const ebpo_node *node, uint32_t *count)
{
    uint32_t value = ebpo_entry_value(node->entry);
    bool below = ebpo_node_is_below(node);
    *count = 0;
    if (node->subtree)
        return ebpo_accel_planes(node->subtree, node, count);
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
        /* most are uniform: nothing is made of them */
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

/* --- for cursors --- */

static ebpo_status children(void *holder, ebpo_node *gray, ebpo_node child[8], ebpo_error *error)
{
    ebpo_context *context = holder;
    ebpo_status status = EBPO_OK;
    if (gray->pruned)
        return EBPO_OK;
    context->planes = true; /* cursors may ask for them */
    if (ebpo_node_is_below(gray))
        status = ebpo_model_enter(context, gray, error);
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++)
        child[octant] = ebpo_model_child(context->model, gray, octant);
    return status;
}

static ebpo_status planes(void *holder, const ebpo_node *node, uint32_t codes[EBPO_NODE_PLANES],
                          unsigned *count, ebpo_error *error)
{
    const ebpo_context *context = holder;
    (void)error;
    const uint32_t *from = ebpo_model_planes(context->model, node, count);
    if (*count)
        memcpy(codes, from, *count * sizeof *codes);
    return EBPO_OK;
}

static ebpo_status winding(void *holder, const ebpo_node *uniform, int32_t *out, ebpo_error *error)
{
    (void)holder;
    (void)error;
    *out = ebpo_entry_winding(uniform->entry);
    return EBPO_OK;
}

const ebpo_node_source ebpo_context_source = { children, planes, winding };
