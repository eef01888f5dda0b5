/* What files and commands call the selections of planes, and which settings each takes. The
 * functions are in the construction's table (construct/selections.c). */
#include <ebpo/build.h>

#include <stddef.h>

static const ebpo_selection_traits selection_traits[] = {
    [EBPO_SELECT_INHERIT] = { .name = "inherit" },
    [EBPO_SELECT_KMEDOIDS] = { .name = "kmedoids",
                               .from_leaves = true,
                               .takes_normals = true,
                               .takes_seed = true },
    [EBPO_SELECT_OFFSET] = { .name = "offset", .from_leaves = true },
    [EBPO_SELECT_RANDOM] = { .name = "random", .from_leaves = true, .takes_seed = true },
};
_Static_assert(sizeof selection_traits / sizeof *selection_traits == EBPO_SELECTION_COUNT,
               "each selection of ebpo/build.h needs a line in this table");

const ebpo_selection_traits *ebpo_selection_describe(ebpo_selection selection)
{
    return (unsigned)selection < EBPO_SELECTION_COUNT ? &selection_traits[selection] : NULL;
}
