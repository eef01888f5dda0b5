#include "core/strict_fp.h"

#include "levels/level_walk.h"

#include <string.h>

#include "geometry/node_types.h"

void ebpo_level_walk_begin(ebpo_level_walk *walk, const ebpo_level *level, int target, bool pruned)
{
    memset(walk, 0, sizeof *walk);
    walk->level = level;
    walk->target = target;
    walk->pruned = pruned;
}

/* The next node of the level at `depth`, of which there is one. */
static ebpo_level_walk_node *pass(ebpo_level_walk *w, int depth)
{
    const ebpo_level *level = &w->level[depth];
    unsigned octant = w->at[depth].octant++;
    ebpo_level_walk_node *node = &w->at[depth].node;
    node->octcode = depth ? ebpo_octcode_child(w->at[depth - 1].node.octcode, octant) : 1;
    node->type = ebpo_group_type(level->types[w->at[depth].group], octant);
    node->rank = w->at[depth].rank[node->type]++;
    node->codes = NULL;
    node->code_count = 0;
    if (node->type == EBPO_GRAY && level->plane_counts) {
        node->code_count = level->plane_counts[node->rank];
        node->codes = node->code_count ? level->planes + w->at[depth].plane : NULL;
        w->at[depth].plane += node->code_count;
    } else if (node->type == EBPO_LEAF && level->leaf_plane_counts) {
        node->code_count = level->leaf_plane_counts[node->rank];
        node->codes = node->code_count ? level->leaf_planes + w->at[depth].leaf_plane : NULL;
        w->at[depth].leaf_plane += node->code_count;
    }
    return node;
}

bool ebpo_level_walk_next(ebpo_level_walk *w, ebpo_level_walk_node *out)
{
    for (;;) {
        int depth = w->depth;
        if (w->at[depth].octant == ebpo_group_octants(depth)) { /* level 0 has one node */
            if (depth == 0)
                return false;
            w->at[depth].group++;
            w->at[depth].octant = 0;
            w->depth--;
            continue;
        }
        if (w->pruned && depth && w->level[depth].types[w->at[depth].group] == 0) {
            w->at[depth].rank[EBPO_WHITE] += 8;
            w->at[depth].octant = 8;
            continue;
        }
        const ebpo_level_walk_node *node = pass(w, depth);
        if (depth == w->target) {
            *out = *node;
            return true;
        }
        if (node->type == EBPO_GRAY)
            w->depth++;
    }
}

/* Of the ancestor at `depth`, and those above it. */
static const ebpo_polytope *ancestor(const ebpo_level_walk *w, int depth, ebpo_envelope_stack *e)
{
    const ebpo_level_walk_node *node = &w->at[depth].node;
    const ebpo_polytope *held = ebpo_envelope_held(e, node->octcode);
    if (held)
        return held;
    if (depth)
        (void)ancestor(w, depth - 1, e);
    return ebpo_envelope_put(e, node->octcode, node->codes, node->code_count);
}

const ebpo_polytope *ebpo_level_walk_envelope(const ebpo_level_walk *w,
                                              const ebpo_level_walk_node *node,
                                              ebpo_envelope_stack *e)
{
    return node->type == EBPO_BLACK ? ebpo_envelope_put_cube(e, node->octcode)
                                    : ancestor(w, w->target, e);
}
