/* Envelopes are cut as a reader of levels cuts them: leaves by stored planes or not at all. */
#include "core/strict_fp.h"

#include "geometry/plane_clip.h"
#include "geometry/cells.h"
#include "geometry/node_types.h"
#include "derive/subset_parts.h"

#include "levels/lod_model.h"

typedef struct measuring {
    ebpo_cutting *c;
    uint64_t group[EBPO_LEVELS_MAX], gray[EBPO_LEVELS_MAX], leaf[EBPO_LEVELS_MAX],
        plane[EBPO_LEVELS_MAX], leaf_plane[EBPO_LEVELS_MAX];
} measuring;

/* Cuts the envelope by the node's own planes. */
static void cut_envelope(ebpo_polytope *envelope, const uint8_t *counts, const uint32_t *planes,
                uint64_t *node, uint64_t *plane)
{
    uint64_t count = counts ? counts[*node] : 0;
    if (count)
        ebpo_planes_cut(envelope, planes + *plane, count);
    *plane += count;
    ++*node;
}

static void measure_group(measuring *m, int level, const ebpo_polytope *parent)
{
    ebpo_tree *tree = m->c->out;
    ebpo_level *l = &tree->level[level];
    uint16_t types = l->types[m->group[level]++];
    for (unsigned octant = 0; octant < ebpo_group_octants(level); octant++) {
        ebpo_node_type type = ebpo_group_type(types, octant);
        ebpo_polytope own;
        if (type != EBPO_GRAY && type != EBPO_LEAF)
            continue;
        if (parent)
            (void)ebpo_polytope_child(parent, octant, &own);
        else
            ebpo_polytope_cube(&own);
        if (type == EBPO_GRAY)
            cut_envelope(&own, l->plane_counts, l->planes, &m->gray[level], &m->plane[level]);
        else
            cut_envelope(&own, l->leaf_plane_counts, l->leaf_planes, &m->leaf[level], &m->leaf_plane[level]);
        *(type == EBPO_GRAY ? &l->gray_volume : &l->leaf_volume) +=
            ebpo_polytope_volume(&own) * ebpo_cell_volume(&m->c->box, level);
        if (type == EBPO_GRAY && level + 1 < tree->info.level_count)
            measure_group(m, level + 1, &own);
    }
}

void ebpo_cut_volumes(ebpo_cutting *c)
{
    measuring m = { .c = c };
    for (int i = 0; i < c->out->info.level_count; i++)
        c->out->level[i].gray_volume = c->out->level[i].leaf_volume = 0;
    measure_group(&m, 0, NULL);
}
