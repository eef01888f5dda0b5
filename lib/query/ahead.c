/* What will be asked for next: the subtrees around the last position, the nearest first. EBP 2017, 4.2.3, where all 26 neighbours are loaded in a fixed order. */
#include "geom/strict_fp.h"

#include "query/ahead.h"

#include <string.h>

#include "query/locate.h"

enum { AROUND = 27, FINER = 2 };

typedef struct neighbour {
    uint64_t key;
    double far2; /* squared distance from the position to its cell, in cells */
} neighbour;

/* The subtree that holds the cell at the cut level; false when that is settled or beyond the root cell. */
static bool subtree_at(const ebpo_top *top, int level, const uint32_t at[3], uint64_t *key)
{
    uint32_t entry = top->nodes.root;
    for (int i = 1; i <= level && ebpo_entry_kind_of(entry) == EBPO_ENTRY_GRAY; i++)
        entry = top->nodes.group[ebpo_entry_value(entry)][ebpo_octant_at(at, level - i)];
    *key = ebpo_entry_value(entry);
    return ebpo_entry_kind_of(entry) == EBPO_ENTRY_BELOW && !top->below[*key].pruned;
}

static int add(neighbour *list, int count, uint64_t key, double far2)
{
    for (int i = 0; i < count; i++)
        if (list[i].key == key) /* a subtree above the cut level holds several cells */
            return count;
    int at = count;
    for (; at > 0 && list[at - 1].far2 > far2; at--)
        list[at] = list[at - 1];
    list[at] = (neighbour){ key, far2 };
    return count + 1;
}

/* `fine`: the position in quarters of cells of the cut level. */
static int neighbours(const ebpo_top *top, const uint32_t fine[3], neighbour list[AROUND])
{
    int count = 0;
    uint32_t last = (1u << top->cut_level) - 1;
    for (int i = 0; i < AROUND; i++) {
        uint32_t at[3];
        uint64_t key;
        double far2 = 0;
        bool within = true;
        for (int k = 0, rest = i; k < 3; k++, rest /= 3) {
            int step = rest % 3 - 1;
            double inside = ((fine[k] & ((1u << FINER) - 1)) + 0.5) / (1 << FINER), away = step < 0 ? inside : step > 0 ? 1 - inside : 0;
            at[k] = (fine[k] >> FINER) + (uint32_t)step;
            within = within && at[k] <= last;
            far2 += away * away;
        }
        if (within && subtree_at(top, top->cut_level, at, &key))
            count = add(list, count, key, far2);
    }
    return count;
}

void ebpo_context_look_ahead(ebpo_context *c, const double p[3])
{
    const ebpo_model *m = c->model;
    ebpo_box box = ebpo_model_box(m);
    uint32_t fine[3];
    if (!ebpo_locate(&box, m->top->cut_level + FINER, p, fine) || (c->looked_ahead && memcmp(fine, c->looked_from, sizeof fine) == 0))
        return;
    c->looked_ahead = true;
    memcpy(c->looked_from, fine, sizeof fine);
    neighbour list[AROUND];
    uint64_t keys[AROUND];
    int count = neighbours(m->top, fine, list);
    for (int i = 0; i < count; i++)
        keys[i] = list[i].key;
    ebpo_cache_prefetch(m->cache, keys, (unsigned)count);
}
