/* The table of selections. */
#include "geom/strict_fp.h"

#include <math.h>

#include "planes/planes.h"

static const ebpo_selection_method methods[] = {
    [EBPO_SELECT_INHERIT] = { { .name = "inherit" }, ebpo_select_greedy },
    [EBPO_SELECT_KMEDOIDS] = { { .name = "kmedoids",
                                 .from_leaves = true,
                                 .takes_normals = true,
                                 .takes_seed = true },
                               ebpo_select_kmedoids },
    [EBPO_SELECT_OFFSET] = { { .name = "offset", .from_leaves = true }, ebpo_select_offset },
    [EBPO_SELECT_RANDOM] = { { .name = "random", .from_leaves = true, .takes_seed = true },
                             ebpo_select_random },
};
_Static_assert(sizeof methods / sizeof *methods == EBPO_SELECTION_COUNT,
               "each selection of ebpo/build.h needs a line in this table");

const ebpo_selection_method *ebpo_selection_of(ebpo_selection selection)
{
    return (unsigned)selection < EBPO_SELECTION_COUNT ? &methods[selection] : NULL;
}

const ebpo_selection_traits *ebpo_selection_describe(ebpo_selection selection)
{
    const ebpo_selection_method *method = ebpo_selection_of(selection);
    return method ? &method->traits : NULL;
}

/* Equation 5, or BP's K. */
static int asked_for(int count, int level, double percent, double k_root)
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

int ebpo_selection_wanted(int count, int level, double percent, double k_root)
{
    int wanted = asked_for(count, level, percent, k_root);
    return wanted < EBPO_PLANES_STORED ? wanted : EBPO_PLANES_STORED;
}
