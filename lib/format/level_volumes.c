/* Computes the volumes of the levels' envelopes. The envelope of a node is the node's cell, cut by
 * the planes that the file stores for the node and its ancestors. (If the file stores no planes of
 * leaves, ebpo_lod_level derives planes of leaves. The volumes here are computed without derived
 * planes.) */
#include "core/strict_fp.h"

#include <string.h>

#include "core/workspace.h"
#include "format/level_volumes.h"
#include "geometry/cells.h"
#include "geometry/level_nodes.h"
#include "geometry/polytope.h"

/* The computation of volumes. The walk visits nodes in stored order. */
typedef struct measuring {
    const ebpo_tree *tree;
    uint32_t parts;    /* parts whose planes are used */
    ebpo_box box;      /* the root cell */
    double *volume[2]; /* [levels] volumes of gray nodes, and of leaves */
    uint64_t visited;  /* number of visited nodes */
    /* for each level: index of the next group, gray node, leaf, plane, and plane of a leaf */
    uint64_t group[EBPO_LEVELS_MAX], gray[EBPO_LEVELS_MAX], leaf[EBPO_LEVELS_MAX],
        plane[EBPO_LEVELS_MAX], leaf_plane[EBPO_LEVELS_MAX];
} measuring;

/* Cuts the envelope by the planes of the node with rank *node, whose first plane is *plane. Then
 * increases *node and *plane to the next node and its first plane. `counts`: NULL if the nodes have
 * no planes. */
static void cut_envelope(ebpo_polytope *envelope, const uint8_t *counts, const uint32_t *planes,
                         uint64_t *node, uint64_t *plane)
{
    uint64_t count = counts ? counts[*node] : 0;
    if (count)
        ebpo_planes_cut(envelope, planes + *plane, count);
    *plane += count;
    ++*node;
}

/* Adds the volumes of the envelopes of the level's next group, and of all groups below it, to the
 * volumes of their levels. `parent` is the envelope of the group's parent; NULL: the group contains
 * the root. */
static void measure_group(measuring *m, int level, const ebpo_polytope *parent)
{
    const ebpo_level *l = &m->tree->level[level];
    const uint8_t *gray_counts = m->parts & EBPO_PART_PLANES ? l->plane_counts : NULL,
                  *leaf_counts = m->parts & EBPO_PART_LEAF_PLANES ? l->leaf_plane_counts : NULL;
    uint16_t types = l->types[m->group[level]++];
    for (unsigned octant = 0; octant < ebpo_group_octants(level); octant++) {
        ebpo_node_type type = ebpo_group_type(types, octant);
        ebpo_polytope envelope;
        if (type != EBPO_GRAY && type != EBPO_LEAF)
            continue;
        if (parent)
            (void)ebpo_polytope_child(parent, octant, &envelope);
        else
            ebpo_polytope_cube(&envelope);
        if (type == EBPO_GRAY)
            cut_envelope(&envelope, gray_counts, l->planes, &m->gray[level], &m->plane[level]);
        else
            cut_envelope(&envelope, leaf_counts, l->leaf_planes, &m->leaf[level],
                         &m->leaf_plane[level]);
        m->volume[type == EBPO_LEAF][level] +=
            ebpo_polytope_volume(&envelope) * ebpo_cell_volume(&m->box, level);
        ebpo_items_step(m->tree->workspace, EBPO_ITEMS_IN_ORDER, ++m->visited);
        if (type == EBPO_GRAY && level + 1 < m->tree->info.level_count)
            measure_group(m, level + 1, &envelope);
    }
}

void ebpo_tree_volumes(const ebpo_tree *tree, uint32_t parts, double gray[EBPO_LEVELS_MAX],
                       double leaf[EBPO_LEVELS_MAX])
{
    measuring m = {
        .tree = tree, .parts = parts, .box = ebpo_root_box(&tree->info), .volume = { gray, leaf }
    };
    memset(gray, 0, EBPO_LEVELS_MAX * sizeof *gray);
    memset(leaf, 0, EBPO_LEVELS_MAX * sizeof *leaf);
    measure_group(&m, 0, NULL);
}
