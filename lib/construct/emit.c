/* Subtrees to stretches of level arrays: a depth-first walk meets the nodes of each level in
 * octcode order. */
#include "core/strict_fp.h"

#include "construct/emit.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "construct/corner_windings.h"
#include "construct/envelopes.h"
#include "construct/piece_levels.h"
#include "construct/proposals.h"
#include "geometry/plane_clip.h"
#include "geometry/node_types.h"

struct ebpo_emit_scratch {
    ebpo_envelope_scratch *envelope;
    ebpo_triangle *faces; /* of one leaf */
    uint64_t faces_capacity;
    ebpo_workspace *workspace;
    /* [a level][3] halves of the envelopes on the path to a node, along z, y, x; too large for the
     * stack, and allocated when the first node of the level has children */
    ebpo_polytope (*half[EBPO_LEVELS_MAX])[3];
};

typedef struct emitter {
    const ebpo_builder *b;
    ebpo_branch *s;
    ebpo_emit_scratch *scratch;
} emitter;

ebpo_status ebpo_emit_scratch_make(ebpo_emit_scratch **out, ebpo_workspace *workspace,
                                   ebpo_error *error)
{
    *out = ebpo_alloc_zero(1, sizeof **out);
    ebpo_status status =
        *out ? ebpo_scratch_make(&(*out)->envelope, error) : ebpo_fail_memory(error, sizeof **out);
    if (status != EBPO_OK) {
        free(*out);
        *out = NULL;
    } else {
        (*out)->workspace = workspace;
    }
    return status;
}

void ebpo_emit_scratch_free(ebpo_emit_scratch *scratch)
{
    if (!scratch)
        return;
    ebpo_scratch_free(scratch->envelope);
    ebpo_array_free(scratch->workspace, scratch->faces);
    for (int level = 0; level < EBPO_LEVELS_MAX; level++)
        free(scratch->half[level]);
    free(scratch);
}

static bool grow_leaf_arrays(ebpo_piece_level *out, uint64_t refs)
{
    ebpo_level *l = &out->level;
    uint64_t n = l->leaf_count + 1, *c = out->capacity;
#define GROW(array, ID, need) \
    ebpo_array_grow_late(l->workspace, &l->array, &c[EBPO_A_##ID], need, sizeof *l->array)
    return GROW(leaf_winding, LEAF_WINDING, n) && GROW(leaf_first, LEAF_SKIP, n) &&
           GROW(leaf_new, LEAF_NEW, n) && GROW(leaf_ref_count, LEAF_REF_COUNT, n) &&
           GROW(leaf_plane_counts, LEAF_PLANE_COUNTS, n) &&
           GROW(leaf_refs, LEAF_REFS, l->ref_count + refs);
#undef GROW
}

static bool emit_list(const emitter *e, const ebpo_build_detail *d, ebpo_piece_level *out,
                      int32_t winding)
{
    ebpo_level *l = &out->level;
    uint64_t refs = d->entry_end - d->entry_begin - d->new_count;
    if (!grow_leaf_arrays(out, refs))
        return false;
    l->leaf_winding[l->leaf_count] = winding;
    l->leaf_first[l->leaf_count] = d->first;
    l->leaf_new[l->leaf_count] = d->new_count;
    l->leaf_ref_count[l->leaf_count] = (uint32_t)refs;
    for (uint64_t i = d->entry_begin, ref = l->ref_count; i < d->entry_end; i++) {
        uint32_t place = e->s->entries[i], face = e->s->list[place];
        if (!(e->s->fresh[place / 8] >> place % 8 & 1) || e->b->number[face] < d->first)
            l->leaf_refs[ref++] = face;
    }
    l->ref_count += refs;
    l->new_count += d->new_count;
    return true;
}

static bool gather_faces(emitter *e, const ebpo_build_detail *d)
{
    ebpo_emit_scratch *scratch = e->scratch;
    uint64_t count = d->entry_end - d->entry_begin;
    if (!ebpo_array_grow_late(e->b->workspace, &scratch->faces, &scratch->faces_capacity, count,
                              sizeof *scratch->faces))
        return false;
    for (uint64_t i = 0; i < count; i++)
        ebpo_branch_triangle(e->b, e->s, e->s->entries[d->entry_begin + i], &scratch->faces[i]);
    return true;
}

/* Planes that are to be stored: the selection's own. Else readers derive them. -1: out of memory.
 */
static int leaf_planes(emitter *e, uint32_t detail, ebpo_cell cell, int32_t winding,
                       ebpo_polytope *envelope, uint32_t *codes)
{
    const ebpo_builder *b = e->b;
    const ebpo_build_detail *d = &e->s->details[detail];
    int count;
    const uint32_t *proposed = ebpo_proposed(e->s, detail, &count);
    if (!proposed && !gather_faces(e, d))
        return -1;
    if (!proposed)
        return ebpo_leaf_planes(&b->box, cell, e->scratch->faces, d->entry_end - d->entry_begin,
                                ebpo_inside_corners(b, winding, d->delta), b->options->epsilon,
                                envelope, codes);
    memcpy(codes, proposed, (size_t)count * sizeof *codes);
    ebpo_planes_cut(envelope, codes, (uint64_t)count);
    return count;
}

static bool emit_leaf(emitter *e, uint32_t detail, ebpo_cell cell, int32_t winding,
                      ebpo_polytope *envelope)
{
    const ebpo_builder *b = e->b;
    const ebpo_build_detail *d = &e->s->details[detail];
    ebpo_piece_level *out = &e->s->out[cell.level];
    ebpo_level *l = &out->level;
    if (!emit_list(e, d, out, winding))
        return false;
    uint32_t codes[EBPO_PLANES_STORED];
    bool stored = b->options->parts & EBPO_PART_LEAF_PLANES;
    int planes = stored ? leaf_planes(e, detail, cell, winding, envelope, codes) : 0;
    if (planes < 0)
        return false;
    l->leaf_volume += ebpo_polytope_volume(envelope) * ebpo_cell_volume(&b->box, cell.level);
    l->leaf_plane_counts[l->leaf_count++] = (uint8_t)planes;
    if (!stored)
        return true;
    if (!ebpo_array_grow_late(l->workspace, &l->leaf_planes, &out->capacity[EBPO_A_LEAF_PLANES],
                              l->leaf_plane_count + (uint64_t)planes, sizeof *l->leaf_planes))
        return false;
    if (planes)
        memcpy(l->leaf_planes + l->leaf_plane_count, codes, (size_t)planes * sizeof *codes);
    l->leaf_plane_count += (uint64_t)planes;
    return true;
}

static bool emit_empty(emitter *e, ebpo_cell cell, int32_t winding)
{
    bool black = e->b->solid && ebpo_rule_inside(e->b->options->rule, winding);
    return ebpo_piece_level_add_empty(&e->s->out[cell.level], black, winding);
}

static bool emit(emitter *e, uint32_t index, ebpo_cell cell, int32_t winding,
                 ebpo_polytope *envelope);

static unsigned filled_children(const ebpo_branch *s, uint32_t child)
{
    unsigned mask = 0;
    for (uint32_t o = 0; o < 8; o++)
        mask |= (unsigned)(s->nodes[child + o].type != EBPO_WHITE) << o;
    return mask;
}

/* In octant order; neighbours share the halves that their envelopes are cut from. A half that
 * rounding leaves nothing of stays the whole cube, and so do its parts: too large, never too small.
 */
static bool emit_children(emitter *e, uint32_t child, ebpo_cell cell, int32_t winding,
                          const int32_t offset[8], const ebpo_polytope *envelope)
{
    unsigned filled = filled_children(e->s, child);
    ebpo_polytope(**half)[3] = &e->scratch->half[cell.level];
    if (!*half && !(*half = ebpo_alloc(1, sizeof **half)))
        return false;
    ebpo_polytope *z = **half, *y = z + 1, *x = z + 2;
    for (unsigned o = 0; o < 8; o++) {
        if (o % 4 == 0 && filled >> o & 15)
            ebpo_polytope_half(envelope, 2, o >> 2 & 1, z);
        if (o % 2 == 0 && filled >> o & 3)
            ebpo_polytope_half(z, 1, o >> 1 & 1, y);
        if (filled >> o & 1)
            ebpo_polytope_half(y, 0, o & 1, x);
        if (!emit(e, child + o, ebpo_cell_child(cell, o), winding + offset[o], x))
            return false;
    }
    return true;
}

static bool emit_gray(emitter *e, const ebpo_build_node *node, ebpo_cell cell, int32_t winding,
                      ebpo_polytope *envelope)
{
    const ebpo_builder *b = e->b;
    uint32_t codes[EBPO_PLANES_STORED];
    int planes = 0;
    if (e->s->out[cell.level].level.gray_count % EBPO_ITEMS_SCATTERED == 0)
        ebpo_release_pages(b->workspace);
    if (b->options->parts & EBPO_PART_PLANES)
        planes = ebpo_gray_planes(b, e->scratch->envelope, e->s, node->detail, cell, winding,
                                  envelope, codes);
    if (planes < 0 || !ebpo_piece_level_add_gray(&e->s->out[cell.level], codes, planes,
                                                 ebpo_polytope_volume(envelope) *
                                                     ebpo_cell_volume(&b->box, cell.level)))
        return false;
    int32_t offset[8];
    ebpo_child_windings(b, e->s, node->child, offset);
    uint16_t types = 0;
    for (uint32_t o = 0; o < 8; o++) {
        ebpo_node_type type = e->s->nodes[node->child + o].type;
        if (type == EBPO_WHITE && b->solid &&
            ebpo_rule_inside(b->options->rule, winding + offset[o]))
            type = EBPO_BLACK;
        types |= ebpo_group_of(type, o);
    }
    if (!ebpo_piece_level_add_group(&e->s->out[cell.level + 1], types))
        return false;
    return emit_children(e, node->child, cell, winding, offset, envelope);
}

static bool emit(emitter *e, uint32_t index, ebpo_cell cell, int32_t winding,
                 ebpo_polytope *envelope)
{
    ebpo_build_node node = e->s->nodes[index];
    switch (node.type) {
    case EBPO_LEAF: return emit_leaf(e, node.detail, cell, winding, envelope);
    case EBPO_GRAY: return emit_gray(e, &node, cell, winding, envelope);
    default: return emit_empty(e, cell, winding);
    }
}

ebpo_status ebpo_emit_piece(const ebpo_builder *b, ebpo_emit_scratch *scratch, ebpo_branch *s,
                            ebpo_error *error)
{
    emitter e = { b, s, scratch };
    s->out = ebpo_array_zero(b->workspace, EBPO_LEVELS_MAX, sizeof *s->out);
    for (int level = 0; s->out && level < EBPO_LEVELS_MAX; level++)
        s->out[level].level.workspace = b->workspace;
    if (!s->out || !emit(&e, 0, s->cell, s->winding, s->above))
        return ebpo_workspace_fail_while(b->workspace, "while computing envelopes", error);
    return EBPO_OK;
}
