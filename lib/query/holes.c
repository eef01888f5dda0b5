/* Decides if points are inside a surface with holes, by the caps of its border: faces that close
 * the loops of border edges.
 *
 * The octree of a surface stores integers k, the winding numbers of the closed mesh that consists
 * of the surface and its caps. The winding number of the surface alone is w_S = k + w_D, where w_D
 * is the winding number of the discs D, which are the caps with reversed orientation
 * (geometry/cap_tree.h). A point is inside if w_S satisfies the file's rule (ebpo_rule) with a
 * threshold t (ebpo_cap_rule).
 *
 * The functions here first compute bounds of w_D that are valid for all points of a cell. These
 * bounds often decide for the whole cell. If the error of these bounds is small, no cap touches the
 * cell, so k changes in the cell at faces only. If |w_D| is also below t and below 1 - t, the rules
 * for w_S and for k give the same result in this cell and in all cells below it. In a white node (a
 * cell without faces), |w_D| may be greater. The whole cell still has one result if the bounds of k
 * + w_D are on one side of the rule's boundary. Near a cap, the value of w_S at the cell's centre
 * and a bound of its variation in the cell decide. Other cells are split. A part of a leaf that no
 * face touches is treated as a white node. Points of the remaining cells are decided one by one
 * (cap_winding.c).
 *
 * If a disc is far from a cell, the angle at which the disc appears is bounded once for the cell
 * and all cells below it. The other discs are near. Each cell has a list of its near discs, which
 * is made from the list of the cell's parent (cap_bounds.c). */
#include "core/strict_fp.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "format/border_loops.h"
#include "geometry/cap_cells.h"
#include "geometry/level_nodes.h"
#include "geometry/predicates.h"
#include "geometry/vec3.h"
#include "query/holes.h"

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
    h->caps.second_order = true;
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

/* A face of the leaf that is being marked, with its bounding box. */
typedef struct marked_face {
    double corner[3][3], low[3], high[3];
} marked_face;

/* A leaf with more faces is not split. (The lists of its faces are small, and count in no budget.)
 */
enum { SPLIT_FACES_MAX = 128 };

typedef struct marking {
    const ebpo_holes *holes;
    const ebpo_marked_table *m;
    ebpo_cap_lists lists; /* of the near discs of all cells on the path to the current cell */
    marked_face *face;    /* faces of the current leaf */
    uint64_t face_capacity;
    /* indices of the faces that touch a part of the leaf, for all parts on the path to the current
     * part; `touching_count` is the end of the last list */
    uint16_t *touching;
    uint64_t touching_count, touching_capacity;
    bool fits;       /* all winding numbers so far are small enough */
    bool has_memory; /* false: the lists are incomplete, because memory was not available */
    uint64_t split_capacity, near_capacity, disc_capacity;
    uint64_t bytes;       /* how many more bytes may be added to the table */
    uint64_t terms;       /* number of terms of all sums of bounds so far */
    ebpo_cap_front front; /* for bounds of w_D that are refined step by step */
} marking;

/* The discs as seen from a cell: bounds of the sum of the far discs, and a list of the near discs.
 */
typedef struct near_discs {
    uint64_t begin, end; /* the list: marking.lists.entry[begin .. end - 1] */
    ebpo_cap_field far;  /* sum of the half angles (2 pi w_D) of the far discs */
    bool decided;        /* the rule for k decides in the whole cell */
    int32_t record;      /* of a gray node: index of an ebpo_near_cell for its leaves, or -1 */
} near_discs;

static ebpo_cap_box box_of(const marking *w, ebpo_cell cell)
{
    double low[3], high[3];
    ebpo_cell_bounds(w->m->box, cell, low, high);
    return ebpo_cap_box_of(low, high);
}

/* Begins to bound w_D in a cell, step by step (ebpo_cap_front_refine). */
static void begin_front(marking *w, const ebpo_cap_box *box, const near_discs *near)
{
    ebpo_cap_front_begin(&w->front, &w->holes->caps, box, w->lists.entry + near->begin,
                         near->end - near->begin, &near->far);
}

/* Returns true if a single disc of the list is large compared with the box. */
static bool has_large_disc(const marking *w, const ebpo_cap_box *box, const near_discs *near)
{
    for (uint64_t i = near->begin; i < near->end; i++) {
        uint32_t entry = w->lists.entry[i];
        const ebpo_cap_node *n = &w->holes->caps.node[entry & ~EBPO_CAP_TRIANGLE];
        if (n->weight && n->radius > box->radius / 2)
            return true;
    }
    return false;
}

/* Returns false if certainly no cap touches the cell. */
static bool caps_touch(const marking *w, ebpo_cell cell, const near_discs *near)
{
    double low[3], high[3];
    ebpo_cell_bounds(w->m->box, cell, low, high);
    return !w->has_memory || ebpo_cap_list_near(&w->holes->caps, w->lists.entry + near->begin,
                                                near->end - near->begin, low, high);
}

/* Returns the sum of the crossings with caps on the way from the lowest corner of a cell (`low`) to
 * a point of the cell. */
static int32_t cross_near(const marking *w, const near_discs *near, const double low[3],
                          const double p[3])
{
    if (!w->has_memory)
        return ebpo_holes_crossings(w->holes, low, p);
    int32_t sum = 0;
    for (uint64_t i = near->begin; i < near->end; i++)
        sum += ebpo_cap_path_crossings(&w->holes->caps, w->lists.entry[i], low, p);
    return sum;
}

/* Returns true if at most `steps` refinements of the bounds show that |w_D| is small in the cell.
 */
static bool is_far(marking *w, const ebpo_cap_box *box, const near_discs *near, int steps)
{
    begin_front(w, box, near);
    return ebpo_cap_front_small(&w->front, w->holes->rule.threshold, 0, steps, &w->terms) == 1;
}

/* Begins to bound w_D at the centre of a cell. *variation bounds the difference between the values
 * at the centre and at any other point of the cell. The values are 2 pi w_S if no face touches the
 * cell, and 2 pi w_D if no cap touches the cell. Returns false if there is no such bound. */
static bool begin_at_centre(marking *w, const ebpo_cap_box *box, const near_discs *near,
                            double *variation)
{
    const ebpo_cap_box centre = ebpo_cap_point(box->centre);
    const uint32_t *list = w->lists.entry + near->begin;
    uint64_t count = near->end - near->begin;
    *variation = ebpo_cap_variation(&w->holes->caps, box, list, count, EBPO_PI_LOW);
    if (*variation == INFINITY)
        return false;
    ebpo_cap_front_begin(&w->front, &w->holes->caps, &centre, list, count, &near->far);
    return true;
}

/* Returns true if the value of w_D at the centre shows that |w_D| is small in the whole cell of a
 * leaf that no cap touches. */
static bool is_far_by_centre(marking *w, const ebpo_cap_box *box, const near_discs *near)
{
    double variation;
    return begin_at_centre(w, box, near, &variation) &&
           ebpo_cap_front_small(&w->front, w->holes->rule.threshold, variation, INT_MAX,
                                &w->terms) == 1;
}

/* Returns 1 if all points of a cell without faces are certainly inside, 0 if all are outside, else
 * -1. `winding`: k at the lowest corner. */
static int find_result(marking *w, ebpo_cell cell, const ebpo_cap_box *box, const near_discs *near,
                       int32_t winding)
{
    double variation, low[3], high[3];
    begin_front(w, box, near);
    int result = ebpo_cap_front_result(&w->front, &w->holes->rule, winding, -1, &w->terms);
    if (result >= 0 || result == EBPO_CAP_BOTH || !has_large_disc(w, box, near) ||
        !begin_at_centre(w, box, near, &variation))
        return result;
    ebpo_cell_bounds(w->m->box, cell, low, high);
    winding += cross_near(w, near, low, box->centre);
    return ebpo_cap_front_result(&w->front, &w->holes->rule, winding, variation, &w->terms);
}

/* Returns true if the rule for k certainly decides at all points of a leaf. */
static bool is_far_leaf(marking *w, ebpo_cell cell, const ebpo_cap_box *box, const near_discs *near)
{
    return is_far(w, box, near, INT_MAX) ||
           (has_large_disc(w, box, near) && !caps_touch(w, cell, near) &&
            is_far_by_centre(w, box, near));
}

/* Makes the list of a cell's near discs from the list of the cell's parent. */
static near_discs narrow_list(marking *w, const ebpo_cap_box *box, const near_discs *parent)
{
    near_discs near = { w->lists.count, 0, parent->far, parent->decided, parent->record };
    if (!near.decided && w->has_memory)
        w->has_memory = ebpo_cap_lists_narrow(&w->lists, &w->holes->caps, box, parent->begin,
                                              parent->end, UINT64_MAX, &near.far) == EBPO_OK;
    near.end = w->lists.count;
    return near;
}

/* Ensures that an array of the table has capacity for `need` items. Takes the bytes of its capacity
 * from the quota. An array grows by an eighth, so that most of the quota is used. Returns false if
 * the quota has too few bytes, or when out of memory. */
static bool grow_in_quota(marking *w, void *array, uint64_t *capacity, uint64_t need, size_t size)
{
    if (need <= *capacity)
        return true;
    uint64_t most = *capacity + w->bytes / size, wanted = *capacity + *capacity / 8 + 16;
    wanted = wanted < need ? need : wanted;
    wanted = wanted > most ? most : wanted;
    void *old, *grown = NULL;
    memcpy(&old, array, sizeof old);
    if (wanted >= need)
        grown = ebpo_realloc(old, wanted, size);
    if (!grown)
        return false;
    memcpy(array, &grown, sizeof grown);
    w->bytes -= (wanted - *capacity) * size;
    *capacity = wanted;
    return true;
}

/* Frees the part of an array's capacity that has no items. */
static void shrink_array(void *array, uint64_t count, size_t size)
{
    void *old;
    memcpy(&old, array, sizeof old);
    void *shrunk = old ? ebpo_realloc(old, count ? count : 1, size) : NULL;
    if (shrunk)
        memcpy(array, &shrunk, sizeof shrunk);
}

/* Copies the list of near discs to `out`: first the entries that may touch the cell, then the
 * others with large errors in the cell, then those with small errors. Sets cell->touching and
 * cell->nearest, the numbers of entries of the first kind, and of the first and second kind. Adds
 * the bounds of the others to *most. */
static void copy_list(const marking *w, const ebpo_cap_box *box, const double low[3],
                      const double high[3], const near_discs *near, uint32_t *out,
                      ebpo_near_cell *cell, ebpo_cap_field *most)
{
    const double small = 0x1p-2; /* 1/25 of a turn */
    const ebpo_cap_tree *caps = &w->holes->caps;
    uint32_t touching = 0, count = 0, end = (uint32_t)(near->end - near->begin);
    for (uint64_t i = near->begin; i < near->end; i++) {
        uint32_t entry = w->lists.entry[i];
        if (ebpo_cap_list_near(caps, &entry, 1, low, high)) {
            out[count++] = out[touching];
            out[touching++] = entry;
        } else if (ebpo_cap_field_add(most, caps, box, entry, small)) {
            out[--end] = entry;
        } else {
            out[count++] = entry;
        }
    }
    cell->touching = touching < EBPO_TOUCHING_ALL ? (uint8_t)touching : EBPO_TOUCHING_ALL;
    cell->nearest = (uint16_t)count;
}

/* Converts bounds to the coordinates of a cell with this box. */
static ebpo_near_field to_near_field(const ebpo_cap_field *f, const ebpo_cap_box *box)
{
    ebpo_near_field out = { .middle = (float)f->at_centre.middle };
    double error = f->at_centre.error + fabs((double)out.middle - f->at_centre.middle);
    for (int k = 0; k < 3; k++) {
        double slope = f->slope[k] * box->half[k];
        out.slope[k] = (float)slope;
        error += fabs((double)out.slope[k] - slope) + 0x1p-28 * fabs(slope);
    }
    out.error = (float)error * (1 + 0x1p-22f) + 0x1p-100f;
    return out;
}

/* Adds an ebpo_near_cell to the table. Returns its index, or -1 if there is no space. */
static int32_t store_near(marking *w, ebpo_cell cell, const near_discs *near, int32_t winding)
{
    ebpo_node_table *t = w->m->table;
    uint64_t count = near->end - near->begin;
    if (!w->has_memory || t->near_count >= 1 << 25 || t->disc_count + count > UINT32_MAX ||
        count > UINT16_MAX ||
        !grow_in_quota(w, &t->near, &w->near_capacity, t->near_count + 1, sizeof *t->near) ||
        !grow_in_quota(w, &t->disc, &w->disc_capacity, t->disc_count + count, sizeof *t->disc))
        return -1;
    const ebpo_cap_box box = box_of(w, cell);
    ebpo_near_cell made = { .winding = winding,
                            .first = (uint32_t)t->disc_count,
                            .count = (uint16_t)count,
                            .level = (uint8_t)cell.level };
    ebpo_cap_field most = near->far;
    double low[3], high[3];
    ebpo_cell_bounds(w->m->box, cell, low, high);
    copy_list(w, &box, low, high, near, t->disc + t->disc_count, &made, &most);
    made.far = to_near_field(&near->far, &box);
    made.most = to_near_field(&most, &box);
    t->near[t->near_count] = made;
    t->disc_count += count;
    return (int32_t)t->near_count++;
}

/* A cell without faces, or a leaf or a part of a leaf, that is marked. */
typedef struct marked_cell {
    ebpo_cell cell;
    int32_t winding; /* k at the lowest corner */
    bool faces;      /* faces may touch the cell */
    /* the list of these faces, unless the cell cannot be split:
     * marking.touching[first_face .. end_face - 1] */
    uint64_t first_face, end_face;
    int32_t record; /* index of an ebpo_near_cell for the cell (EBPO_MARK_FACES_LISTED), or -1 */
} marked_cell;

/* Adds a face of the current leaf to the list, if its bounding box touches the leaf's cell. Returns
 * false when out of memory, or if the leaf has too many faces. */
static bool add_face(marking *w, const double t[3][3], const double low[3], const double high[3])
{
    marked_face made;
    uint64_t count = w->touching_count;
    for (int k = 0; k < 3; k++) {
        made.low[k] = ebpo_min3(t[0][k], t[1][k], t[2][k]);
        made.high[k] = ebpo_max3(t[0][k], t[1][k], t[2][k]);
        if (made.low[k] > high[k] || made.high[k] < low[k])
            return true;
    }
    memcpy(made.corner, t, sizeof made.corner);
    if (count == SPLIT_FACES_MAX ||
        !ebpo_grow(&w->face, &w->face_capacity, count + 1, sizeof *w->face))
        return false;
    w->face[count] = made;
    w->touching_count++;
    return true;
}

/* Lists the faces that may touch the cell of a leaf. Returns false when out of memory, or if the
 * leaf has too many faces. */
static bool list_faces(marking *w, const ebpo_accel_leaf *leaf, marked_cell *cell)
{
    const ebpo_accel *s = w->m->accel;
    double low[3], high[3];
    w->touching_count = 0;
    ebpo_cell_bounds(w->m->box, cell->cell, low, high);
    for (const ebpo_listed_block *at = s->list + leaf->list;; at++) {
        uint64_t listed = ebpo_listed(at);
        for (unsigned lanes = ebpo_listed_lanes(listed); lanes; lanes &= lanes - 1) {
            double t[3][3];
            ebpo_accel_triangle(
                s, ebpo_listed_number(listed) * EBPO_BLOCK + (unsigned)__builtin_ctz(lanes), t);
            if (!add_face(w, (const double(*)[3])t, low, high))
                return false;
        }
        if (listed & EBPO_LISTED_LAST)
            break;
    }
    /* a list for the leaf and for one cell of each level below it */
    uint64_t count = w->touching_count;
    if (!ebpo_grow(&w->touching, &w->touching_capacity, count * (EBPO_LEVELS_MAX + 1),
                   sizeof *w->touching))
        return false;
    for (uint64_t i = 0; i < count; i++)
        w->touching[i] = (uint16_t)i;
    cell->first_face = 0;
    cell->end_face = count;
    cell->faces = count > 0;
    return true;
}

/* Lists the faces that may touch a part of a cell. */
static void list_faces_of_part(marking *w, const marked_cell *whole, marked_cell *part,
                               const double low[3], const double high[3])
{
    part->first_face = w->touching_count;
    for (uint64_t i = whole->first_face; i < whole->end_face; i++) {
        const marked_face *f = &w->face[w->touching[i]];
        if (f->low[0] <= high[0] && f->high[0] >= low[0] && f->low[1] <= high[1] &&
            f->high[1] >= low[1] && f->low[2] <= high[2] && f->high[2] >= low[2])
            w->touching[w->touching_count++] = w->touching[i];
    }
    part->end_face = w->touching_count;
    part->faces = part->end_face > part->first_face;
}

/* Returns the sum of the crossings with the faces of a cell on the way from the cell's lowest
 * corner (`low`) to a point p of the cell. */
static int32_t cross_faces(const marking *w, const marked_cell *whole, const double low[3],
                           const double p[3])
{
    double from[3] = { low[0], low[1], low[2] };
    int32_t sum = 0;
    for (int axis = 0; axis < 3; axis++) {
        int u = axis == 2 ? 0 : axis + 1, v = axis == 0 ? 2 : axis - 1;
        for (uint64_t i = whole->first_face; i < whole->end_face && p[axis] > from[axis]; i++) {
            const marked_face *f = &w->face[w->touching[i]];
            if (f->low[u] <= from[u] && f->high[u] >= from[u] && f->low[v] <= from[v] &&
                f->high[v] >= from[v])
                sum += ebpo_axis_crossing(from, p[axis], axis, f->corner[0], f->corner[1],
                                          f->corner[2]);
        }
        from[axis] = p[axis];
    }
    return sum;
}

static int32_t mark_cell(marking *w, const marked_cell *marked, const near_discs *parent);

/* Splits a cell into eight parts and marks the parts. If the parts cannot be split, they share one
 * ebpo_near_cell, that of the whole cell; parts without faces do not share that of a cell with
 * faces. Returns the index of the parts in the table's `split`, or -1 if the cell cannot be split.
 */
static int32_t split_cell(marking *w, const marked_cell *whole, const near_discs *near)
{
    ebpo_node_table *t = w->m->table;
    uint32_t index = t->split_count;
    marked_cell part = *whole;
    double low[3], corner[3], high[3];
    if (whole->cell.level >= w->m->deepest || index >= 1 << 25 ||
        (whole->faces && whole->first_face == whole->end_face) ||
        !grow_in_quota(w, &t->split, &w->split_capacity, index + 1, sizeof *t->split))
        return -1;
    t->split_count++;
    if (whole->cell.level + 1 == w->m->deepest && whole->record < 0)
        part.record = store_near(w, whole->cell, near, whole->winding);
    const int32_t record = part.record;
    ebpo_cell_bounds(w->m->box, whole->cell, low, high);
    for (unsigned octant = 0; octant < 8; octant++) {
        part.cell = ebpo_cell_child(whole->cell, octant);
        ebpo_cell_bounds(w->m->box, part.cell, corner, high);
        part.winding =
            whole->winding + cross_near(w, near, low, corner) + cross_faces(w, whole, low, corner);
        list_faces_of_part(w, whole, &part, corner, high);
        part.record = part.faces == whole->faces ? record : -1;
        int32_t marked = mark_cell(w, &part, near);
        t->split[index][octant] = marked;
        w->touching_count = part.first_face;
    }
    return (int32_t)index;
}

/* Returns the marked entry of a cell whose points may have different results. `near`: the cell's
 * near discs. */
static int32_t mark_undecided(marking *w, const marked_cell *m, const near_discs *near)
{
    int32_t index = split_cell(w, m, near);
    if (index >= 0)
        return ebpo_marked_entry(index, EBPO_MARK_SPLIT);
    index = m->record >= 0 ? m->record : store_near(w, m->cell, near, m->winding);
    ebpo_uniform_mark listed = m->faces ? EBPO_MARK_FACES_LISTED : EBPO_MARK_LISTED,
                      unlisted = m->faces ? EBPO_MARK_FACES_NEAR : EBPO_MARK_NEAR;
    return index >= 0 ? ebpo_marked_entry(index, listed) : ebpo_marked_entry(m->winding, unlisted);
}

/* Returns the marked entry of a cell without faces, or of a leaf or part of a leaf. */
static int32_t mark_cell(marking *w, const marked_cell *m, const near_discs *parent)
{
    const ebpo_cap_box box = box_of(w, m->cell);
    const near_discs near = narrow_list(w, &box, parent);
    int32_t marked = 0;
    bool decided = false;
    w->fits = w->fits && abs(m->winding) < 1 << 25;
    if (!w->fits) /* the marks fail, and sums of winding numbers could overflow */
        return 0;
    if (m->faces) {
        decided = near.decided || (w->has_memory && is_far_leaf(w, m->cell, &box, &near));
        marked = ebpo_marked_entry(m->winding, EBPO_MARK_FACES);
    } else {
        int result = near.decided    ? ebpo_rule_inside((ebpo_rule)w->holes->rule.rule, m->winding)
                     : w->has_memory ? find_result(w, m->cell, &box, &near, m->winding)
                                     : -1;
        decided = result >= 0;
        marked = ebpo_marked_entry(m->winding, (ebpo_uniform_mark)(decided && result));
    }
    if (!decided)
        marked = mark_undecided(w, m, &near);
    w->lists.count = near.begin;
    return marked;
}

/* Marks a leaf, if the rule for k does not decide in it. */
static void mark_leaf(marking *w, ebpo_accel_leaf *leaf, ebpo_cell cell, const near_discs *parent)
{
    const ebpo_accel *s = w->m->accel;
    const ebpo_cap_box box = box_of(w, cell);
    const near_discs near = narrow_list(w, &box, parent);
    if (!near.decided && (!w->has_memory || !is_far_leaf(w, cell, &box, &near))) {
        marked_cell m = {
            .cell = cell, .winding = leaf->winding, .faces = true, .record = near.record
        };
        w->fits = w->fits && abs(leaf->winding) < 1 << 25;
        if (cell.level < w->m->deepest && !list_faces(w, leaf, &m))
            m.first_face = m.end_face;
        leaf->kind = EBPO_LEAF_GENERAL;
        leaf->cell_face = EBPO_NEAR_BORDER;
        leaf->rows = (uint32_t)(w->fits ? mark_undecided(w, &m, &near) : 0);
        w->m->cell_faces(s, s->list + leaf->list, cell);
    }
    w->lists.count = near.begin;
}

static uint32_t mark_uniform(marking *w, ebpo_cell cell, int32_t winding, const near_discs *parent)
{
    const marked_cell m = { .cell = cell, .winding = winding, .record = -1 };
    uint32_t entry = 0;
    w->fits = ebpo_entry_uniform(mark_cell(w, &m, parent), &entry) && w->fits;
    return entry;
}

/* Marks a node and the nodes below it. Recursive, one call for each level. */
static void mark_node(marking *w, uint32_t *entry, ebpo_cell cell, const near_discs *parent)
{
    enum { STEPS = 2 }; /* refinements for a gray node, whose children can be tested, too */
    ebpo_node_table *t = w->m->table;
    uint32_t value = ebpo_entry_value(*entry);
    switch (ebpo_entry_kind_of(*entry)) {
    case EBPO_ENTRY_UNIFORM:
        *entry = mark_uniform(w, cell, ebpo_entry_winding(*entry), parent);
        break;
    case EBPO_ENTRY_LEAF:
        if (w->m->accel)
            mark_leaf(w, &w->m->accel->leaf[value], cell, parent);
        break;
    case EBPO_ENTRY_GRAY: {
        const ebpo_cap_box box = box_of(w, cell);
        near_discs near = narrow_list(w, &box, parent);
        near.decided = near.decided || (w->has_memory && is_far(w, &box, &near, STEPS));
        if (w->m->accel && !near.decided && near.record < 0 && cell.level + 1 >= w->m->deepest)
            near.record = store_near(w, cell, &near, 0); /* its leaves have their own k */
        for (unsigned octant = 0; octant < 8; octant++)
            mark_node(w, &t->group[value][octant], ebpo_cell_child(cell, octant), &near);
        w->lists.count = near.begin;
        break;
    }
    case EBPO_ENTRY_SUBTREE_ROOT: break;
    }
}

/* Returns true if an entry of the grid is of a node with a mark. *marked: the mark. */
static bool has_mark(const ebpo_marked_table *m, uint32_t entry, int32_t *marked)
{
    if (ebpo_entry_kind_of(entry) == EBPO_ENTRY_UNIFORM) {
        *marked = ebpo_entry_winding(entry);
        return true;
    }
    if (ebpo_entry_kind_of(entry) != EBPO_ENTRY_LEAF || !m->accel)
        return false;
    const ebpo_accel_leaf *leaf = &m->accel->leaf[ebpo_entry_value(entry)];
    *marked = (int32_t)leaf->rows;
    return ebpo_leaf_kind_of(leaf) == EBPO_LEAF_GENERAL && leaf->cell_face == EBPO_NEAR_BORDER;
}

/* Replaces the entries of split nodes in the grid by those of their parts. Parts of leaves that
 * have faces, or whose parts may have faces, keep the entry of the leaf. */
static void paint_parts(const ebpo_marked_table *m)
{
    ebpo_node_table *t = m->table;
    uint32_t side = t->grid ? 1u << t->grid_bits : 0, at[3];
    uint64_t i = 0;
    int32_t marked;
    for (at[2] = 0; at[2] < side; at[2]++)
        for (at[1] = 0; at[1] < side; at[1]++)
            for (at[0] = 0; at[0] < side; at[0]++, i++) {
                int level = t->grid_depth[i];
                bool leaf = ebpo_entry_kind_of(t->grid[i]) == EBPO_ENTRY_LEAF;
                if (!has_mark(m, t->grid[i], &marked))
                    continue;
                marked = ebpo_marked_part(t, marked, at, t->grid_bits, t->grid_bits, &level);
                if (leaf && ebpo_entry_mark(marked) >= EBPO_MARK_SPLIT)
                    continue;
                if (ebpo_entry_uniform(marked, &t->grid[i]))
                    t->grid_depth[i] = (uint8_t)level;
            }
}

ebpo_status ebpo_holes_mark(ebpo_holes *holes, const ebpo_marked_table *marked, ebpo_error *error)
{
    ebpo_node_table *table = marked->table;
    marking *w = ebpo_alloc_zero(1, sizeof *w);
    near_discs all = { .record = -1 };
    if (!w)
        return ebpo_fail_memory(error, sizeof *w);
    w->holes = holes;
    w->m = marked;
    w->fits = true;
    w->bytes = marked->bytes;
    w->has_memory = ebpo_grow(&w->lists.entry, &w->lists.capacity, 1, sizeof *w->lists.entry);
    if (w->has_memory && holes->caps.node_count > 0)
        w->lists.entry[all.end++] = 0; /* the root of the tree of caps: all discs */
    w->lists.count = all.end;
    mark_node(w, &table->root, marked->root, &all);
    bool fits = w->fits;
    holes->terms += w->terms;
    shrink_array(&table->near, table->near_count, sizeof *table->near);
    shrink_array(&table->disc, table->disc_count, sizeof *table->disc);
    shrink_array(&table->split, table->split_count, sizeof *table->split);
    free(w->lists.entry);
    free(w->face);
    free(w->touching);
    free(w);
    if (table->grid) { /* the grid has copies of entries, so the grid is made again */
        free(table->grid);
        free(table->grid_depth);
        table->grid = NULL;
        table->grid_depth = NULL;
        table->grid_bits = 0;
        ebpo_node_table_make_grid(table);
        paint_parts(marked);
    }
    return fits ? EBPO_OK
                : ebpo_fail(error, EBPO_E_LIMIT, "the winding number of a node is beyond 2^25");
}

uint64_t ebpo_holes_marked_bytes(const ebpo_node_table *table)
{
    return table->split_count * sizeof *table->split + table->near_count * sizeof *table->near +
           table->disc_count * sizeof *table->disc;
}

/* --- points --- */

int32_t ebpo_holes_crossings(const ebpo_holes *holes, const double low[3], const double p[3])
{
    return holes->caps.node_count ? ebpo_cap_path_crossings(&holes->caps, 0, low, p) : 0;
}

/* Converts a decision to a result, and counts ties. */
static ebpo_where where_of(ebpo_holes *holes, ebpo_cap_decision d)
{
    if (d.tie)
        holes->ties++;
    return d.inside ? EBPO_IN : EBPO_OUT;
}

ebpo_where ebpo_holes_where(ebpo_holes *holes, const double p[3], int32_t winding)
{
    return where_of(holes, ebpo_cap_decide(&holes->caps, p, winding, &holes->rule));
}

int32_t ebpo_holes_list_crossings(const ebpo_holes *holes, const ebpo_node_table *table,
                                  const ebpo_near_cell *cell, const double low[3],
                                  const double p[3])
{
    int32_t sum = 0;
    uint32_t count = ebpo_near_touching(cell);
    ebpo_cap_list_prefetch(&holes->caps, table->disc + cell->first, count);
    for (uint32_t i = 0; i < count; i++)
        sum += ebpo_cap_path_crossings(&holes->caps, table->disc[cell->first + i], low, p);
    return sum;
}

ebpo_where ebpo_holes_where_in(ebpo_holes *holes, const ebpo_node_table *table,
                               const ebpo_near_cell *cell, const double p[3], const double x[3],
                               int32_t winding)
{
    return where_of(holes, ebpo_cap_decide_near(&holes->caps, cell, table->disc + cell->first, p, x,
                                                winding, &holes->rule));
}
