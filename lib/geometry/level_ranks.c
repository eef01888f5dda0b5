#include "geometry/level_ranks.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "geometry/node_types.h"

void ebpo_level_ranks_free(ebpo_level_ranks *ranks)
{
    for (int type = 0; type < 4; type++)
        free(ranks->before[type]);
    free(ranks->plane_first);
    free(ranks->leaf_plane_first);
    free(ranks->ref_first);
    memset(ranks, 0, sizeof *ranks);
}

/* Nodes of a type in the groups before each, and in all of them. */
static ebpo_status count_before(uint64_t **out, const ebpo_level *level, ebpo_node_type type,
                                uint64_t *count, ebpo_error *error)
{
    *count = 0;
    if (!(*out = ebpo_alloc(level->group_count, sizeof **out)))
        return ebpo_fail_memory(error, level->group_count * sizeof **out);
    for (uint64_t i = 0; i < level->group_count; i++) {
        (*out)[i] = *count;
        *count += ebpo_group_count(level->types[i], type, 8);
    }
    return EBPO_OK;
}

static ebpo_status make_ranks(ebpo_level_ranks *out, const ebpo_level *level, int number,
                              ebpo_error *error)
{
    const bool wanted[4] = { [EBPO_WHITE] = level->white_winding,
                             [EBPO_BLACK] = level->black_winding,
                             [EBPO_LEAF] = true,
                             [EBPO_GRAY] = true };
    uint64_t count[4] = { level->white_count, level->black_count, 0, 0 };
    ebpo_status status = EBPO_OK;
    for (int type = 0; type < 4 && status == EBPO_OK; type++)
        if (wanted[type])
            status =
                count_before(&out->before[type], level, (ebpo_node_type)type, &count[type], error);
    if (status != EBPO_OK)
        return status;
    if (number == 0 && wanted[EBPO_WHITE])
        count[EBPO_WHITE] -= 7; /* octants that the root's group does not have */
    if (count[EBPO_GRAY] != level->gray_count || count[EBPO_LEAF] != level->leaf_count ||
        count[EBPO_BLACK] != level->black_count || count[EBPO_WHITE] != level->white_count)
        return ebpo_fail(error, EBPO_E_FORMAT,
                         "level %d: its types and its node counts disagree; run ebpo verify",
                         number);
    return EBPO_OK;
}

static ebpo_status sums_disagree(int number, const char *what, ebpo_error *error)
{
    return ebpo_fail(error, EBPO_E_FORMAT,
                     "level %d: the counts of its %s do not add up; run ebpo verify", number, what);
}

/* The sums of the counts before each; `bytes`: of a count, 1 or 4. */
static ebpo_status sum_before(uint64_t **out, const void *counts, size_t bytes, uint64_t count,
                              uint64_t total, int number, const char *what, ebpo_error *error)
{
    const uint8_t *narrow = counts;
    const uint32_t *wide = counts;
    if (!(*out = ebpo_alloc(count, sizeof **out)))
        return ebpo_fail_memory(error, count * sizeof **out);
    uint64_t sum = 0;
    for (uint64_t i = 0; i < count; i++) {
        (*out)[i] = sum;
        sum += bytes == 1 ? narrow[i] : wide[i];
    }
    return sum == total ? EBPO_OK : sums_disagree(number, what, error);
}

ebpo_status ebpo_level_ranks_make(ebpo_level_ranks *out, const ebpo_level *level, int number,
                                  ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    ebpo_status status = make_ranks(out, level, number, error);
    if (status == EBPO_OK && level->plane_counts)
        status = sum_before(&out->plane_first, level->plane_counts, 1, level->gray_count,
                            level->plane_count, number, "planes", error);
    if (status == EBPO_OK && level->leaf_plane_counts)
        status = sum_before(&out->leaf_plane_first, level->leaf_plane_counts, 1, level->leaf_count,
                            level->leaf_plane_count, number, "leaf planes", error);
    if (status == EBPO_OK && level->leaf_ref_count)
        status = sum_before(&out->ref_first, level->leaf_ref_count, 4, level->leaf_count,
                            level->ref_count, number, "face lists", error);
    if (status != EBPO_OK)
        ebpo_level_ranks_free(out);
    return status;
}
