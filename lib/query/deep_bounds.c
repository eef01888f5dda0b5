#include "core/strict_fp.h"

#include "query/nearest.h"

#include <math.h>

#include "format/reader.h"

/* Each level takes four times the one above it; the third would save a tenth of the loads that two
 * leave: docs/develop/design.md. */
enum { DEEP_LEVELS = 2 };
/* On a path a question comes to a few subtrees that are new. What is more is for nothing; reading
 * two levels takes about as long as so many loads. */
enum { NEW_AS_USUAL = 4, LOADS_TO_READ = 64 };

/* --- making --- */

static bool take_levels(ebpo_model *m, int level)
{
    uint64_t most = ebpo_top_envelopes_estimate(m->info, level);
    ebpo_top *deep = NULL;
    if (!ebpo_skeletons_take(m->skeletons, most))
        return false;
    if (ebpo_top_read_envelopes(&deep, m->file, level, m->options.threads, NULL) != EBPO_OK)
        deep = NULL;
    ebpo_skeletons_give_back(m->skeletons, most - (deep ? deep->bytes : 0));
    atomic_store_explicit(&m->deep, deep, memory_order_release);
    return true;
}

void ebpo_deep_bounds_make(ebpo_model *m)
{
    int cut = m->top->cut_level, level = cut + DEEP_LEVELS;
    if (level > m->info->level_count - 1)
        level = m->info->level_count - 1;
    if (!m->skeletons || atomic_exchange(&m->deep_begun, true))
        return;
    while (level > cut && !take_levels(m, level))
        level--;
}

void ebpo_deep_bounds_tell(ebpo_model *m, unsigned loaded)
{
    if (loaded <= NEW_AS_USUAL || m->deep_begun || ebpo_input_expects(&m->file->in))
        return;
    uint64_t more = loaded - NEW_AS_USUAL;
    if (atomic_fetch_add(&m->new_loads, more) + more >= LOADS_TO_READ)
        ebpo_deep_bounds_make(m);
}

/* --- asking --- */

typedef struct deep_search {
    const ebpo_top *top;
    const ebpo_ranking *ranking;
    double best; /* so far */
} deep_search;

typedef struct deep_child {
    uint32_t entry;
    ebpo_cell cell;
    double lower;
} deep_child;

static ebpo_top_planes planes_of(const ebpo_top *t, uint32_t entry)
{
    uint32_t value = ebpo_entry_value(entry);
    return ebpo_entry_kind_of(entry) == EBPO_ENTRY_BELOW ? t->below_planes[value] : t->gray[value];
}

/* Those that may be nearer than the best, the nearest first. */
static int rank(const deep_search *g, uint32_t gray, ebpo_cell cell, double parent,
                deep_child out[8])
{
    int count = 0;
    for (unsigned octant = 0; octant < 8; octant++) {
        deep_child c = { ebpo_table_child(&g->top->nodes, gray, octant),
                         ebpo_cell_child(cell, octant), 0 };
        if (ebpo_entry_kind_of(c.entry) == EBPO_ENTRY_UNIFORM)
            continue;
        ebpo_top_planes planes = planes_of(g->top, c.entry);
        c.lower = fmax(parent, ebpo_rank_cell(g->ranking, c.cell, g->top->planes + planes.first,
                                              planes.count, g->best));
        if (c.lower >= g->best)
            continue;
        int at = count++;
        for (; at > 0 && out[at - 1].lower > c.lower; at--)
            out[at] = out[at - 1];
        out[at] = c;
    }
    return count;
}

static void search(deep_search *g, uint32_t gray, ebpo_cell cell, double parent)
{
    deep_child child[8];
    int count = rank(g, gray, cell, parent, child);
    for (int i = 0; i < count && child[i].lower < g->best; i++)
        if (ebpo_entry_kind_of(child[i].entry) == EBPO_ENTRY_GRAY)
            search(g, child[i].entry, child[i].cell, child[i].lower);
        else
            g->best = child[i].lower;
}

double ebpo_deep_bound(const ebpo_ranking *ranking, const ebpo_node *node, double lower,
                       double limit)
{
    const ebpo_model *m = ranking->model;
    const ebpo_top *top = atomic_load_explicit(&m->deep, memory_order_acquire);
    int level = node->cell.level;
    if (!top || !m->skeletons || node->type != EBPO_GRAY)
        return lower;
    ebpo_descent d = ebpo_descent_begin(&top->nodes, level, node->cell.at);
    while (d.level < level && ebpo_descent_step(&d, &top->nodes, level, node->cell.at))
        ;
    if (d.level < level || ebpo_entry_kind_of(d.entry) != EBPO_ENTRY_GRAY)
        return lower;
    deep_search g = { top, ranking, nextafter(limit, INFINITY) };
    search(&g, d.entry, node->cell, lower);
    return fmax(lower, g.best);
}
