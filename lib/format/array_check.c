#include "format/array_check.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/workspace.h"
#include "format/schema.h"
#include "geometry/plane_code.h"
#include "geometry/node_types.h"
#include "geometry/rule.h"

static const char *next_step(const ebpo_check *check)
{
    return check->as == EBPO_E_FORMAT ? "get a fresh copy of the file" : "the tree was not written";
}

ebpo_status ebpo_check_fail(const ebpo_check *check, int level, const char *array, const char *what,
                            ebpo_error *error)
{
    char path[64];
    if (level >= 0)
        snprintf(path, sizeof path, "/levels/%02d/%s", level, array);
    else
        snprintf(path, sizeof path, "%s", array);
    return ebpo_fail_at(error, check->as, check->shown, path, -1, "%s; %s", what, next_step(check));
}

static ebpo_status check_types(const ebpo_check *check, const ebpo_info *info, int level,
                               const ebpo_level *arrays, ebpo_error *error)
{
    uint64_t counts[4] = { 0, 0, 0, 0 };
    uint64_t groups = ebpo_schema_groups(info, level);
    if (arrays->group_count != groups || !arrays->types)
        return ebpo_check_fail(check, level, "types",
                               "there is not one group for each gray node of the level above",
                               error);
    if (level == 0 && arrays->types[0] > 3)
        return ebpo_check_fail(check, level, "types", "the root has siblings", error);
    uint64_t empty = 0;
    EBPO_FOR_ITEMS(check->workspace, i, 0, groups) {
        for (unsigned octant = 0; octant < ebpo_group_octants(level); octant++)
            counts[ebpo_group_type(arrays->types[i], octant)]++;
    }
    for (uint64_t i = 0; i < groups; i++)
        empty += arrays->types[i] == 0;
    if (level && empty != info->level[level - 1].pruned_count)
        return ebpo_check_fail(
            check, level, "types",
            info->pruned ? "there is not one empty group for each pruned node of the level above"
                         : "a group is 0: all children of a gray node are white",
            error);
    const ebpo_level_summary *s = &info->level[level];
    if (counts[EBPO_WHITE] != s->white_count || counts[EBPO_BLACK] != s->black_count ||
        counts[EBPO_LEAF] != s->leaf_count || counts[EBPO_GRAY] != s->gray_count)
        return ebpo_check_fail(check, level, "types",
                               "the types do not add up to the counts in the head", error);
    return EBPO_OK;
}

/* Whether the arrays are there that must be, and none that cannot be. */
static ebpo_status check_presence(const ebpo_check *check, const ebpo_info *info, int level,
                                  const ebpo_level *arrays, ebpo_error *error)
{
    for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++) {
        const ebpo_array_spec *spec = &ebpo_schema[id];
        bool called_for = ebpo_schema_rows(info, (ebpo_array_id)id, level) != 0;
        if (!ebpo_schema_is_held(id))
            continue;
        if (called_for && !spec->if_needed && !ebpo_level_array(arrays, id))
            return ebpo_check_fail(check, level, spec->name, "the array is missing", error);
        if (!info->solid && spec->needs == EBPO_NEEDS_SOLID && ebpo_level_array(arrays, id))
            return ebpo_check_fail(check, level, spec->name, "a surface has no winding numbers",
                                   error);
    }
    return EBPO_OK;
}

static ebpo_status check_planes(const ebpo_check *check, int level, const char *counts_name,
                                const uint8_t *counts, uint64_t nodes, const char *planes_name,
                                const uint32_t *planes, uint64_t plane_count, ebpo_error *error)
{
    uint64_t sum = 0;
    for (uint64_t i = 0; i < nodes; i++)
        sum += counts[i];
    if (sum != plane_count)
        return ebpo_check_fail(check, level, counts_name,
                               "the counts do not add up to the number of planes", error);
    EBPO_FOR_ITEMS(check->workspace, i, 0, plane_count) {
        int32_t n[3], d;
        if (!ebpo_plane_code_decode(planes[i], n, &d))
            return ebpo_check_fail(check, level, planes_name, "a code stands for no plane", error);
    }
    return EBPO_OK;
}

static ebpo_status check_colours(const ebpo_check *check, int level, const ebpo_level *arrays,
                                 ebpo_error *error)
{
    EBPO_FOR_ITEMS(check->workspace, i, 0, arrays->gray_count)
        if (arrays->gray_colours[i] >> 24)
            return ebpo_check_fail(check, level, "gray_colours", "a colour is above 2^24 - 1",
                                   error);
    return EBPO_OK;
}

static ebpo_status check_windings(const ebpo_check *check, const ebpo_info *info, int level,
                                  const ebpo_level *arrays, ebpo_error *error)
{
    if (arrays->black_winding)
        EBPO_FOR_ITEMS(check->workspace, i, 0, arrays->black_count)
            if (!ebpo_rule_inside(info->rule, arrays->black_winding[i]))
                return ebpo_check_fail(check, level, "black_winding",
                                       "a black node lies outside by the winding rule", error);
    if (arrays->white_winding)
        EBPO_FOR_ITEMS(check->workspace, i, 0, arrays->white_count)
            if (ebpo_rule_inside(info->rule, arrays->white_winding[i]))
                return ebpo_check_fail(check, level, "white_winding",
                                       "a white node lies inside by the winding rule", error);
    return EBPO_OK;
}

static ebpo_status check_refs(const ebpo_check *check, int level, const uint32_t *refs,
                              uint64_t count, uint64_t first, ebpo_error *error)
{
    for (uint64_t k = 0; k < count; k++)
        if (refs[k] >= first || (k && refs[k] <= refs[k - 1]))
            return ebpo_check_fail(
                check, level, "leaf_refs",
                "a leaf refers to faces out of order, or to one that does not come before its own",
                error);
    return EBPO_OK;
}

static ebpo_status check_leaves(const ebpo_check *check, const ebpo_info *info, int level,
                                const ebpo_level *arrays, ebpo_error *error)
{
    const ebpo_level_summary *s = &info->level[level];
    uint64_t end = 0, news = 0, refs = 0;
    EBPO_FOR_ITEMS(check->workspace, i, 0, arrays->leaf_count) {
        uint64_t first = arrays->leaf_first[i];
        if (first < end || first > info->face_count ||
            arrays->leaf_new[i] > info->face_count - first)
            return ebpo_check_fail(
                check, level, "leaf_skip",
                "a leaf's new faces overlap another's or lie beyond the last face", error);
        end = first + arrays->leaf_new[i];
        news += arrays->leaf_new[i];
        if (arrays->leaf_ref_count[i] > s->ref_count - refs)
            return ebpo_check_fail(check, level, "leaf_ref_count",
                                   "the counts exceed the number of references", error);
        ebpo_status status =
            check_refs(check, level, arrays->leaf_refs ? arrays->leaf_refs + refs : NULL,
                       arrays->leaf_ref_count[i], first, error);
        if (status != EBPO_OK)
            return status;
        refs += arrays->leaf_ref_count[i];
    }
    if (news != s->new_count || refs != s->ref_count)
        return ebpo_check_fail(check, level, "leaf_new",
                               "the leaves' counts do not add up to those in the head", error);
    return EBPO_OK;
}

ebpo_status ebpo_check_level(const ebpo_check *check, const ebpo_info *info, int level,
                             const ebpo_level *arrays, ebpo_error *error)
{
    ebpo_status status = check_types(check, info, level, arrays, error);
    if (status == EBPO_OK)
        status = check_presence(check, info, level, arrays, error);
    if (status == EBPO_OK && info->parts & EBPO_PART_PLANES)
        status =
            check_planes(check, level, "plane_counts", arrays->plane_counts, arrays->gray_count,
                         "planes", arrays->planes, arrays->plane_count, error);
    if (status == EBPO_OK && info->parts & EBPO_PART_LEAF_PLANES)
        status = check_planes(check, level, "leaf_plane_counts", arrays->leaf_plane_counts,
                              arrays->leaf_count, "leaf_planes", arrays->leaf_planes,
                              arrays->leaf_plane_count, error);
    if (status == EBPO_OK && info->parts & EBPO_PART_COLOURS)
        status = check_colours(check, level, arrays, error);
    if (status == EBPO_OK)
        status = check_windings(check, info, level, arrays, error);
    if (status == EBPO_OK && info->parts & EBPO_PART_MESH)
        status = check_leaves(check, info, level, arrays, error);
    return status;
}

typedef struct walk {
    const ebpo_check *check;
    const ebpo_tree *tree;
    /* next of each level: depth-first order passes them in octcode order */
    uint64_t group[EBPO_LEVELS_MAX], leaf[EBPO_LEVELS_MAX];
    uint64_t seen;
} walk;

static ebpo_status walk_group(walk *w, int level, ebpo_error *error)
{
    const ebpo_level *arrays = &w->tree->level[level];
    uint16_t types = arrays->types[w->group[level]++];
    for (unsigned octant = 0; octant < ebpo_group_octants(level); octant++) {
        ebpo_node_type type = ebpo_group_type(types, octant);
        if (type == EBPO_GRAY && level + 1 < w->tree->info.level_count) {
            ebpo_status status = walk_group(w, level + 1, error);
            if (status != EBPO_OK)
                return status;
        } else if (type == EBPO_LEAF) {
            uint64_t i = w->leaf[level]++;
            if (arrays->leaf_first[i] != w->seen)
                return ebpo_check_fail(w->check, level, "leaf_skip",
                                       "the leaves' new faces are not in depth-first order", error);
            w->seen += arrays->leaf_new[i];
        }
    }
    return EBPO_OK;
}

ebpo_status ebpo_check_order(const ebpo_check *check, const ebpo_tree *tree, ebpo_error *error)
{
    walk w = { .check = check, .tree = tree };
    ebpo_status status = walk_group(&w, 0, error);
    if (status == EBPO_OK && w.seen != tree->info.face_count)
        return ebpo_check_fail(check, 0, "leaf_new",
                               "the leaves do not have every face as a new one once", error);
    return status;
}

ebpo_status ebpo_check_map(const ebpo_check *check, const char *array, const uint32_t *map,
                           uint64_t count, uint64_t limit, ebpo_error *error)
{
    limit = limit <= UINT32_MAX ? limit : UINT64_C(1) << 32; /* all that 32 bits can name */
    uint64_t *seen = ebpo_alloc_zero(limit / 64 + 1, sizeof *seen);
    if (!seen)
        return ebpo_fail_memory(error, limit / 8);
    ebpo_status status = EBPO_OK;
    EBPO_FOR_ITEMS(check->workspace, i, 0, count) {
        uint64_t bit = UINT64_C(1) << map[i] % 64;
        if (map[i] >= limit || seen[map[i] / 64] & bit) {
            status = ebpo_check_fail(check, -1, array,
                                     "a source number is out of range or used twice", error);
            break;
        }
        seen[map[i] / 64] |= bit;
    }
    free(seen);
    return status;
}

ebpo_status ebpo_check_finite(const ebpo_check *check, const ebpo_mesh *mesh, ebpo_error *error)
{
    bool finite = true;
    EBPO_FOR_ITEMS(check->workspace, i, 0, mesh->vertex_count * 3)
        finite &= mesh->xyz32 ? isfinite(mesh->xyz32[i]) : isfinite(mesh->xyz64[i]);
    return finite ? EBPO_OK
                  : ebpo_check_fail(check, -1, "/mesh/vertices",
                                    "a coordinate is not a finite number", error);
}
