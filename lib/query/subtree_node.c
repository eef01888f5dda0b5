/* A node in the model's coordinates: its half-spaces and its envelope. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "geometry/plane_code.h"
#include "levels/lod_model.h"
#include "geometry/envelope_stack.h"
#include "geometry/half_spaces.h"
#include "levels/cell_to_model.h"
#include "levels/stream_node.h"
#include "query/subtree_parts.h"

struct ebpo_subtree_scratch {
    ebpo_envelope_stack envelopes;
    ebpo_polytope leaf;
    ebpo_node_buffers lent;
    double inherited[EBPO_HALF_SPACES_MAX][4];
    ebpo_triangle *faces; /* of a leaf */
    uint64_t face_capacity;
};

void ebpo_subtree_free_scratch(ebpo_subtree_scratch *scratch)
{
    if (scratch)
        free(scratch->faces);
    free(scratch);
}

/* --- the way from the tree's root down to a node --- */

/* Planes that the node of this level has on the way to `octcode`; `node` is that node's number, and
 * becomes the next one's, where the level is the subtree's. */
static const uint32_t *planes_on_way(const ebpo_subtree *s, uint64_t octcode, int level,
                                     uint64_t *node, uint32_t *count)
{
    int last = ebpo_octcode_level(octcode), root = s->root.cell.level;
    *count = 0;
    if (level < root && s->has_planes) {
        *count = s->above_first[level + 1] - s->above_first[level];
        return s->above_planes + s->above_first[level];
    }
    if (level < root)
        return NULL;
    uint64_t at = *node;
    if (level < last)
        *node = s->children[at] + (octcode >> 3 * (last - level - 1) & 7);
    if (!s->has_planes)
        return NULL;
    *count = s->plane_first[at + 1] - s->plane_first[at];
    return s->planes + s->plane_first[at];
}

static void add_inherited(ebpo_subtree *s, uint64_t octcode, ebpo_subtree_node *out)
{
    ebpo_cell cell = ebpo_cell_of_octcode(octcode);
    uint64_t node = 0;
    for (int level = 0; level < cell.level; level++) {
        uint32_t count;
        const uint32_t *codes = planes_on_way(s, octcode, level, &node, &count);
        for (uint32_t i = 0; i < count; i++) {
            int32_t n[3], d;
            if (ebpo_plane_code_decode(codes[i], n, &d))
                ebpo_plane_to_world(&s->box, ebpo_cell_ancestor(cell, level), n, d,
                                    s->scratch->inherited[out->inherited_count++]);
        }
    }
    out->inherited = (const double(*)[4])s->scratch->inherited;
}

/* The node's envelope, but for planes that a leaf derives. */
static const ebpo_polytope *stored_envelope(ebpo_subtree *s, uint64_t octcode, ebpo_node_type type)
{
    ebpo_envelope_stack *stack = &s->scratch->envelopes;
    const ebpo_polytope *envelope = NULL;
    int last = ebpo_octcode_level(octcode);
    uint64_t node = 0;
    if (type == EBPO_BLACK)
        return ebpo_envelope_put_cube(stack, octcode);
    for (int level = 0; level <= last; level++) {
        ebpo_octcode own = octcode >> 3 * (last - level);
        uint32_t count;
        const uint32_t *codes = planes_on_way(s, octcode, level, &node, &count);
        envelope = ebpo_envelope_held(stack, own);
        if (!envelope)
            envelope = ebpo_envelope_put(stack, own, codes, count);
    }
    return envelope;
}

/* --- leaves --- */

static ebpo_status gather_faces(ebpo_subtree *s, uint64_t leaf, uint64_t *count, ebpo_error *error)
{
    ebpo_subtree_scratch *scratch = s->scratch;
    uint32_t first = s->list_first[leaf];
    *count = s->list_first[leaf + 1] - first;
    if (!ebpo_grow(&scratch->faces, &scratch->face_capacity, *count, sizeof *scratch->faces))
        return ebpo_fail_memory(error, *count * sizeof *scratch->faces);
    for (uint64_t i = 0; i < 3 * *count; i++) {
        uint64_t vertex = s->mesh.faces[3 * (uint64_t)s->list[first + i / 3] + i % 3];
        for (uint64_t k = 0; k < 3; k++)
            scratch->faces[i / 3].corner[i % 3][k] = s->mesh.xyz32
                                                         ? (double)s->mesh.xyz32[3 * vertex + k]
                                                         : s->mesh.xyz64[3 * vertex + k];
    }
    return EBPO_OK;
}

/* Cuts the scratch's envelope of a leaf by planes that follow from its faces. */
static ebpo_status derive_planes(ebpo_subtree *s, uint64_t leaf, uint32_t codes[EBPO_PLANES_MAX],
                                 unsigned *code_count, ebpo_error *error)
{
    ebpo_cell cell = ebpo_cell_of_octcode(s->octcodes[leaf]);
    uint64_t count;
    ebpo_status status = gather_faces(s, leaf, &count, error);
    if (status != EBPO_OK)
        return status;
    const ebpo_triangle *faces = s->scratch->faces;
    unsigned inside = s->windings ? ebpo_lod_inside_corners(&s->box, cell, s->rule,
                                                            s->windings[leaf], faces, count)
                                  : 0;
    *code_count = (unsigned)ebpo_leaf_planes(&s->box, cell, faces, count, inside, 0,
                                             &s->scratch->leaf, codes);
    return EBPO_OK;
}

/* --- all of a node --- */

static ebpo_status describe(ebpo_subtree *s, uint64_t number, bool polygons, ebpo_subtree_node *out,
                            ebpo_error *error)
{
    uint64_t octcode = s->octcodes[number];
    ebpo_node_type type = (ebpo_node_type)s->types[number];
    uint32_t derived[EBPO_PLANES_MAX], *codes = s->planes;
    unsigned count = 0;
    bool derives = type == EBPO_LEAF && !s->has_leaf_planes && !s->no_faces;
    ebpo_node_begin(&out->node, &s->box, octcode, type);
    out->node.winding = s->windings ? s->windings[number] : 0;
    add_inherited(s, octcode, out);
    const ebpo_polytope *envelope =
        (polygons && type != EBPO_WHITE) || derives ? stored_envelope(s, octcode, type) : NULL;
    if (s->has_planes) {
        codes += s->plane_first[number];
        count = s->plane_first[number + 1] - s->plane_first[number];
    }
    if (derives) {
        ebpo_polytope_copy(&s->scratch->leaf, envelope);
        ebpo_status status = derive_planes(s, number, codes = derived, &count, error);
        if (status != EBPO_OK)
            return status;
        envelope = &s->scratch->leaf;
    }
    ebpo_node_add_planes(&out->node, &s->box, codes, count, &s->scratch->lent);
    if (polygons && envelope)
        ebpo_node_add_polygons(&out->node, &s->box, envelope, &s->scratch->lent);
    return EBPO_OK;
}

ebpo_status ebpo_subtree_get_node(ebpo_subtree *s, uint64_t number, bool polygons,
                                  ebpo_subtree_node *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_subtree_node node = EBPO_SUBTREE_NODE_INIT;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_subtree_node, out, error);
    if (status != EBPO_OK)
        return status;
    if (number >= s->node_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "there is no node number %" PRIu64 "; the subtree has %" PRIu64 " nodes",
                         number, s->node_count);
    if (!s->scratch && !(s->scratch = ebpo_alloc_zero(1, sizeof *s->scratch)))
        return ebpo_fail_memory(error, sizeof *s->scratch);
    status = describe(s, number, polygons, &node, error);
    return status == EBPO_OK ? EBPO_GIVE(ebpo_subtree_node, out, &node) : status;
}
