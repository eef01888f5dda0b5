/* Decides exactly whether points are inside a model.
 *
 * In leaves of some kinds, the signs of the planes of the leaf's faces at the point decide
 * (leaf_kinds.c). In other leaves, the query starts from the known winding number at another
 * position of the cell. It adds the crossings of faces on the way from this position to the point.
 * The way is one axis-parallel segment from a free cell face (a cell face that no face intersects),
 * or three such segments from the cell's lowest corner. A filter in single precision counts the
 * crossings first (inside_kernels.c). A face that the filter cannot decide is *open*; exact
 * predicates decide it. In a model that is completely in memory, a batch goes down the tree with
 * several points at a time.
 *
 * A query that may use envelopes, stops at a level or has a deadline goes from node to node and
 * loads subtrees on the way. With EBPO_LOAD_NODES, such a query reads only the nodes on the way. If
 * the point is in a pruned node (whose children are not in the file), an envelope decides, or the
 * query fails with EBPO_E_ABSENT. For surfaces, envelopes do not decide, because the inside of a
 * surface may be outside its envelopes.
 *
 * In a surface with its border (the edges of its holes), leaves and white nodes near the border are
 * marked, and points in them are decided by holes.c. A batch gathers these points, and decides them
 * together.
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

/* Decides a point in a pruned node by the envelopes of the nodes above it. (Declared here, because
 * inside_pruned and functions below call each other.) */
static ebpo_status inside_pruned(ebpo_context *context, const double p[3], ebpo_inside_result *out,
                                 ebpo_error *error);

/* --- one leaf --- */

/* Decides the open faces, and adds their crossings to *sum. Returns true if `point` (NULL: no test)
 * is on one of these faces. */
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

/* Sets *sum to the signed crossings of a leaf's faces with a segment. Returns false if `point`, an
 * end of the segment, is on a face. If `point` is NULL, always returns true. */
static bool cross_leaf(const ebpo_inside_kernels *kernels, const ebpo_accel *s,
                       const ebpo_accel_leaf *leaf, const ebpo_axis_segment *g, const double *point,
                       uint32_t *open, int32_t *sum)
{
    uint32_t count = 0;
    *sum = kernels->crossings(s, s->list + leaf->list, g, open, &count);
    return count == 0 || !decide_open(s, open, count, g, point, sum);
}

/* A point in a leaf's cell. */
typedef struct leaf_point {
    ebpo_cell leaf; /* the leaf's cell */
    int deepest;    /* level of `position` */
    double xi[3];   /* coordinates in the cell, 0 .. 1; the error is at most 2^-30 */
    const ebpo_position *position;
    uint32_t sixteenth; /* coordinates in sixteenths of the cell, eight bits for each axis, as the
                         * lower sides in ebpo_listed_block */
} leaf_point;

/* Computes the coordinates of a position in the cell of this level, 0 .. 1 on each axis. */
static inline void find_coordinates(int deepest, int level, const ebpo_position *position,
                                    double x[3])
{
    int up = deepest - level;
    double size = ebpo_half_power(up);
    for (int k = 0; k < 3; k++)
        x[k] = (position->cells[k] - (double)(position->at[k] >> up << up)) * size;
}

/* Finds the position of a point in the cell of its leaf. `level`: level of the leaf. */
static inline void find_leaf_point(int deepest, int level, const ebpo_position *position,
                                   leaf_point *out)
{
    int up = deepest - level;
    out->leaf.level = level;
    out->deepest = deepest;
    out->position = position;
    out->sixteenth = 0;
    find_coordinates(deepest, level, position, out->xi);
    for (int k = 0; k < 3; k++) {
        out->leaf.at[k] = position->at[k] >> up;
        int at = (int)(out->xi[k] * EBPO_LISTED_CELLS); /* rounding may give 16 */
        out->sixteenth |= (uint32_t)(at < 15 ? at : 15) << 8 * k;
    }
}

/* Returns ebpo_axis_segment.reach for a segment of length 0 at the point. */
static inline uint32_t reach_of(const leaf_point *at)
{
    return at->sixteenth | (UINT32_C(0x0f0f0f) - at->sixteenth) << 4;
}

/* Returns the segment from the leaf's free cell face to the point. */
static ebpo_axis_segment cell_face_segment(const ebpo_box *box, uint8_t cell_face,
                                           const leaf_point *at, const double p[3])
{
    int axis = cell_face / 2;
    ebpo_axis_segment g = {
        { p[0], p[1], p[2] },
        p[axis],
        axis,
        /* the cell face is at 15 (upper face), or at 0, stored as 15 (lower face) */
        reach_of(at) | (cell_face % 2 ? 0x0fu : 0xf0u) << 8 * axis
    };
    double end = ebpo_cell_face(box, axis, at->leaf.level, at->leaf.at[axis] + cell_face % 2);
    if (cell_face % 2)
        g.to = end;
    else
        g.from[axis] = end;
    return g;
}

/* Computes the winding number by one segment between the free cell face and the point. Returns
 * false if the point is on a face. */
static bool from_cell_face(const ebpo_inside_kernels *kernels, const ebpo_accel *s,
                           const ebpo_accel_leaf *leaf, const leaf_point *at, const double p[3],
                           uint32_t *open, int32_t *winding)
{
    ebpo_axis_segment g = cell_face_segment(&s->box, leaf->cell_face, at, p);
    int32_t sum;
    if (!cross_leaf(kernels, s, leaf, &g, p, open, &sum))
        return false;
    *winding = leaf->winding + leaf->cell_face_step + (leaf->cell_face % 2 ? -sum : sum);
    return true;
}

/* The lowest corner of a leaf's cell, or of a part of this cell. */
typedef struct path_start {
    double low[3];
    int32_t winding;
    uint32_t reach; /* ebpo_axis_segment.reach for a segment of length 0 at the corner */
} path_start;

/* Returns the lowest corner of the leaf's cell, or of the part that has this level and contains the
 * point. `winding`: winding number at the corner. */
static path_start start_of(const ebpo_accel *s, int32_t winding, const leaf_point *at, int level)
{
    path_start out = { .winding = winding, .reach = 0xf0f0f0 };
    ebpo_cell cell = at->leaf;
    double high[3];
    int down = level - cell.level;
    if (down > 0) {
        const uint32_t *position = at->position->at;
        cell = ebpo_cell_ancestor((ebpo_cell){ at->deepest,
                                               { position[0], position[1], position[2] } },
                                  level);
        out.reach = 0;
        for (int k = 0; k < 3; k++) {
            uint32_t x = (down < 4 ? cell.at[k] << (4 - down) : cell.at[k] >> (down - 4)) & 15;
            out.reach |= (x | (15 - x) << 4) << 8 * k;
        }
    }
    ebpo_cell_bounds(&s->box, cell, out.low, high);
    return out;
}

/* Computes the winding number by three segments from a corner to the point (format-spec, section
 * 10). Returns false if the point is on a face; only the last segment, which ends at the point,
 * tests this. `boxed`: the boxes of the leaf's list are known. */
static bool from_corner(const ebpo_inside_kernels *kernels, const ebpo_accel *s,
                        const ebpo_accel_leaf *leaf, bool boxed, const path_start *start,
                        const leaf_point *at, const double p[3], uint32_t *open, int32_t *winding)
{
    const double *low = start->low;
    ebpo_axis_segment g = { { low[0], low[1], low[2] }, 0, 0, EBPO_REACH_ALL };
    uint32_t reach = start->reach;
    *winding = start->winding;
    for (int axis = 0; axis < 3; axis++) {
        int32_t sum;
        uint32_t byte = UINT32_C(0xff) << 8 * axis;
        g.axis = axis;
        g.to = p[axis];
        reach = (reach & ~(UINT32_C(0x0f) << 8 * axis)) | (at->sixteenth & byte);
        if (boxed)
            g.reach = reach;
        if (!cross_leaf(kernels, s, leaf, &g, axis == 2 ? p : NULL, open, &sum))
            return false;
        *winding += sum;
        g.from[axis] = p[axis];
        reach = (reach & ~byte) | (reach_of(at) & byte);
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

/* Classifies the point by the signs of the leaf's planes. Returns false if rounding errors could
 * change the result. */
static bool from_planes(const ebpo_accel *s, const ebpo_accel_leaf *leaf, const leaf_point *in,
                        int32_t *winding)
{
    float x = (float)in->xi[0], y = (float)in->xi[1], z = (float)in->xi[2];
    const ebpo_kind_row *row = EBPO_KIND_ROW(s->kinds, leaf->rows);
    const ebpo_kind_row *head = row++;
    four_signs above = { 0 }, not_below = { 0 };
    for (uint32_t group = 0; group < head->head.fours; group++, row += 4) {
        four_floats q[4];
        memcpy(q, row, sizeof q);
        four_floats value = q[0] * x + q[1] * y + q[2] * z - q[3];
        above |= value > EBPO_PLANE_ERROR;
        not_below |= value >= -EBPO_PLANE_ERROR;
    }
    if (any_sign(above)) {
        *winding = head->head.outer;
        return true;
    }
    *winding = head->head.inner;
    return !any_sign(not_below);
}

/* Counts a query of a leaf whose kind is not known, and may find the kind. Returns the kind. */
static __attribute__((noinline)) ebpo_leaf_kind query_kind(const ebpo_context *context,
                                                           const ebpo_accel *s,
                                                           ebpo_accel_leaf *leaf,
                                                           const leaf_point *at)
{
    if (ebpo_leaf_query(s, leaf, at->leaf, context->model->kernels.inside->cell_faces))
        ebpo_model_count_kind(context->model, leaf);
    return ebpo_leaf_kind_of(leaf);
}

static inline ebpo_leaf_kind kind_of(const ebpo_context *context, const ebpo_accel *s,
                                     ebpo_accel_leaf *leaf, const leaf_point *at)
{
    ebpo_leaf_kind kind = ebpo_leaf_kind_of(leaf);
    return kind <= EBPO_LEAF_CONCAVE ? kind : query_kind(context, s, leaf, at);
}

/* Sets the result for a winding number. For a surface, the result's winding number is 0 or 1. If
 * ebpo_context.undecided is true, the result has the given winding number also for a surface. */
static inline void give_winding(const ebpo_context *context, int32_t winding,
                                ebpo_inside_result *out)
{
    bool in = ebpo_rule_inside(context->model->info->rule, winding);
    bool rounded = context->model->holes && !context->undecided;
    *out = (ebpo_inside_result){ in ? EBPO_IN : EBPO_OUT, rounded ? in : winding, 0 };
}

/* Decides a point of a surface. `winding`: winding number at the point, for the closed mesh of the
 * surface and its caps (faces that close its holes). */
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
static inline void inside_beyond_root(const ebpo_context *context, const double p[3],
                                      ebpo_inside_result *out)
{
    if (context->model->holes)
        decide_capped(context, p, 0, out);
    else
        give_out(out);
}

/* Decides a point of a cell near the border. `cell`: the record of the cell, which makes the
 * decision faster, or NULL. `winding`: winding number of surface and caps at the point. */
static void decide_near(const ebpo_context *context, const ebpo_node_table *table,
                        const ebpo_near_cell *cell, int32_t winding, const ebpo_position *position,
                        const double p[3], ebpo_inside_result *out)
{
    double x[3];
    if (context->undecided || !cell) {
        decide_capped(context, p, winding, out);
        return;
    }
    find_coordinates(context->model->locator.level, cell->level, position, x);
    ebpo_where where = ebpo_holes_where_in(context->model->holes, table, cell, p, x, winding);
    *out = (ebpo_inside_result){ (int32_t)where, where == EBPO_IN, 0 };
}

/* Ensures the capacity of context->open. */
static ebpo_status prepare_open(ebpo_context *context, const ebpo_accel *s, ebpo_error *error)
{
    uint64_t most = (uint64_t)s->list_longest * EBPO_BLOCK;
    if (most > context->open_capacity &&
        !ebpo_grow(&context->open, &context->open_capacity, most, sizeof *context->open))
        return ebpo_fail_memory(error, most * sizeof *context->open);
    return EBPO_OK;
}

/* Decides a point in a leaf by counting crossings. The leaf is not near the border, or its kind is
 * not known. */
static ebpo_status result_by_faces(ebpo_context *context, const ebpo_accel *s,
                                   const ebpo_accel_leaf *leaf, bool bounded, const leaf_point *at,
                                   const double p[3], ebpo_inside_result *out, ebpo_error *error)
{
    const ebpo_inside_kernels *kernels = context->model->kernels.inside;
    int32_t winding;
    bool on_no_face;
    ebpo_status status = prepare_open(context, s, error);
    if (status != EBPO_OK)
        return status;
    /* another thread may be writing the cell face of a leaf that is not bounded yet */
    if (bounded && leaf->cell_face < EBPO_NO_CELL_FACE) {
        on_no_face = from_cell_face(kernels, s, leaf, at, p, context->open, &winding);
    } else {
        const path_start start = start_of(s, leaf->winding, at, at->leaf.level);
        on_no_face = from_corner(kernels, s, leaf, bounded, &start, at, p, context->open, &winding);
    }
    if (on_no_face)
        give_winding(context, winding, out);
    else
        *out = (ebpo_inside_result){ EBPO_ON, 0, 0 };
    return EBPO_OK;
}

/* In a surface, classifies a point in a cell with the mark EBPO_MARK_IN or EBPO_MARK_OUT. */
static inline void give_marked(int32_t marked, ebpo_inside_result *out)
{
    bool in = ebpo_entry_mark(marked) == EBPO_MARK_IN;
    *out = (ebpo_inside_result){ in ? EBPO_IN : EBPO_OUT, in, 0 };
}

/* In a surface, classifies a point in a cell of this level without faces. If ebpo_context.undecided
 * is true, computes the winding number at the point. It may differ from the winding number at the
 * cell's lowest corner, because caps may cross the cell. */
static void decide_without_faces(const ebpo_context *context, const ebpo_node_table *table,
                                 int32_t marked, int level, const ebpo_position *position,
                                 const double p[3], ebpo_inside_result *out)
{
    int deepest = context->model->locator.level;
    ebpo_uniform_mark mark = ebpo_entry_mark(marked);
    const ebpo_box box = ebpo_model_box(context->model);
    const ebpo_holes *holes = context->model->holes;
    const ebpo_near_cell *near = NULL;
    double low[3], high[3];
    if (mark <= EBPO_MARK_IN && !context->undecided) {
        give_marked(marked, out);
        return;
    }
    int32_t winding = ebpo_marked_value(marked);
    if (mark == EBPO_MARK_LISTED) {
        near = &table->near[winding];
        winding = near->winding;
        level = near->level;
    }
    if (!near || near->touching) {
        ebpo_cell cell = ebpo_cell_ancestor(
            (ebpo_cell){ deepest, { position->at[0], position->at[1], position->at[2] } }, level);
        ebpo_cell_bounds(&box, cell, low, high);
        winding += near ? ebpo_holes_list_crossings(holes, table, near, low, p)
                        : ebpo_holes_crossings(holes, low, p);
    }
    decide_near(context, table, near, winding, position, p, out);
}

/* Decides a point in a leaf near the border, or in a part of it with faces. `level`: level of the
 * part. */
static ebpo_status decide_with_faces(ebpo_context *context, const ebpo_accel *s,
                                     const ebpo_accel_leaf *leaf, int32_t marked, int level,
                                     const leaf_point *at, const double p[3],
                                     ebpo_inside_result *out, ebpo_error *error)
{
    const ebpo_holes *holes = context->model->holes;
    const ebpo_near_cell *near = NULL;
    ebpo_uniform_mark mark = ebpo_entry_mark(marked);
    int32_t winding = ebpo_marked_value(marked);
    ebpo_status status = prepare_open(context, s, error);
    if (status != EBPO_OK)
        return status;
    if (mark == EBPO_MARK_FACES_LISTED) {
        near = &s->nodes.near[winding];
        bool of_leaf = near->level >= at->leaf.level; /* false: of several leaves */
        winding = of_leaf ? near->winding : leaf->winding;
        level = of_leaf ? near->level : at->leaf.level;
    }
    const path_start start = start_of(s, winding, at, level);
    if (!from_corner(context->model->kernels.inside, s, leaf, true, &start, at, p, context->open,
                     &winding)) {
        *out = (ebpo_inside_result){ EBPO_ON, 0, 0 };
        return EBPO_OK;
    }
    if (mark == EBPO_MARK_FACES) {
        give_winding(context, winding, out);
        return EBPO_OK;
    }
    winding += near ? ebpo_holes_list_crossings(holes, &s->nodes, near, start.low, p)
                    : ebpo_holes_crossings(holes, start.low, p);
    decide_near(context, &s->nodes, near, winding, at->position, p, out);
    return EBPO_OK;
}

/* Returns true if the leaf is near the border of a surface. */
static inline bool is_near_border(ebpo_leaf_kind kind, const ebpo_accel_leaf *leaf)
{
    return kind == EBPO_LEAF_GENERAL && leaf->cell_face == EBPO_NEAR_BORDER;
}

/* Decides a point in a part of a leaf or white node near the border. `level`: level of the part.
 * `leaf`: NULL for a white node; then only `at->position` is read. */
static ebpo_status result_in_part(ebpo_context *context, const ebpo_accel *s,
                                  const ebpo_accel_leaf *leaf, int32_t marked, int level,
                                  const leaf_point *at, const double p[3], ebpo_inside_result *out,
                                  ebpo_error *error)
{
    if (ebpo_entry_mark(marked) >= EBPO_MARK_FACES)
        return decide_with_faces(context, s, leaf, marked, level, at, p, out, error);
    decide_without_faces(context, &s->nodes, marked, level, at->position, p, out);
    return EBPO_OK;
}

/* Decides a point in a leaf near the border. */
static ebpo_status result_near_border(ebpo_context *context, const ebpo_accel *s,
                                      const ebpo_accel_leaf *leaf, const leaf_point *at,
                                      const double p[3], ebpo_inside_result *out, ebpo_error *error)
{
    int level = at->leaf.level, deepest = context->model->locator.level;
    int32_t marked = ebpo_marked_part(&s->nodes, (int32_t)leaf->rows, at->position->at, deepest,
                                      deepest, &level);
    return result_in_part(context, s, leaf, marked, level, at, p, out, error);
}

/* Decides a point in a leaf, by planes if the leaf's kind allows it. */
static ebpo_status result_in_leaf(ebpo_context *context, const ebpo_accel *s, ebpo_accel_leaf *leaf,
                                  const leaf_point *at, const double p[3], ebpo_inside_result *out,
                                  ebpo_error *error)
{
    int32_t winding;
    ebpo_leaf_kind kind = kind_of(context, s, leaf, at);
    if (is_near_border(kind, leaf))
        return result_near_border(context, s, leaf, at, p, out, error);
    if (!ebpo_leaf_has_planes(kind) || !from_planes(s, leaf, at, &winding))
        return result_by_faces(context, s, leaf, ebpo_leaf_is_bounded(kind), at, p, out, error);
    give_winding(context, winding, out);
    return EBPO_OK;
}

/* Classifies p in leaf `index` of a subtree. The leaf is at this level, p is in the leaf's cell,
 * and `position` is p's shifted position. */
static ebpo_status inside_leaf(ebpo_context *context, const ebpo_accel *s, uint32_t index,
                               int level, const ebpo_position *position, const double p[3],
                               ebpo_inside_result *out, ebpo_error *error)
{
    leaf_point at;
    find_leaf_point(context->model->locator.level, level, position, &at);
    return result_in_leaf(context, s, &s->leaf[index], &at, p, out, error);
}

/* In a surface, classifies a point in a white node with any mark (ebpo_uniform_mark). */
static __attribute__((noinline)) void inside_marked(const ebpo_context *context,
                                                    const ebpo_node_table *table, uint32_t entry,
                                                    const ebpo_position *position, int level,
                                                    const double p[3], ebpo_inside_result *out)
{
    int deepest = context->model->locator.level;
    int32_t marked =
        ebpo_marked_part(table, ebpo_entry_winding(entry), position->at, deepest, deepest, &level);
    decide_without_faces(context, table, marked, level, position, p, out);
}

/* Classifies a point in a white or black node, if all its points have the same result. Returns
 * false otherwise. */
static inline bool give_uniform(const ebpo_context *context, uint32_t entry,
                                ebpo_inside_result *out)
{
    int32_t value = ebpo_entry_winding(entry);
    bool same = true;
    if (!context->model->holes)
        give_winding(context, value, out);
    else if (ebpo_entry_mark(value) <= EBPO_MARK_IN && !context->undecided)
        give_marked(value, out);
    else
        same = false;
    return same;
}

/* Classifies a point in a white or black node of a table. */
static inline void inside_uniform(const ebpo_context *context, const ebpo_node_table *table,
                                  uint32_t entry, const ebpo_position *position, int level,
                                  const double p[3], ebpo_inside_result *out)
{
    if (!give_uniform(context, entry, out))
        inside_marked(context, table, entry, position, level, p, out);
}

/* Classifies p in a subtree. The root's cell must contain p. `position`: shifted position of p. */
static ebpo_status inside_subtree(ebpo_context *context, const ebpo_accel *s,
                                  const ebpo_position *position, const double p[3],
                                  ebpo_inside_result *out, ebpo_error *error)
{
    ebpo_descent d = ebpo_descend(&s->nodes, context->model->locator.level, position->at);
    if (ebpo_entry_kind_of(d.entry) == EBPO_ENTRY_UNIFORM) {
        inside_uniform(context, &s->nodes, d.entry, position, d.level, p, out);
        return EBPO_OK;
    }
    if (ebpo_entry_kind_of(d.entry) == EBPO_ENTRY_SUBTREE_ROOT)
        return inside_pruned(context, p, out, error);
    return inside_leaf(context, s, ebpo_entry_value(d.entry), d.level, position, p, out, error);
}

/* Number of points that are processed together, stage by stage: while the other points are
 * processed, the processor fetches the memory for the next stage of one point. */
enum { POINTS_TOGETHER = 16 };

/* One of these points on its way down the tree. */
typedef struct lane {
    ebpo_position position;
    bool within;    /* the point is in the root cell */
    ebpo_descent d; /* the node that the point has reached */
} lane;

/* A point whose way down the tree ended in a leaf. */
typedef struct waiting {
    ebpo_accel_leaf *leaf;
    unsigned point; /* index of the point */
    leaf_point in;
} waiting;

/* A point near the border of a surface. Such points are few. They are gathered and then decided
 * together: the processor fetches the data for all of them at a time, and the code for these
 * decisions stays in its caches. */
typedef struct later_point {
    const ebpo_accel_leaf *leaf; /* NULL: a white node */
    leaf_point in;               /* of a white node: only `position` is valid */
    ebpo_position position;
    int32_t marked; /* mark of the leaf or node, then of its part that contains the point */
    int level;      /* level of this cell */
    const ebpo_near_cell *near; /* the record of the part, or NULL */
    const double *p;
    ebpo_inside_result *out;
} later_point;

/* The points that wait for their decision. */
enum { LATER_MAX = 64 };
typedef struct later_points {
    unsigned count;
    later_point point[LATER_MAX];
} later_points;

/* Begins the way down of each point. */
static void start_lanes(const ebpo_accel *s, const ebpo_locator *locator, const double *points,
                        unsigned count, lane *l)
{
    int deepest = locator->level;
    for (unsigned i = 0; i < count; i++) {
        l[i].within = ebpo_locator_find(locator, points + 3 * i, &l[i].position);
        if (l[i].within && s->nodes.grid) {
            uint64_t cell = ebpo_grid_cell(&s->nodes, deepest, l[i].position.at);
            __builtin_prefetch(&s->nodes.grid[cell]);
        }
    }
    for (unsigned i = 0; i < count; i++)
        if (l[i].within) {
            l[i].d = ebpo_descent_begin(&s->nodes, deepest, l[i].position.at);
            ebpo_descent_prefetch(&l[i].d, &s->nodes);
        }
}

/* Moves all points down, one level at a time, until each of them has reached its last node. */
static void descend_together(const ebpo_accel *s, int deepest, unsigned count, lane *l)
{
    for (bool more = true; more;) {
        more = false;
        for (unsigned i = 0; i < count; i++)
            if (l[i].within && ebpo_descent_step(&l[i].d, &s->nodes, deepest, l[i].position.at))
                more |= ebpo_descent_prefetch(&l[i].d, &s->nodes);
    }
}

/* Prefetches the cache lines of the leaf's blocks that a segment with this `reach`
 * (ebpo_axis_segment) may intersect. */
static void prefetch_blocks(const ebpo_accel *s, const ebpo_accel_leaf *leaf, uint32_t reach)
{
    const ebpo_axis_segment g = { .reach = reach };
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

/* Prefetches the cache lines of the blocks that the point's segment may intersect. */
static void prefetch_leaf(const ebpo_accel *s, const waiting *w, const double p[3])
{
    const ebpo_accel_leaf *leaf = w->leaf;
    ebpo_leaf_kind kind = ebpo_leaf_kind_of(leaf);
    uint32_t reach = EBPO_REACH_ALL;
    if (ebpo_leaf_has_planes(kind))
        return;
    if (ebpo_leaf_is_bounded(kind) && leaf->cell_face < EBPO_NO_CELL_FACE)
        reach = cell_face_segment(&s->box, leaf->cell_face, &w->in, p).reach;
    prefetch_blocks(s, leaf, reach);
}

/* Prefetches the record of a mark, or the marks of its parts. */
static void prefetch_mark(const ebpo_node_table *table, int32_t marked)
{
    ebpo_uniform_mark mark = ebpo_entry_mark(marked);
    int32_t value = ebpo_marked_value(marked);
    if (mark == EBPO_MARK_SPLIT) {
        __builtin_prefetch(table->split[value]);
    } else if (mark == EBPO_MARK_LISTED || mark == EBPO_MARK_FACES_LISTED) {
        __builtin_prefetch(&table->near[value]);
        __builtin_prefetch((const char *)(&table->near[value] + 1) - 1);
    }
}

/* Adds a point to those that wait. `leaf`: NULL for a white node. */
static void put_later(later_points *later, const ebpo_accel *s, const waiting *leaf,
                      const ebpo_position *position, int32_t marked, int level, const double *p,
                      ebpo_inside_result *out)
{
    later_point *l = &later->point[later->count++];
    l->leaf = leaf ? leaf->leaf : NULL;
    if (leaf)
        l->in = leaf->in;
    l->position = *position;
    l->in.position = &l->position;
    l->marked = marked;
    l->level = level;
    l->near = NULL;
    l->p = p;
    l->out = out;
    prefetch_mark(&s->nodes, marked);
}

/* Finds the part that contains the point, and prefetches its record or the list of its blocks. */
static void find_part(const ebpo_context *context, const ebpo_accel *s, later_point *l)
{
    int deepest = context->model->locator.level;
    l->marked = ebpo_marked_part(&s->nodes, l->marked, l->position.at, deepest, deepest, &l->level);
    ebpo_uniform_mark mark = ebpo_entry_mark(l->marked);
    if (mark == EBPO_MARK_LISTED || mark == EBPO_MARK_FACES_LISTED)
        l->near = &s->nodes.near[ebpo_marked_value(l->marked)];
    if (l->near)
        prefetch_mark(&s->nodes, l->marked);
    if (mark >= EBPO_MARK_FACES)
        __builtin_prefetch(s->list + l->leaf->list);
}

/* Decides the points that wait. */
static ebpo_status decide_later(ebpo_context *context, const ebpo_accel *s, later_points *later,
                                ebpo_error *error)
{
    const ebpo_cap_tree *caps = &context->model->holes->caps;
    const later_point *end = later->point + later->count;
    ebpo_status status = EBPO_OK;
    for (later_point *l = later->point; l < end; l++)
        find_part(context, s, l);
    for (const later_point *l = later->point; l < end; l++) {
        if (l->near)
            __builtin_prefetch(s->nodes.disc + l->near->first);
        if (ebpo_entry_mark(l->marked) >= EBPO_MARK_FACES)
            prefetch_blocks(s, l->leaf, EBPO_REACH_ALL);
    }
    for (const later_point *l = later->point; l < end; l++)
        if (l->near)
            ebpo_cap_list_prefetch(caps, s->nodes.disc + l->near->first, l->near->nearest);
    for (const later_point *l = later->point; l < end && status == EBPO_OK; l++)
        status =
            result_in_part(context, s, l->leaf, l->marked, l->level, &l->in, l->p, l->out, error);
    later->count = 0;
    return status;
}

/* Decides the points whose way down ended in a leaf. Those near the border are added to `later`. */
static ebpo_status result_waiting(ebpo_context *context, const ebpo_accel *s, waiting *w,
                                  unsigned count, const double *points, later_points *later,
                                  ebpo_inside_result *out, ebpo_error *error)
{
    unsigned kept = 0;
    for (unsigned i = 0; i < count; i++) {
        const ebpo_accel_leaf *leaf = w[i].leaf;
        if (is_near_border(ebpo_leaf_kind_of(leaf), leaf)) {
            put_later(later, s, &w[i], w[i].in.position, (int32_t)leaf->rows, w[i].in.leaf.level,
                      points + 3 * w[i].point, &out[w[i].point]);
            continue;
        }
        __builtin_prefetch(s->list + leaf->list);
        if (ebpo_leaf_has_planes(ebpo_leaf_kind_of(leaf)))
            __builtin_prefetch(EBPO_KIND_ROW(s->kinds, leaf->rows));
        if (kept < i)
            w[kept] = w[i];
        kept++;
    }
    for (unsigned i = 0; i < kept; i++)
        prefetch_leaf(s, &w[i], points + 3 * w[i].point);
    ebpo_status status = EBPO_OK;
    for (unsigned i = 0; i < kept && status == EBPO_OK; i++)
        status = result_in_leaf(context, s, w[i].leaf, &w[i].in, points + 3 * w[i].point,
                                &out[w[i].point], error);
    return status;
}

/* Classifies at most POINTS_TOGETHER points. Those near the border are added to `later`. */
static ebpo_status inside_together(ebpo_context *context, const ebpo_accel *s, const double *points,
                                   unsigned count, later_points *later, ebpo_inside_result *out,
                                   ebpo_error *error)
{
    lane l[POINTS_TOGETHER];
    waiting w[POINTS_TOGETHER];
    unsigned leaves = 0;
    int deepest = context->model->locator.level;
    start_lanes(s, &context->model->locator, points, count, l);
    descend_together(s, deepest, count, l);
    for (unsigned i = 0; i < count; i++) {
        if (!l[i].within) {
            inside_beyond_root(context, points + 3 * i, &out[i]);
        } else if (ebpo_entry_kind_of(l[i].d.entry) == EBPO_ENTRY_UNIFORM) {
            if (!give_uniform(context, l[i].d.entry, &out[i]))
                put_later(later, s, NULL, &l[i].position, ebpo_entry_winding(l[i].d.entry),
                          l[i].d.level, points + 3 * i, &out[i]);
        } else if (ebpo_entry_kind_of(l[i].d.entry) == EBPO_ENTRY_SUBTREE_ROOT) {
            ebpo_status status = inside_pruned(context, points + 3 * i, &out[i], error);
            if (status != EBPO_OK)
                return status;
        } else {
            w[leaves].leaf = &s->leaf[ebpo_entry_value(l[i].d.entry)];
            w[leaves].point = i;
            __builtin_prefetch(w[leaves].leaf);
            find_leaf_point(deepest, l[i].d.level, &l[i].position, &w[leaves].in);
            leaves++;
        }
    }
    return result_waiting(context, s, w, leaves, points, later, out, error);
}

/* Classifies points with the whole tree in memory. */
static ebpo_status inside_whole(ebpo_context *context, const double *points, uint64_t count,
                                bool *done, ebpo_inside_result *out, ebpo_error *error)
{
    const ebpo_accel *s = context->model->whole;
    ebpo_status status = EBPO_OK;
    if (count == 1) {
        ebpo_position position;
        if (ebpo_locator_find(&context->model->locator, points, &position))
            status = inside_subtree(context, s, &position, points, out, error);
        else
            inside_beyond_root(context, points, out);
    }
    later_points later;
    later.count = 0;
    for (uint64_t i = 0; count > 1 && i < count && status == EBPO_OK; i += POINTS_TOGETHER) {
        unsigned group = count - i < POINTS_TOGETHER ? (unsigned)(count - i) : POINTS_TOGETHER;
        status = inside_together(context, s, points + 3 * i, group, &later, out + i, error);
        if (status == EBPO_OK && later.count > LATER_MAX - POINTS_TOGETHER)
            status = decide_later(context, s, &later, error);
    }
    if (status == EBPO_OK && later.count)
        status = decide_later(context, s, &later, error);
    if (status == EBPO_OK && done)
        memset(done, true, count);
    return status;
}

/* --- node by node: EBP 2017, 4.2 --- */

/* Returns true if envelopes contain the inside. The envelopes of a surface with holes contain the
 * points that are inside with the threshold 1/2 or a greater threshold. They decide nothing about
 * the winding number of the mesh with its caps, which a query with c->undecided computes. */
static bool envelopes_hold(const ebpo_context *c)
{
    const ebpo_model *m = c->model;
    return !m->holes ||
           (m->info->border_inside && m->holes->rule.threshold >= 0.5 && !c->undecided);
}

/* Returns true if the query tests the envelopes of nodes on the way down. */
static bool uses_envelopes(const ebpo_context *c, const ebpo_inside_options *o)
{
    /* A point outside an envelope is outside the solid, but its winding number is known (0) only
     * under the rule nonzero. Under other rules the result would be incomplete, so only queries
     * with a level or deadline use envelopes. */
    bool proves_result =
        c->model->info->rule == EBPO_RULE_NONZERO || o->level >= 0 || o->deadline_ns;
    if (o->envelopes == EBPO_ENVELOPES_SKIP || !proves_result || !envelopes_hold(c))
        return false;
    return o->envelopes == EBPO_ENVELOPES_USE || !c->model->whole || o->level >= 0 ||
           o->deadline_ns;
}

/* A query of one point. */
typedef struct inside_query {
    ebpo_context *context;
    const ebpo_inside_options *options;
    ebpo_box box;
    bool envelopes;         /* test envelopes */
    uint64_t deadline;      /* a time of ebpo_clock; 0: none */
    const double *p;        /* [3] the point */
    ebpo_position position; /* shifted position of p */
} inside_query;

/* Sets the result "undecided", with a bound of p's distance: the diagonal of the cell. In a surface
 * with holes, a pruned node and a leaf may be without faces. But the parent has faces, so the bound
 * is the parent's diagonal. */
static void give_maybe(const inside_query *query, ebpo_cell cell, ebpo_inside_result *out)
{
    const ebpo_info *info = query->context->model->info;
    bool may_lack_faces =
        info->border_inside && cell.level > 0 && (info->pruned || !(info->parts & EBPO_PART_MESH));
    *out = (ebpo_inside_result){ EBPO_MAYBE, 0,
                                 ebpo_cell_diagonal(&query->box, cell) * (may_lack_faces ? 2 : 1) };
}

/* Returns true if the query tests envelopes and p is outside the envelope of the node. */
static bool outside_envelope(const inside_query *query, const ebpo_node *node)
{
    uint32_t count;
    const uint32_t *codes =
        query->envelopes ? ebpo_model_planes(query->context->model, node, &count) : NULL;
    return codes && ebpo_outside_planes(&query->box, node->cell, codes, count, query->p);
}

static bool is_late(const inside_query *query)
{
    return query->deadline && ebpo_clock() > query->deadline;
}

/* Returns true if the query's level or deadline ends the way down at this node. */
static bool stops_here(const inside_query *query, const ebpo_node *node)
{
    if (query->options->level >= 0 &&
        (node->cell.level >= query->options->level || node->type != EBPO_GRAY || node->pruned))
        return true;
    return is_late(query);
}

/* Returns the table of the nodes that are not in a subtree loaded on demand. */
static const ebpo_node_table *top_nodes(const ebpo_model *m)
{
    return m->whole ? &m->whole->nodes : &m->top->nodes;
}

/* Decides the point at a node of the top or of a subtree, if this is possible without visiting the
 * node's children or faces. Returns false if this is not possible. */
static inline bool decide_at(const inside_query *query, const ebpo_node *node,
                             ebpo_inside_result *out)
{
    if (ebpo_node_is_uniform(node))
        inside_uniform(query->context,
                       node->subtree ? &node->subtree->nodes : top_nodes(query->context->model),
                       node->entry, &query->position, node->cell.level, query->p, out);
    else if (outside_envelope(query, node))
        give_out(out);
    else if (stops_here(query, node))
        give_maybe(query, node->cell, out);
    else
        return false;
    return true;
}

/* Decides the point on the way down from the root. Loads the subtree on the way. */
static ebpo_status walk_down(inside_query *query, ebpo_inside_result *out, ebpo_error *error)
{
    const ebpo_model *m = query->context->model;
    int deepest = m->info->level_count - 1;
    ebpo_node node = ebpo_model_root(m);
    for (;;) {
        if (decide_at(query, &node, out))
            return EBPO_OK;
        if (ebpo_node_is_subtree_root(&node)) {
            ebpo_status status = ebpo_model_enter(query->context, &node, error);
            if (status != EBPO_OK)
                return status;
            if (!query->envelopes && query->options->level < 0 && !query->deadline)
                return inside_subtree(query->context, node.subtree, &query->position, query->p, out,
                                      error);
        }
        if (ebpo_entry_kind_of(node.entry) == EBPO_ENTRY_LEAF)
            return inside_leaf(query->context, node.subtree, ebpo_entry_value(node.entry),
                               node.cell.level, &query->position, query->p, out, error);
        node = ebpo_model_child(m, &node,
                                ebpo_octant_at(query->position.at, deepest - node.cell.level - 1));
    }
}

/* --- node by node from the file (EBPO_LOAD_NODES): only nodes on the way are read, and only
 * decoded chunks are kept --- */

/* Decides the point in a leaf, which is read as a subtree and then freed. */
static ebpo_status leaf_from_file(inside_query *query, const ebpo_node *leaf,
                                  ebpo_inside_result *out, ebpo_error *error)
{
    ebpo_model *m = query->context->model;
    ebpo_slice slice;
    ebpo_accel *subtree = NULL;
    ebpo_status status = ebpo_model_has_capacity(m, leaf, error);
    if (status == EBPO_OK)
        status = ebpo_slice_read_parts(&slice, m->chunks, leaf,
                                       ebpo_subtree_needs(EBPO_ACCEL_NODES), error);
    if (status == EBPO_OK)
        status = ebpo_accel_make(&subtree, &slice, m->info, EBPO_ACCEL_NODES, 1, error);
    if (status == EBPO_OK && m->holes)
        status =
            ebpo_holes_mark(m->holes,
                            &(ebpo_marked_table){ &subtree->box, leaf->cell, &subtree->nodes,
                                                  subtree, m->kernels.inside->cell_faces, 0, 0 },
                            error);
    if (status == EBPO_OK) {
        ebpo_model_count_leaves(m, subtree, 1);
        status = inside_leaf(query->context, subtree, ebpo_entry_value(subtree->nodes.root),
                             leaf->cell.level, &query->position, query->p, out, error);
        ebpo_model_count_leaves(m, subtree, -1);
    }
    ebpo_accel_free(subtree);
    return status;
}

/* Decides a point in a white node of a surface. `winding`: winding number at the cell's lowest
 * corner. */
static void decide_white(const inside_query *query, ebpo_cell cell, int32_t winding,
                         ebpo_inside_result *out)
{
    double low[3], high[3];
    ebpo_cell_bounds(&query->box, cell, low, high);
    winding += ebpo_holes_crossings(query->context->model->holes, low, query->p);
    decide_capped(query->context, query->p, winding, out);
}

/* Decides the point in a white or black node, whose winding number is read from the file. */
static ebpo_status uniform_from_file(inside_query *query, const ebpo_node *node,
                                     ebpo_inside_result *out, ebpo_error *error)
{
    int32_t winding;
    ebpo_status status = ebpo_chunks_winding(query->context->model->chunks, node, &winding, error);
    if (status == EBPO_OK && query->context->model->holes)
        decide_white(query, node->cell, winding, out);
    else if (status == EBPO_OK)
        give_winding(query->context, winding, out);
    return status;
}

/* Handles a gray node on the way: sets the result and *done, or moves the cursor to the child that
 * contains the point. A node is known to be pruned only after its children have been requested. */
static ebpo_status pass_gray(inside_query *query, ebpo_cursor *c, bool *done,
                             ebpo_inside_result *out, ebpo_error *error)
{
    const ebpo_model *m = query->context->model;
    const ebpo_node *node = ebpo_cursor_node(c), *child;
    uint32_t codes[EBPO_NODE_PLANES];
    unsigned count = 0;
    ebpo_status status = EBPO_OK;
    *done = true;
    if (query->envelopes)
        status = ebpo_cursor_planes(c, codes, &count, error);
    if (status != EBPO_OK)
        return status;
    if (ebpo_outside_planes(&query->box, node->cell, codes, count, query->p)) {
        give_out(out);
        return EBPO_OK;
    }
    bool limited = query->options->level >= 0;
    if ((limited && (node->cell.level >= query->options->level || node->pruned)) ||
        is_late(query)) {
        give_maybe(query, node->cell, out);
        return EBPO_OK;
    }
    status = ebpo_cursor_children(c, &child, error);
    if (status != EBPO_OK)
        return status;
    *done = !child;
    if (child)
        ebpo_cursor_down(c, ebpo_octant_at(query->position.at,
                                           m->info->level_count - 2 - node->cell.level));
    else if (limited || is_late(query))
        give_maybe(query, node->cell, out);
    else
        status = ebpo_fail_pruned(m, node->cell, error);
    return status;
}

/* Walks down from the root of a subtree (`below`), by reading nodes from the file. */
static ebpo_status walk_file(inside_query *query, const ebpo_node *below, ebpo_inside_result *out,
                             ebpo_error *error)
{
    const ebpo_model *m = query->context->model;
    ebpo_cursor c;
    ebpo_cursor_begin(&c, &ebpo_chunks_source, m->chunks,
                      m->top->below[ebpo_entry_value(below->entry)]);
    while (ebpo_cursor_node(&c)->type == EBPO_GRAY) {
        bool done;
        ebpo_status status = pass_gray(query, &c, &done, out, error);
        if (status != EBPO_OK || done)
            return status;
    }
    const ebpo_node *node = ebpo_cursor_node(&c);
    bool empty = node->type != EBPO_LEAF;
    if (!empty) {
        ebpo_status status = ebpo_chunks_leaf_empty(m->chunks, node, &empty, error);
        if (status != EBPO_OK)
            return status;
    }
    if (!empty && (query->options->level >= 0 || is_late(query))) {
        give_maybe(query, node->cell, out);
        return EBPO_OK;
    }
    return empty ? uniform_from_file(query, node, out, error)
                 : leaf_from_file(query, node, out, error);
}

/* Decides the point on the way down from the root, for EBPO_LOAD_NODES. */
static ebpo_status walk_nodes(inside_query *query, ebpo_inside_result *out, ebpo_error *error)
{
    const ebpo_model *m = query->context->model;
    int deepest = m->info->level_count - 1;
    ebpo_node node = ebpo_model_root(m);
    while (!ebpo_node_is_subtree_root(&node)) {
        if (decide_at(query, &node, out))
            return EBPO_OK;
        node = ebpo_model_child(m, &node,
                                ebpo_octant_at(query->position.at, deepest - node.cell.level - 1));
    }
    return walk_file(query, &node, out, error);
}

/* Returns the whole model if it is in memory; if not, the pinned subtree of the context, if its
 * cell contains p; otherwise NULL. *entry, *level: entry and level of the node at which the way
 * down the top of the tree ends. For a whole model, the kind of *entry is SUBTREE_ROOT, and *level
 * is not set. */
static const ebpo_accel *find_held(const inside_query *query, uint32_t *entry, int *level)
{
    const ebpo_context *c = query->context;
    int deepest = c->model->info->level_count - 1;
    *entry = ebpo_entry(EBPO_ENTRY_SUBTREE_ROOT, 0);
    if (c->model->whole)
        return c->model->whole;
    ebpo_descent d = ebpo_descend(&c->model->top->nodes, deepest, query->position.at);
    *entry = d.entry;
    *level = d.level;
    bool below = ebpo_entry_kind_of(*entry) == EBPO_ENTRY_SUBTREE_ROOT;
    return below && ebpo_context_has_pinned(c, ebpo_entry_value(*entry)) ? c->pinned : NULL;
}

/* Decides p without envelopes, if the context has all data for p in memory. (Envelopes save time
 * only by avoiding loads, and here nothing is loaded.) Returns false if some data is missing. */
static bool result_in_memory(inside_query *query, ebpo_inside_result *out, ebpo_status *status,
                             ebpo_error *error)
{
    const ebpo_model *m = query->context->model;
    uint32_t entry;
    int level;
    const ebpo_accel *held = find_held(query, &entry, &level);
    *status = EBPO_OK;
    if (ebpo_entry_kind_of(entry) == EBPO_ENTRY_UNIFORM) {
        inside_uniform(query->context, top_nodes(m), entry, &query->position, level, query->p, out);
        return true;
    }
    if (!held)
        return false;
    if (!query->deadline) {
        *status = inside_subtree(query->context, held, &query->position, query->p, out, error);
        return true;
    }
    int deepest = m->info->level_count - 1;
    ebpo_descent d = ebpo_descend(&held->nodes, deepest, query->position.at);
    if (ebpo_entry_kind_of(d.entry) == EBPO_ENTRY_SUBTREE_ROOT)
        return false; /* pruned: an envelope may decide */
    ebpo_cell cell = ebpo_descent_cell(&d, deepest, query->position.at);
    if (ebpo_entry_kind_of(d.entry) == EBPO_ENTRY_UNIFORM)
        inside_uniform(query->context, &held->nodes, d.entry, &query->position, d.level, query->p,
                       out);
    else if (is_late(query))
        give_maybe(query, cell, out);
    else
        *status = inside_leaf(query->context, held, ebpo_entry_value(d.entry), d.level,
                              &query->position, query->p, out, error);
    return true;
}

/* Decides a point in a pruned node of the whole tree or of a subtree by an envelope. Returns
 * EBPO_E_ABSENT if no envelope decides. */
static ebpo_status inside_pruned(ebpo_context *context, const double p[3], ebpo_inside_result *out,
                                 ebpo_error *error)
{
    const ebpo_model *m = context->model;
    if (!envelopes_hold(context))
        return ebpo_fail_pruned(m, (ebpo_cell){ 0, { 0, 0, 0 } }, error);
    ebpo_inside_options options = EBPO_INSIDE_OPTIONS_INIT;
    inside_query query = {
        .context = context, .options = &options, .box = ebpo_model_box(m), .envelopes = true, .p = p
    };
    if (!ebpo_locator_find(&m->locator, p, &query.position))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "a point outside the root cell has no node");
    ebpo_status status = walk_down(&query, out, error);
    /* If the point is outside under another rule than nonzero, its winding number is not known. */
    if (status == EBPO_OK && out->where == EBPO_OUT && m->info->rule != EBPO_RULE_NONZERO)
        return ebpo_fail_pruned(m, (ebpo_cell){ 0, { 0, 0, 0 } }, error);
    return status;
}

/* Classifies a point from node to node: with envelopes, to a level, with a deadline, or in a model
 * that is not completely in memory. */
static ebpo_status inside_walk(ebpo_context *context, const double p[3],
                               const ebpo_inside_options *options, ebpo_inside_result *out,
                               ebpo_error *error)
{
    const ebpo_model *m = context->model;
    inside_query query = { .context = context,
                           .options = options,
                           .box = ebpo_model_box(m),
                           .envelopes = uses_envelopes(context, options),
                           .p = p };
    if (options->deadline_ns)
        query.deadline = ebpo_clock() + options->deadline_ns;
    if (!ebpo_locator_find(&m->locator, p, &query.position)) {
        inside_beyond_root(context, p, out);
        return EBPO_OK;
    }
    ebpo_status status;
    bool plain = options->envelopes != EBPO_ENVELOPES_USE && options->level < 0;
    if (plain && (m->whole || m->options.loading != EBPO_LOAD_NODES) &&
        result_in_memory(&query, out, &status, error))
        return status;
    return !m->whole && m->options.loading == EBPO_LOAD_NODES ? walk_nodes(&query, out, error)
                                                              : walk_down(&query, out, error);
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
    bool planes =
        envelopes_hold(context) &&
        (o->level >= 0 || o->deadline_ns || o->envelopes == EBPO_ENVELOPES_USE || m->info->pruned);
    context->content = planes ? EBPO_ACCEL_PLANES : EBPO_ACCEL_NODES;
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

/* Returns true if the query has no special options and the model is completely in memory. Then only
 * the point must be checked. */
static inline bool is_plain(const ebpo_context *context, const ebpo_inside_options *o)
{
    return context->model->results_inside &&
           (!o || (o->struct_size == sizeof *o && o->level == EBPO_LEVEL_ALL &&
                   o->envelopes == EBPO_ENVELOPES_AUTO && !o->deadline_ns));
}

/* Classifies a point for which is_plain is true. A finite point in the root cell needs no check. */
static ebpo_status inside_plain(ebpo_context *context, const double point[3],
                                ebpo_inside_result *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_position position;
    if (ebpo_locator_find(&context->model->locator, point, &position))
        return inside_subtree(context, context->model->whole, &position, point, out, error);
    ebpo_status status = ebpo_check_points(point, 1, error);
    if (status == EBPO_OK)
        inside_beyond_root(context, point, out);
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
