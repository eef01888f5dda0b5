#include "core/strict_fp.h"

#include "construct/piece_levels.h"

#include <string.h>

#include "core/workspace.h"

void ebpo_piece_levels_free(ebpo_piece_level *out)
{
    ebpo_workspace *workspace = out ? out[0].level.workspace : NULL;
    for (int i = 0; out && i < EBPO_LEVELS_MAX; i++)
        if (!out[i].packed)
            ebpo_level_free(&out[i].level);
    ebpo_array_free(workspace, out);
}

bool ebpo_piece_level_add_group(ebpo_piece_level *out, uint16_t types)
{
    ebpo_level *l = &out->level;
    if (!ebpo_array_grow_late(l->workspace, &l->types, &out->capacity[EBPO_A_TYPES],
                              l->group_count + 1, sizeof *l->types))
        return false;
    l->types[l->group_count++] = types;
    return true;
}

bool ebpo_piece_level_add_gray(ebpo_piece_level *out, const uint32_t *codes, int count,
                               double volume)
{
    ebpo_level *l = &out->level;
    if (!ebpo_array_grow_late(l->workspace, &l->plane_counts, &out->capacity[EBPO_A_PLANE_COUNTS],
                              l->gray_count + 1, 1) ||
        !ebpo_array_grow_late(l->workspace, &l->planes, &out->capacity[EBPO_A_PLANES],
                              l->plane_count + (uint64_t)count, sizeof *l->planes))
        return false;
    l->plane_counts[l->gray_count++] = (uint8_t)count;
    if (count) /* the array may not be there yet */
        memcpy(l->planes + l->plane_count, codes, (size_t)count * sizeof *codes);
    l->plane_count += (uint64_t)count;
    l->gray_volume += volume;
    return true;
}

bool ebpo_piece_level_add_empty(ebpo_piece_level *out, bool black, int32_t winding)
{
    ebpo_level *l = &out->level;
    int32_t **array = black ? &l->black_winding : &l->white_winding;
    uint64_t *count = black ? &l->black_count : &l->white_count;
    if (!ebpo_array_grow_late(l->workspace, array,
                              &out->capacity[black ? EBPO_A_BLACK_WINDING : EBPO_A_WHITE_WINDING],
                              *count + 1, sizeof **array))
        return false;
    (*array)[(*count)++] = winding;
    return true;
}
