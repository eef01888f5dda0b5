#include "core/strict_fp.h"

#include "query/modes.h"

#include <math.h>

#include "core/alloc.h"
#include "core/error.h"
#include "geometry/plane_clip.h"
#include "geometry/polytope.h"
#include "levels/lod_model.h"
#include "query/inside.h"
#include "query/limited.h"
#include "query/nearest.h"
#include "query/query_node.h"
#include "query/query_model.h"

static const ebpo_distance_result nothing = { INFINITY,          0,           INFINITY,
                                              { NAN, NAN, NAN }, { 0, 0, 0 }, EBPO_NO_FACE };

static ebpo_status all_leaves(ebpo_context *c, ebpo_nearest *n, ebpo_node node, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    if (ebpo_node_is_uniform(&node))
        return EBPO_OK;
    if (ebpo_node_is_below(&node)) {
        status = ebpo_model_enter(c, &node, error);
        if (status == EBPO_OK)
            ebpo_nearest_search(n, c, node.subtree);
        return status;
    }
    if (ebpo_entry_kind_of(node.entry) == EBPO_ENTRY_LEAF) {
        ebpo_nearest_leaf(n, node.subtree, &node.subtree->leaf[ebpo_entry_value(node.entry)]);
        return EBPO_OK;
    }
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++)
        status = all_leaves(c, n, ebpo_model_child(c->model, &node, octant), error);
    return status;
}

ebpo_status ebpo_distance_around(ebpo_context *c, const double p[3], const ebpo_distance_options *o,
                                 ebpo_distance_result *out, ebpo_error *error)
{
    ebpo_box box = ebpo_model_box(c->model);
    uint32_t at[3];
    int fine = c->model->info->level_count - 1;
    *out = nothing;
    if (!ebpo_locate(&box, fine, p, at))
        return EBPO_OK;
    ebpo_node node = ebpo_model_root(c->model), gray = node;
    ebpo_status status = EBPO_OK;
    while (status == EBPO_OK && !ebpo_node_is_uniform(&node)) {
        if (ebpo_node_is_below(&node))
            status = ebpo_model_enter(c, &node, error);
        if (status != EBPO_OK || ebpo_entry_kind_of(node.entry) == EBPO_ENTRY_LEAF)
            break;
        gray = node;
        node = ebpo_model_child(c->model, &node, ebpo_octant_at(at, fine - node.cell.level - 1));
    }
    ebpo_nearest n;
    ebpo_nearest_begin(&n, c->model, p, o->max_distance);
    if (status == EBPO_OK && !ebpo_node_is_uniform(&node))
        ebpo_nearest_leaf(&n, node.subtree, &node.subtree->leaf[ebpo_entry_value(node.entry)]);
    else if (status == EBPO_OK && o->mode == EBPO_DISTANCE_RECURSIVE)
        status = all_leaves(c, &n, gray, error);
    if (status == EBPO_OK)
        ebpo_nearest_end(&n, o->max_distance, out);
    out->lo = 0; /* not the minimum: only an upper bound is certain */
    return status == EBPO_OK ? ebpo_give_sign(c, p, o, out, error) : status;
}

static void corner_of(const ebpo_box *box, ebpo_cell cell, const double xi[3], double out[3])
{
    for (int k = 0; k < 3; k++) {
        double low = ebpo_wall(box, k, cell.level, cell.at[k]);
        out[k] = low + xi[k] * (box->size[k] / (double)(1u << cell.level));
    }
}

static void nearest_polygon(const ebpo_polytope *e, const ebpo_box *box, ebpo_cell cell,
                            const double p[3], ebpo_distance_result *out)
{
    double best[3][3];
    for (int f = 0; f < e->face_count; f++)
        for (int i = e->first[f] + 1; i + 1 < e->first[f + 1]; i++) {
            double t[3][3];
            ebpo_distance_bounds b;
            corner_of(box, cell, e->vertex[e->corner[e->first[f]]], t[0]);
            corner_of(box, cell, e->vertex[e->corner[i]], t[1]);
            corner_of(box, cell, e->vertex[e->corner[i + 1]], t[2]);
            ebpo_triangle_distance_bounds(p, (const double(*)[3])t, &b);
            if (b.hi < out->distance) {
                out->distance = b.hi;
                for (int k = 0; k < 9; k++)
                    best[k / 3][k % 3] = t[k / 3][k % 3];
            }
        }
    if (isinf(out->distance))
        return;
    ebpo_triangle_nearest exact;
    ebpo_triangle_nearest_exact(p, (const double(*)[3])best, NULL, out->normal, &exact);
    out->distance = exact.distance;
    for (int k = 0; k < 3; k++)
        out->point[k] = exact.point[k];
}

/* The nodes around a point, from the root to the last one that has an envelope. */
typedef struct node_chain {
    ebpo_node node[EBPO_LEVELS_MAX];
    int count;
    const ebpo_node *pruned; /* behind the last one, or NULL */
    ebpo_node child;
} node_chain;

static ebpo_status follow(ebpo_context *c, const uint32_t at[3], int level, node_chain *out,
                          ebpo_error *error)
{
    int fine = c->model->info->level_count - 1;
    ebpo_node node = ebpo_model_root(c->model);
    out->count = 0;
    out->pruned = NULL;
    for (;;) {
        out->node[out->count++] = node;
        if ((level >= 0 && node.cell.level >= level) || node.type != EBPO_GRAY)
            return EBPO_OK;
        if (ebpo_node_is_below(&node)) {
            ebpo_status status = ebpo_model_enter(c, &node, error);
            if (status != EBPO_OK)
                return status;
        }
        out->child =
            ebpo_model_child(c->model, &node, ebpo_octant_at(at, fine - node.cell.level - 1));
        if (out->child.type != EBPO_GRAY)
            return EBPO_OK;
        if (c->model->info->boxed && out->child.pruned) {
            /* leaves outside a subset's box look the same */
            out->pruned = &out->child;
            return EBPO_OK;
        }
        node = out->child;
    }
}

/* The octant of a node in the one above. */
static unsigned octant_of(ebpo_cell cell)
{
    return (cell.at[0] & 1) | (cell.at[1] & 1) << 1 | (cell.at[2] & 1) << 2;
}

/* Leaves the envelope of the last node that has any in cutting[0]; returns its number in the chain.
 * What a node's is cut from is the one above, so that one that is kept stands for all above it. */
static int cut_envelope(ebpo_context *c, const node_chain *chain)
{
    ebpo_polytope *out = &c->cutting[0], *above = &c->cutting[1];
    int at = chain->count - 1;
    while (at >= 0 && !ebpo_kept_envelopes_get(c->envelopes, chain->node[at].cell, out))
        at--;
    while (++at < chain->count) {
        uint32_t count;
        const ebpo_node *node = &chain->node[at];
        const uint32_t *codes = ebpo_model_planes(c->model, node, &count);
        if (at == 0) {
            ebpo_polytope_cube(out);
        } else {
            ebpo_polytope_copy(above, out);
            if (!ebpo_polytope_child(above, octant_of(node->cell), out)) {
                ebpo_polytope_copy(out, above);
                break;
            }
        }
        ebpo_planes_cut(out, codes, count);
        ebpo_kept_envelopes_put(&c->envelopes, node->cell, out);
    }
    return at - 1;
}

ebpo_status ebpo_distance_to_envelope(ebpo_context *c, const double p[3],
                                      const ebpo_distance_options *o, ebpo_distance_result *out,
                                      ebpo_error *error)
{
    ebpo_box box = ebpo_model_box(c->model);
    uint32_t at[3];
    *out = nothing;
    if (!ebpo_locate(&box, c->model->info->level_count - 1, p, at))
        return EBPO_OK;
    node_chain chain;
    ebpo_status status = follow(c, at, o->level, &chain, error);
    if (status != EBPO_OK)
        return status;
    if (!c->cutting && !(c->cutting = ebpo_alloc(2, sizeof *c->cutting)))
        return ebpo_fail_memory(error, 2 * sizeof *c->cutting);
    int last = cut_envelope(c, &chain);
    if (chain.pruned && last == chain.count - 1)
        return ebpo_fail_pruned(c->model, chain.pruned->cell, error);
    nearest_polygon(&c->cutting[0], &box, chain.node[last].cell, p, out);
    out->lo = 0;
    out->hi = INFINITY;
    return EBPO_OK;
}
