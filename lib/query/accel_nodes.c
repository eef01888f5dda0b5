#include <string.h>

#include "query/accel.h"

static ebpo_node node_of(const ebpo_accel *s, uint32_t entry, ebpo_cell cell)
{
    ebpo_node node = ebpo_entry_node(entry, cell, (ebpo_rule)s->rule);
    node.subtree = s;
    return node;
}

ebpo_node ebpo_accel_root(const ebpo_accel *s) { return node_of(s, s->nodes.root, s->root.cell); }

ebpo_node ebpo_accel_child(const ebpo_accel *s, const ebpo_node *gray, unsigned octant)
{
    return node_of(s, ebpo_table_child(&s->nodes, gray->entry, octant),
                   ebpo_cell_child(gray->cell, octant));
}

const uint32_t *ebpo_accel_planes(const ebpo_accel *s, const ebpo_node *node, unsigned *count)
{
    uint32_t number = ebpo_entry_value(node->entry);
    *count = 0;
    if (node->type != EBPO_GRAY || !s->gray_first)
        return NULL;
    *count = s->gray_first[number + 1] - s->gray_first[number];
    return s->gray_planes + s->gray_first[number];
}

/* --- for cursors --- */

static ebpo_status children(void *holder, ebpo_node *gray, ebpo_node child[8], ebpo_error *error)
{
    (void)error;
    for (unsigned octant = 0; octant < 8 && !gray->pruned; octant++)
        child[octant] = ebpo_accel_child(holder, gray, octant);
    return EBPO_OK;
}

static ebpo_status planes(void *holder, const ebpo_node *node, uint32_t codes[EBPO_NODE_PLANES],
                          unsigned *count, ebpo_error *error)
{
    (void)error;
    const uint32_t *from = ebpo_accel_planes(holder, node, count);
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

const ebpo_node_source ebpo_accel_source = { children, planes, winding };
