/* Finds the cells in which the caps of a surface with holes may decide what is inside (capped.h).
 *
 * The search is breadth first from the root. A cell is omitted if certainly |w_D| < 1/2 in it; no
 * cap touches such a cell. A cell in which |w_D| is certainly greater is not divided. Other cells
 * are divided while the number of tests is below the limit, and no deeper than the tree. Each cell
 * has a list of the caps near it, made from its parent's list (geometry/cap_bounds.h). A cell is
 * not divided either, and has no list, if its list is longer than LIST_MAX and longer than its
 * share, as one of 8^level cells, of ENTRIES_PER_EDGE entries for each border edge: thousands of
 * large caps that overlap would be in the lists of almost all cells. The first levels may have long
 * lists, because their entries are small groups of caps, most of which are far from the cells
 * below. */
#include "core/strict_fp.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "construct/capped.h"
#include "construct/construct_stages.h"
#include "construct/planes.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/workspace.h"
#include "geometry/cap_cells.h"

enum {
    /* Tests of cells, which take microseconds each: always, and for each border edge. */
    TESTS_ALWAYS = 1 << 14,
    TESTS_PER_EDGE = 16,
    LIST_MAX = 1024,
    ENTRIES_PER_EDGE = 64,
    PROGRESS_CELLS = 2048, /* number of divided cells between two reports of progress */
    RELEASE_CELLS = 64,    /* number of divided cells between two releases of pages */
    DETAIL_LEVELS = 3
};

static const double threshold = 0.5;

/* A cap cell. */
typedef struct cap_cell {
    ebpo_octcode code;
    bool is_end;         /* it is not divided */
    bool has_no_list;    /* its list would be too long; all its points may be inside */
    uint64_t begin, end; /* range of its list of near caps */
    ebpo_bounded far;    /* bounds of the other caps */
} cap_cell;

typedef struct cap_level {
    cap_cell *cell; /* [count] ascending octcodes */
    uint64_t count, capacity;
} cap_level;

struct ebpo_capped {
    ebpo_workspace *workspace; /* owns the lists and the cap cells */
    const ebpo_box *box;
    ebpo_cap_rule rule;
    ebpo_cap_tree caps;
    cap_level level[EBPO_LEVELS_MAX];
    int deepest; /* last level with cap cells */
    ebpo_cap_lists lists;
};

/* --- making --- */

/* Tests the eight children of a cap cell and adds the cap cells among them to the next level.
 * `list_max`: maximal length of their lists. Returns false when out of memory. */
static bool divide_cell(ebpo_capped *c, ebpo_cap_front *front, const cap_cell *parent,
                        uint64_t list_max, cap_level *next)
{
    for (unsigned octant = 0; octant < 8; octant++) {
        cap_cell child = { .code = ebpo_octcode_child(parent->code, octant),
                           .begin = c->lists.count,
                           .far = parent->far };
        ebpo_cell cell = ebpo_cell_of_octcode(child.code);
        ebpo_cap_field far = { .at_centre = parent->far }; /* of the first order: without slope */
        double low[3], high[3];
        ebpo_cell_bounds(c->box, cell, low, high);
        const ebpo_cap_box box = ebpo_cap_box_of(low, high);
        ebpo_status status = ebpo_cap_lists_narrow(&c->lists, &c->caps, &box, parent->begin,
                                                   parent->end, list_max, &far);
        child.far = far.at_centre;
        if (status == EBPO_E_MEMORY)
            return false;
        child.has_no_list = status == EBPO_E_LIMIT;
        child.end = c->lists.count;
        int small = child.has_no_list ? 0
                                      : ebpo_cap_small_in(front, &c->caps, low, high,
                                                          c->lists.entry + child.begin,
                                                          child.end - child.begin, &far, threshold);
        child.is_end = small == 0;
        if (small == 1) {
            c->lists.count = child.begin;
            continue;
        }
        if (!ebpo_array_grow_late(c->workspace, &next->cell, &next->capacity, next->count + 1,
                                  sizeof *next->cell))
            return false;
        next->cell[next->count++] = child;
    }
    return true;
}

static ebpo_status fail_lists(const ebpo_capped *c, ebpo_error *error)
{
    return ebpo_workspace_fail(c->workspace, c->lists.count * sizeof *c->lists.entry, error);
}

/* Divides the cells of level c->deepest. `tests`: number of tests before; `tests_max`: limit. */
static ebpo_status divide_level(ebpo_capped *c, ebpo_cap_front *front,
                                const ebpo_progress *progress, uint64_t tests, uint64_t tests_max,
                                ebpo_error *error)
{
    cap_level *l = &c->level[c->deepest];
    uint64_t divided = 0, share = ENTRIES_PER_EDGE * c->caps.position_count >> 3 * (c->deepest + 1),
             list_max = share > LIST_MAX ? share : LIST_MAX;
    for (uint64_t i = 0; i < l->count; i++) {
        if (l->cell[i].is_end)
            continue;
        if (divided % PROGRESS_CELLS == 0 &&
            !ebpo_progress_step(progress, "border", tests + 8 * divided, tests_max, error))
            return EBPO_E_CANCELLED;
        if (divided % RELEASE_CELLS == 0)
            ebpo_release_pages(c->workspace);
        if (!divide_cell(c, front, &l->cell[i], list_max, l + 1))
            return fail_lists(c, error);
        divided++;
    }
    return EBPO_OK;
}

/* Finds the cap cells, level by level. */
static ebpo_status find_cells(ebpo_capped *c, ebpo_cap_front *front, const ebpo_progress *progress,
                              int max_level, uint64_t tests_max, ebpo_error *error)
{
    cap_level *root = &c->level[0];
    if (!ebpo_array_grow_late(c->workspace, &root->cell, &root->capacity, 1, sizeof *root->cell) ||
        !ebpo_array_grow_late(c->workspace, &c->lists.entry, &c->lists.capacity, 1,
                              sizeof *c->lists.entry))
        return fail_lists(c, error);
    c->lists.entry[c->lists.count++] = 0; /* the root of the tree of caps: all caps */
    root->cell[root->count++] = (cap_cell){ .code = 1, .end = 1 };
    uint64_t tests = 0;
    for (; c->deepest < max_level; c->deepest++) {
        const cap_level *l = &c->level[c->deepest];
        uint64_t divided = 0;
        for (uint64_t i = 0; i < l->count; i++)
            divided += !l->cell[i].is_end;
        if (divided == 0 || tests + 8 * divided > tests_max)
            break;
        ebpo_status status = divide_level(c, front, progress, tests, tests_max, error);
        if (status != EBPO_OK)
            return status;
        tests += 8 * divided;
    }
    for (uint64_t i = 0; i < c->level[c->deepest].count; i++)
        c->level[c->deepest].cell[i].is_end = true;
    return EBPO_OK;
}

/* Removes the cells without cap cells below that are not divided further. */
static void remove_empty(ebpo_capped *c)
{
    for (int k = c->deepest - 1; k >= 0; k--) {
        cap_level *l = &c->level[k], *below = l + 1;
        uint64_t kept = 0, next = 0;
        for (uint64_t i = 0; i < l->count; i++) {
            while (next < below->count && below->cell[next].code >> 3 < l->cell[i].code)
                next++;
            if (l->cell[i].is_end ||
                (next < below->count && below->cell[next].code >> 3 == l->cell[i].code))
                l->cell[kept++] = l->cell[i];
        }
        l->count = kept;
    }
}

ebpo_status ebpo_capped_make(ebpo_builder *b, const ebpo_border_loops *loops, ebpo_error *error)
{
    ebpo_capped *c = ebpo_alloc_zero(1, sizeof *c);
    ebpo_cap_front *front = ebpo_alloc(1, sizeof *front);
    ebpo_status status = c && front ? ebpo_cap_tree_of_loops(&c->caps, loops, error)
                                    : ebpo_fail_memory(error, sizeof *c + sizeof *front);
    if (status == EBPO_OK) {
        c->workspace = c->lists.workspace = b->workspace;
        c->box = &b->box;
        c->rule = (ebpo_cap_rule){ (uint8_t)b->options->rule, threshold };
        status = find_cells(c, front, &b->options->progress, b->max_level,
                            TESTS_ALWAYS + TESTS_PER_EDGE * loops->point_count, error);
    }
    free(front);
    if (status == EBPO_OK) {
        remove_empty(c);
        b->capped = c;
    } else
        ebpo_capped_free(c);
    return status;
}

void ebpo_capped_free(ebpo_capped *capped)
{
    if (!capped)
        return;
    for (int i = 0; i < EBPO_LEVELS_MAX; i++)
        ebpo_array_free(capped->workspace, capped->level[i].cell);
    ebpo_array_free(capped->workspace, capped->lists.entry);
    ebpo_cap_tree_free(&capped->caps);
    free(capped);
}

/* --- use --- */

/* Returns the index of the first cell of a level with at least this octcode. */
static uint64_t lower_bound(const cap_level *l, ebpo_octcode code)
{
    uint64_t low = 0, count = l->count;
    while (count) {
        uint64_t half = count / 2;
        if (l->cell[low + half].code < code) {
            low += half + 1;
            count -= half + 1;
        } else
            count = half;
    }
    return low;
}

/* Returns the deepest cap cell that contains the cell, or NULL if the cell is in no cap cell, or if
 * a cap cell that contains it has been divided and the cell is outside its parts. */
static const cap_cell *find_cell(const ebpo_capped *c, ebpo_cell cell)
{
    ebpo_octcode code = ebpo_octcode_of_cell(cell);
    const cap_cell *found = NULL;
    for (int level = 0; level <= cell.level && level <= c->deepest; level++) {
        const cap_level *l = &c->level[level];
        ebpo_octcode ancestor = code >> 3 * (cell.level - level);
        uint64_t i = lower_bound(l, ancestor);
        if (i == l->count || l->cell[i].code != ancestor)
            return NULL;
        found = &l->cell[i];
        if (found->is_end)
            return found;
    }
    return found;
}

ebpo_cap_overlap ebpo_capped_overlap(const ebpo_capped *capped, ebpo_cell cell)
{
    const cap_cell *found = find_cell(capped, cell);
    return !found ? EBPO_CAP_NONE : found->is_end ? EBPO_CAP_WHOLE : EBPO_CAP_PART;
}

/* The corner differences of a cell, to which the crossings of caps are added. */
typedef struct cap_corners {
    const ebpo_box *box;
    ebpo_cell cell;
    int32_t *delta; /* [8] */
} cap_corners;

/* Adds the crossings of a cap: minus those of the disc. Returns false, so that the visit goes on.
 */
static bool add_disc(void *context, const double a[3], const double b[3], const double c[3],
                     uint32_t weight)
{
    const cap_corners *to = context;
    int32_t disc[8];
    ebpo_triangle face;
    memcpy(face.corner[0], a, sizeof face.corner[0]);
    memcpy(face.corner[1], b, sizeof face.corner[1]);
    memcpy(face.corner[2], c, sizeof face.corner[2]);
    ebpo_corner_windings(to->box, to->cell, &face, 1, disc);
    for (int i = 0; i < 8; i++)
        to->delta[i] -= (int32_t)weight * disc[i];
    return false;
}

void ebpo_cap_corners(const ebpo_cap_tree *tree, const ebpo_box *box, ebpo_cell cell,
                      int32_t delta[8])
{
    double low[3], high[3];
    cap_corners to = { box, cell, delta };
    ebpo_cell_bounds(box, cell, low, high);
    ebpo_caps_visit(tree, low, high, add_disc, &to);
}

void ebpo_capped_add_corners(const ebpo_capped *capped, ebpo_cell cell, int32_t delta[8])
{
    /* all caps are in cap cells */
    if (find_cell(capped, cell))
        ebpo_cap_corners(&capped->caps, capped->box, cell, delta);
}

bool ebpo_capped_may_hold(const ebpo_capped *capped, ebpo_cell cell, int32_t winding)
{
    const cap_cell *found = find_cell(capped, cell);
    if (!found)
        return ebpo_rule_inside((ebpo_rule)capped->rule.rule, winding);
    if (found->has_no_list)
        return true;
    double low[3], high[3];
    uint64_t terms = 0;
    ebpo_cap_front front;
    ebpo_cell_bounds(capped->box, cell, low, high);
    const ebpo_cap_box box = ebpo_cap_box_of(low, high), centre = ebpo_cap_point(box.centre);
    ebpo_cap_front_begin(&front, &capped->caps, &box, capped->lists.entry + found->begin,
                         found->end - found->begin, &(ebpo_cap_field){ .at_centre = found->far });
    int result = ebpo_cap_front_result(&front, &capped->rule, winding, -1, &terms);
    if (result >= 0)
        return result;
    double variation = ebpo_cap_variation(&capped->caps, &box, NULL, 0, EBPO_PI_LOW);
    if (variation == INFINITY)
        return true;
    winding += ebpo_cap_path_crossings(&capped->caps, 0, low, box.centre);
    ebpo_cap_front_begin_all(&front, &capped->caps, &centre);
    return ebpo_cap_front_result(&front, &capped->rule, winding, variation, &terms) != 0;
}

bool ebpo_capped_corners(const ebpo_capped *capped, ebpo_cell cell,
                         bool (*add)(void *context, const double x[3]), void *context)
{
    ebpo_octcode code = ebpo_octcode_of_cell(cell);
    int last =
        cell.level + DETAIL_LEVELS < capped->deepest ? cell.level + DETAIL_LEVELS : capped->deepest;
    for (int level = cell.level + 1; level <= last; level++) {
        const cap_level *l = &capped->level[level];
        int down = level - cell.level;
        double side = ebpo_half_power(down);
        for (uint64_t i = lower_bound(l, code << 3 * down);
             i < l->count && l->cell[i].code >> 3 * down == code; i++) {
            if (level < last && !l->cell[i].is_end)
                continue;
            ebpo_cell part = ebpo_cell_of_octcode(l->cell[i].code);
            for (int corner = 0; corner < 8; corner++) {
                double x[3];
                for (int k = 0; k < 3; k++)
                    x[k] = side * (double)(part.at[k] - (cell.at[k] << down) +
                                           (uint32_t)(corner >> k & 1));
                if (!add(context, x))
                    return false;
            }
        }
    }
    return true;
}
