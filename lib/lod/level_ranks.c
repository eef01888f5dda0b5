#include "lod/level_ranks.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "octree/node_types.h"

void ebpo_lod_index_free(ebpo_lod_index *index)
{
    free(index->gray_before);
    free(index->leaf_before);
    free(index->plane_first);
    free(index->leaf_plane_first);
    free(index->ref_first);
    memset(index, 0, sizeof *index);
}

static ebpo_status make_ranks(ebpo_lod_index *out, const ebpo_level *level, int number,
                              ebpo_error *error)
{
    out->gray_before = ebpo_alloc(level->group_count, sizeof *out->gray_before);
    out->leaf_before = ebpo_alloc(level->group_count, sizeof *out->leaf_before);
    if (!out->gray_before || !out->leaf_before)
        return ebpo_fail_memory(error, level->group_count * sizeof *out->gray_before);
    uint64_t gray = 0, leaf = 0;
    for (uint64_t i = 0; i < level->group_count; i++) {
        out->gray_before[i] = gray;
        out->leaf_before[i] = leaf;
        gray += ebpo_group_count(level->types[i], EBPO_GRAY, 8);
        leaf += ebpo_group_count(level->types[i], EBPO_LEAF, 8);
    }
    if (gray != level->gray_count || leaf != level->leaf_count)
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

static ebpo_status sum8(uint64_t **out, const uint8_t *counts, uint64_t count, uint64_t total,
                        int number, const char *what, ebpo_error *error)
{
    if (!(*out = ebpo_alloc(count, sizeof **out)))
        return ebpo_fail_memory(error, count * sizeof **out);
    uint64_t sum = 0;
    for (uint64_t i = 0; i < count; i++) {
        (*out)[i] = sum;
        sum += counts[i];
    }
    return sum == total ? EBPO_OK : sums_disagree(number, what, error);
}

static ebpo_status sum32(uint64_t **out, const uint32_t *counts, uint64_t count, uint64_t total,
                         int number, const char *what, ebpo_error *error)
{
    if (!(*out = ebpo_alloc(count, sizeof **out)))
        return ebpo_fail_memory(error, count * sizeof **out);
    uint64_t sum = 0;
    for (uint64_t i = 0; i < count; i++) {
        (*out)[i] = sum;
        sum += counts[i];
    }
    return sum == total ? EBPO_OK : sums_disagree(number, what, error);
}

ebpo_status ebpo_lod_index_make(ebpo_lod_index *out, const ebpo_level *level, int number,
                                ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    ebpo_status status = make_ranks(out, level, number, error);
    if (status == EBPO_OK && level->plane_counts)
        status = sum8(&out->plane_first, level->plane_counts, level->gray_count, level->plane_count,
                      number, "planes", error);
    if (status == EBPO_OK && level->leaf_plane_counts)
        status = sum8(&out->leaf_plane_first, level->leaf_plane_counts, level->leaf_count,
                      level->leaf_plane_count, number, "leaf planes", error);
    if (status == EBPO_OK && level->leaf_ref_count)
        status = sum32(&out->ref_first, level->leaf_ref_count, level->leaf_count, level->ref_count,
                       number, "face lists", error);
    if (status != EBPO_OK)
        ebpo_lod_index_free(out);
    return status;
}
