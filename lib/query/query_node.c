#include "geom/strict_fp.h"

#include "query/query_node.h"

#include <math.h>

#include "octree/rule.h"
#include "query/pruned.h"

static const ebpo_node_table *table_of(const ebpo_model *model, const ebpo_node *node)
{
    return node->subtree ? &node->subtree->nodes : &model->top->nodes;
}

/* What an entry says beside itself. */
static void fill_in(const ebpo_model *model, ebpo_node *node)
{
    const ebpo_node *below;
    switch (ebpo_entry_kind_of(node->entry)) {
    case EBPO_ENTRY_UNIFORM:
        node->type = ebpo_rule_inside(model->info->rule, ebpo_entry_winding(node->entry))
                         ? EBPO_BLACK
                         : EBPO_WHITE;
        break;
    case EBPO_ENTRY_LEAF: node->type = EBPO_LEAF; break;
    case EBPO_ENTRY_GRAY: node->type = EBPO_GRAY; break;
    case EBPO_ENTRY_BELOW:
        below = node->subtree ? NULL : &model->top->below[ebpo_entry_value(node->entry)];
        node->type = below ? below->type : EBPO_GRAY;
        node->pruned = !below || below->pruned;
        break;
    }
}

ebpo_node ebpo_model_root(const ebpo_model *model)
{
    ebpo_node root = { .subtree = model->whole };
    root.entry = table_of(model, &root)->root;
    fill_in(model, &root);
    return root;
}

ebpo_node ebpo_model_child(const ebpo_model *model, const ebpo_node *gray, unsigned octant)
{
    ebpo_node child = { .cell = ebpo_cell_child(gray->cell, octant), .subtree = gray->subtree };
    child.entry = ebpo_table_child(table_of(model, gray), gray->entry, octant);
    fill_in(model, &child);
    return child;
}

ebpo_status ebpo_model_enter(ebpo_context *context, ebpo_node *node, ebpo_error *error)
{
    ebpo_subtree *subtree;
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
    if (!node->subtree && (below || node->type == EBPO_GRAY)) {
        ebpo_top_planes planes = below ? model->top->below_planes[value] : model->top->gray[value];
        *count = planes.count;
        return model->top->planes + planes.first;
    }
    if (node->type != EBPO_GRAY || !node->subtree->gray_first)
        return NULL;
    *count = node->subtree->gray_first[value + 1] - node->subtree->gray_first[value];
    return node->subtree->gray_planes + node->subtree->gray_first[value];
}

double ebpo_model_lower_bound(const ebpo_model *m, const ebpo_box *box, const ebpo_node *node,
                              double parent, const double p[3])
{
    uint32_t count;
    const uint32_t *codes = ebpo_model_planes(m, node, &count);
    return fmax(parent, ebpo_envelope_distance(box, node->cell, codes, count, p));
}

int ebpo_rank_children(const ebpo_model *m, const ebpo_box *box, const ebpo_node *gray,
                       double parent, const double p[3], ebpo_ranked out[8])
{
    int count = 0;
    for (unsigned octant = 0; octant < 8; octant++) {
        ebpo_ranked r = { ebpo_model_child(m, gray, octant), 0 };
        if (ebpo_node_is_uniform(&r.node))
            continue;
        r.lower = ebpo_model_lower_bound(m, box, &r.node, parent, p);
        int at = count++;
        for (; at > 0 && out[at - 1].lower > r.lower; at--)
            out[at] = out[at - 1];
        out[at] = r;
    }
    return count;
}
