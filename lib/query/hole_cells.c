/* Decisions for whole cells of a mesh with holes.
 *
 * Bounds for all points of a cell often decide for the whole cell. If no cap is near the cell,
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

/* Tolerances of the bounds. */
static const double FIRST_TOLERANCE = 0.5, LAST_TOLERANCE = 0x1p-8;

/* A point's node. */
typedef struct found_node {
    ebpo_position position;
    ebpo_descent d;
    uint64_t number; /* in ebpo_holes.cell */
} found_node;

/* Finds the node around p. Returns false outside of the root cell. */
static bool find_node(const ebpo_holes *h, const double p[3], found_node *out)
{
    const ebpo_node_table *table = &h->whole->nodes;
    int fine = h->locator.level;
    if (!ebpo_locator_find(&h->locator, p, &out->position))
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
static bool bound_in_cell(const ebpo_holes *h, ebpo_cell cell, double tolerance, double centre[3],
                          ebpo_bounded *out)
{
    double low[3], high[3], half[3];
    ebpo_cell_bounds(&h->whole->box, cell, low, high);
    for (int k = 0; k < 3; k++) {
        centre[k] = low[k] / 2 + high[k] / 2;
        half[k] = fmax(high[k] - centre[k], centre[k] - low[k]);
    }
    *out = ebpo_cap_tree_bound(&h->caps, centre, half, tolerance);
    /* a triangle without a bound has an error of pi or more */
    return out->error < 3;
}

/* Decides a white node. */
static ebpo_cell_decision classify_uniform(const ebpo_holes *h, ebpo_cell cell)
{
    double centre[3];
    ebpo_bounded b;
    int32_t winding;
    for (double t = FIRST_TOLERANCE; t >= LAST_TOLERANCE; t /= 8) {
        if (!bound_in_cell(h, cell, t, centre, &b) ||
            !ebpo_holes_crossings(h, centre, false, &winding))
            return EBPO_CELL_NEAR;
        b = ebpo_cap_winding_of(b, winding);
        int result = ebpo_cap_rule_result(&h->rule, b.middle - b.error, b.middle + b.error);
        if (result >= 0)
            return result ? EBPO_CELL_IN : EBPO_CELL_OUT;
    }
    return EBPO_CELL_NEAR;
}

/* Returns EBPO_CELL_FAR, and the winding number at the leaf's lowest corner, or EBPO_CELL_NEAR. */
static ebpo_cell_decision classify_leaf(const ebpo_holes *h, ebpo_cell cell, int32_t *winding)
{
    double low[3], high[3], centre[3], least = fmin(h->rule.threshold, 1 - h->rule.threshold);
    ebpo_bounded b;
    for (double t = FIRST_TOLERANCE; t >= LAST_TOLERANCE; t /= 8) {
        if (!bound_in_cell(h, cell, t, centre, &b))
            return EBPO_CELL_NEAR;
        b = ebpo_cap_winding_of(b, 0);
        if (fabs(b.middle) + b.error < least - 0x1p-40) {
            ebpo_cell_bounds(&h->whole->box, cell, low, high);
            (void)ebpo_holes_crossings(h, low, true, winding);
            return EBPO_CELL_FAR;
        }
    }
    return EBPO_CELL_NEAR;
}

void ebpo_holes_find_cell(ebpo_holes *h, const double p[3], ebpo_holes_cell *out)
{
    found_node n;
    out->decision = EBPO_CELL_NEAR;
    if (!h->cell_count || !find_node(h, p, &n))
        return;
    uint32_t value = ebpo_entry_value(n.d.entry);
    bool uniform = ebpo_entry_kind_of(n.d.entry) == EBPO_ENTRY_UNIFORM;
    _Atomic uint8_t *kept = uniform ? &h->cell[n.number] : &h->leaf[value];
    out->decision = (ebpo_cell_decision)*kept;
    if (out->decision == EBPO_CELL_UNKNOWN) {
        ebpo_cell cell = ebpo_descent_cell(&n.d, h->locator.level, n.position.at);
        int32_t winding = 0;
        out->decision = uniform ? classify_uniform(h, cell) : classify_leaf(h, cell, &winding);
        if (!uniform)
            h->leaf_winding[value] = winding;
        *kept = (uint8_t)out->decision;
    }
    if (out->decision != EBPO_CELL_FAR)
        return;
    out->leaf = value;
    out->level = n.d.level;
    out->winding = h->leaf_winding[value];
    out->position = n.position;
}
