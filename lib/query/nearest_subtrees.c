/* Finds the nearest face of a model. If the model is not completely in memory, loads and searches
 * subtrees in the order of their bounds.
 *
 * Nodes of the top (levels 0 to the cut level) and subtrees wait in a queue, ordered by guaranteed
 * lower bounds of their distance. The search ends when the next bound is beyond the best face. So a
 * subtree is loaded only if its bound is at most the result. This is true whichever subtrees are in
 * memory. If a subtree was loaded before, its bound comes from its skeleton (upper nodes of its
 * hierarchy over faces, skeleton.c). If it never was, its bound comes from the envelopes of the
 * first levels below the cut level (*deep bounds*, nearest.h). Deep bounds are read after queries
 * have loaded many subtrees that they would not have needed with better bounds. For a remote file,
 * a query reads these envelopes only for the subtrees near its point, before it loads many. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/os.h"
#include "core/error.h"
#include "format/reader.h"
#include "geometry/cells.h"
#include "query/load_ahead.h"
#include "query/nearest.h"

/* Returns true if `a` leaves the queue before `b`. */
static bool comes_out_before(const ebpo_ranked *a, const ebpo_ranked *b)
{
    return a->lower != b->lower ? a->lower < b->lower : a->node.entry < b->node.entry;
}

ebpo_status ebpo_queue_push(ebpo_context *c, const ebpo_ranked *r, ebpo_error *error)
{
    if (!ebpo_grow(&c->queue, &c->queue_capacity, c->queue_count + 1, sizeof *c->queue))
        return ebpo_fail_memory(error, (c->queue_count + 1) * sizeof *c->queue);
    uint64_t at = c->queue_count++;
    for (; at > 0 && comes_out_before(r, &c->queue[(at - 1) / 2]); at = (at - 1) / 2)
        c->queue[at] = c->queue[(at - 1) / 2];
    c->queue[at] = *r;
    return EBPO_OK;
}

ebpo_ranked ebpo_queue_pop(ebpo_context *c)
{
    ebpo_ranked first = c->queue[0], last = c->queue[--c->queue_count];
    uint64_t at = 0, count = c->queue_count;
    for (uint64_t child = 1; child < count; child = 2 * at + 1) {
        if (child + 1 < count && comes_out_before(&c->queue[child + 1], &c->queue[child]))
            child++;
        if (!comes_out_before(&c->queue[child], &last))
            break;
        c->queue[at] = c->queue[child];
        at = child;
    }
    c->queue[at] = last;
    return first;
}

/* For a remote file, the least number of subtrees whose envelopes are read together. (With 24, 11
 * points deep inside a model of 4.3 million faces take 3 % more bytes, with 48 12 % more.) */
enum { ENVELOPES_LEAST = 8 };
/* A *new* subtree has no skeleton, because it was never loaded. A query near the previous query
 * loads at most a few new subtrees. If a query loads more than NEW_NEEDED new subtrees, the excess
 * counts as loaded without need. Deep bounds are read after LOADS_TO_READ loads without need, which
 * take about as long as reading two levels. */
enum { NEW_NEEDED = 4, LOADS_TO_READ = 64 };

/* --- deep bounds --- */

/* Reads the deep bounds of the levels down to `level`. Returns EBPO_E_LIMIT if the quota of
 * skeletons is too small. */
static ebpo_status read_levels(ebpo_model *m, int level)
{
    uint64_t estimate = ebpo_top_envelopes_estimate(m->info, level);
    ebpo_top *deep = NULL;
    if (!ebpo_skeletons_take(m->skeletons, estimate))
        return EBPO_E_LIMIT;
    ebpo_status status = ebpo_top_read_envelopes(&deep, m->file, level, m->options.threads, NULL);
    if (status != EBPO_OK)
        deep = NULL;
    ebpo_skeletons_give_back(m->skeletons, estimate - (deep ? deep->bytes : 0));
    atomic_store_explicit(&m->deep, deep, memory_order_release);
    return status == EBPO_E_LIMIT ? EBPO_OK : status;
}

void ebpo_deep_bounds_make(ebpo_model *m)
{
    int level = m->top->cut_level + EBPO_DEEP_LEVELS, last = m->info->level_count - 1;
    if (!m->skeletons || atomic_exchange(&m->deep_begun, true))
        return;
    level = level < last ? level : last;
    while (level > m->top->cut_level && read_levels(m, level) == EBPO_E_LIMIT)
        level--;
}

void ebpo_deep_bounds_report(ebpo_model *m, unsigned loaded)
{
    if (loaded <= NEW_NEEDED || m->deep_begun || ebpo_input_prefetches(&m->file->in))
        return;
    uint64_t more = loaded - NEW_NEEDED;
    if (atomic_fetch_add(&m->new_loads, more) + more >= LOADS_TO_READ)
        ebpo_deep_bounds_make(m);
}

/* A search for the least lower bound among the deepest nodes of the deep bounds. */
typedef struct deep_search {
    const ebpo_top *top;
    const ebpo_ranking *ranking;
    double best; /* least bound of a deepest node so far */
    /* upper bound of the distance (or key) of the nearest face, from the visited gray nodes: each
     * of them has a face */
    double upper;
} deep_search;

typedef struct deep_node {
    uint32_t entry; /* in the table of the deep bounds */
    ebpo_cell cell;
    double lower;       /* lower bound of the distance */
    ebpo_facing facing; /* half-spaces that contain the node's envelope */
} deep_node;

/* Returns the planes of the node that has this entry in the table of the deep bounds. */
static ebpo_top_planes planes_of(const ebpo_top *t, uint32_t entry)
{
    uint32_t value = ebpo_entry_value(entry);
    return ebpo_entry_kind_of(entry) == EBPO_ENTRY_SUBTREE_ROOT ? t->below_planes[value]
                                                                : t->gray[value];
}

/* Returns a lower bound of the distance to a node, at least `parent`. *facing: half-spaces that
 * contain the parent's envelope, then the node's (ebpo_facing_distance). Far points do not use
 * them. */
static double rank_facing(const ebpo_ranking *r, const ebpo_top *top, uint32_t entry,
                          ebpo_cell cell, double parent, double enough, ebpo_facing *facing)
{
    ebpo_top_planes planes = planes_of(top, entry);
    const uint32_t *codes = top->planes + planes.first;
    return fmax(parent, r->far ? ebpo_rank_cell(r, cell, codes, planes.count, enough)
                               : ebpo_facing_distance(&r->box, cell, codes, planes.count, r->p,
                                                      enough, facing));
}

/* Lists the children of a gray node that have bounds below g->best, the nearest first. Returns
 * their number. */
static int rank_deep_children(const deep_search *g, const deep_node *gray, deep_node out[8])
{
    int count = 0;
    for (unsigned octant = 0; octant < 8; octant++) {
        deep_node c = *gray;
        c.entry = ebpo_table_child(&g->top->nodes, gray->entry, octant);
        c.cell = ebpo_cell_child(gray->cell, octant);
        if (ebpo_entry_kind_of(c.entry) == EBPO_ENTRY_UNIFORM)
            continue;
        c.lower = rank_facing(g->ranking, g->top, c.entry, c.cell, gray->lower, g->best, &c.facing);
        if (c.lower >= g->best)
            continue;
        int at = count++;
        for (; at > 0 && out[at - 1].lower > c.lower; at--)
            out[at] = out[at - 1];
        out[at] = c;
    }
    return count;
}

/* Lowers g->best to the least bound of a deepest node below a gray node. */
static void search_deep(deep_search *g, const deep_node *gray)
{
    deep_node child[8];
    int count = rank_deep_children(g, gray, child);
    for (int i = 0; i < count && child[i].lower < g->best; i++)
        if (ebpo_entry_kind_of(child[i].entry) == EBPO_ENTRY_GRAY) {
            g->upper = fmin(g->upper, ebpo_rank_cell_end(g->ranking, child[i].cell));
            search_deep(g, &child[i]);
        } else {
            g->best = child[i].lower;
        }
}

/* Returns a guaranteed lower bound of the distance to the faces in the cell of a subtree's root,
 * from the envelopes of the nodes above it and below it: those that the context has read, or deep
 * bounds. `lower`: a known lower bound; the result is at least this bound. Once a bound is beyond
 * `limit`, no better bound is searched for. *upper: is lowered to an upper bound of the distance to
 * the model's nearest face, if one is found; NULL is allowed. (For a far point, all bounds are
 * keys.) Any thread may call this function. */
static double bound_below_cut(const ebpo_context *c, const ebpo_ranking *ranking,
                              const ebpo_node *node, double lower, double limit, double *upper)
{
    const ebpo_model *m = c->model;
    const ebpo_top *top =
        m->skeletons ? atomic_load_explicit(&m->deep, memory_order_acquire) : NULL;
    top = top ? top : m->top;
    deep_node at = { .entry = top->nodes.root, .lower = lower };
    for (;;) {
        bool ends = at.cell.level == node->cell.level;
        ebpo_entry_kind kind = ebpo_entry_kind_of(at.entry);
        if (kind == EBPO_ENTRY_UNIFORM || (kind != EBPO_ENTRY_GRAY && !ends))
            return at.lower; /* not a node above the cut: the file changed after it was opened */
        at.lower = rank_facing(ranking, top, at.entry, at.cell, at.lower, limit, &at.facing);
        if (at.lower > limit)
            return at.lower;
        if (ends)
            break;
        unsigned octant = ebpo_cell_octant(node->cell, at.cell.level);
        at.entry = ebpo_table_child(&top->nodes, at.entry, octant);
        at.cell = ebpo_cell_child(at.cell, octant);
    }
    const ebpo_top *read = ebpo_context_envelopes(c, ebpo_entry_value(node->entry));
    if (read) {
        top = read;
        at.entry = read->nodes.root;
    }
    if (ebpo_entry_kind_of(at.entry) != EBPO_ENTRY_GRAY)
        return at.lower;
    deep_search g = { top, ranking, nextafter(limit, INFINITY), INFINITY };
    search_deep(&g, &at);
    if (upper)
        *upper = fmin(*upper, g.upper);
    return fmax(at.lower, g.best);
}

/* --- the search --- */

/* Values of ebpo_ranked.what: what an entry of the queue stands for. NODE: a node of the top, or a
 * subtree that has not left the queue yet. OWNED: the faces that the subtree owns (see "bounds from
 * skeletons" below), or all its faces if the subtree has no skeleton. SHARED: the subtree's shared
 * faces, which other subtrees own. */
enum { NODE = 0, OWNED, SHARED };

typedef struct searching {
    ebpo_context *c;
    ebpo_nearest *n;
    ebpo_ranking ranking;
    unsigned new_loads; /* number of new subtrees that this search loaded */
    double hinted;      /* prefetch hints were sent for all new subtrees up to this bound */
    bool improved; /* no more envelopes are read: few subtrees lack them, or the quota is used up */
} searching;

/* Adds a node to the queue if its bound is within the limit. */
static ebpo_status add_node(searching *g, const ebpo_ranked *r, ebpo_error *error)
{
    ebpo_nearest *n = g->n;
    if (r->lower > ebpo_nearest_limit(n) || ebpo_node_is_uniform(&r->node) ||
        r->node.pruned) /* pruned nodes: see inspect_pruned (distance.c) */
        return EBPO_OK;
    if (ebpo_node_is_subtree_root(&r->node)) {
        /* The node lists a face, so the distance of its cell's farthest point is an upper bound. */
        double end = ebpo_rank_cell_end(&g->ranking, r->node.cell);
        n->upper = fmin(n->upper, n->far.far ? ebpo_far_upper(&n->far, end) : end);
        n->limit = fmin(n->limit, n->upper);
        n->key_limit = n->far.far ? fmin(n->key_limit, end) : n->key_limit;
    }
    return r->lower <= ebpo_nearest_limit(n) ? ebpo_queue_push(g->c, r, error) : EBPO_OK;
}

/* Adds the children of a node of the top to the queue. */
static ebpo_status add_children(searching *g, const ebpo_ranked *r, ebpo_error *error)
{
    ebpo_ranked child[8];
    int count =
        ebpo_rank_children(&g->ranking, &r->node, r->lower, ebpo_nearest_limit(g->n), child);
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < count && status == EBPO_OK; i++)
        status = add_node(g, &child[i], error);
    return status;
}

/* --- marks (ebpo_context.marks): the query with number q marks a subtree with 2 q when its owned
 * faces are added to the queue, and with 2 q + 1 when the subtree is searched --- */

static bool is_searched(const ebpo_context *c, uint32_t below)
{
    return c->marks[below] == 2 * c->query_number + 1;
}

/* Empties the queue, and gives the query a number. */
static ebpo_status begin_query(ebpo_context *c, ebpo_error *error)
{
    uint64_t count = c->model->top->below_count;
    c->queue_count = 0;
    if (c->marks && ++c->query_number < UINT32_MAX / 2)
        return EBPO_OK;
    free(c->marks);
    c->query_number = 1;
    c->marks = ebpo_alloc_zero(count, sizeof *c->marks);
    return c->marks ? EBPO_OK : ebpo_fail_memory(error, count * sizeof *c->marks);
}

static bool is_in_memory(const ebpo_context *c, uint32_t below)
{
    return ebpo_context_has_pinned(c, below) ||
           ebpo_cache_has(c->model->cache, ebpo_context_key(c, below));
}

/* Returns the root node of the subtree top->below[below]. */
static ebpo_node node_below(const ebpo_model *m, uint32_t below)
{
    ebpo_node node = m->top->below[below];
    node.entry = ebpo_entry(EBPO_ENTRY_SUBTREE_ROOT, below);
    return node;
}

/* A list of new subtrees, other than `but`, that this query has not searched and that may have a
 * face within `limit`, the nearest first. */
typedef struct needed {
    const searching *g;
    double limit; /* if the list is full, lowered to the bound of its last subtree */
    uint32_t but;
    bool without; /* only subtrees of which the context has no envelopes */
    unsigned count;
    uint32_t below[EBPO_CACHE_AHEAD + 1]; /* with space for `but` */
    double lower[EBPO_CACHE_AHEAD];       /* lower bounds of the distance */
} needed;

/* Adds the subtrees at or below a node. `lower`: lower bound of the distance to the node. */
static void add_needed(needed *l, ebpo_node node, double lower)
{
    const searching *g = l->g;
    if (lower > l->limit || ebpo_node_is_uniform(&node) || node.pruned)
        return;
    if (!ebpo_node_is_subtree_root(&node)) {
        ebpo_ranked child[8];
        int count = ebpo_rank_children(&g->ranking, &node, lower, l->limit, child);
        for (int i = 0; i < count; i++)
            add_needed(l, child[i].node, child[i].lower);
        return;
    }
    uint32_t below = ebpo_entry_value(node.entry);
    if (below == l->but || is_searched(g->c, below) ||
        ebpo_skeletons_find(g->c->model->skeletons, below) ||
        (l->without && (node.type != EBPO_GRAY || ebpo_context_envelopes(g->c, below))))
        return;
    lower = bound_below_cut(g->c, &g->ranking, &node, lower, l->limit, NULL);
    if (lower > l->limit)
        return;
    unsigned at = l->count < EBPO_CACHE_AHEAD ? l->count++ : EBPO_CACHE_AHEAD - 1;
    for (; at > 0 && l->lower[at - 1] > lower; at--) {
        l->lower[at] = l->lower[at - 1];
        l->below[at] = l->below[at - 1];
    }
    l->lower[at] = lower;
    l->below[at] = below;
    if (l->count == EBPO_CACHE_AHEAD)
        l->limit = l->lower[EBPO_CACHE_AHEAD - 1];
}

static needed list_needed(const searching *g, double limit, uint32_t but, bool without)
{
    needed l = { .g = g, .limit = limit, .but = but, .without = without };
    add_needed(&l, ebpo_model_root(g->c->model), 0);
    return l;
}

/* Before a subtree of a remote file is entered, sends prefetch hints for it and for other new
 * subtrees that the search probably needs, so that one round trip fetches all of them. The result
 * of the search is between the bound of this subtree and the limit; the subtrees with bounds in the
 * first 3/16 of this interval are requested. Measured for 60 points anywhere in the box of a model
 * of 4.3 million faces, per query: 11.5 round trips and 999 kB without these hints; 6.9 round trips
 * and 1,040 kB with 3/16; 6.0 round trips and 1,103 kB with 1/2. If envelopes of subtrees were
 * read, the bounds are better, and the first 17/20 are requested. Before a face is found, only this
 * subtree is requested. For far points, whose bounds are keys (point_bounds.h), no hints are sent.
 */
static void hint_subtrees(searching *g, uint32_t below, double lower)
{
    ebpo_context *c = g->c;
    double share = !g->n->found ? 0 : c->envelope_count ? 0.85 : 0.1875;
    double limit = share > 0 ? lower + (g->n->limit - lower) * share : lower;
    if (g->ranking.far || lower <= g->hinted || !ebpo_input_prefetches(&c->model->file->in) ||
        is_in_memory(c, below))
        return;
    needed list = list_needed(g, limit, below, false);
    g->hinted = list.limit;
    list.below[list.count] = below;
    ebpo_context_hint(c, list.below, list.count + 1);
}

/* Searches all faces of a subtree, unless this query has already searched the subtree. */
static ebpo_status search_below(searching *g, const ebpo_ranked *r, ebpo_error *error)
{
    ebpo_node node = r->node;
    uint32_t below = ebpo_entry_value(node.entry);
    if (is_searched(g->c, below))
        return EBPO_OK;
    /* Few of many subtrees have the result, so the source index of its face is read later. */
    bool many = g->c->envelope_count && g->n->found;
    atomic_fetch_add(&g->c->model->without_maps, many);
    hint_subtrees(g, below, r->lower);
    g->c->marks[below] = 2 * g->c->query_number + 1;
    g->c->searched++;
    const ebpo_skeletons *skeletons = g->c->model->skeletons;
    bool is_new = !ebpo_skeletons_find(skeletons, below);
    uint64_t loaded = g->c->loaded;
    double limit = g->n->limit;
    ebpo_status status = ebpo_model_enter(g->c, &node, error);
    atomic_fetch_sub(&g->c->model->without_maps, many);
    if (status != EBPO_OK)
        return status;
    ebpo_nearest_search(g->n, g->c, node.subtree);
    g->new_loads += g->c->loaded > loaded && is_new;
    /* A better bound of this subtree would help later queries in two cases: the subtree had no face
     * nearer than the limit, or the limit is larger than the subtree's cell, so that many subtrees
     * are at similar distances. */
    bool needs_bounds =
        g->n->limit == limit || g->n->limit > ebpo_cell_diagonal(&g->ranking.box, node.cell);
    if (g->c->loaded > loaded && needs_bounds)
        ebpo_skeletons_grow(g->c->model->skeletons, below, node.subtree, g->n->p, g->n->limit);
    return EBPO_OK;
}

/* --- bounds from skeletons ---
 *
 * A face is listed by every subtree whose cell it intersects, and owned by one of them. A face that
 * several subtrees list is searched in its owner only, so it is searched once. In the queue, a
 * subtree S first has the bound of its cell, which is a bound for the parts of its faces within the
 * cell. When the queue returns S, the owned faces of S get a second entry in the queue. If shared
 * faces of S may be within the limit, the subtrees that may own these faces get entries. The bound
 * of such an entry is valid for all faces of the owner, also outside the owner's cell. If one of
 * these owners has no skeleton, S itself is searched.
 *
 * So the nearest face is found: its nearest point is in the cell of some S, and S or the face's
 * owner is searched. The bounds of all entries that lead from S to the owner are at most the
 * distance of the face. The queue may return S and the owner in any order. */

/* Returns the bounds (distances, or keys for a far point) of a skeleton. */
static ebpo_skeleton_bounds skeleton_bounds(const searching *g, const ebpo_skeleton *k)
{
    return g->ranking.far ? ebpo_skeleton_far_bounds(k, g->ranking.far, g->n->key_limit)
                          : ebpo_skeleton_lower_bounds(k, g->n->p, g->n->limit);
}

/* Adds the owned faces of a subtree to the queue, unless this query has already done that. `lower`:
 * bound of the queue's current entry. (Entries leave the queue in ascending
 * order of their bounds. So a later entry of the same faces could only have the same or a larger
 * bound, and is not needed.) */
static ebpo_status add_owned(searching *g, uint32_t below, double lower, ebpo_error *error)
{
    ebpo_context *c = g->c;
    if (c->marks[below] >= 2 * c->query_number)
        return EBPO_OK;
    c->marks[below] = 2 * c->query_number;
    const ebpo_skeleton *k = ebpo_skeletons_find(c->model->skeletons, below);
    double owned = skeleton_bounds(g, k).owned;
    ebpo_ranked r = { node_below(c->model, below), fmax(lower, owned), OWNED };
    return r.lower <= ebpo_nearest_limit(g->n) ? ebpo_queue_push(c, &r, error) : EBPO_OK;
}

/* A walk to the subtrees that may own shared faces of a subtree S. These subtrees precede S in
 * depth-first order, and their cells intersect a box around the shared faces. */
typedef struct owners {
    searching *g;
    uint64_t code;                /* octcode of S */
    int level;                    /* level of S's root */
    double lower;                 /* bound with which S left the queue */
    const ebpo_faces_box *shared; /* box around some shared faces of S */
    /* Called for each owner. The walk ends if it returns false. */
    bool (*visit)(struct owners *o, uint32_t below, ebpo_error *error);
    ebpo_status status;
} owners;

/* Returns true if the box o->shared intersects the enlarged cell. A node may also list faces
 * outside its cell, within 1/256 of the cell's size (format-spec, section 7). The cell is enlarged
 * by 1/128, so that rounding errors do not matter. */
static bool cell_intersects(const owners *o, ebpo_cell cell)
{
    double low[3], high[3];
    ebpo_cell_bounds(&o->g->ranking.box, cell, low, high);
    for (int k = 0; k < 3; k++) {
        double margin = (high[k] - low[k]) / 128 + (fabs(low[k]) + fabs(high[k])) * 0x1p-50;
        if (o->shared->low[k] > high[k] + margin || o->shared->high[k] < low[k] - margin)
            return false;
    }
    return true;
}

/* Returns true if the cell contains S or precedes S, depth first. */
static bool comes_before(const owners *o, ebpo_cell cell)
{
    uint64_t code = ebpo_octcode_of_cell(cell);
    int deeper = cell.level - o->level;
    return deeper > 0 ? code >> 3 * deeper < o->code : code <= o->code >> 3 * -deeper;
}

/* Returns true if the owner has a skeleton (owners.visit). */
static bool is_known(owners *o, uint32_t below, ebpo_error *error)
{
    (void)error;
    return ebpo_skeletons_find(o->g->c->model->skeletons, below) != NULL;
}

/* Adds the owned faces of an owner to the queue (owners.visit). */
static bool add_owner(owners *o, uint32_t below, ebpo_error *error)
{
    o->status = add_owned(o->g, below, o->lower, error);
    return o->status == EBPO_OK;
}

/* Visits the owners below a node. Returns false as soon as o->visit returns false. */
static bool visit_owners(owners *o, uint32_t entry, ebpo_cell cell, ebpo_error *error)
{
    const ebpo_node_table *nodes = &o->g->c->model->top->nodes;
    if (ebpo_entry_kind_of(entry) == EBPO_ENTRY_UNIFORM || !comes_before(o, cell) ||
        !cell_intersects(o, cell))
        return true;
    if (ebpo_entry_kind_of(entry) == EBPO_ENTRY_SUBTREE_ROOT)
        return ebpo_octcode_of_cell(cell) == o->code || o->visit(o, ebpo_entry_value(entry), error);
    for (unsigned octant = 0; octant < 8; octant++)
        if (!visit_owners(o, ebpo_table_child(nodes, entry, octant), ebpo_cell_child(cell, octant),
                          error))
            return false;
    return true;
}

/* Visits the owners of the faces in all boxes. Returns false as soon as o->visit does. */
static bool visit_all(owners *o, const ebpo_faces_box *boxes, unsigned count, ebpo_error *error)
{
    for (unsigned i = 0; i < count; i++) {
        o->shared = &boxes[i];
        if (!visit_owners(o, o->g->c->model->top->nodes.root, (ebpo_cell){ 0, { 0, 0, 0 } }, error))
            return false;
    }
    return true;
}

/* Adds the owned faces of all owners of the subtree's shared faces to the queue. Returns false, and
 * adds nothing, if some owner has no skeleton. */
static bool add_owners(searching *g, const ebpo_skeleton *k, const ebpo_ranked *r,
                       ebpo_status *status, ebpo_error *error)
{
    ebpo_faces_box box[EBPO_SHARED_BOXES];
    unsigned count = ebpo_skeleton_shared_boxes(k, g->n->p, g->n->limit, box);
    owners o = { .g = g,
                 .code = ebpo_octcode_of_cell(r->node.cell),
                 .level = r->node.cell.level,
                 .lower = r->lower,
                 .visit = is_known,
                 .status = EBPO_OK };
    if (!visit_all(&o, box, count, error))
        return false;
    o.visit = add_owner;
    visit_all(&o, box, count, error);
    *status = o.status;
    return true;
}

static double deep_bound(const searching *g, const ebpo_ranked *r)
{
    return bound_below_cut(g->c, &g->ranking, &r->node, r->lower, ebpo_nearest_limit(g->n), NULL);
}

/* For a remote file: if many new subtrees may have the nearest face, reads the envelopes of the
 * first levels of the nearest of them, and lowers the limit of the search by the cells of these
 * levels. Envelopes are read after a face is found, or before it if the point is so far from all
 * faces that the first face will exclude few subtrees (it lowers the limit by at most 40 %).
 * `lower`: bound of all faces that were not searched. A query with a deadline does not read
 * envelopes, because the read could take longer. */
static ebpo_status improve_bounds(searching *g, double lower, ebpo_error *error)
{
    ebpo_nearest *n = g->n;
    if (g->improved || g->ranking.far || n->deadline || !(n->found || lower > 0.6 * n->limit) ||
        !ebpo_model_has_envelopes(g->c->model))
        return EBPO_OK;
    needed list = list_needed(g, n->limit, UINT32_MAX, true);
    g->improved = list.count < ENVELOPES_LEAST; /* a later list has only subtrees of this list */
    if (g->improved)
        return EBPO_OK;
    unsigned before = g->c->envelope_count;
    ebpo_status status = ebpo_context_read_envelopes(g->c, list.below, list.count, error);
    g->improved = g->c->envelope_count - before < list.count;
    for (unsigned i = 0; i < list.count && status == EBPO_OK; i++) {
        ebpo_node node = node_below(g->c->model, list.below[i]);
        bound_below_cut(g->c, &g->ranking, &node, 0, n->limit, &n->upper);
        n->limit = fmin(n->limit, n->upper);
    }
    return status;
}

/* Handles a subtree without skeleton that leaves the queue for the first time. If deep bounds
 * increase the subtree's bound, the subtree goes back to the queue. Otherwise the subtree is
 * searched. */
static ebpo_status inspect_new(searching *g, const ebpo_ranked *r, ebpo_error *error)
{
    ebpo_status status = improve_bounds(g, r->lower, error);
    if (status != EBPO_OK)
        return status;
    ebpo_ranked all = { r->node, deep_bound(g, r), OWNED };
    if (all.lower > ebpo_nearest_limit(g->n))
        return EBPO_OK;
    return all.lower > r->lower ? ebpo_queue_push(g->c, &all, error) : search_below(g, r, error);
}

/* Handles a subtree that leaves the queue for the first time. */
static ebpo_status inspect_subtree(searching *g, const ebpo_ranked *r, ebpo_error *error)
{
    uint32_t below = ebpo_entry_value(r->node.entry);
    const ebpo_skeleton *k = ebpo_skeletons_find(g->c->model->skeletons, below);
    if (ebpo_context_has_pinned(g->c, below))
        return search_below(g, r, error);
    if (!k)
        return inspect_new(g, r, error);
    ebpo_skeleton_bounds bounds = skeleton_bounds(g, k);
    double least = fmax(r->lower, fmin(bounds.owned, bounds.shared));
    if (least > ebpo_nearest_limit(g->n))
        return EBPO_OK;
    /* If the subtree is in memory, all its faces are searched together. */
    bool in_memory = is_in_memory(g->c, below);
    double lower = in_memory ? r->lower : deep_bound(g, r);
    ebpo_ranked owned = { r->node, in_memory ? least : fmax(lower, bounds.owned), OWNED },
                shared = { r->node, in_memory ? INFINITY : fmax(lower, bounds.shared), SHARED };
    double limit = ebpo_nearest_limit(g->n);
    ebpo_status status = owned.lower <= limit ? ebpo_queue_push(g->c, &owned, error) : EBPO_OK;
    if (status == EBPO_OK && shared.lower <= limit)
        status = ebpo_queue_push(g->c, &shared, error);
    return status;
}

/* Handles the shared faces of a subtree: adds the owners to the queue, or searches the subtree. */
static ebpo_status inspect_shared(searching *g, const ebpo_ranked *r, ebpo_error *error)
{
    uint32_t below = ebpo_entry_value(r->node.entry);
    const ebpo_skeleton *k = ebpo_skeletons_find(g->c->model->skeletons, below);
    ebpo_status status = EBPO_OK;
    if (is_searched(g->c, below) ||
        (!is_in_memory(g->c, below) && add_owners(g, k, r, &status, error)))
        return status;
    return search_below(g, r, error);
}

/* Searches a model that is loaded subtree by subtree. */
static ebpo_status search_parts(searching *g, ebpo_error *error)
{
    ebpo_nearest *n = g->n;
    const ebpo_model *m = g->c->model;
    ebpo_ranked root = { ebpo_model_root(m), n->far.far ? -INFINITY : 0, NODE };
    ebpo_status status = begin_query(g->c, error);
    if (status == EBPO_OK)
        status = add_node(g, &root, error);
    while (status == EBPO_OK && g->c->queue_count) {
        ebpo_ranked next = ebpo_queue_pop(g->c);
        if (next.lower > ebpo_nearest_limit(n))
            break;
        if (ebpo_nearest_is_late(n)) {
            ebpo_nearest_pass_over(n, next.lower);
            break;
        }
        status = !ebpo_node_is_subtree_root(&next.node) ? add_children(g, &next, error)
                 : next.what == OWNED                   ? search_below(g, &next, error)
                 : next.what == SHARED                  ? inspect_shared(g, &next, error)
                                                        : inspect_subtree(g, &next, error);
    }
    ebpo_deep_bounds_report(g->c->model, g->new_loads);
    ebpo_context_drop_envelopes(g->c);
    return status;
}

ebpo_status ebpo_nearest_first(ebpo_context *c, ebpo_nearest *n, ebpo_error *error)
{
    searching g = { c, n, ebpo_ranking_of(c->model, n->p, &n->far), 0, -1, false };
    if (!c->model->whole)
        return search_parts(&g, error);
    ebpo_nearest_search(n, c, c->model->whole);
    return EBPO_OK;
}
