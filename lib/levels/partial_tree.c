#include "levels/partial_tree.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "geometry/octcode.h"

void ebpo_partial_free(ebpo_partial *partial)
{
    free(partial->group);
    free(partial->codes);
    free(partial->winding);
    memset(partial, 0, sizeof *partial);
}

static ebpo_status make_room(ebpo_partial *g, unsigned codes, ebpo_error *error)
{
    if (g->group_count >= UINT32_MAX)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "more nodes than a view can hold; give a deepest level or a budget");
    if (!ebpo_grow(&g->group, &g->group_capacity, g->group_count + 1, sizeof *g->group) ||
        !ebpo_grow(&g->codes, &g->code_capacity, g->code_count + codes, sizeof *g->codes) ||
        (g->windings &&
         !ebpo_grow(&g->winding, &g->winding_capacity, g->group_count + 1, sizeof *g->winding)))
        return ebpo_fail_memory(error, (g->group_count + 1) * sizeof *g->group +
                                           (g->code_count + codes) * sizeof *g->codes);
    return EBPO_OK;
}

ebpo_status ebpo_partial_add(ebpo_partial *g, const ebpo_info *info, uint64_t parent,
                             const ebpo_group *read, ebpo_error *error)
{
    int level = parent ? ebpo_octcode_level(parent) + 1 : 0;
    uint64_t grays = ebpo_group_count(read->types, EBPO_GRAY, 8);
    if (grays >
        info->level[level].gray_count - g->grays[level]) /* else a damaged index could give one node
                                                            to many parents, without end */
        return ebpo_fail(
            error, EBPO_E_FORMAT,
            "level %d: its index gives more gray nodes than the head states; run ebpo verify",
            level);
    ebpo_status status = make_room(g, read->code_count, error);
    if (status != EBPO_OK)
        return status;
    ebpo_partial_group *out = &g->group[g->group_count];
    *out = (ebpo_partial_group){ .parent = parent,
                                 .first_gray = read->rank[EBPO_GRAY],
                                 .first_code = g->code_count,
                                 .types = read->types };
    memcpy(out->plane_count, read->plane_count, sizeof out->plane_count);
    if (read->code_count)
        memcpy(g->codes + g->code_count, read->codes, read->code_count * sizeof *g->codes);
    if (g->windings)
        memcpy(g->winding[g->group_count], read->winding, sizeof *g->winding);
    g->grays[level] += grays;
    g->code_count += read->code_count;
    g->group_count++;
    return EBPO_OK;
}

const uint32_t *ebpo_partial_codes(const ebpo_partial *g, ebpo_partial_node node, unsigned *count)
{
    const ebpo_partial_group *group = &g->group[node.group];
    uint64_t first = group->first_code;
    for (unsigned i = 0; i < node.octant; i++)
        first += group->plane_count[i];
    *count = group->plane_count[node.octant];
    return *count ? g->codes + first : NULL;
}

const ebpo_polytope *ebpo_partial_envelope(const ebpo_partial *g, ebpo_partial_node node,
                                           ebpo_envelope_stack *e)
{
    ebpo_octcode octcode = ebpo_partial_octcode(g, node);
    int level = ebpo_octcode_level(octcode);
    const ebpo_polytope *envelope = NULL;
    ebpo_partial_node at = { 0, 0 };
    if (ebpo_partial_type(g, node) == EBPO_BLACK)
        return ebpo_envelope_put_cube(e, octcode);
    for (int depth = 0; depth <= level; depth++) {
        ebpo_octcode own = octcode >> 3 * (level - depth);
        if (depth == level)
            at = node; /* its group may not be linked yet */
        else if (depth)
            at = (ebpo_partial_node){ g->group[at.group].child[at.octant], (uint8_t)(own & 7) };
        envelope = ebpo_envelope_held(e, own);
        if (!envelope) {
            unsigned count;
            const uint32_t *codes = ebpo_partial_codes(g, at, &count);
            envelope = ebpo_envelope_put(e, own, codes, count);
        }
    }
    return envelope;
}
