/* Decides points inside a surface with holes, by the caps of its border.
 *
 * The octree of a surface has the winding numbers k of the surface with its caps, which are
 * integers. The winding number of the surface is w = k + w_D, where w_D is the winding number of
 * the discs D (geometry/cap_tree.h). Bounds of w_D for all points of a cell often decide for the
 * whole cell. The error of a bound shows that no cap touches the cell, so k changes in the cell at
 * faces only. If |w_D| is below t and below 1 - t for the threshold t, the rule for w equals the
 * rule for k; the rules are then equal in all cells below too. Other white nodes have one result if
 * the bounds of k + w_D are on one side of the rule's boundary. Points of the remaining cells are
 * decided one by one (cap_winding.c). */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "format/border_loops.h"
#include "geometry/level_nodes.h"
#include "query/holes.h"

/* Tolerances of the bounds of half angles. */
static const double FIRST_TOLERANCE = 0.5, LAST_TOLERANCE = 0x1p-8;

ebpo_status ebpo_holes_read(ebpo_holes **out, const ebpo_file *file, double threshold,
                            ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    ebpo_border_loops loops;
    *out = NULL;
    ebpo_status status = ebpo_border_read(file, &loops, error);
    if (status != EBPO_OK)
        return status;
    ebpo_holes *h = ebpo_alloc_zero(1, sizeof *h);
    status =
        h ? ebpo_cap_tree_of_loops(&h->caps, &loops, error) : ebpo_fail_memory(error, sizeof *h);
    ebpo_border_loops_free(&loops);
    if (status != EBPO_OK) {
        free(h);
        return status;
    }
    h->rule = (ebpo_cap_rule){ (uint8_t)info->rule, threshold };
    *out = h;
    return EBPO_OK;
}

void ebpo_holes_free(ebpo_holes *holes)
{
    if (!holes)
        return;
    ebpo_cap_tree_free(&holes->caps);
    free(holes);
}

uint64_t ebpo_holes_bytes(const ebpo_holes *holes)
{
    return holes ? sizeof *holes + holes->caps.position_count * sizeof *holes->caps.position +
                       holes->caps.node_count * sizeof *holes->caps.node
                 : 0;
}

/* --- marks --- */

typedef struct marking {
    const ebpo_holes *holes;
    const ebpo_marked_table *m;
    bool fits; /* winding numbers are small enough */
    uint64_t capacity;
} marking;

/* Bounds w_D in a cell. Returns false if a cap may touch the cell. */
static bool bound_in_cell(const marking *w, ebpo_cell cell, double tolerance, ebpo_bounded *out)
{
    double low[3], high[3], centre[3], half[3];
    ebpo_cell_bounds(w->m->box, cell, low, high);
    for (int k = 0; k < 3; k++) {
        centre[k] = low[k] / 2 + high[k] / 2;
        half[k] = fmax(high[k] - centre[k], centre[k] - low[k]);
    }
    *out = ebpo_cap_tree_bound(&w->holes->caps, centre, half, tolerance);
    /* a triangle without a bound has an error of pi or more */
    return out->error < 3;
}

/* Returns true if the rule for k decides in the cell. Refines the bounds down to `least`. */
static bool is_far(const marking *w, ebpo_cell cell, double least)
{
    const double t = fmin(w->holes->rule.threshold, 1 - w->holes->rule.threshold);
    ebpo_bounded b;
    for (double tolerance = FIRST_TOLERANCE; tolerance >= least; tolerance /= 8) {
        if (!bound_in_cell(w, cell, tolerance, &b))
            return false;
        b = ebpo_cap_winding_of(b, 0);
        if (fabs(b.middle) + b.error < t - 0x1p-40)
            return true;
        if (fabs(b.middle) - b.error > t)
            return false;
    }
    return false;
}

static bool caps_touch(const marking *w, ebpo_cell cell)
{
    double low[3], high[3];
    ebpo_cell_bounds(w->m->box, cell, low, high);
    return ebpo_caps_near(&w->holes->caps, low, high);
}

/* Returns the mark of a cell without faces. `winding`: winding number at the cell's lowest
 * corner. */
static ebpo_uniform_mark find_mark(const marking *w, ebpo_cell cell, int32_t winding)
{
    ebpo_bounded b;
    for (double t = FIRST_TOLERANCE; t >= LAST_TOLERANCE && bound_in_cell(w, cell, t, &b); t /= 8) {
        b = ebpo_cap_winding_of(b, winding);
        int result = ebpo_cap_rule_result(&w->holes->rule, b.middle - b.error, b.middle + b.error);
        if (result >= 0)
            return result ? EBPO_MARK_IN : EBPO_MARK_OUT;
    }
    return caps_touch(w, cell) ? EBPO_MARK_NEAR : EBPO_MARK_APART;
}

static uint32_t mark_cell(marking *w, ebpo_cell cell, int32_t winding, bool far);

/* Splits a cell without faces. Returns the index of its parts, or -1 if there is no space. */
static int64_t split_cell(marking *w, ebpo_cell cell, int32_t winding)
{
    ebpo_node_table *t = w->m->table;
    uint32_t index = t->split_count;
    double low[3], corner[3], high[3];
    if (cell.level >= w->m->deepest || index >= w->m->splits ||
        !ebpo_grow(&t->split, &w->capacity, index + 1, sizeof *t->split))
        return -1;
    t->split_count++;
    ebpo_cell_bounds(w->m->box, cell, low, high);
    for (unsigned octant = 0; octant < 8; octant++) {
        ebpo_cell child = ebpo_cell_child(cell, octant);
        ebpo_cell_bounds(w->m->box, child, corner, high);
        uint32_t entry =
            mark_cell(w, child, winding + ebpo_holes_crossings(w->holes, low, corner), false);
        t->split[index][octant] = entry;
    }
    return index;
}

/* Returns the entry of a cell without faces. */
static uint32_t mark_cell(marking *w, ebpo_cell cell, int32_t winding, bool far)
{
    bool in = ebpo_rule_inside((ebpo_rule)w->holes->rule.rule, winding);
    ebpo_uniform_mark mark = !far ? find_mark(w, cell, winding) : in ? EBPO_MARK_IN : EBPO_MARK_OUT;
    int64_t parts = mark >= EBPO_MARK_APART ? split_cell(w, cell, winding) : -1;
    uint32_t entry = 0;
    w->fits = w->fits && abs(winding) < 1 << 25 &&
              ebpo_entry_uniform(parts >= 0 ? ebpo_marked_entry((int32_t)parts, EBPO_MARK_SPLIT)
                                            : ebpo_marked_entry(winding, mark),
                                 &entry);
    return entry;
}

static void mark_leaf(marking *w, ebpo_accel_leaf *leaf, ebpo_cell cell)
{
    if (is_far(w, cell, LAST_TOLERANCE))
        return;
    leaf->kind = EBPO_LEAF_GENERAL;
    leaf->cell_face = caps_touch(w, cell) ? EBPO_NEAR_CAPS : EBPO_NEAR_BORDER;
}

/* Marks a node and the nodes below it. Recursive, one call for each level. */
static void mark_node(marking *w, uint32_t *entry, ebpo_cell cell, bool far)
{
    ebpo_node_table *t = w->m->table;
    uint32_t value = ebpo_entry_value(*entry);
    switch (ebpo_entry_kind_of(*entry)) {
    case EBPO_ENTRY_UNIFORM: *entry = mark_cell(w, cell, ebpo_entry_winding(*entry), far); break;
    case EBPO_ENTRY_LEAF:
        if (w->m->leaf && !far)
            mark_leaf(w, &w->m->leaf[value], cell);
        break;
    case EBPO_ENTRY_GRAY:
        far = far || is_far(w, cell, FIRST_TOLERANCE);
        for (unsigned octant = 0; octant < 8; octant++)
            mark_node(w, &t->group[value][octant], ebpo_cell_child(cell, octant), far);
        break;
    case EBPO_ENTRY_SUBTREE_ROOT: break;
    }
}

ebpo_status ebpo_holes_mark(const ebpo_holes *holes, const ebpo_marked_table *marked,
                            ebpo_error *error)
{
    marking w = { holes, marked, true, 0 };
    ebpo_node_table *table = marked->table;
    mark_node(&w, &table->root, marked->root, false);
    if (table->grid) { /* it has copies of entries */
        free(table->grid);
        free(table->grid_depth);
        table->grid = NULL;
        table->grid_depth = NULL;
        table->grid_bits = 0;
        ebpo_node_table_make_grid(table);
    }
    return w.fits ? EBPO_OK
                  : ebpo_fail(error, EBPO_E_LIMIT, "the winding number of a node is beyond 2^25");
}

/* --- points --- */

int32_t ebpo_holes_crossings(const ebpo_holes *holes, const double low[3], const double p[3])
{
    double from[3] = { low[0], low[1], low[2] };
    int32_t sum = 0;
    for (int axis = 0; axis < 3; axis++) {
        sum += ebpo_cap_crossings(&holes->caps, from, p[axis], axis);
        from[axis] = p[axis];
    }
    return sum;
}

ebpo_where ebpo_holes_where(ebpo_holes *holes, const double p[3], int32_t winding)
{
    ebpo_cap_decision d = ebpo_cap_decide(&holes->caps, p, winding, &holes->rule);
    if (d.tie)
        holes->ties++;
    return d.inside ? EBPO_IN : EBPO_OUT;
}
