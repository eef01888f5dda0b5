#include "core/strict_fp.h"

#include "verify/nesting.h"

#include "core/workspace.h"
#include "core/wide.h"

#include "geometry/plane_code.h"

enum { NODES_PER_LEVEL = 256, POINTS_PER_NODE = 8, POINT_BITS = 16 };

static void check_codes(ebpo_tally *tally, const ebpo_twin_tree *view, int l, ebpo_node_type type,
                        const uint8_t *counts)
{
    const ebpo_level *level = &view->tree->level[l];
    EBPO_FOR_ITEMS(level->workspace, group, 0, level->group_count)
        for (unsigned octant = 0; octant < (l == 0 ? 1u : 8u); octant++) {
            if (ebpo_twin_type(level, group, octant) != type)
                continue;
            uint64_t rank = view->groups[l][group].of_type[type];
            for (unsigned i = 0; i < octant; i++)
                rank += ebpo_twin_type(level, group, i) == type;
            ebpo_twin_node node = {
                .group = group, .octant = octant, .type = type, .rank = rank, .cell.level = l
            };
            uint32_t count;
            const uint32_t *codes = counts[rank] ? ebpo_twin_planes(view, &node, &count) : NULL;
            for (uint32_t i = 0; i < counts[rank]; i++) {
                int32_t n[3], d;
                tally->checks[EBPO_VERIFY_NESTING]++;
                if (!ebpo_plane_decode(codes[i], n, &d))
                    ebpo_tally_violation(tally, EBPO_VERIFY_NESTING,
                                         &(ebpo_verify_place){
                                             ebpo_twin_at(view, l, group, octant).code,
                                             EBPO_NO_FACE, i },
                                         "the code %08x stands for no plane", (unsigned)codes[i]);
            }
        }
}

/* A chain of nodes from the root down. */
typedef struct chain {
    int depth;
    ebpo_twin_node node[EBPO_LEVELS_MAX];
} chain;

static void chain_to(chain *out, const ebpo_twin_tree *view, const ebpo_twin_node *end)
{
    out->depth = end->cell.level;
    out->node[0] = ebpo_twin_root(view);
    for (int l = 1; l <= out->depth; l++)
        out->node[l] = ebpo_twin_child(view, &out->node[l - 1],
                                       (unsigned)(end->code >> 3 * (out->depth - l) & 7));
}

/* The point (in 2^-16 of the cell `at`) against a plane of the cell `above`, in the coordinates of
 * `above`. */
static bool keeps_above(const ebpo_cell *above, const ebpo_cell *at, const int64_t point[3],
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

/* The same, with the plane taken down level by level as readers do. */
static bool keeps_below(const chain *c, int from, int to, const int64_t point[3],
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

static void check_point(ebpo_tally *tally, const ebpo_twin_tree *view, const chain *c,
                        const int64_t point[3])
{
    const ebpo_cell *at = &c->node[c->depth].cell;
    for (int l = 0; l < c->depth; l++) {
        uint32_t count;
        const uint32_t *codes = ebpo_twin_planes(view, &c->node[l], &count);
        for (uint32_t i = 0; i < count; i++) {
            int32_t n[3], d;
            if (!ebpo_plane_decode(codes[i], n, &d))
                continue;
            tally->checks[EBPO_VERIFY_NESTING]++;
            if (keeps_above(&c->node[l].cell, at, point, n, d) !=
                keeps_below(c, l, c->depth, point, n, d))
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

/* Walls of a cell are walls or the middle of its parent, as doubles too. */
static void check_walls(ebpo_tally *tally, const ebpo_twin_tree *view, const ebpo_twin_node *node)
{
    int level = node->cell.level;
    bool same = true;
    for (int k = 0; k < 3; k++) {
        uint32_t even = node->cell.at[k] & ~1u, at = node->cell.at[k];
        same &= ebpo_wall(&view->box, k, level, even) ==
                    ebpo_wall(&view->box, k, level - 1, even / 2) &&
                ebpo_wall(&view->box, k, level, even + 2) ==
                    ebpo_wall(&view->box, k, level - 1, even / 2 + 1) &&
                ebpo_wall(&view->box, k, level, at + 1) - ebpo_wall(&view->box, k, level, at) ==
                    view->box.size[k] / (double)(1u << level);
    }
    tally->checks[EBPO_VERIFY_NESTING]++;
    if (!same)
        ebpo_tally_violation(tally, EBPO_VERIFY_NESTING,
                             &(ebpo_verify_place){ node->code, EBPO_NO_FACE, EBPO_NO_PLANE },
                             "the walls of the cell are not walls of its parent's grid");
}

static uint64_t next_random(uint64_t *state)
{
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    return *state;
}

/* Random points of the cell, and its corners. */
static void check_node(ebpo_tally *tally, const ebpo_twin_tree *view, const ebpo_twin_node *node)
{
    chain c;
    chain_to(&c, view, node);
    check_walls(tally, view, node);
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

void ebpo_check_nesting(ebpo_tally *tally, const ebpo_twin_tree *view)
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
            ebpo_twin_node node = ebpo_twin_at(view, l, (cell % cells) / 8, (unsigned)(cell % 8));
            check_node(tally, view, &node);
        }
    }
}
