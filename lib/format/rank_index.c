/* Prefix sums that let a reader start in the middle of a level. Arrays of an absent part count as
 * zeros. */
#include "core/alloc.h"
#include "core/arrays.h"
#include "format/rank_index.h"
#include "format/schema.h"
#include "geometry/node_types.h"

static uint64_t *make_index(uint64_t count, unsigned cols)
{
    return ebpo_alloc_zero((count / EBPO_INDEX_ROWS + 1) * cols, sizeof(uint64_t));
}

uint64_t *ebpo_index_types(const ebpo_level *level, bool root)
{
    uint64_t *index = make_index(level->group_count, 4);
    uint64_t before[4] = { 0, 0, 0, 0 };
    EBPO_FOR_ITEMS(level->workspace, i, 0, index ? level->group_count : 0) {
        if (i % EBPO_INDEX_ROWS == 0)
            for (int k = 0; k < 4; k++)
                index[i / EBPO_INDEX_ROWS * 4 + k] = before[k];
        for (unsigned octant = 0; octant < ebpo_group_octants(!root); octant++)
            before[ebpo_group_type(level->types[i], octant)]++;
    }
    return index;
}

uint64_t *ebpo_index_gray(const ebpo_level *level)
{
    uint64_t *index = make_index(level->gray_count, 1);
    uint64_t planes = 0;
    for (uint64_t i = 0; index && i < level->gray_count; i++) {
        if (i % EBPO_INDEX_ROWS == 0)
            index[i / EBPO_INDEX_ROWS] = planes;
        planes += level->plane_counts ? level->plane_counts[i] : 0;
    }
    return index;
}

uint64_t *ebpo_index_leaves(const ebpo_level *level)
{
    uint64_t *index = make_index(level->leaf_count, 3);
    uint64_t end = 0, refs = 0, planes = 0;
    EBPO_FOR_ITEMS(level->workspace, i, 0, index ? level->leaf_count : 0) {
        if (i % EBPO_INDEX_ROWS == 0) {
            index[i / EBPO_INDEX_ROWS * 3] = end;
            index[i / EBPO_INDEX_ROWS * 3 + 1] = refs;
            index[i / EBPO_INDEX_ROWS * 3 + 2] = planes;
        }
        if (level->leaf_first) {
            end = level->leaf_first[i] + level->leaf_new[i];
            refs += level->leaf_ref_count[i];
        }
        planes += level->leaf_plane_counts ? level->leaf_plane_counts[i] : 0;
    }
    return index;
}
