/* Finds the nodes of a tree in memory, and runs the checks for which no single face is needed:
 * nesting and structure.
 *
 * - Nodes are found by rank (number among the nodes of the level and type). For each group of
 *   siblings, the numbers of items before the group are stored. These numbers give the positions of
 *   a node's children, planes, lists and winding number.
 * - Structure: the arrays are consistent (ebpo_check_shape, which runs before all other checks),
 *   and the tree obeys the format: summaries, leaf sizes, the order of faces, the root box,
 *   balanced edges of a solid.
 * - Nesting: the planes of a node and of all its ancestors bound the node's envelope. So the
 *   envelope is within the parent's envelope if a plane is the same half-space in the coordinates
 *   of every cell. This condition is checked in integers, for points of sampled cells. Each point
 *   is compared with each plane twice: first the point is transformed to the cell of the plane,
 *   then the plane is transformed to the cell of the point. Both comparisons must agree. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>

#include "core/error.h"
#include "core/hash.h"
#include "core/wide.h"
#include "core/workspace.h"
#include "format/schema.h"
#include "geometry/polytope.h"
#include "mesh/mesh_parts.h"
#include "verify/verify_tree.h"

/* --- finding nodes --- */

/* Adds the numbers of nodes, planes and references in a group to *sum. */
static void add_group(ebpo_reference_group *sum, const ebpo_reference_tree *view,
                      const ebpo_level *level, uint64_t group, unsigned octants)
{
    for (unsigned octant = 0; octant < octants; octant++) {
        ebpo_node_type type = ebpo_reference_type(level, group, octant);
        uint64_t rank = sum->of_type[type]++;
        if (type == EBPO_GRAY && view->has_planes)
            sum->planes += level->plane_counts[rank];
        if (type == EBPO_LEAF && view->has_mesh)
            sum->refs += level->leaf_ref_count[rank];
        if (type == EBPO_LEAF && view->has_leaf_planes)
            sum->leaf_planes += level->leaf_plane_counts[rank];
    }
}

static unsigned octants_at(int level) { return level == 0 ? 1 : 8; }

ebpo_status ebpo_reference_make(ebpo_reference_tree *out, const ebpo_tree *tree,
                                ebpo_workspace *workspace, ebpo_error *error)
{
    *out = (ebpo_reference_tree){ .tree = tree,
                                  .workspace = workspace,
                                  .box.grid_level = tree->info.grid_level };
    for (int k = 0; k < 3; k++) {
        out->box.origin[k] = tree->info.box_origin[k];
        out->box.size[k] = tree->info.box_size[k];
    }
    out->has_mesh = tree->info.parts & EBPO_PART_MESH;
    out->has_planes = tree->info.parts & EBPO_PART_PLANES;
    out->has_leaf_planes = tree->info.parts & EBPO_PART_LEAF_PLANES;
    for (int l = 0; l < tree->info.level_count; l++) {
        const ebpo_level *level = &tree->level[l];
        out->groups[l] = ebpo_array_alloc(workspace, level->group_count, sizeof *out->groups[l]);
        if (!out->groups[l]) {
            ebpo_reference_free(out);
            return ebpo_workspace_fail(workspace, level->group_count * sizeof *out->groups[l],
                                       error);
        }
        ebpo_reference_group sum = { 0 };
        EBPO_FOR_ITEMS(workspace, group, 0, level->group_count) {
            out->groups[l][group] = sum;
            add_group(&sum, out, level, group, octants_at(l));
        }
    }
    return EBPO_OK;
}

void ebpo_reference_free(ebpo_reference_tree *view)
{
    for (int l = 0; l < EBPO_LEVELS_MAX; l++)
        ebpo_array_free(view->workspace, view->groups[l]);
    *view = (ebpo_reference_tree){ 0 };
}

/* Returns the node at a position, with its type and rank. `group`: index of its group in the level
 * of `cell`. */
static ebpo_reference_node node_in_group(const ebpo_reference_tree *view, ebpo_octcode code,
                                         ebpo_cell cell, uint64_t group, unsigned octant)
{
    const ebpo_level *level = &view->tree->level[cell.level];
    ebpo_reference_node node = {
        code, cell, group, octant, ebpo_reference_type(level, group, octant), 0
    };
    node.rank = view->groups[cell.level][group].of_type[node.type];
    for (unsigned i = 0; i < octant; i++)
        node.rank += ebpo_reference_type(level, group, i) == node.type;
    return node;
}

ebpo_reference_node ebpo_reference_root(const ebpo_reference_tree *view)
{
    return node_in_group(view, 1, (ebpo_cell){ 0, { 0, 0, 0 } }, 0, 0);
}

bool ebpo_reference_is_pruned(const ebpo_reference_tree *view, const ebpo_reference_node *node)
{
    const ebpo_tree *tree = view->tree;
    if (!tree->info.pruned || node->type != EBPO_GRAY)
        return false;
    return node->cell.level + 1 >= tree->info.level_count ||
           tree->level[node->cell.level + 1].types[node->rank] == 0;
}

ebpo_reference_node ebpo_reference_child(const ebpo_reference_tree *view,
                                         const ebpo_reference_node *node, unsigned octant)
{
    ebpo_cell cell = { node->cell.level + 1, { 0 } };
    for (int k = 0; k < 3; k++)
        cell.at[k] = 2 * node->cell.at[k] + (octant >> k & 1);
    return node_in_group(view, ebpo_octcode_child(node->code, octant), cell, node->rank, octant);
}

/* Returns the index of the group of `level` that contains the gray node of this rank. */
static uint64_t group_of_gray(const ebpo_reference_tree *view, int level, uint64_t rank)
{
    uint64_t low = 0, high = view->tree->level[level].group_count;
    while (high - low > 1) {
        uint64_t middle = low + (high - low) / 2;
        if (view->groups[level][middle].of_type[EBPO_GRAY] <= rank)
            low = middle;
        else
            high = middle;
    }
    return low;
}

/* Returns the node with this octant in this group of a level. To determine its cell, finds its
 * ancestors. */
static ebpo_reference_node reference_at(const ebpo_reference_tree *view, int level, uint64_t group,
                                        unsigned octant)
{
    unsigned path[EBPO_LEVELS_MAX];
    path[level] = octant;
    for (int l = level - 1; l >= 0; l--) {
        uint64_t rank = group;
        group = group_of_gray(view, l, rank);
        uint64_t before = view->groups[l][group].of_type[EBPO_GRAY];
        unsigned i = 0;
        while (i < 7 && !(ebpo_reference_type(&view->tree->level[l], group, i) == EBPO_GRAY &&
                          before++ == rank))
            i++;
        path[l] = i;
    }
    ebpo_reference_node node = ebpo_reference_root(view);
    for (int l = 1; l <= level; l++)
        node = ebpo_reference_child(view, &node, path[l]);
    return node;
}

const uint32_t *ebpo_reference_planes(const ebpo_reference_tree *view,
                                      const ebpo_reference_node *node, uint32_t *count)
{
    const ebpo_level *level = &view->tree->level[node->cell.level];
    const ebpo_reference_group *group = &view->groups[node->cell.level][node->group];
    bool gray = node->type == EBPO_GRAY;
    *count = 0;
    if (gray ? !view->has_planes : node->type != EBPO_LEAF || !view->has_leaf_planes)
        return NULL;
    const uint8_t *counts = gray ? level->plane_counts : level->leaf_plane_counts;
    uint64_t first = gray ? group->planes : group->leaf_planes;
    for (uint64_t rank = group->of_type[node->type]; rank < node->rank; rank++)
        first += counts[rank];
    *count = counts[node->rank];
    return *count ? (gray ? level->planes : level->leaf_planes) + first : NULL;
}

const uint32_t *ebpo_reference_refs(const ebpo_reference_tree *view,
                                    const ebpo_reference_node *leaf, uint32_t *count)
{
    const ebpo_level *level = &view->tree->level[leaf->cell.level];
    const ebpo_reference_group *group = &view->groups[leaf->cell.level][leaf->group];
    uint64_t first = group->refs;
    for (uint64_t rank = group->of_type[EBPO_LEAF]; rank < leaf->rank; rank++)
        first += level->leaf_ref_count[rank];
    *count = level->leaf_ref_count[leaf->rank];
    return *count ? level->leaf_refs + first : NULL;
}

int64_t ebpo_reference_winding(const ebpo_reference_tree *view, const ebpo_reference_node *node)
{
    const ebpo_level *level = &view->tree->level[node->cell.level];
    switch (node->type) {
    case EBPO_WHITE: return level->white_winding ? level->white_winding[node->rank] : 0;
    case EBPO_BLACK: return level->black_winding ? level->black_winding[node->rank] : 1;
    case EBPO_LEAF: return level->leaf_winding ? level->leaf_winding[node->rank] : 0;
    default: return 0;
    }
}

/* --- nesting --- */

enum {
    NODES_PER_LEVEL = 256, /* number of sampled cells of a level */
    /* number of tested corners, and of tested random points, of a sampled cell */
    POINTS_PER_NODE = 8,
    /* the unit of coordinates of points is the cell's side divided by 2^POINT_BITS */
    POINT_BITS = 16
};

/* Checks that the plane codes of all nodes of one type in a level are valid. */
static void check_codes(ebpo_tally *tally, const ebpo_reference_tree *view, int l,
                        ebpo_node_type type, const uint8_t *counts)
{
    const ebpo_level *level = &view->tree->level[l];
    EBPO_FOR_ITEMS(level->workspace, group, 0, level->group_count)
        for (unsigned octant = 0; octant < (l == 0 ? 1u : 8u); octant++) {
            if (ebpo_reference_type(level, group, octant) != type)
                continue;
            uint64_t rank = view->groups[l][group].of_type[type];
            for (unsigned i = 0; i < octant; i++)
                rank += ebpo_reference_type(level, group, i) == type;
            ebpo_reference_node node = {
                .group = group, .octant = octant, .type = type, .rank = rank, .cell.level = l
            };
            uint32_t count;
            const uint32_t *codes =
                counts[rank] ? ebpo_reference_planes(view, &node, &count) : NULL;
            for (uint32_t i = 0; i < counts[rank]; i++) {
                int32_t n[3], d;
                tally->checks[EBPO_VERIFY_NESTING]++;
                if (!ebpo_plane_decode(codes[i], n, &d))
                    ebpo_tally_violation(tally, EBPO_VERIFY_NESTING,
                                         &(ebpo_verify_place){
                                             reference_at(view, l, group, octant).code,
                                             EBPO_NO_FACE, i },
                                         "invalid plane code %08x", (unsigned)codes[i]);
            }
        }
}

/* A node and its ancestors, from the root down. */
typedef struct chain {
    int depth;
    ebpo_reference_node node[EBPO_LEVELS_MAX];
} chain;

static void chain_to(chain *out, const ebpo_reference_tree *view, const ebpo_reference_node *end)
{
    out->depth = end->cell.level;
    out->node[0] = ebpo_reference_root(view);
    for (int l = 1; l <= out->depth; l++)
        out->node[l] = ebpo_reference_child(view, &out->node[l - 1],
                                            (unsigned)(end->code >> 3 * (out->depth - l) & 7));
}

/* Returns true if a point is on the inner side of a plane of the cell `above`. The point is given
 * in the coordinates of the cell `at`, in units of 2^-16 of its side. The function transforms the
 * point to the coordinates of `above`. */
static bool point_kept_above(const ebpo_cell *above, const ebpo_cell *at, const int64_t point[3],
                             const int32_t n[3], int64_t d)
{
    int down = at->level - above->level;
    ebpo_wide sum = { 0, 0 };
    for (int k = 0; k < 3; k++) {
        int64_t offset = (int64_t)at->at[k] - ((int64_t)above->at[k] << down);
        sum = ebpo_wide_plus(sum,
                             ebpo_wide_signed_product(n[k], point[k] + offset * (1 << POINT_BITS)));
    }
    return ebpo_wide_signed_at_most(ebpo_wide_left(sum, 12),
                                    ebpo_wide_signed_product(d, INT64_C(1) << (POINT_BITS + down)));
}

/* Returns true if a point is on the inner side of a plane, as point_kept_above does, but transforms
 * the plane. The plane belongs to the node of level `from` of the chain. The plane is transformed
 * level by level, as readers do, to the coordinates of the point's cell, which is the cell of the
 * node of level `to`. */
static bool point_kept_below(const chain *c, int from, int to, const int64_t point[3],
                             const int32_t n[3], int64_t d)
{
    for (int l = from + 1; l <= to; l++)
        d = ebpo_plane_to_child(n, d, c->node[l].octant);
    ebpo_wide sum = { 0, 0 };
    for (int k = 0; k < 3; k++)
        sum = ebpo_wide_plus(sum, ebpo_wide_signed_product(n[k], point[k]));
    return ebpo_wide_signed_at_most(ebpo_wide_left(sum, 12),
                                    ebpo_wide_signed_product(d, 1 << POINT_BITS));
}

/* Compares a point of the deepest cell of a chain with all planes of the cells above, in both ways.
 */
static void check_point(ebpo_tally *tally, const ebpo_reference_tree *view, const chain *c,
                        const int64_t point[3])
{
    const ebpo_cell *at = &c->node[c->depth].cell;
    for (int l = 0; l < c->depth; l++) {
        uint32_t count;
        const uint32_t *codes = ebpo_reference_planes(view, &c->node[l], &count);
        for (uint32_t i = 0; i < count; i++) {
            int32_t n[3], d;
            if (!ebpo_plane_decode(codes[i], n, &d))
                continue;
            tally->checks[EBPO_VERIFY_NESTING]++;
            if (point_kept_above(&c->node[l].cell, at, point, n, d) !=
                point_kept_below(c, l, c->depth, point, n, d))
                ebpo_tally_violation(tally, EBPO_VERIFY_NESTING,
                                     &(ebpo_verify_place){ c->node[c->depth].code, EBPO_NO_FACE,
                                                           i },
                                     "a point of the cell is on different sides of a plane of "
                                     "level %d in the coordinates of the "
                                     "two cells",
                                     l);
        }
    }
}

/* Checks that the coordinate of each cell face is a double that is equal to the coordinate of a
 * cell face of the parent or of the parent's middle plane. Checks that the difference of opposite
 * cell faces is the size of the cell. */
static void check_cell_faces(ebpo_tally *tally, const ebpo_reference_tree *view,
                             const ebpo_reference_node *node)
{
    int level = node->cell.level;
    bool same = true;
    for (int k = 0; k < 3; k++) {
        uint32_t even = node->cell.at[k] & ~1u, at = node->cell.at[k];
        same &= ebpo_cell_face(&view->box, k, level, even) ==
                    ebpo_cell_face(&view->box, k, level - 1, even / 2) &&
                ebpo_cell_face(&view->box, k, level, even + 2) ==
                    ebpo_cell_face(&view->box, k, level - 1, even / 2 + 1) &&
                ebpo_cell_face(&view->box, k, level, at + 1) -
                        ebpo_cell_face(&view->box, k, level, at) ==
                    view->box.size[k] / (double)(1u << level);
    }
    tally->checks[EBPO_VERIFY_NESTING]++;
    if (!same)
        ebpo_tally_violation(tally, EBPO_VERIFY_NESTING,
                             &(ebpo_verify_place){ node->code, EBPO_NO_FACE, EBPO_NO_PLANE },
                             "the cell's faces are not on its parent's grid");
}

static uint64_t next_random(uint64_t *state)
{
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    return *state;
}

/* Checks the nesting of a node: compares random points and the corners of its cell with the planes
 * of its ancestors. */
static void check_nesting_at(ebpo_tally *tally, const ebpo_reference_tree *view,
                             const ebpo_reference_node *node)
{
    chain c;
    chain_to(&c, view, node);
    check_cell_faces(tally, view, node);
    uint64_t state = node->code * 0x9e3779b97f4a7c15 | 1;
    for (unsigned i = 0; i < POINTS_PER_NODE; i++) {
        int64_t corner[3], inner[3];
        for (int k = 0; k < 3; k++) {
            corner[k] = (int64_t)(i >> k & 1) << POINT_BITS;
            inner[k] = (int64_t)(next_random(&state) >> (64 - POINT_BITS));
        }
        check_point(tally, view, &c, corner);
        check_point(tally, view, &c, inner);
    }
}

void ebpo_check_nesting(ebpo_tally *tally, const ebpo_reference_tree *view)
{
    for (int l = 0; l < view->tree->info.level_count; l++) {
        const ebpo_level *level = &view->tree->level[l];
        if (view->has_planes)
            check_codes(tally, view, l, EBPO_GRAY, level->plane_counts);
        if (view->has_leaf_planes)
            check_codes(tally, view, l, EBPO_LEAF, level->leaf_plane_counts);
        uint64_t cells = 8 * level->group_count;
        for (uint64_t i = 0; l > 0 && i < NODES_PER_LEVEL && i < cells; i++) {
            uint64_t cell = cells <= NODES_PER_LEVEL
                                ? i
                                : cells / NODES_PER_LEVEL * i +
                                      cells % NODES_PER_LEVEL * i / NODES_PER_LEVEL + i % 8;
            ebpo_reference_node node =
                reference_at(view, l, (cell % cells) / 8, (unsigned)(cell % 8));
            check_nesting_at(tally, view, &node);
        }
    }
}

#define CHECK(condition, ...) ebpo_tally_check(tally, EBPO_VERIFY_STRUCTURE, condition, __VA_ARGS__)

/* --- structure: the arrays are consistent ---
 *
 * These functions return false after a violation, because other checks could then read beyond the
 * ends of arrays. */

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
                 "level %d is below the grid level %d, where cells are not exact",
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
            count[ebpo_reference_type(level, group, octant)]++;
    return CHECK(count[EBPO_GRAY] == level->gray_count && count[EBPO_LEAF] == level->leaf_count &&
                     count[EBPO_WHITE] == level->white_count &&
                     count[EBPO_BLACK] == level->black_count,
                 "level %d: the types do not add up to its counts of nodes", l) &&
           CHECK(l + 1 < tree->info.level_count || level->gray_count == 0 || tree->info.pruned,
                 "level %d, the last one, has gray nodes", l);
}

/* Checks that `counts`, one for each node, add up to the length of a list. */
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
    if (tree->info.solid || tree->info.parts & EBPO_PART_BORDER)
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
        !CHECK(level->leaf_refs || level->ref_count == 0,
               "level %d: references of leaves are missing", l))
        return false;
    uint64_t refs = 0, fresh = 0;
    EBPO_FOR_ITEMS(level->workspace, leaf, 0, level->leaf_count) {
        refs += level->leaf_ref_count[leaf];
        fresh += level->leaf_new[leaf];
    }
    if (!CHECK(refs == level->ref_count && fresh == level->new_count,
               "level %d: the lists have %" PRIu64 " new faces and %" PRIu64
               " references, but the counts state %" PRIu64 " and %" PRIu64,
               l, fresh, refs, level->new_count, level->ref_count))
        return false;
    refs = 0;
    bool ok = true;
    EBPO_FOR_ITEMS(level->workspace, leaf, 0, level->leaf_count) {
        ok &= CHECK(
            leaf_faces_in_range(level, leaf, refs, tree->mesh.face_count),
            "level %d, leaf %" PRIu64
            ": it lists faces that the mesh lacks, or its references are not ascending and below "
            "its first new face",
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
               "the mesh has %" PRIu64 " vertices and %" PRIu64 " faces, the header states %" PRIu64
               " and %" PRIu64,
               mesh->vertex_count, mesh->face_count, tree->info.vertex_count,
               tree->info.face_count) ||
        !CHECK(!!mesh->xyz32 != !!mesh->xyz64 && mesh->faces && mesh->vertex_count < UINT32_MAX &&
                   mesh->face_count < UINT32_MAX,
               "the mesh has no vertices or no faces") ||
        !CHECK(!!mesh->xyz64 == tree->info.double_coordinates,
               "the header and the mesh have different kinds of coordinates"))
        return false;
    uint64_t outside = 0, infinite = 0;
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, 3 * mesh->face_count)
        outside += mesh->faces[i] >= mesh->vertex_count;
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, mesh->vertex_count) {
        double p[3];
        ebpo_mesh_position(mesh, i, p);
        infinite += !isfinite(p[0]) || !isfinite(p[1]) || !isfinite(p[2]);
    }
    bool corners_ok =
        CHECK(outside == 0, "%" PRIu64 " corners of faces name vertices that do not exist",
              outside);
    return CHECK(infinite == 0, "%" PRIu64 " vertices are not finite", infinite) && corners_ok;
}

static bool colours_shape(ebpo_tally *tally, const ebpo_level *level, int l)
{
    uint32_t all = 0;
    EBPO_FOR_ITEMS(level->workspace, i, 0, level->gray_colours ? level->gray_count : 0)
        all |= level->gray_colours[i];
    return CHECK(all < 1 << 24, "level %d: a colour is above 2^24 - 1", l);
}

/* Checks that all required arrays of a level are present. Counts a check only if an array is
 * missing, because other functions check most of these arrays. */
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

/* --- structure: the tree --- */

/* Returns true if a volume is at most the volume of `cells` cells of level l, plus a tolerance for
 * the rounding of sums. Also returns true for sizes beyond about 1e102 or below 1e-102, because the
 * volumes of such cells exceed the range of double, and the format does not specify these volumes.
 */
static bool volume_possible(double volume, uint64_t cells, int l, const ebpo_info *info)
{
    double cell =
        ldexp(info->box_size[0], -l) * ldexp(info->box_size[1], -l) * ldexp(info->box_size[2], -l);
    if (!isnormal(cell))
        return true;
    return volume >= 0 && volume <= (double)cells * cell * (1 + 1e-6);
}

static void check_summary(ebpo_tally *tally, const ebpo_tree *tree, int l)
{
    const ebpo_level *level = &tree->level[l];
    const ebpo_level_summary *stored = &tree->info.level[l];
    CHECK(stored->gray_count == level->gray_count && stored->leaf_count == level->leaf_count &&
              stored->white_count == level->white_count &&
              stored->black_count == level->black_count,
          "level %d: the header's counts of nodes differ from the level's", l);
    CHECK(stored->plane_count == level->plane_count &&
              stored->leaf_plane_count == level->leaf_plane_count,
          "level %d: the header's counts of planes differ from the level's", l);
    CHECK(stored->new_count == level->new_count && stored->ref_count == level->ref_count,
          "level %d: the header's counts of faces differ from the level's", l);
    CHECK(stored->gray_volume == level->gray_volume && stored->leaf_volume == level->leaf_volume,
          "level %d: the header's volumes differ from the level's", l);
    CHECK(volume_possible(level->gray_volume, level->gray_count, l, &tree->info) &&
              volume_possible(level->leaf_volume, level->leaf_count, l, &tree->info),
          "level %d: envelopes of volume %g and %g do not fit their cells", l, level->gray_volume,
          level->leaf_volume);
}

/* State of visiting all nodes, depth first. */
typedef struct descent {
    ebpo_tally *tally;
    const ebpo_reference_tree *view;
    uint64_t next_face;               /* index of the first face that no visited leaf has listed */
    uint64_t grays;                   /* number of visited gray nodes */
    uint64_t pruned[EBPO_LEVELS_MAX]; /* number of pruned nodes (whose children are not in the
                                         file), by level */
} descent;

/* Counts a check of a node, and a violation if `holds` is false. */
static void record_check(descent *d, const ebpo_reference_node *node, bool holds, const char *text)
{
    d->tally->checks[EBPO_VERIFY_STRUCTURE]++;
    if (!holds)
        ebpo_tally_violation(d->tally, EBPO_VERIFY_STRUCTURE,
                             &(ebpo_verify_place){ node->code, EBPO_NO_FACE, EBPO_NO_PLANE }, "%s",
                             text);
}

static void check_leaf(descent *d, const ebpo_reference_node *leaf)
{
    const ebpo_info *info = &d->view->tree->info;
    const ebpo_level *level = &d->view->tree->level[leaf->cell.level];
    if (!d->view->has_mesh)
        return;
    uint64_t listed = (uint64_t)level->leaf_new[leaf->rank] + level->leaf_ref_count[leaf->rank];
    record_check(
        d, leaf, level->leaf_first[leaf->rank] == d->next_face,
        "the leaf's new faces do not follow the new faces of the previous leaf in depth-first "
        "order");
    record_check(d, leaf, listed > 0 || info->border_inside, "the leaf lists no face");
    record_check(d, leaf, leaf->cell.level >= info->max_level || listed <= info->leaf_faces,
                 "the leaf lists more faces than leaf_faces, and is above max_level");
    d->next_face = level->leaf_first[leaf->rank] + level->leaf_new[leaf->rank];
}

static void check_gray(descent *d, const ebpo_reference_node *node);

static void check_node(descent *d, const ebpo_reference_node *node)
{
    if (node->type == EBPO_LEAF)
        check_leaf(d, node);
    else if (node->type == EBPO_GRAY)
        check_gray(d, node);
    else if (node->type == EBPO_BLACK)
        record_check(d, node, d->view->tree->info.solid,
                     "a surface has no inside, but the node is black");
}

static void check_gray(descent *d, const ebpo_reference_node *node)
{
    /* a subset may also have a pruned node in place of a leaf */
    if (ebpo_reference_is_pruned(d->view, node)) {
        d->pruned[node->cell.level]++;
        return;
    }
    record_check(d, node, node->cell.level < d->view->tree->info.max_level,
                 "a node at the maximum level is gray");
    bool has_faces = false;
    if (d->grays++ % EBPO_ITEMS_IN_ORDER == 0)
        ebpo_release_pages(d->view->workspace);
    for (unsigned octant = 0; octant < 8; octant++) {
        ebpo_reference_node child = ebpo_reference_child(d->view, node, octant);
        has_faces |= child.type >= EBPO_LEAF;
        check_node(d, &child);
    }
    record_check(d, node, has_faces,
                 "the node is gray, but none of its children is gray or a leaf");
}

/* Checks that all corners of faces are within the root box. */
static void check_vertices(ebpo_tally *tally, const ebpo_reference_tree *view)
{
    const ebpo_mesh *mesh = &view->tree->mesh;
    uint64_t outside = 0, first = 0;
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, 3 * mesh->face_count) {
        double p[3];
        ebpo_mesh_position(mesh, mesh->faces[i], p);
        bool within = true;
        for (int k = 0; k < 3; k++)
            within &= p[k] > view->box.origin[k] && p[k] < view->box.origin[k] + view->box.size[k];
        first = within || outside ? first : i;
        outside += !within;
    }
    CHECK(outside == 0,
          "%" PRIu64 " corners of faces are not strictly inside the root box, face %" PRIu64
          " first",
          outside, first / 3);
}

/* Returns true if the faces use every edge equally often in both directions. Each edge has a
 * pseudo-random value, which is added for each use in one direction and subtracted for each use in
 * the other direction. If some edge is not used equally often, the sum is 0 with a probability of
 * only 2^-64. */
static bool edges_balance(const ebpo_mesh *mesh)
{
    uint64_t sum = 0;
    EBPO_FOR_ITEMS(mesh->workspace, f, 0, mesh->face_count)
        for (int i = 0; i < 3; i++) {
            uint64_t a = mesh->faces[3 * f + (uint64_t)i],
                     b = mesh->faces[3 * f + (uint64_t)(i + 1) % 3];
            uint64_t value = a < b ? ebpo_random_mix(a << 32 | b) : -ebpo_random_mix(b << 32 | a);
            sum += a == b ? 0 : value;
        }
    return sum == 0;
}

void ebpo_check_structure(ebpo_tally *tally, const ebpo_reference_tree *view)
{
    const ebpo_tree *tree = view->tree;
    for (int l = 0; l < tree->info.level_count; l++)
        check_summary(tally, tree, l);
    descent d = { .tally = tally, .view = view };
    ebpo_reference_node root = ebpo_reference_root(view);
    check_node(&d, &root);
    for (int l = 0; l < tree->info.level_count; l++)
        CHECK(d.pruned[l] == tree->info.level[l].pruned_count,
              "level %d: %" PRIu64 " nodes are pruned, the header states %" PRIu64, l, d.pruned[l],
              tree->info.level[l].pruned_count);
    if (!view->has_mesh)
        return;
    CHECK(d.next_face == tree->mesh.face_count, "leaves list %" PRIu64 " of %" PRIu64 " faces",
          d.next_face, tree->mesh.face_count);
    check_vertices(tally, view);
    /* in a subset, the mesh is a part of the model and may be unbalanced */
    if (tree->info.solid && !tree->info.pruned)
        CHECK(edges_balance(&tree->mesh),
              "the file states a solid, but the directions of the mesh's edges do not cancel");
}
