/* Decisions for whole cells of a mesh with holes.
 *
 * Bounds for the ball around a cell often decide for the whole cell. If no cap is near the ball,
 * which the error of the bound shows, caps do not change the integer winding number in the cell. In
 * a white node, w is then within the bounds, which may give one result. In a leaf, where faces
 * change the integer k, let |w_D| be below t and below 1 - t for the threshold t: then the rule for
 * w equals the rule for k, and k is found from the lowest corner and the leaf's faces, as in a
 * solid. Points of other cells are decided one by one. The first query of a cell finds this;
 * threads that do so at the same time find the same. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "geometry/level_nodes.h"
#include "query/holes.h"

enum { CELL_UNKNOWN, CELL_OUT, CELL_IN, CELL_FAR, CELL_NEAR };

/* Tolerances of the bounds. */
static const double FIRST_TOLERANCE = 0.5, LAST_TOLERANCE = 0x1p-8;

void ebpo_holes_attach(ebpo_holes *h, const ebpo_accel *whole)
{
    uint64_t grid = whole->nodes.grid ? UINT64_C(1) << 3 * whole->nodes.grid_bits : 1;
    h->cell_count = grid + 8 * (uint64_t)whole->nodes.group_count;
    h->leaf_count = whole->leaf_count;
    h->cell = ebpo_alloc_zero(h->cell_count, sizeof *h->cell);
    h->leaf = ebpo_alloc_zero(h->leaf_count + 1, sizeof *h->leaf);
    h->leaf_winding = ebpo_alloc_zero(h->leaf_count + 1, sizeof *h->leaf_winding);
    if (h->cell && h->leaf && h->leaf_winding)
        return;
    free(h->cell);
    free(h->leaf);
    free(h->leaf_winding);
    h->cell = h->leaf = NULL;
    h->leaf_winding = NULL;
    h->cell_count = h->leaf_count = 0;
}

/* A point's node. */
typedef struct found_node {
    ebpo_position position;
    ebpo_descent d;
    uint64_t number; /* in ebpo_holes.cell */
} found_node;

/* Finds the node around p. Returns false outside of the root cell. */
static bool find_node(const ebpo_model *m, const double p[3], found_node *out)
{
    const ebpo_node_table *table = &m->whole->nodes;
    int fine = m->locator.level;
    if (!ebpo_locator_find(&m->locator, p, &out->position))
        return false;
    const uint32_t *at = out->position.at;
    uint64_t grid = table->grid ? UINT64_C(1) << 3 * table->grid_bits : 1;
    out->d = ebpo_descent_begin(table, fine, at);
    out->number = table->grid ? ebpo_grid_cell(table, fine, at) : 0;
    uint32_t gray = out->d.entry;
    while (ebpo_descent_step(&out->d, table, fine, at)) {
        out->number =
            grid + 8 * (uint64_t)ebpo_entry_value(gray) + ebpo_octant_at(at, fine - out->d.level);
        gray = out->d.entry;
    }
    return true;
}

/* Bounds w_D in the cell. Returns false if a cap may be near. */
static bool bound_in_cell(const ebpo_holes *h, const ebpo_box *box, ebpo_cell cell,
                          double tolerance, double centre[3], ebpo_bounded *out)
{
    double low[3], high[3], square = 0;
    ebpo_cell_bounds(box, cell, low, high);
    for (int k = 0; k < 3; k++) {
        centre[k] = low[k] / 2 + high[k] / 2;
        square += (high[k] - low[k]) * (high[k] - low[k]);
    }
    double radius = sqrt(square) / 2 * (1 + 0x1p-40) + 0x1p-500;
    *out = ebpo_cap_tree_bound(&h->caps, centre, radius, tolerance);
    /* a triangle without a bound has an error of pi or more */
    return out->error < 3;
}

/* Decides a white node. */
static int classify_uniform(const ebpo_model *m, ebpo_cell cell)
{
    ebpo_box box = ebpo_model_box(m);
    double centre[3];
    ebpo_bounded b;
    int32_t winding;
    for (double t = FIRST_TOLERANCE; t >= LAST_TOLERANCE; t /= 8) {
        if (!bound_in_cell(m->holes, &box, cell, t, centre, &b) ||
            !ebpo_holes_crossings(m, centre, false, &winding))
            return CELL_NEAR;
        b = ebpo_cap_winding_of(b, winding);
        int result = ebpo_cap_rule_result(&m->holes->rule, b.middle - b.error, b.middle + b.error);
        if (result >= 0)
            return result ? CELL_IN : CELL_OUT;
    }
    return CELL_NEAR;
}

/* Returns CELL_FAR, and the winding number at the leaf's lowest corner, or CELL_NEAR. */
static int classify_leaf(const ebpo_model *m, ebpo_cell cell, int32_t *winding)
{
    const ebpo_holes *h = m->holes;
    ebpo_box box = ebpo_model_box(m);
    double low[3], high[3], centre[3], least = fmin(h->rule.threshold, 1 - h->rule.threshold);
    ebpo_bounded b;
    for (double t = FIRST_TOLERANCE; t >= LAST_TOLERANCE; t /= 8) {
        if (!bound_in_cell(h, &box, cell, t, centre, &b))
            return CELL_NEAR;
        b = ebpo_cap_winding_of(b, 0);
        if (fabs(b.middle) + b.error < least - 0x1p-40) {
            ebpo_cell_bounds(&box, cell, low, high);
            (void)ebpo_holes_crossings(m, low, true, winding);
            return CELL_FAR;
        }
    }
    return CELL_NEAR;
}

ebpo_status ebpo_holes_by_cell(ebpo_context *context, const double p[3], ebpo_inside_result *out,
                               bool *done, ebpo_error *error)
{
    const ebpo_model *m = context->model;
    ebpo_holes *h = m->holes;
    found_node n;
    *done = h->cell_count && find_node(m, p, &n);
    if (!*done)
        return EBPO_OK;
    uint32_t value = ebpo_entry_value(n.d.entry);
    bool uniform = ebpo_entry_kind_of(n.d.entry) == EBPO_ENTRY_UNIFORM;
    _Atomic uint8_t *kept = uniform ? &h->cell[n.number] : &h->leaf[value];
    int state = *kept;
    if (state == CELL_UNKNOWN) {
        ebpo_cell cell = ebpo_descent_cell(&n.d, m->locator.level, n.position.at);
        int32_t winding = 0;
        state = uniform ? classify_uniform(m, cell) : classify_leaf(m, cell, &winding);
        if (!uniform)
            h->leaf_winding[value] = winding;
        *kept = (uint8_t)state;
    }
    *done = state != CELL_NEAR;
    *out = (ebpo_inside_result){ state == CELL_IN ? EBPO_IN : EBPO_OUT, 0, 0 };
    return state == CELL_FAR ? ebpo_inside_leaf_from(context, value, h->leaf_winding[value],
                                                     n.d.level, &n.position, p, out, error)
                             : EBPO_OK;
}
