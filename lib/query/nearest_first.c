/* Distances under a budget: subtrees are loaded in the order in which they may matter. */
#include "core/strict_fp.h"

#include "query/nearest.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/clock.h"
#include "core/error.h"
#include "geometry/cell.h"
#include "geometry/octcode.h"

/* --- the search --- */

/* What of a subtree waits: the node, of which nothing else is known; its own faces; its outer ones.
 */
enum { NODE = 0, OWN, OUTER };

typedef struct searching {
    ebpo_context *c;
    ebpo_nearest *n;
    ebpo_ranking ranking;
    unsigned new_loads; /* of subtrees of which nothing was known */
} searching;

static ebpo_status add(searching *g, const ebpo_ranked *r, ebpo_error *error)
{
    ebpo_nearest *n = g->n;
    if (r->lower > ebpo_nearest_limit(n) || ebpo_node_is_uniform(&r->node) ||
        r->node.pruned) /* pruned: see look_at_pruned */
        return EBPO_OK;
    if (ebpo_node_is_below(&r->node)) {
        /* it holds some face */
        double end = ebpo_rank_cell_end(&g->ranking, r->node.cell);
        n->upper = fmin(n->upper, n->far.far ? ebpo_far_upper(&n->far, end) : end);
        n->limit = fmin(n->limit, n->upper);
        n->key_limit = n->far.far ? fmin(n->key_limit, end) : n->key_limit;
    }
    return r->lower <= ebpo_nearest_limit(n) ? ebpo_queue_push(g->c, r, error) : EBPO_OK;
}

static ebpo_status add_children(searching *g, const ebpo_ranked *r, ebpo_error *error)
{
    ebpo_ranked child[8];
    int count =
        ebpo_rank_children(&g->ranking, &r->node, r->lower, ebpo_nearest_limit(g->n), child);
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < count && status == EBPO_OK; i++)
        status = add(g, &child[i], error);
    return status;
}

/* --- subtrees, once each: by numbers that are twice the question's, or one more --- */

static bool is_searched(const ebpo_context *c, uint32_t below)
{
    return c->seen[below] == 2 * c->question + 1;
}

static ebpo_status begin_question(ebpo_context *c, ebpo_error *error)
{
    uint64_t count = c->model->top->below_count;
    c->queue_count = 0;
    if (c->seen && ++c->question < UINT32_MAX / 2)
        return EBPO_OK;
    free(c->seen);
    c->question = 1;
    c->seen = ebpo_alloc_zero(count, sizeof *c->seen);
    return c->seen ? EBPO_OK : ebpo_fail_memory(error, count * sizeof *c->seen);
}

static bool is_there(const ebpo_context *c, uint32_t below)
{
    return ebpo_context_has_pinned(c, below) ||
           ebpo_cache_has(c->model->cache, ebpo_context_key(c, below));
}

static ebpo_status search_below(searching *g, ebpo_node node, ebpo_error *error)
{
    uint32_t below = ebpo_entry_value(node.entry);
    if (is_searched(g->c, below))
        return EBPO_OK;
    g->c->seen[below] = 2 * g->c->question + 1;
    g->c->searched++;
    const ebpo_skeletons *skeletons = g->c->model->skeletons;
    bool is_new = !ebpo_skeletons_find(skeletons, below);
    uint64_t loaded = g->c->loaded;
    double limit = g->n->limit;
    ebpo_status status = ebpo_model_enter(g->c, &node, error);
    if (status != EBPO_OK)
        return status;
    ebpo_nearest_search(g->n, g->c, node.subtree);
    g->new_loads += g->c->loaded > loaded && is_new;
    /* for nothing, or as one of many that are about as far away */
    bool again =
        g->n->limit == limit || g->n->limit > ebpo_cell_diagonal(&g->ranking.box, node.cell);
    if (g->c->loaded > loaded && again)
        ebpo_skeletons_grow(g->c->model->skeletons, below, node.subtree, g->n->p, g->n->limit);
    return EBPO_OK;
}

/* --- what skeletons tell ---
 *
 * A face is listed by every subtree whose cell it meets, and is the own of one of them: else one
 * across a wall would be looked for on both sides. A subtree is come to by its cell, for what its
 * faces have within it. For its own faces it is searched. For outer ones that may matter, the
 * subtrees whose own they may be are, by bounds that hold wherever their faces are; unless one of
 * those is not known: then it is searched itself. So the nearest face is found: its nearest point
 * is in a cell that is come to, and that subtree is searched, or the one whose own the face is. No
 * bound on the way there is greater than the face's distance. Which of these two the order of the
 * queue brings first does not matter. */

static ebpo_skeleton_bounds skeleton_bounds(const searching *g, const ebpo_skeleton *k)
{
    return g->ranking.far ? ebpo_skeleton_far_bounds(k, g->ranking.far, g->n->key_limit)
                          : ebpo_skeleton_lower_bounds(k, g->n->p, g->n->limit);
}

static ebpo_node node_below(const ebpo_model *m, uint32_t below)
{
    ebpo_node node = m->top->below[below];
    node.entry = ebpo_entry(EBPO_ENTRY_BELOW, below);
    return node;
}

/* `lower`: of what it is considered for. These only rise, so that once is enough. */
static ebpo_status consider_own(searching *g, uint32_t below, double lower, ebpo_error *error)
{
    ebpo_context *c = g->c;
    if (c->seen[below] >= 2 * c->question)
        return EBPO_OK;
    c->seen[below] = 2 * c->question;
    const ebpo_skeleton *k = ebpo_skeletons_find(c->model->skeletons, below);
    double own = skeleton_bounds(g, k).own;
    ebpo_ranked r = { node_below(c->model, below), fmax(lower, own), OWN };
    return r.lower <= ebpo_nearest_limit(g->n) ? ebpo_queue_push(c, &r, error) : EBPO_OK;
}

/* A walk to the subtrees that may have outer faces of another one as their own: whose cells meet
 * the faces' box, and come before it, depth first. */
typedef struct owners {
    searching *g;
    uint64_t code; /* of the other one */
    int level;
    double lower;
    const ebpo_outer_box *outer;
    bool (*visit)(struct owners *o, uint32_t below, ebpo_error *error);
    ebpo_status status;
} owners;

/* A cell lists what comes near it, too: node_bounds.c. */
static bool cell_meets(const owners *o, ebpo_cell cell)
{
    double low[3], high[3];
    ebpo_cell_bounds(&o->g->ranking.box, cell, low, high);
    for (int k = 0; k < 3; k++) {
        double near = (high[k] - low[k]) / 128 + (fabs(low[k]) + fabs(high[k])) * 0x1p-50;
        if (o->outer->low[k] > high[k] + near || o->outer->high[k] < low[k] - near)
            return false;
    }
    return true;
}

static bool comes_before(const owners *o, ebpo_cell cell)
{
    uint64_t code = ebpo_octcode_of_cell(cell);
    int deeper = cell.level - o->level;
    return deeper > 0 ? code >> 3 * deeper < o->code : code <= o->code >> 3 * -deeper;
}

static bool is_known(owners *o, uint32_t below, ebpo_error *error)
{
    (void)error;
    return ebpo_skeletons_find(o->g->c->model->skeletons, below) != NULL;
}

static bool consider(owners *o, uint32_t below, ebpo_error *error)
{
    o->status = consider_own(o->g, below, o->lower, error);
    return o->status == EBPO_OK;
}

/* False as soon as a visit is. */
static bool visit_owners(owners *o, uint32_t entry, ebpo_cell cell, ebpo_error *error)
{
    const ebpo_node_table *nodes = &o->g->c->model->top->nodes;
    if (ebpo_entry_kind_of(entry) == EBPO_ENTRY_UNIFORM || !comes_before(o, cell) ||
        !cell_meets(o, cell))
        return true;
    if (ebpo_entry_kind_of(entry) == EBPO_ENTRY_BELOW)
        return ebpo_octcode_of_cell(cell) == o->code || o->visit(o, ebpo_entry_value(entry), error);
    for (unsigned octant = 0; octant < 8; octant++)
        if (!visit_owners(o, ebpo_table_child(nodes, entry, octant), ebpo_cell_child(cell, octant),
                          error))
            return false;
    return true;
}

static bool visit_all(owners *o, const ebpo_outer_box *boxes, unsigned count, ebpo_error *error)
{
    for (unsigned i = 0; i < count; i++) {
        o->outer = &boxes[i];
        if (!visit_owners(o, o->g->c->model->top->nodes.root, (ebpo_cell){ 0, { 0, 0, 0 } }, error))
            return false;
    }
    return true;
}

/* False: some owner is not known, and nothing has been done. */
static bool consider_owners(searching *g, const ebpo_skeleton *k, const ebpo_ranked *r,
                            ebpo_status *status, ebpo_error *error)
{
    ebpo_outer_box box[EBPO_OUTER_BOXES];
    unsigned count = ebpo_skeleton_outer_boxes(k, g->n->p, g->n->limit, box);
    owners o = { .g = g,
                 .code = ebpo_octcode_of_cell(r->node.cell),
                 .level = r->node.cell.level,
                 .lower = r->lower,
                 .visit = is_known,
                 .status = EBPO_OK };
    if (!visit_all(&o, box, count, error))
        return false;
    o.visit = consider;
    visit_all(&o, box, count, error);
    *status = o.status;
    return true;
}

static double deep_bound(const searching *g, const ebpo_ranked *r)
{
    return ebpo_deep_bound(&g->ranking, &r->node, r->lower, ebpo_nearest_limit(g->n));
}

/* Nothing has been kept of it: it is searched, but after what is nearer than it can be. */
static ebpo_status look_at_new(searching *g, const ebpo_ranked *r, ebpo_error *error)
{
    ebpo_ranked all = { r->node, deep_bound(g, r), OWN };
    if (all.lower > ebpo_nearest_limit(g->n))
        return EBPO_OK;
    return all.lower > r->lower ? ebpo_queue_push(g->c, &all, error)
                                : search_below(g, r->node, error);
}

static ebpo_status look(searching *g, const ebpo_ranked *r, ebpo_error *error)
{
    uint32_t below = ebpo_entry_value(r->node.entry);
    const ebpo_skeleton *k = ebpo_skeletons_find(g->c->model->skeletons, below);
    if (ebpo_context_has_pinned(g->c, below))
        return search_below(g, r->node, error);
    if (!k)
        return look_at_new(g, r, error);
    ebpo_skeleton_bounds bounds = skeleton_bounds(g, k);
    double least = fmax(r->lower, fmin(bounds.own, bounds.outer));
    if (least > ebpo_nearest_limit(g->n))
        return EBPO_OK;
    bool there = is_there(g->c, below); /* then both at once */
    double lower = there ? r->lower : deep_bound(g, r);
    ebpo_ranked own = { r->node, there ? least : fmax(lower, bounds.own), OWN },
                outer = { r->node, there ? INFINITY : fmax(lower, bounds.outer), OUTER };
    double limit = ebpo_nearest_limit(g->n);
    ebpo_status status = own.lower <= limit ? ebpo_queue_push(g->c, &own, error) : EBPO_OK;
    if (status == EBPO_OK && outer.lower <= limit)
        status = ebpo_queue_push(g->c, &outer, error);
    return status;
}

static ebpo_status look_at_outer(searching *g, const ebpo_ranked *r, ebpo_error *error)
{
    uint32_t below = ebpo_entry_value(r->node.entry);
    const ebpo_skeleton *k = ebpo_skeletons_find(g->c->model->skeletons, below);
    ebpo_status status = EBPO_OK;
    if (is_searched(g->c, below) ||
        (!is_there(g->c, below) && consider_owners(g, k, r, &status, error)))
        return status;
    return search_below(g, r->node, error);
}

static bool is_past_deadline(ebpo_nearest *n)
{
    return n->late = n->late || (n->deadline && ebpo_clock() > n->deadline);
}

static ebpo_status search_parts(searching *g, ebpo_error *error)
{
    ebpo_nearest *n = g->n;
    const ebpo_model *m = g->c->model;
    ebpo_ranked root = { ebpo_model_root(m), n->far.far ? -INFINITY : 0, NODE };
    ebpo_status status = begin_question(g->c, error);
    if (status == EBPO_OK)
        status = add(g, &root, error);
    while (status == EBPO_OK && g->c->queue_count) {
        ebpo_ranked next = ebpo_queue_pop(g->c);
        if (next.lower > ebpo_nearest_limit(n))
            break;
        if (is_past_deadline(n)) {
            ebpo_nearest_pass_over(n, next.lower);
            break;
        }
        status = !ebpo_node_is_below(&next.node) ? add_children(g, &next, error)
                 : next.what == OWN              ? search_below(g, next.node, error)
                 : next.what == OUTER            ? look_at_outer(g, &next, error)
                                                 : look(g, &next, error);
    }
    ebpo_deep_bounds_tell(g->c->model, g->new_loads);
    return status;
}

ebpo_status ebpo_nearest_first(ebpo_context *c, ebpo_nearest *n, ebpo_error *error)
{
    searching g = { c, n, ebpo_ranking_of(c->model, n->p, &n->far), 0 };
    if (!c->model->whole)
        return search_parts(&g, error);
    ebpo_nearest_search(n, c, c->model->whole);
    return EBPO_OK;
}
