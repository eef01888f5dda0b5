/* Decides exactly whether points are inside a model.
 *
 * In a leaf the signs of its faces' planes decide where possible (leaf_kinds.c). Where the signs do
 * not decide, the faces that axis-parallel segments cross are counted: one segment begins at a cell
 * face that no face intersects, or three segments lead from the cell's lowest corner to the point.
 * A filter in single precision counts first (inside_kernels.c); exact predicates decide the faces
 * that the filter leaves open. Many points in a model that is all in memory go down the tree
 * several at a time.
 *
 * A query that may use envelopes, stops at a level or has a deadline goes from node to node and
 * loads subtrees on the way; with EBPO_LOAD_NODES it reads only the nodes on the way. Envelopes
 * decide pruned nodes (whose children are not in the file), or the query fails with EBPO_E_ABSENT.
 * Envelopes of a surface do not contain its inside, so only its white nodes decide.
 *
 * Sources: EBP 2017, 4.2; format-spec, section 10. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/os.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "format/reader.h"
#include "geometry/cursor.h"
#include "geometry/level_nodes.h"
#include "geometry/predicates.h"
#include "query/holes.h"
#include "query/load_ahead.h"
#include "query/query_model.h"
#include "query/query_node.h"

/* Decides points in pruned nodes. Recursive: a subtree may end in a pruned node, above which
 * envelopes decide. */
static ebpo_status inside_pruned(ebpo_context *context, const double p[3], ebpo_inside_result *out,
                                 ebpo_error *error);

/* --- one leaf --- */

/* Decides the faces that the filter left open, and adds their crossings. Returns true when the
 * point is on a face that was open. */
static bool decide_open(const ebpo_accel *s, const uint32_t *open, uint32_t count,
                        const ebpo_axis_segment *g, const double *point, int32_t *sum)
{
    for (uint32_t i = 0; i < count; i++) {
        double t[3][3];
        ebpo_accel_triangle(s, open[i], t);
        if (point && ebpo_point_on_triangle(point, t[0], t[1], t[2]))
            return true;
        *sum += ebpo_axis_crossing(g->from, g->to, g->axis, t[0], t[1], t[2]);
    }
    return false;
}

/* Counts crossings along a segment. Tests if `point` (the segment's end) is on a face; NULL: no
 * test. Returns false when `point` is on a face. */
static bool cross_leaf(const ebpo_inside_kernels *kernels, const ebpo_accel *s,
                       const ebpo_accel_leaf *leaf, const ebpo_axis_segment *g, const double *point,
                       uint32_t *open, int32_t *sum)
{
    uint32_t count = 0;
    *sum = kernels->crossings(s, s->list + leaf->list, g, open, &count);
    return count == 0 || !decide_open(s, open, count, g, point, sum);
}

/* A point in a leaf's cell. */
typedef struct in_leaf {
    ebpo_cell leaf;
    double xi[3];       /* the point in the coordinates of the cell, 0 .. 1; the error is at most
                         * 2^-30 */
    uint32_t sixteenth; /* the point in sixteenths of the cell as in ebpo_listed_block, eight bits
                         * for each axis */
} in_leaf;

static inline void find_in_leaf(int fine, int level, const ebpo_position *place, in_leaf *out)
{
    int up = fine - level;
    double size = ebpo_half_power(up);
    out->leaf.level = level;
    out->sixteenth = 0;
    for (int k = 0; k < 3; k++) {
        out->leaf.at[k] = place->at[k] >> up;
        out->xi[k] = (place->cells[k] - (double)(out->leaf.at[k] << up)) * size;
        int at = (int)(out->xi[k] * EBPO_LISTED_CELLS); /* rounding may give 16 */
        out->sixteenth |= (uint32_t)(at < 15 ? at : 15) << 8 * k;
    }
}

/* Returns the `reach` of ebpo_axis_segment for the point alone; a segment from the point to a cell
 * face extends this reach. */
static inline uint32_t reach_of(const in_leaf *i)
{
    return i->sixteenth | (UINT32_C(0x0f0f0f) - i->sixteenth) << 4;
}

/* Returns the segment from the leaf's free cell face to the point. */
static ebpo_axis_segment cell_face_segment(const ebpo_box *box, uint8_t cell_face, const in_leaf *i,
                                           const double p[3])
{
    int axis = cell_face / 2;
    ebpo_axis_segment g = {
        { p[0], p[1], p[2] },
        p[axis],
        axis,
        /* the cell face is at 15 (upper face), or at 0, stored as 15 (lower face) */
        reach_of(i) | (cell_face % 2 ? 0x0fu : 0xf0u) << 8 * axis
    };
    double end = ebpo_cell_face(box, axis, i->leaf.level, i->leaf.at[axis] + cell_face % 2);
    if (cell_face % 2)
        g.to = end;
    else
        g.from[axis] = end;
    return g;
}

/* Finds the winding number by one segment from a cell face that no face intersects. */
static bool from_cell_face(const ebpo_inside_kernels *kernels, const ebpo_accel *s,
                           const ebpo_accel_leaf *leaf, const in_leaf *i, const double p[3],
                           uint32_t *open, int32_t *winding)
{
    ebpo_axis_segment g = cell_face_segment(&s->box, leaf->cell_face, i, p);
    int32_t sum;
    if (!cross_leaf(kernels, s, leaf, &g, p, open, &sum))
        return false;
    *winding = leaf->winding + leaf->cell_face_step + (leaf->cell_face % 2 ? -sum : sum);
    return true;
}

/* Finds the winding number by three segments from the lowest corner: format-spec, section 10. The
 * last segment finds the faces that contain the point. `boxed`: the boxes of the leaf's list are
 * known. */
static bool from_corner(const ebpo_inside_kernels *kernels, const ebpo_accel *s,
                        const ebpo_accel_leaf *leaf, bool boxed, const in_leaf *i,
                        const double p[3], uint32_t *open, int32_t *winding)
{
    double low[3], high[3];
    ebpo_cell_bounds(&s->box, i->leaf, low, high);
    ebpo_axis_segment g = { { low[0], low[1], low[2] }, 0, 0, EBPO_REACH_ALL };
    uint32_t reach = 0xf0f0f0; /* the segment begins at the corner on all axes */
    *winding = leaf->winding;
    for (int axis = 0; axis < 3; axis++) {
        int32_t sum;
        uint32_t byte = UINT32_C(0xff) << 8 * axis;
        g.axis = axis;
        g.to = p[axis];
        reach |= i->sixteenth & byte;
        if (boxed)
            g.reach = reach;
        if (!cross_leaf(kernels, s, leaf, &g, axis == 2 ? p : NULL, open, &sum))
            return false;
        *winding += sum;
        g.from[axis] = p[axis];
        reach = (reach & ~byte) | (reach_of(i) & byte);
    }
    return true;
}

typedef float four_floats __attribute__((vector_size(16)));
typedef int32_t four_signs __attribute__((vector_size(16)));

static inline bool any_sign(four_signs mask)
{
    uint64_t half[2];
    memcpy(half, &mask, sizeof half);
    return half[0] | half[1];
}

/* Classifies the point by the signs of the leaf's planes. Returns false when a value is within the
 * rounding error. */
static bool from_planes(const ebpo_accel *s, const ebpo_accel_leaf *leaf, const in_leaf *in,
                        int32_t *winding)
{
    float x = (float)in->xi[0], y = (float)in->xi[1], z = (float)in->xi[2];
    const ebpo_kind_row *row = EBPO_KIND_ROW(s->kinds, leaf->rows);
    const ebpo_kind_row *says = row++;
    four_signs above = { 0 }, near = { 0 };
    for (uint32_t left = says->says.fours; left > 0; left--, row += 4) {
        four_floats q[4];
        memcpy(q, row, sizeof q);
        four_floats value = q[0] * x + q[1] * y + q[2] * z - q[3];
        above |= value > EBPO_PLANE_ERROR;
        near |= value >= -EBPO_PLANE_ERROR;
    }
    if (any_sign(above)) {
        *winding = says->says.outer;
        return true;
    }
    *winding = says->says.inner;
    return !any_sign(near);
}

/* Finds the leaf's kind during queries. */
static __attribute__((noinline)) ebpo_leaf_kind query_kind(const ebpo_context *context,
                                                           const ebpo_accel *s,
                                                           ebpo_accel_leaf *leaf, const in_leaf *i)
{
    if (ebpo_leaf_query(s, leaf, i->leaf, context->model->kernels.inside->cell_faces))
        ebpo_model_count_kind(context->model, leaf);
    return ebpo_leaf_kind_of(leaf);
}

static inline ebpo_leaf_kind kind_of(const ebpo_context *context, const ebpo_accel *s,
                                     ebpo_accel_leaf *leaf, const in_leaf *i)
{
    ebpo_leaf_kind kind = ebpo_leaf_kind_of(leaf);
    return kind <= EBPO_LEAF_CONCAVE ? kind : query_kind(context, s, leaf, i);
}

static inline void give_winding(const ebpo_context *context, int32_t winding,
                                ebpo_inside_result *out)
{
    bool in = ebpo_rule_inside(context->model->info->rule, winding);
    bool rounded = context->model->holes && !context->undecided;
    *out = (ebpo_inside_result){ in ? EBPO_IN : EBPO_OUT, rounded ? in : winding, 0 };
}

/* Decides a point of a surface by the winding number of surface and caps. */
static void decide_capped(const ebpo_context *context, const double p[3], int32_t winding,
                          ebpo_inside_result *out)
{
    ebpo_where where =
        context->undecided ? EBPO_OUT : ebpo_holes_where(context->model->holes, p, winding);
    *out =
        (ebpo_inside_result){ (int32_t)where, context->undecided ? winding : where == EBPO_IN, 0 };
}

static inline void give_out(ebpo_inside_result *out)
{
    *out = (ebpo_inside_result){ EBPO_OUT, 0, 0 };
}

/* Classifies a point outside of the root cell. */
static inline void inside_nowhere(const ebpo_context *context, const double p[3],
                                  ebpo_inside_result *out)
{
    if (context->model->holes)
        decide_capped(context, p, 0, out);
    else
        give_out(out);
}

/* Decides a point of a cell near the border by the winding number at the cell's lowest corner, plus
 * the crossings of faces on the way from there to the point. */
static void decide_near(const ebpo_context *context, ebpo_cell cell, int32_t winding,
                        const double p[3], ebpo_inside_result *out)
{
    const ebpo_box box = ebpo_model_box(context->model);
    double low[3], high[3];
    ebpo_cell_bounds(&box, cell, low, high);
    decide_capped(context, p, winding + ebpo_holes_crossings(context->model->holes, low, p), out);
}

/* Counts crossings of faces. */
static ebpo_status result_by_faces(ebpo_context *context, const ebpo_accel *s,
                                   const ebpo_accel_leaf *leaf, bool bounded, const in_leaf *i,
                                   const double p[3], ebpo_inside_result *out, ebpo_error *error)
{
    const ebpo_inside_kernels *kernels = context->model->kernels.inside;
    uint64_t most = (uint64_t)s->list_longest * EBPO_BLOCK;
    int32_t winding;
    /* another thread may be writing the cell face of a leaf that is not bounded yet */
    bool near = bounded && leaf->cell_face >= EBPO_NEAR_BORDER;
    if (most > context->open_capacity &&
        !ebpo_grow(&context->open, &context->open_capacity, most, sizeof *context->open))
        return ebpo_fail_memory(error, most * sizeof *context->open);
    bool off = bounded && leaf->cell_face < EBPO_NO_CELL_FACE
                   ? from_cell_face(kernels, s, leaf, i, p, context->open, &winding)
                   : from_corner(kernels, s, leaf, bounded && !near, i, p, context->open, &winding);
    if (!off)
        *out = (ebpo_inside_result){ EBPO_ON, 0, 0 };
    else if (near && leaf->cell_face == EBPO_NEAR_CAPS)
        decide_near(context, i->leaf, winding, p, out);
    else if (near)
        decide_capped(context, p, winding, out);
    else
        give_winding(context, winding, out);
    return EBPO_OK;
}

static ebpo_status result_in_leaf(ebpo_context *context, const ebpo_accel *s, ebpo_accel_leaf *leaf,
                                  const in_leaf *i, const double p[3], ebpo_inside_result *out,
                                  ebpo_error *error)
{
    int32_t winding;
    ebpo_leaf_kind kind = kind_of(context, s, leaf, i);
    if (!ebpo_leaf_has_planes(kind) || !from_planes(s, leaf, i, &winding))
        return result_by_faces(context, s, leaf, ebpo_leaf_is_bounded(kind), i, p, out, error);
    give_winding(context, winding, out);
    return EBPO_OK;
}

/* Classifies p in a leaf of a subtree at this level; p is in the leaf's cell, and `place` is its
 * shifted position. */
static ebpo_status inside_leaf(ebpo_context *context, const ebpo_accel *s, uint32_t number,
                               int level, const ebpo_position *place, const double p[3],
                               ebpo_inside_result *out, ebpo_error *error)
{
    in_leaf i;
    find_in_leaf(context->model->locator.level, level, place, &i);
    return result_in_leaf(context, s, &s->leaf[number], &i, p, out, error);
}

/* Classifies a point in a white node of a surface. */
static __attribute__((noinline)) void inside_marked(const ebpo_context *context,
                                                    const ebpo_node_table *table, uint32_t entry,
                                                    const ebpo_position *place, int level,
                                                    const double p[3], ebpo_inside_result *out)
{
    int fine = context->model->locator.level;
    int32_t marked = ebpo_entry_winding(entry);
    while (ebpo_entry_mark(marked) == EBPO_MARK_SPLIT)
        marked = ebpo_entry_winding(
            table->split[ebpo_marked_value(marked)][ebpo_octant_at(place->at, fine - ++level)]);
    int32_t winding = ebpo_marked_value(marked);
    bool in = ebpo_entry_mark(marked) == EBPO_MARK_IN;
    switch (ebpo_entry_mark(marked)) {
    case EBPO_MARK_APART: decide_capped(context, p, winding, out); break;
    case EBPO_MARK_NEAR:
        decide_near(context,
                    ebpo_cell_ancestor((ebpo_cell){ fine,
                                                    { place->at[0], place->at[1], place->at[2] } },
                                       level),
                    winding, p, out);
        break;
    default:
        *out =
            (ebpo_inside_result){ in ? EBPO_IN : EBPO_OUT, context->undecided ? winding : in, 0 };
    }
}

/* Classifies a point in a white or black node of a table. */
static inline void inside_uniform(const ebpo_context *context, const ebpo_node_table *table,
                                  uint32_t entry, const ebpo_position *place, int level,
                                  const double p[3], ebpo_inside_result *out)
{
    if (context->model->holes)
        inside_marked(context, table, entry, place, level, p, out);
    else
        give_winding(context, ebpo_entry_winding(entry), out);
}

/* Classifies p in a subtree whose root's cell contains p; `place` is its shifted position. */
static ebpo_status inside_subtree(ebpo_context *context, const ebpo_accel *s,
                                  const ebpo_position *place, const double p[3],
                                  ebpo_inside_result *out, ebpo_error *error)
{
    ebpo_descent d = ebpo_descend(&s->nodes, context->model->locator.level, place->at);
    if (ebpo_entry_kind_of(d.entry) == EBPO_ENTRY_UNIFORM) {
        inside_uniform(context, &s->nodes, d.entry, place, d.level, p, out);
        return EBPO_OK;
    }
    if (ebpo_entry_kind_of(d.entry) == EBPO_ENTRY_SUBTREE_ROOT)
        return inside_pruned(context, p, out, error);
    return inside_leaf(context, s, ebpo_entry_value(d.entry), d.level, place, p, out, error);
}

/* Number of points that are processed together, stage by stage, so that memory for one stage is
 * fetched while other points are processed. */
enum { TOGETHER = 16 };

typedef struct lane {
    ebpo_position place;
    bool within;
    ebpo_descent d;
} lane;

/* A point whose way down the tree ended in a leaf. */
typedef struct waiting {
    ebpo_accel_leaf *leaf;
    unsigned point;
    in_leaf in;
} waiting;

static void start_lanes(const ebpo_accel *s, const ebpo_locator *locator, const double *points,
                        unsigned count, lane *l)
{
    int fine = locator->level;
    for (unsigned i = 0; i < count; i++) {
        l[i].within = ebpo_locator_find(locator, points + 3 * i, &l[i].place);
        if (l[i].within && s->nodes.grid) {
            uint64_t cell = ebpo_grid_cell(&s->nodes, fine, l[i].place.at);
            __builtin_prefetch(&s->nodes.grid[cell]);
        }
    }
    for (unsigned i = 0; i < count; i++)
        if (l[i].within) {
            l[i].d = ebpo_descent_begin(&s->nodes, fine, l[i].place.at);
            ebpo_descent_prefetch(&l[i].d, &s->nodes);
        }
}

static void descend_together(const ebpo_accel *s, int fine, unsigned count, lane *l)
{
    for (bool more = true; more;) {
        more = false;
        for (unsigned i = 0; i < count; i++)
            if (l[i].within && ebpo_descent_step(&l[i].d, &s->nodes, fine, l[i].place.at))
                more |= ebpo_descent_prefetch(&l[i].d, &s->nodes);
    }
}

/* Prefetches the cache lines of the blocks that the point's segment may intersect. */
static void prefetch_blocks(const ebpo_accel *s, const waiting *w, const double p[3])
{
    const ebpo_accel_leaf *leaf = w->leaf;
    ebpo_leaf_kind kind = ebpo_leaf_kind_of(leaf);
    ebpo_axis_segment g = { .reach = EBPO_REACH_ALL };
    if (ebpo_leaf_has_planes(kind))
        return;
    if (ebpo_leaf_is_bounded(kind) && leaf->cell_face < EBPO_NO_CELL_FACE)
        g = cell_face_segment(&s->box, leaf->cell_face, &w->in, p);
    const ebpo_listed_block *list = s->list + leaf->list;
    for (int b = 0; b < 8; b++) {
        uint64_t listed = ebpo_listed(list + b);
        if (ebpo_axis_segment_intersects(&g, listed))
            for (int line = 0; line < (s->wide ? 4 : 2); line++)
                __builtin_prefetch((const char *)ebpo_accel_meshlet(s, ebpo_listed_number(listed)) +
                                   64 * line);
        if (listed & EBPO_LISTED_LAST)
            return;
    }
}

static ebpo_status result_waiting(ebpo_context *context, const ebpo_accel *s, const waiting *w,
                                  unsigned count, const double *points, ebpo_inside_result *out,
                                  ebpo_error *error)
{
    for (unsigned i = 0; i < count; i++) {
        __builtin_prefetch(s->list + w[i].leaf->list);
        if (ebpo_leaf_has_planes(ebpo_leaf_kind_of(w[i].leaf)))
            __builtin_prefetch(EBPO_KIND_ROW(s->kinds, w[i].leaf->rows));
    }
    for (unsigned i = 0; i < count; i++)
        prefetch_blocks(s, &w[i], points + 3 * w[i].point);
    ebpo_status status = EBPO_OK;
    for (unsigned i = 0; i < count && status == EBPO_OK; i++)
        status = result_in_leaf(context, s, w[i].leaf, &w[i].in, points + 3 * w[i].point,
                                &out[w[i].point], error);
    return status;
}

static ebpo_status inside_together(ebpo_context *context, const ebpo_accel *s, const double *points,
                                   unsigned count, ebpo_inside_result *out, ebpo_error *error)
{
    lane l[TOGETHER];
    waiting w[TOGETHER];
    unsigned leaves = 0;
    int fine = context->model->locator.level;
    start_lanes(s, &context->model->locator, points, count, l);
    descend_together(s, fine, count, l);
    for (unsigned i = 0; i < count; i++) {
        if (!l[i].within) {
            inside_nowhere(context, points + 3 * i, &out[i]);
        } else if (ebpo_entry_kind_of(l[i].d.entry) == EBPO_ENTRY_UNIFORM) {
            inside_uniform(context, &s->nodes, l[i].d.entry, &l[i].place, l[i].d.level,
                           points + 3 * i, &out[i]);
        } else if (ebpo_entry_kind_of(l[i].d.entry) == EBPO_ENTRY_SUBTREE_ROOT) {
            ebpo_status status = inside_pruned(context, points + 3 * i, &out[i], error);
            if (status != EBPO_OK)
                return status;
        } else {
            w[leaves].leaf = &s->leaf[ebpo_entry_value(l[i].d.entry)];
            w[leaves].point = i;
            __builtin_prefetch(w[leaves].leaf);
            find_in_leaf(fine, l[i].d.level, &l[i].place, &w[leaves].in);
            leaves++;
        }
    }
    return result_waiting(context, s, w, leaves, points, out, error);
}

/* Classifies points with the whole tree in memory. */
static ebpo_status inside_whole(ebpo_context *context, const double *points, uint64_t count,
                                bool *done, ebpo_inside_result *out, ebpo_error *error)
{
    const ebpo_accel *s = context->model->whole;
    ebpo_status status = EBPO_OK;
    if (count == 1) {
        ebpo_position place;
        if (ebpo_locator_find(&context->model->locator, points, &place))
            status = inside_subtree(context, s, &place, points, out, error);
        else
            inside_nowhere(context, points, out);
    }
    for (uint64_t i = 0; count > 1 && i < count && status == EBPO_OK; i += TOGETHER)
        status = inside_together(context, s, points + 3 * i,
                                 count - i < TOGETHER ? (unsigned)(count - i) : TOGETHER, out + i,
                                 error);
    if (status == EBPO_OK && done)
        memset(done, true, count);
    return status;
}

/* --- node by node: EBP 2017, 4.2 --- */

static bool uses_envelopes(const ebpo_context *c, const ebpo_inside_options *o)
{
    /* An envelope proves that a point is outside, but not which winding number the point has: with
     * rules other than nonzero the result would be incomplete. */
    bool whole_result =
        c->model->info->rule == EBPO_RULE_NONZERO || o->level >= 0 || o->deadline_ns;
    if (o->envelopes == EBPO_ENVELOPES_SKIP || !whole_result || c->model->holes)
        return false;
    return o->envelopes == EBPO_ENVELOPES_USE || !c->model->whole || o->level >= 0 ||
           o->deadline_ns;
}

typedef struct inside_query {
    ebpo_context *context;
    const ebpo_inside_options *options;
    ebpo_box box;
    bool envelopes;
    uint64_t deadline; /* a time of ebpo_clock; 0: none */
    const double *p;
    ebpo_position place;
} inside_query;

static void give_maybe(const inside_query *a, ebpo_cell cell, ebpo_inside_result *out)
{
    *out = (ebpo_inside_result){ EBPO_MAYBE, 0, ebpo_cell_diagonal(&a->box, cell) };
}

static bool outside_envelope(const inside_query *a, const ebpo_node *node)
{
    uint32_t count;
    const uint32_t *codes =
        a->envelopes ? ebpo_model_planes(a->context->model, node, &count) : NULL;
    return codes && ebpo_outside_planes(&a->box, node->cell, codes, count, a->p);
}

static bool is_late(const inside_query *a) { return a->deadline && ebpo_clock() > a->deadline; }

static bool stops_here(const inside_query *a, const ebpo_node *node)
{
    if (a->options->level >= 0 &&
        (node->cell.level >= a->options->level || node->type != EBPO_GRAY || node->pruned))
        return true;
    return is_late(a);
}

/* Returns the table of nodes that are in no subtree. */
static const ebpo_node_table *top_nodes(const ebpo_model *m)
{
    return m->whole ? &m->whole->nodes : &m->top->nodes;
}

/* Decides the point at a node of the top or of a subtree, without visiting the node's children.
 * Returns false if that is not possible. */
static inline bool decide_at(const inside_query *a, const ebpo_node *node, ebpo_inside_result *out)
{
    if (ebpo_node_is_uniform(node))
        inside_uniform(a->context,
                       node->subtree ? &node->subtree->nodes : top_nodes(a->context->model),
                       node->entry, &a->place, node->cell.level, a->p, out);
    else if (outside_envelope(a, node))
        give_out(out);
    else if (stops_here(a, node))
        give_maybe(a, node->cell, out);
    else
        return false;
    return true;
}

static ebpo_status walk_down(inside_query *a, ebpo_inside_result *out, ebpo_error *error)
{
    const ebpo_model *m = a->context->model;
    int fine = m->info->level_count - 1;
    ebpo_node node = ebpo_model_root(m);
    for (;;) {
        if (decide_at(a, &node, out))
            return EBPO_OK;
        if (ebpo_node_is_subtree_root(&node)) {
            ebpo_status status = ebpo_model_enter(a->context, &node, error);
            if (status != EBPO_OK)
                return status;
            if (!a->envelopes && a->options->level < 0 && !a->deadline)
                return inside_subtree(a->context, node.subtree, &a->place, a->p, out, error);
        }
        if (ebpo_entry_kind_of(node.entry) == EBPO_ENTRY_LEAF)
            return inside_leaf(a->context, node.subtree, ebpo_entry_value(node.entry),
                               node.cell.level, &a->place, a->p, out, error);
        node = ebpo_model_child(m, &node, ebpo_octant_at(a->place.at, fine - node.cell.level - 1));
    }
}

/* --- node by node from the file: only nodes on the way are read, and only decoded chunks are kept
 * --- */

static ebpo_status leaf_from_file(inside_query *a, const ebpo_node *leaf, ebpo_inside_result *out,
                                  ebpo_error *error)
{
    ebpo_model *m = a->context->model;
    ebpo_slice slice;
    ebpo_accel *subtree;
    ebpo_status status = ebpo_model_has_capacity(m, leaf, error);
    if (status == EBPO_OK)
        status = ebpo_slice_read(&slice, m->chunks, leaf, error);
    if (status == EBPO_OK)
        status = ebpo_accel_make(&subtree, &slice, m->info, false, 1, error);
    if (status == EBPO_OK && m->holes)
        status = ebpo_holes_mark(m->holes,
                                 &(ebpo_marked_table){ &subtree->box, leaf->cell, &subtree->nodes,
                                                       subtree->leaf, 0, 0 },
                                 error);
    if (status == EBPO_OK) {
        ebpo_model_count_leaves(m, subtree, 1);
        status = inside_leaf(a->context, subtree, ebpo_entry_value(subtree->nodes.root),
                             leaf->cell.level, &a->place, a->p, out, error);
        ebpo_model_count_leaves(m, subtree, -1);
        ebpo_accel_free(subtree);
    }
    return status;
}

static ebpo_status uniform_from_file(inside_query *a, const ebpo_node *node,
                                     ebpo_inside_result *out, ebpo_error *error)
{
    int32_t winding;
    ebpo_status status = ebpo_chunks_winding(a->context->model->chunks, node, &winding, error);
    if (status == EBPO_OK && a->context->model->holes)
        decide_near(a->context, node->cell, winding, a->p, out);
    else if (status == EBPO_OK)
        give_winding(a->context, winding, out);
    return status;
}

/* Handles a gray node on the way; sets *done when the node decides. A node is known to be pruned
 * only after its children have been requested. */
static ebpo_status pass_gray(inside_query *a, ebpo_cursor *c, bool *done, ebpo_inside_result *out,
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
        give_out(out);
        return EBPO_OK;
    }
    bool limited = a->options->level >= 0;
    if ((limited && (node->cell.level >= a->options->level || node->pruned)) || is_late(a)) {
        give_maybe(a, node->cell, out);
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
        give_maybe(a, node->cell, out);
    else
        status = ebpo_fail_pruned(m, node->cell, error);
    return status;
}

/* Walks down from the root of a subtree by reading nodes from the file. */
static ebpo_status walk_file(inside_query *a, const ebpo_node *below, ebpo_inside_result *out,
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
        give_maybe(a, node->cell, out);
        return EBPO_OK;
    }
    return node->type == EBPO_LEAF ? leaf_from_file(a, node, out, error)
                                   : uniform_from_file(a, node, out, error);
}

static ebpo_status walk_nodes(inside_query *a, ebpo_inside_result *out, ebpo_error *error)
{
    const ebpo_model *m = a->context->model;
    int fine = m->info->level_count - 1;
    ebpo_node node = ebpo_model_root(m);
    while (!ebpo_node_is_subtree_root(&node)) {
        if (decide_at(a, &node, out))
            return EBPO_OK;
        node = ebpo_model_child(m, &node, ebpo_octant_at(a->place.at, fine - node.cell.level - 1));
    }
    return walk_file(a, &node, out, error);
}

/* Returns the subtree that the context holds if its cell contains p, else NULL. *entry, *level: the
 * node at which the way down the levels above the subtrees ends. */
static const ebpo_accel *held_around(const inside_query *a, uint32_t *entry, int *level)
{
    const ebpo_context *c = a->context;
    int fine = c->model->info->level_count - 1;
    *entry = ebpo_entry(EBPO_ENTRY_SUBTREE_ROOT, 0);
    if (c->model->whole)
        return c->model->whole;
    ebpo_descent d = ebpo_descend(&c->model->top->nodes, fine, a->place.at);
    *entry = d.entry;
    *level = d.level;
    bool below = ebpo_entry_kind_of(*entry) == EBPO_ENTRY_SUBTREE_ROOT;
    return below && ebpo_context_has_pinned(c, ebpo_entry_value(*entry)) ? c->pinned : NULL;
}

/* Returns true when the context holds all data that p needs: then envelopes save nothing, and only
 * the faces of a leaf take time. */
static bool result_in_memory(inside_query *a, ebpo_inside_result *out, ebpo_status *status,
                             ebpo_error *error)
{
    const ebpo_model *m = a->context->model;
    uint32_t entry;
    int level;
    const ebpo_accel *held = held_around(a, &entry, &level);
    *status = EBPO_OK;
    if (ebpo_entry_kind_of(entry) == EBPO_ENTRY_UNIFORM) {
        inside_uniform(a->context, top_nodes(m), entry, &a->place, level, a->p, out);
        return true;
    }
    if (!held)
        return false;
    if (!a->deadline) {
        *status = inside_subtree(a->context, held, &a->place, a->p, out, error);
        return true;
    }
    int fine = m->info->level_count - 1;
    ebpo_descent d = ebpo_descend(&held->nodes, fine, a->place.at);
    if (ebpo_entry_kind_of(d.entry) == EBPO_ENTRY_SUBTREE_ROOT)
        return false; /* pruned: an envelope may decide */
    ebpo_cell cell = ebpo_descent_cell(&d, fine, a->place.at);
    if (ebpo_entry_kind_of(d.entry) == EBPO_ENTRY_UNIFORM)
        inside_uniform(a->context, &held->nodes, d.entry, &a->place, d.level, a->p, out);
    else if (is_late(a))
        give_maybe(a, cell, out);
    else
        *status = inside_leaf(a->context, held, ebpo_entry_value(d.entry), d.level, &a->place, a->p,
                              out, error);
    return true;
}

/* Decides below a pruned node of the whole tree or of a subtree by an envelope, or returns
 * EBPO_E_ABSENT. */
static ebpo_status inside_pruned(ebpo_context *context, const double p[3], ebpo_inside_result *out,
                                 ebpo_error *error)
{
    const ebpo_model *m = context->model;
    if (m->holes) /* envelopes do not contain the inside of a surface */
        return ebpo_fail_pruned(m, (ebpo_cell){ 0, { 0, 0, 0 } }, error);
    ebpo_inside_options options = EBPO_INSIDE_OPTIONS_INIT;
    inside_query a = {
        .context = context, .options = &options, .box = ebpo_model_box(m), .envelopes = true, .p = p
    };
    if (!ebpo_locator_find(&m->locator, p, &a.place))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "a point outside the root cell has no node");
    ebpo_status status = walk_down(&a, out, error);
    if (status == EBPO_OK && out->where == EBPO_OUT &&
        m->info->rule != EBPO_RULE_NONZERO) /* the point is outside, but its winding number is not
                                             * known */
        return ebpo_fail_pruned(m, (ebpo_cell){ 0, { 0, 0, 0 } }, error);
    return status;
}

/* Classifies a point from node to node: with envelopes, to a level, with a deadline, or with a
 * model that is not all in memory. */
static ebpo_status inside_walk(ebpo_context *context, const double p[3],
                               const ebpo_inside_options *options, ebpo_inside_result *out,
                               ebpo_error *error)
{
    const ebpo_model *m = context->model;
    inside_query a = { .context = context,
                       .options = options,
                       .box = ebpo_model_box(m),
                       .envelopes = uses_envelopes(context, options),
                       .p = p };
    if (options->deadline_ns)
        a.deadline = ebpo_clock() + options->deadline_ns;
    if (!ebpo_locator_find(&m->locator, p, &a.place)) {
        inside_nowhere(context, p, out);
        return EBPO_OK;
    }
    ebpo_status status;
    bool plain = options->envelopes != EBPO_ENVELOPES_USE && options->level < 0;
    if (plain && (m->whole || m->options.loading != EBPO_LOAD_NODES) &&
        result_in_memory(&a, out, &status, error))
        return status;
    return !m->whole && m->options.loading == EBPO_LOAD_NODES ? walk_nodes(&a, out, error)
                                                              : walk_down(&a, out, error);
}

ebpo_status ebpo_inside_many(ebpo_context *context, const double *points, uint64_t count,
                             const ebpo_inside_options *options, ebpo_inside_result *out,
                             ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_inside_options wanted = EBPO_INSIDE_OPTIONS_INIT;
    const ebpo_inside_options *o = &wanted;
    const ebpo_model *m = context->model;
    ebpo_status status = EBPO_TAKE(ebpo_inside_options, &wanted, options, error);
    if (status == EBPO_OK)
        status = ebpo_check_query_level(o->level, error);
    if (status == EBPO_OK && o->envelopes > EBPO_ENVELOPES_SKIP)
        status = ebpo_fail_value(error);
    if (status == EBPO_OK && !m->info->solid && !m->holes)
        status = ebpo_fail_file(error, EBPO_E_NOT_SOLID, m->file->in.shown,
                                "the model is a surface, stored without its border: it has no "
                                "inside; 'ebpo repack' adds the border, or run 'ebpo check' on its "
                                "source to see the repairs that make a solid");
    if (status == EBPO_OK)
        status = ebpo_check_points(points, count, error);
    if (status == EBPO_OK && o->level < 0)
        status = ebpo_check_mesh(m, error);
    if (status == EBPO_OK && m->whole && o->level < 0 && !o->deadline_ns &&
        o->envelopes != EBPO_ENVELOPES_USE)
        return inside_whole(context, points, count, o->done, out, error);
    context->planes = !m->holes && (o->level >= 0 || o->deadline_ns ||
                                    o->envelopes == EBPO_ENVELOPES_USE || m->info->pruned);
    ebpo_batch batch = { .context = context,
                         .points = points,
                         .count = count,
                         .done = o->done,
                         .as_given = o->deadline_ns || o->level >= 0 };
    if (status == EBPO_OK)
        ebpo_batch_begin(&batch);
    for (uint64_t i = 0; i < batch.count && status == EBPO_OK; i++) {
        uint64_t k = ebpo_batch_next(&batch, i);
        if (o->done && o->done[k])
            continue;
        status = inside_walk(context, points + 3 * k, o, &out[k], error);
        if (status == EBPO_OK && ebpo_model_prefetches(m) &&
            (o->level < 0 || o->level > m->top->cut_level))
            ebpo_context_prefetch(context, points + 3 * k, 0);
        status = ebpo_batch_note(&batch, i, k, status, error);
    }
    return ebpo_batch_end(&batch, status, error);
}

/* Returns true if the query has no special options and everything is in memory: only the point must
 * be checked. */
static inline bool is_plain(const ebpo_context *context, const ebpo_inside_options *o)
{
    return context->model->results_inside &&
           (!o || (o->struct_size == sizeof *o && o->level == EBPO_LEVEL_ALL &&
                   o->envelopes == EBPO_ENVELOPES_AUTO && !o->deadline_ns));
}

static ebpo_status inside_plain(ebpo_context *context, const double point[3],
                                ebpo_inside_result *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_position place;
    if (ebpo_locator_find(&context->model->locator, point, &place))
        return inside_subtree(context, context->model->whole, &place, point, out, error);
    ebpo_status status = ebpo_check_points(point, 1, error);
    if (status == EBPO_OK)
        inside_nowhere(context, point, out);
    return status;
}

ebpo_status ebpo_inside(ebpo_context *context, const double point[3],
                        const ebpo_inside_options *options, ebpo_inside_result *out,
                        ebpo_error *error)
{
    return is_plain(context, options) ? inside_plain(context, point, out, error)
                                      : ebpo_inside_many(context, point, 1, options, out, error);
}

ebpo_status ebpo_give_sign(ebpo_context *c, const double p[3], const ebpo_distance_options *o,
                           ebpo_distance_result *out, ebpo_error *error)
{
    ebpo_inside_result where;
    ebpo_inside_options plain = EBPO_INSIDE_OPTIONS_INIT;
    const ebpo_model *m = c->model;
    if ((!m->info->solid && !m->holes) || o->unsigned_distance || out->face == EBPO_NO_FACE)
        return EBPO_OK;
    ebpo_status status = m->whole ? inside_whole(c, p, 1, NULL, &where, error)
                                  : inside_walk(c, p, &plain, &where, error);
    if (status == EBPO_OK && where.where == EBPO_IN)
        out->distance = -out->distance;
    return status;
}
