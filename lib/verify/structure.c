#include "core/strict_fp.h"

#include "verify/structure.h"

#include <inttypes.h>
#include <math.h>

#include "core/workspace.h"
#include "format/schema.h"
#include "mesh/mesh_parts.h"

#define CHECK(condition, ...) ebpo_tally_check(tally, EBPO_VERIFY_STRUCTURE, condition, __VA_ARGS__)

static bool head_shape(ebpo_tally *tally, const ebpo_info *info)
{
    if (!CHECK(info->level_count >= 1 && info->level_count <= EBPO_LEVELS_MAX,
               "the file has %d levels; 1 to %d are possible", info->level_count, EBPO_LEVELS_MAX))
        return false;
    ebpo_box box = { .grid_level = info->grid_level };
    for (int k = 0; k < 3; k++) {
        box.origin[k] = info->box_origin[k];
        box.size[k] = info->box_size[k];
    }
    return CHECK(ebpo_box_valid(&box), "the root box is not on a dyadic grid down to level %d",
                 info->grid_level) &&
           CHECK(info->level_count - 1 <= info->grid_level,
                 "level %d lies below the grid level %d, where cells are not exact",
                 info->level_count - 1, info->grid_level) &&
           CHECK((unsigned)info->rule <= EBPO_RULE_POSITIVE, "unknown rule %d", (int)info->rule);
}

static bool types_shape(ebpo_tally *tally, const ebpo_tree *tree, int l)
{
    const ebpo_level *level = &tree->level[l];
    uint64_t groups = l == 0 ? 1 : tree->level[l - 1].gray_count;
    if (!CHECK(level->group_count == groups,
               "level %d has %" PRIu64 " groups of siblings for %" PRIu64 " gray nodes above", l,
               level->group_count, groups) ||
        !CHECK(level->types || groups == 0, "level %d has no types", l))
        return false;
    uint64_t count[4] = { 0 };
    EBPO_FOR_ITEMS(level->workspace, group, 0, groups)
        for (unsigned octant = 0; octant < (l == 0 ? 1u : 8u); octant++)
            count[ebpo_twin_type(level, group, octant)]++;
    return CHECK(count[EBPO_GRAY] == level->gray_count && count[EBPO_LEAF] == level->leaf_count &&
                     count[EBPO_WHITE] == level->white_count &&
                     count[EBPO_BLACK] == level->black_count,
                 "level %d: the types do not add up to its counts of nodes", l) &&
           CHECK(l + 1 < tree->info.level_count || level->gray_count == 0 || tree->info.pruned,
                 "level %d, the last one, has gray nodes", l);
}

/* Per-node counts and the array they share out. */
static bool counted_shape(ebpo_tally *tally, const ebpo_level *level, int l, const char *what,
                          uint64_t nodes, const uint8_t *counts, uint64_t total,
                          const uint32_t *items)
{
    if (!CHECK((counts || nodes == 0) && (items || total == 0), "level %d: %s are missing", l,
               what))
        return false;
    uint64_t sum = 0;
    EBPO_FOR_ITEMS(level->workspace, i, 0, nodes)
        sum += counts[i];
    return CHECK(sum == total, "level %d: counts of %s sum to %" PRIu64 ", but there are %" PRIu64,
                 l, what, sum, total);
}

static bool windings_shape(ebpo_tally *tally, const ebpo_tree *tree, int l)
{
    const ebpo_level *level = &tree->level[l];
    if (tree->info.solid)
        return CHECK(level->leaf_winding || level->leaf_count == 0,
                     "level %d: winding numbers of leaves are missing", l);
    return CHECK(!level->leaf_winding && !level->black_winding && !level->white_winding,
                 "level %d: a surface has no winding numbers", l);
}

static bool leaf_faces_in_range(const ebpo_level *level, uint64_t leaf, uint64_t first_ref,
                                uint64_t face_count)
{
    uint64_t first = level->leaf_first[leaf];
    if (first > face_count || level->leaf_new[leaf] > face_count - first)
        return false;
    const uint32_t *refs = level->leaf_refs ? level->leaf_refs + first_ref : NULL;
    EBPO_FOR_ITEMS(level->workspace, i, 0, level->leaf_ref_count[leaf])
        if (refs[i] >= first || (i > 0 && refs[i] <= refs[i - 1]))
            return false;
    return true;
}

static bool lists_shape(ebpo_tally *tally, const ebpo_tree *tree, int l)
{
    const ebpo_level *level = &tree->level[l];
    if (!CHECK((level->leaf_first && level->leaf_new && level->leaf_ref_count) ||
                   level->leaf_count == 0,
               "level %d: face lists of leaves are missing", l) ||
        !CHECK(level->leaf_refs || level->ref_count == 0, "level %d: back-references are missing",
               l))
        return false;
    uint64_t refs = 0, fresh = 0;
    EBPO_FOR_ITEMS(level->workspace, leaf, 0, level->leaf_count) {
        refs += level->leaf_ref_count[leaf];
        fresh += level->leaf_new[leaf];
    }
    if (!CHECK(refs == level->ref_count && fresh == level->new_count,
               "level %d: lists hold %" PRIu64 " new faces and %" PRIu64
               " references, counts say %" PRIu64 " and %" PRIu64,
               l, fresh, refs, level->new_count, level->ref_count))
        return false;
    refs = 0;
    bool ok = true;
    EBPO_FOR_ITEMS(level->workspace, leaf, 0, level->leaf_count) {
        ok &= CHECK(
            leaf_faces_in_range(level, leaf, refs, tree->mesh.face_count),
            "level %d, leaf %" PRIu64
            ": its list leaves the faces, or its references do not ascend below its first new face",
            l, leaf);
        refs += level->leaf_ref_count[leaf];
    }
    return ok;
}

static bool mesh_shape(ebpo_tally *tally, const ebpo_tree *tree)
{
    const ebpo_mesh *mesh = &tree->mesh;
    if (!CHECK(mesh->vertex_count == tree->info.vertex_count &&
                   mesh->face_count == tree->info.face_count,
               "the mesh has %" PRIu64 " vertices and %" PRIu64 " faces, the head says %" PRIu64
               " and %" PRIu64,
               mesh->vertex_count, mesh->face_count, tree->info.vertex_count,
               tree->info.face_count) ||
        !CHECK(!!mesh->xyz32 != !!mesh->xyz64 && mesh->faces && mesh->vertex_count < UINT32_MAX &&
                   mesh->face_count < UINT32_MAX,
               "the mesh has no vertices or no faces") ||
        !CHECK(!!mesh->xyz64 == tree->info.double_coordinates,
               "the head and the mesh differ about the kind of coordinates"))
        return false;
    uint64_t outside = 0, infinite = 0;
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, 3 * mesh->face_count)
        outside += mesh->faces[i] >= mesh->vertex_count;
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, mesh->vertex_count) {
        double p[3];
        ebpo_mesh_position(mesh, i, p);
        infinite += !isfinite(p[0]) || !isfinite(p[1]) || !isfinite(p[2]);
    }
    bool corners_fine =
        CHECK(outside == 0, "%" PRIu64 " corners of faces name vertices that do not exist",
              outside);
    return CHECK(infinite == 0, "%" PRIu64 " vertices are not finite", infinite) && corners_fine;
}

static bool colours_shape(ebpo_tally *tally, const ebpo_level *level, int l)
{
    uint32_t all = 0;
    EBPO_FOR_ITEMS(level->workspace, i, 0, level->gray_colours ? level->gray_count : 0)
        all |= level->gray_colours[i];
    return CHECK(all < 1 << 24, "level %d: a colour is above 2^24 - 1", l);
}

/* What the checks above do not look for by name. Counted only when it fails. */
static bool arrays_shape(ebpo_tally *tally, const ebpo_tree *tree, int l)
{
    const ebpo_level *level = &tree->level[l];
    uint32_t has = ebpo_schema_has(&tree->info);
    for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++) {
        const ebpo_array_spec *spec = &ebpo_schema[id];
        if (!ebpo_schema_is_held(id) || spec->if_needed || !(spec->needs & has) ||
            ebpo_level_array(level, id) || !ebpo_level_rows(level, id))
            continue;
        return CHECK(false, "level %d: %s is missing", l, spec->name);
    }
    return true;
}

bool ebpo_check_shape(ebpo_tally *tally, const ebpo_tree *tree)
{
    uint32_t parts = tree->info.parts;
    if (!head_shape(tally, &tree->info) || ((parts & EBPO_PART_MESH) && !mesh_shape(tally, tree)))
        return false;
    for (int l = 0; l < tree->info.level_count; l++) {
        const ebpo_level *level = &tree->level[l];
        if (!types_shape(tally, tree, l) || !windings_shape(tally, tree, l) ||
            ((parts & EBPO_PART_MESH) && !lists_shape(tally, tree, l)) ||
            ((parts & EBPO_PART_PLANES) &&
             !counted_shape(tally, level, l, "planes", level->gray_count, level->plane_counts,
                            level->plane_count, level->planes)) ||
            ((parts & EBPO_PART_LEAF_PLANES) &&
             !counted_shape(tally, level, l, "leaf planes", level->leaf_count,
                            level->leaf_plane_counts, level->leaf_plane_count,
                            level->leaf_planes)) ||
            !arrays_shape(tally, tree, l) ||
            ((parts & EBPO_PART_COLOURS) && !colours_shape(tally, level, l)))
            return false;
    }
    return true;
}
