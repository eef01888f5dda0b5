/* The table of selections. */
#include "geom/strict_fp.h"

#include <math.h>

#include "planes/planes.h"

static const ebpo_selection_method methods[] = {
    [EBPO_SELECT_INHERIT] = { .select = ebpo_select_greedy },
    [EBPO_SELECT_KMEDOIDS] = { .select = ebpo_select_kmedoids,
                               .from_leaves = true,
                               .has_seed = true,
                               .has_normals = true },
    [EBPO_SELECT_OFFSET] = { .select = ebpo_select_offset, .from_leaves = true },
    [EBPO_SELECT_RANDOM] = { .select = ebpo_select_random, .from_leaves = true, .has_seed = true },
};

const ebpo_selection_method *ebpo_selection_of(ebpo_selection selection)
{
    return (unsigned)selection < sizeof methods / sizeof *methods ? &methods[selection] : NULL;
}

int ebpo_selection_wanted(int count, int level, double percent, double k_root)
{
    if (!(k_root > 0))
        return (int)ceil(count * percent / 100);
    double k = ldexp(k_root, -level);
    if (k < 1)
        return count;
    while (k >= count && k >= 2)
        k /= 2;
    return k > count ? count : (int)k;
}
