#include "levels/lod_colours.h"

#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "format/schema.h"
#include "geometry/cells.h"
#include "geometry/node_types.h"
#include "geometry/octcode.h"

/* Down from the root: of the last gray node on the way, which is the node or its parent. */
static bool find_colour(const ebpo_lod_model *model, uint64_t octcode, uint32_t *colour)
{
    int depth = ebpo_cell_of_octcode(octcode).level;
    uint64_t group = 0;
    bool found = false;
    for (int level = 0; level <= depth; level++) {
        const ebpo_level *l = &model->level[level];
        unsigned octant = level ? octcode >> 3 * (depth - level) & 7 : 0;
        uint16_t types = l->types[group];
        if (ebpo_group_type(types, octant) != EBPO_GRAY || !l->gray_colours)
            break;
        group = model->ranks[level].before[EBPO_GRAY][group] +
                ebpo_group_count(types, EBPO_GRAY, octant);
        *colour = l->gray_colours[group];
        found = true;
    }
    return found;
}

void ebpo_lod_add_colours(ebpo_lod_nodes *nodes, const ebpo_lod_model *model)
{
    for (uint64_t i = 0; i < nodes->node_count; i++) {
        ebpo_lod_node *node = &nodes->nodes[i];
        node->colour = EBPO_COLOUR_OF_NOTHING;
        node->coloured = find_colour(model, node->octcode, &node->colour);
    }
}

static bool are_coloured(const ebpo_lod_nodes *nodes)
{
    for (uint64_t i = 0; i < nodes->node_count; i++)
        if (nodes->nodes[i].coloured)
            return true;
    return false;
}

ebpo_status ebpo_lod_colours(const ebpo_lod_nodes *nodes, uint64_t vertex_count, ebpo_colours *out,
                             ebpo_error *error)
{
    uint64_t sum = 0;
    memset(out, 0, sizeof *out);
    for (uint64_t i = 0; i < nodes->node_count; i++)
        sum += nodes->nodes[i].vertex_count;
    if (sum != vertex_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the nodes have %llu vertices, the mesh %llu; give both of one level",
                         (unsigned long long)sum, (unsigned long long)vertex_count);
    if (!are_coloured(nodes))
        return EBPO_OK;
    uint8_t *rgba = out->vertex = ebpo_alloc(vertex_count, 4);
    if (!rgba)
        return ebpo_fail_memory(error, vertex_count * 4);
    for (uint64_t i = 0; i < nodes->node_count; i++)
        for (uint32_t v = 0; v < nodes->nodes[i].vertex_count; v++, rgba += 4) {
            uint32_t colour = nodes->nodes[i].colour;
            rgba[0] = (uint8_t)colour;
            rgba[1] = (uint8_t)(colour >> 8);
            rgba[2] = (uint8_t)(colour >> 16);
            rgba[3] = 255;
        }
    return EBPO_OK;
}
