/* Computes the distance to the surface, the nearest point and the normal (EBP 2017, 4.4).
 *
 * nearest_subtrees.c finds the exact minimum. Three other modes, from the thesis, do not always
 * find the minimum. These modes search only the leaf that contains the point, all leaves below the
 * deepest gray node that contains the point, or the envelope of a node. With a level, a query
 * returns an interval for the distance, from the envelopes of that level's nodes. If a deadline
 * passes, the query returns an interval from the nodes that were searched until then. In a subset,
 * a query fails with EBPO_E_ABSENT if an omitted face might be nearer than the found face. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "core/alloc.h"
#include "core/os.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "geometry/polytope.h"
#include "levels/lod.h"
#include "query/load_ahead.h"
#include "query/nearest.h"
#include "query/query_model.h"
#include "query/query_node.h"

/* --- distances that are not always the minimum --- */

/* The result if no face is within the limit. */
static const ebpo_distance_result no_result = { INFINITY,          0,           INFINITY,
                                                { NAN, NAN, NAN }, { 0, 0, 0 }, EBPO_NO_FACE };

/* Searches all leaves below a node. */
static ebpo_status search_leaves(ebpo_context *c, ebpo_nearest *n, ebpo_node node,
                                 ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    if (ebpo_node_is_uniform(&node))
        return EBPO_OK;
    if (ebpo_node_is_subtree_root(&node)) {
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
        status = search_leaves(c, n, ebpo_model_child(c->model, &node, octant), error);
    return status;
}

/* Searches the leaf that contains p. If p is not in a leaf, finds nothing (EBPO_DISTANCE_LEAVES),
 * or searches all leaves below the deepest gray node that contains p (EBPO_DISTANCE_RECURSIVE). */
static ebpo_status distance_around(ebpo_context *c, const double p[3],
                                   const ebpo_distance_options *o, ebpo_distance_result *out,
                                   ebpo_error *error)
{
    ebpo_box box = ebpo_model_box(c->model);
    uint32_t at[3];
    int deepest = c->model->info->level_count - 1;
    *out = no_result;
    if (!ebpo_locate(&box, deepest, p, at))
        return EBPO_OK;
    ebpo_node node = ebpo_model_root(c->model), gray = node;
    ebpo_status status = EBPO_OK;
    while (status == EBPO_OK && !ebpo_node_is_uniform(&node)) {
        if (ebpo_node_is_subtree_root(&node))
            status = ebpo_model_enter(c, &node, error);
        if (status != EBPO_OK || ebpo_entry_kind_of(node.entry) == EBPO_ENTRY_LEAF)
            break;
        gray = node;
        node = ebpo_model_child(c->model, &node, ebpo_octant_at(at, deepest - node.cell.level - 1));
    }
    ebpo_nearest n;
    ebpo_nearest_begin(&n, c->model, p, o->max_distance);
    if (status == EBPO_OK && !ebpo_node_is_uniform(&node))
        ebpo_nearest_leaf(&n, node.subtree, &node.subtree->leaf[ebpo_entry_value(node.entry)]);
    else if (status == EBPO_OK && o->mode == EBPO_DISTANCE_RECURSIVE)
        status = search_leaves(c, &n, gray, error);
    if (status == EBPO_OK)
        status = ebpo_nearest_end(&n, c->model, o->max_distance, out, error);
    out->lo = 0; /* the result may not be the minimum: it is only an upper bound */
    return status == EBPO_OK ? ebpo_give_sign(c, p, o, out, error) : status;
}

/* Converts coordinates in the cell (xi, 0 .. 1) to a point of the model. */
static void point_at(const ebpo_box *box, ebpo_cell cell, const double xi[3], double out[3])
{
    for (int k = 0; k < 3; k++) {
        double low = ebpo_cell_face(box, k, cell.level, cell.at[k]);
        out[k] = low + xi[k] * (box->size[k] / (double)(1u << cell.level));
    }
}

/* Finds the nearest point of the polygons of the envelope `e`, which are divided into triangles. */
static void nearest_polygon(const ebpo_polytope *e, const ebpo_box *box, ebpo_cell cell,
                            const double p[3], ebpo_distance_result *out)
{
    double best[3][3];
    for (int f = 0; f < e->face_count; f++)
        for (int i = e->first[f] + 1; i + 1 < e->first[f + 1]; i++) {
            double t[3][3];
            ebpo_distance_bounds b;
            point_at(box, cell, e->vertex[e->corner[e->first[f]]], t[0]);
            point_at(box, cell, e->vertex[e->corner[i]], t[1]);
            point_at(box, cell, e->vertex[e->corner[i + 1]], t[2]);
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

/* The nodes that contain a point, from the root to the last node that has an envelope. */
typedef struct node_chain {
    ebpo_node node[EBPO_LEVELS_MAX];
    int count;
    const ebpo_node *pruned; /* &child, if `child` is a pruned node without envelope; else NULL */
    ebpo_node child;         /* the next node on the way down, if the last node is gray */
} node_chain;

/* Finds the chain of nodes that contain the cell `at` of the deepest level, down to `level` (-1: no
 * limit). */
static ebpo_status follow_cells(ebpo_context *c, const uint32_t at[3], int level, node_chain *out,
                                ebpo_error *error)
{
    int deepest = c->model->info->level_count - 1;
    ebpo_node node = ebpo_model_root(c->model);
    out->count = 0;
    out->pruned = NULL;
    for (;;) {
        out->node[out->count++] = node;
        if ((level >= 0 && node.cell.level >= level) || node.type != EBPO_GRAY)
            return EBPO_OK;
        if (ebpo_node_is_subtree_root(&node)) {
            ebpo_status status = ebpo_model_enter(c, &node, error);
            if (status != EBPO_OK)
                return status;
        }
        out->child =
            ebpo_model_child(c->model, &node, ebpo_octant_at(at, deepest - node.cell.level - 1));
        if (out->child.type != EBPO_GRAY)
            return EBPO_OK;
        if (c->model->info->boxed && out->child.pruned) {
            /* the node may have been a leaf outside the subset's box: leaves have no envelope */
            out->pruned = &out->child;
            return EBPO_OK;
        }
        node = out->child;
    }
}

/* Returns the octant of a node in its parent. */
static unsigned octant_of(ebpo_cell cell)
{
    return (cell.at[0] & 1) | (cell.at[1] & 1) << 1 | (cell.at[2] & 1) << 2;
}

/* Computes the envelope of the chain's last node that has one, in c->cutting[0]; returns the node's
 * index in the chain. A node's envelope is cut from its parent's envelope, so the computation
 * starts at the deepest node whose envelope the context has kept from an earlier query. */
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

/* Computes the distance to the polygons of the envelope of the deepest gray node that contains p,
 * on levels 0 to o->level (-1: on all levels). */
static ebpo_status distance_to_envelope(ebpo_context *c, const double p[3],
                                        const ebpo_distance_options *o, ebpo_distance_result *out,
                                        ebpo_error *error)
{
    ebpo_box box = ebpo_model_box(c->model);
    uint32_t at[3];
    *out = no_result;
    if (!ebpo_locate(&box, c->model->info->level_count - 1, p, at))
        return EBPO_OK;
    node_chain chain;
    ebpo_status status = follow_cells(c, at, o->level, &chain, error);
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

/* --- subsets: an omitted face may be nearer than the found face --- */

/* Visits the nodes at or below `node` whose lower bound of the distance is within the search's
 * limit. Before the deadline, fails with EBPO_E_ABSENT at the first pruned node. After the
 * deadline, does not fail and enters no subtrees, but lowers *nearest to the bounds of pruned nodes
 * and subtrees. `lower`: bound of `node`. */
static ebpo_status pruned_within(ebpo_context *c, const ebpo_nearest *n,
                                 const ebpo_ranking *ranking, ebpo_node node, double lower,
                                 double *nearest, ebpo_error *error)
{
    const ebpo_model *m = c->model;
    ebpo_status status = EBPO_OK;
    double limit = ebpo_nearest_limit(n);
    if (lower > limit || ebpo_node_is_uniform(&node) || node.type != EBPO_GRAY)
        return EBPO_OK;
    if (node.pruned || (ebpo_node_is_subtree_root(&node) && n->late)) {
        *nearest = fmin(*nearest, lower);
        return n->late ? EBPO_OK : ebpo_fail_pruned(m, node.cell, error);
    }
    if (ebpo_node_is_subtree_root(&node))
        status = ebpo_model_enter(c, &node, error);
    if (status != EBPO_OK)
        return status;
    ebpo_ranked child[8];
    int count = ebpo_rank_children(ranking, &node, lower, limit, child);
    for (int i = 0; i < count && status == EBPO_OK; i++)
        status = pruned_within(c, n, ranking, child[i].node, child[i].lower, nearest, error);
    return status;
}

/* In a subset, fails with EBPO_E_ABSENT if an omitted part of the model may change the result.
 * After the deadline, does not fail, but lowers the lower end of the result's interval to the bound
 * of that part. */
static ebpo_status inspect_pruned(ebpo_context *c, ebpo_nearest *n, ebpo_error *error)
{
    ebpo_ranking ranking = ebpo_ranking_of(c->model, n->p, &n->far);
    double nearest = INFINITY;
    if (!c->model->info->pruned)
        return EBPO_OK;
    ebpo_status status = pruned_within(c, n, &ranking, ebpo_model_root(c->model),
                                       ebpo_rank_root(&ranking), &nearest, error);
    if (nearest < INFINITY)
        ebpo_nearest_pass_over(n, nearest);
    return status;
}

/* Prefetches the subtrees that queries near p will need. */
static void prefetch_around(ebpo_context *c, const double p[3], double search_distance)
{
    if (ebpo_model_prefetches(c->model))
        ebpo_context_prefetch(c, p, search_distance);
}

/* Finds the nearest face, or an interval for the distance if the deadline passes. A warm search
 * starts from the face that the context's last query found. */
static ebpo_status exact_distance(ebpo_context *c, const double p[3],
                                  const ebpo_distance_options *o, ebpo_distance_result *out,
                                  ebpo_error *error)
{
    ebpo_nearest n;
    ebpo_nearest_begin(&n, c->model, p, o->max_distance);
    if (o->deadline_ns)
        n.deadline = ebpo_clock() + o->deadline_ns;
    if (o->warm && c->warm && c->model->whole)
        ebpo_nearest_begin_at(&n, c->warm_block, c->warm_node);
    else if (o->warm && c->warm)
        ebpo_nearest_begin_with(&n, (const double(*)[3])c->warm_triangle, c->warm_face);
    ebpo_status status = ebpo_nearest_first(c, &n, error);
    if (status == EBPO_OK)
        status = inspect_pruned(c, &n, error);
    if (status != EBPO_OK)
        return status;
    if (n.late && n.passed_over <= n.limit) {
        /* If no face was found before the deadline, the distance of the farthest point of the root
         * cell is an upper bound, because a face is in the root cell. */
        ebpo_box box = ebpo_model_box(c->model);
        double hi = fmin(n.upper, ebpo_cell_far(&box, (ebpo_cell){ 0, { 0, 0, 0 } }, p)),
               lo = fmin(fmin(n.passed_over, n.found ? n.bounds.lo : n.upper), hi);
        *out = (ebpo_distance_result){ NAN, lo, hi, { NAN, NAN, NAN }, { 0, 0, 0 }, EBPO_NO_FACE };
        prefetch_around(c, p, hi);
        return EBPO_OK;
    }
    status = ebpo_nearest_end(&n, c->model, o->max_distance, out, error);
    if (status != EBPO_OK)
        return status;
    prefetch_around(c, p, out->face == EBPO_NO_FACE ? o->max_distance : out->distance);
    if (out->face == EBPO_NO_FACE)
        return EBPO_OK;
    c->warm = true;
    c->warm_block = n.block;
    c->warm_node = n.node;
    c->warm_face = n.file_face;
    memcpy(c->warm_triangle, n.triangle, sizeof n.triangle);
    return ebpo_give_sign(c, p, o, out, error);
}

/* --- the interval from the nodes of a level --- */

typedef struct interval {
    ebpo_context *c;
    const ebpo_distance_options *o;
    ebpo_ranking ranking; /* computes bounds of nodes */
    ebpo_far far;         /* the point, if it is far from the model (point_bounds.h) */
    uint64_t deadline;    /* a time of ebpo_clock; 0: none */
    /* bounds so far: distances, or keys (point_bounds.h) if the point is far */
    double lo, hi;
} interval;

/* Returns true if the node may be without faces: in a surface with holes, a leaf without faces may
 * be the source of a pruned node, and a file without the mesh does not tell such leaves apart. */
static bool may_lack_faces(const ebpo_model *m, const ebpo_node *node)
{
    return m->info->border_inside && node->cell.level > 0 &&
           (node->pruned || (node->type == EBPO_LEAF && !(m->info->parts & EBPO_PART_MESH)));
}

/* Improves the interval by the envelopes at or below `node`. `lower`: lower bound of the distance
 * to `node`. */
static ebpo_status narrow_interval(interval *v, ebpo_node node, double lower, ebpo_error *error)
{
    if (lower > v->hi || ebpo_node_is_uniform(&node))
        return EBPO_OK;
    if (!may_lack_faces(v->c->model, &node))
        v->hi = fmin(v->hi, ebpo_rank_cell_end(&v->ranking, node.cell));
    if (node.cell.level >= v->o->level || node.type != EBPO_GRAY || node.pruned ||
        (v->deadline && ebpo_clock() > v->deadline)) {
        v->lo = fmin(v->lo, lower);
        return EBPO_OK;
    }
    if (ebpo_node_is_subtree_root(&node)) {
        ebpo_status status = ebpo_model_enter(v->c, &node, error);
        if (status != EBPO_OK)
            return status;
    }
    ebpo_ranked child[8];
    int count = ebpo_rank_children(&v->ranking, &node, lower, v->hi, child);
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < count && status == EBPO_OK; i++)
        status = narrow_interval(v, child[i].node, child[i].lower, error);
    return status;
}

/* Computes an interval for the distance from the envelopes of a level. */
static ebpo_status distance_interval(ebpo_context *context, const double p[3],
                                     const ebpo_distance_options *options, double *lo, double *hi,
                                     ebpo_error *error)
{
    interval v = { .c = context, .o = options, .lo = INFINITY, .hi = INFINITY };
    if (options->deadline_ns)
        v.deadline = ebpo_clock() + options->deadline_ns;
    ebpo_box box = ebpo_model_box(context->model);
    ebpo_far_make(&v.far, &box, p);
    v.ranking = ebpo_ranking_of(context->model, p, &v.far);
    ebpo_status status =
        narrow_interval(&v, ebpo_model_root(context->model), ebpo_rank_root(&v.ranking), error);
    *lo = fmin(v.lo, v.hi);
    *hi = v.hi;
    if (v.far.far) {
        *lo = ebpo_far_lower(&v.far, *lo);
        *hi = ebpo_far_upper(&v.far, *hi);
    }
    return status;
}

/* Sets the result of a query with a level: only an interval. */
static ebpo_status limited_distance(ebpo_context *c, const double p[3],
                                    const ebpo_distance_options *o, ebpo_distance_result *out,
                                    ebpo_error *error)
{
    *out = (ebpo_distance_result){ NAN, 0, INFINITY, { NAN, NAN, NAN }, { 0, 0, 0 }, EBPO_NO_FACE };
    ebpo_status status = distance_interval(c, p, o, &out->lo, &out->hi, error);
    if (out->lo > o->max_distance)
        out->distance = INFINITY;
    return status;
}

static ebpo_status distance_of_point(ebpo_context *c, const double p[3],
                                     const ebpo_distance_options *o, ebpo_distance_result *out,
                                     ebpo_error *error)
{
    if (o->mode == EBPO_DISTANCE_ENVELOPE)
        return distance_to_envelope(c, p, o, out, error);
    if (o->mode == EBPO_DISTANCE_RECURSIVE || o->mode == EBPO_DISTANCE_LEAVES)
        return distance_around(c, p, o, out, error);
    return o->level >= 0 ? limited_distance(c, p, o, out, error)
                         : exact_distance(c, p, o, out, error);
}

static ebpo_status check_values(const ebpo_distance_options *o, ebpo_error *error)
{
    if (!(o->max_distance >= 0))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "maximum distance %g is invalid; give 0 or more",
                         o->max_distance);
    return o->mode <= EBPO_DISTANCE_ENVELOPE ? EBPO_OK : ebpo_fail_value(error);
}

/* Returns EBPO_E_ARGUMENT if the mode does not support the given level or deadline. */
static ebpo_status check_mode(const ebpo_distance_options *o, ebpo_error *error)
{
    bool by_leaves = o->mode == EBPO_DISTANCE_RECURSIVE || o->mode == EBPO_DISTANCE_LEAVES;
    if (by_leaves && (o->level >= 0 || o->deadline_ns))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the recursive and leaves modes of distance support neither level nor "
                         "deadline; omit these, or use the exact mode");
    if (o->mode == EBPO_DISTANCE_ENVELOPE && o->deadline_ns)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the envelope mode of distance supports no deadline; give a level "
                         "(--max-level) instead");
    return EBPO_OK;
}

/* Adds the work of a batch to the model's statistics. `searched`, `loaded`: c->searched and
 * c->loaded before the batch. */
static void count_work(ebpo_context *c, uint64_t queries, uint64_t searched, uint64_t loaded)
{
    if (c->model->whole)
        return;
    c->model->distances += queries;
    c->model->distance_subtrees += c->searched - searched;
    c->model->distance_loads += c->loaded - loaded;
}

ebpo_status ebpo_distance_many(ebpo_context *context, const double *points, uint64_t count,
                               const ebpo_distance_options *options, ebpo_distance_result *out,
                               ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_distance_options wanted = EBPO_DISTANCE_OPTIONS_INIT;
    const ebpo_distance_options *o = &wanted;
    ebpo_status status = EBPO_TAKE(ebpo_distance_options, &wanted, options, error);
    if (status == EBPO_OK)
        status = ebpo_check_query_level(o->level, error);
    if (status == EBPO_OK)
        status = check_values(o, error);
    if (status == EBPO_OK)
        status = check_mode(o, error);
    if (status == EBPO_OK)
        status = ebpo_check_points(points, count, error);
    if (status == EBPO_OK && o->level < 0 && o->mode != EBPO_DISTANCE_ENVELOPE)
        status = ebpo_check_mesh(context->model, error);
    /* Planes improve the bounds of nodes, which matter with a level, with a deadline and, in a
     * subset, for omitted parts. */
    bool planes = o->level >= 0 || o->deadline_ns || o->mode != EBPO_DISTANCE_EXACT ||
                  context->model->info->pruned;
    context->content = planes ? EBPO_ACCEL_PLANES : EBPO_ACCEL_NODES;
    ebpo_batch batch = { .context = context,
                         .points = points,
                         .count = count,
                         .done = o->done,
                         .as_given = o->deadline_ns || o->level >= 0,
                         .searches_around = true };
    uint64_t searched = context->searched, loaded = context->loaded;
    if (status == EBPO_OK)
        ebpo_batch_begin(&batch);
    for (uint64_t i = 0; i < batch.count && status == EBPO_OK; i++) {
        uint64_t k = ebpo_batch_next(&batch, i);
        if (o->done && o->done[k])
            continue;
        status = distance_of_point(context, points + 3 * k, o, &out[k], error);
        status = ebpo_batch_note(&batch, i, k, status, error);
    }
    status = ebpo_batch_end(&batch, status, error);
    count_work(context, status == EBPO_OK ? count : 0, searched, loaded);
    return status;
}

ebpo_status ebpo_distance(ebpo_context *context, const double point[3],
                          const ebpo_distance_options *options, ebpo_distance_result *out,
                          ebpo_error *error)
{
    return ebpo_distance_many(context, point, 1, options, out, error);
}
