/* The function of each selection; its name and settings: format/head_facts.c. */
#include "core/strict_fp.h"

#include <math.h>

#include "construct/planes.h"

static const ebpo_select_fn selection_functions[] = {
    [EBPO_SELECT_INHERIT] = ebpo_select_greedy,
    [EBPO_SELECT_KMEDOIDS] = ebpo_select_kmedoids,
    [EBPO_SELECT_OFFSET] = ebpo_select_offset,
    [EBPO_SELECT_RANDOM] = ebpo_select_random,
};
_Static_assert(sizeof selection_functions / sizeof *selection_functions == EBPO_SELECTION_COUNT,
               "each selection of ebpo/build.h needs a line in this table");

ebpo_select_fn ebpo_selection_function(ebpo_selection selection)
{
    return (unsigned)selection < EBPO_SELECTION_COUNT ? selection_functions[selection] : NULL;
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
