/* All stretches of level arrays joined in depth-first order, which is octcode order in each level. */
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "build/builder.h"
#include "build/top.h"

typedef struct joiner {
    ebpo_builder *b;
    ebpo_out **stretch; /* depth first: pieces of the top and whole subtrees by turns */
    uint64_t count, capacity;
    ebpo_out *current;
} joiner;

static bool push(joiner *j, ebpo_out *out)
{
    if (!ebpo_grow(&j->stretch, &j->capacity, j->count + 1, sizeof *j->stretch))
        return false;
    j->stretch[j->count++] = out;
    return true;
}

static ebpo_out *current(joiner *j)
{
    if (j->current)
        return j->current;
    ebpo_out *out = ebpo_alloc_zero(EBPO_LEVELS_MAX, sizeof *out);
    if (!out || !push(j, out)) {
        free(out);
        return NULL;
    }
    return j->current = out;
}

static unsigned type_of(const ebpo_builder *b, const ebpo_build_node *n, int32_t winding)
{
    unsigned type = n->type == EBPO_LEAF ? b->sub[n->detail].root_type : n->type;
    if (type == EBPO_WHITE && b->solid && ebpo_rule_inside(b->options->rule, winding))
        return EBPO_BLACK;
    return type;
}

static bool walk(joiner *j, uint32_t index, ebpo_cell cell, int32_t winding)
{
    ebpo_builder *b = j->b;
    ebpo_build_node node = b->top.nodes[index];
    if (node.type == EBPO_LEAF) {
        ebpo_out *out = b->sub[node.detail].out;
        b->sub[node.detail].out = NULL;
        if (!push(j, out)) {
            ebpo_out_free(out);
            return false;
        }
        j->current = NULL;
        return true;
    }
    ebpo_out *out = current(j);
    if (!out)
        return false;
    if (node.type == EBPO_WHITE)
        return ebpo_emit_empty(&out[cell.level], b->solid && ebpo_rule_inside(b->options->rule, winding), winding);
    const ebpo_top_envelope *t = &b->top_envelope[node.detail];
    const int32_t *child_delta[8];
    int32_t offset[8];
    ebpo_child_deltas(b, &b->top, node.child, child_delta);
    ebpo_child_offsets(child_delta, offset);
    uint16_t types = 0;
    for (uint32_t o = 0; o < 8; o++)
        types |= (uint16_t)(type_of(b, &b->top.nodes[node.child + o], winding + offset[o]) << 2 * o);
    if (!ebpo_emit_gray(&out[cell.level], t->codes, t->count, t->volume) || !ebpo_emit_group(&out[cell.level + 1], types))
        return false;
    for (uint32_t o = 0; o < 8; o++)
        if (!walk(j, node.child + o, ebpo_child_cell(cell, o), winding + offset[o]))
            return false;
    return true;
}

typedef struct slice {
    size_t array, count; /* offsets in ebpo_level of the pointer and of its length */
    size_t size;
} slice;

#define SLICE(array, count, type) { offsetof(ebpo_level, array), offsetof(ebpo_level, count), sizeof(type) }
static const slice slices[] = {
    SLICE(types, group_count, uint16_t), SLICE(plane_counts, gray_count, uint8_t), SLICE(planes, plane_count, uint32_t),
    SLICE(leaf_winding, leaf_count, int32_t), SLICE(black_winding, black_count, int32_t),
    SLICE(white_winding, white_count, int32_t), SLICE(leaf_first, leaf_count, uint64_t),
    SLICE(leaf_new, leaf_count, uint32_t), SLICE(leaf_ref_count, leaf_count, uint32_t),
    SLICE(leaf_refs, ref_count, uint32_t), SLICE(leaf_plane_counts, leaf_count, uint8_t),
    SLICE(leaf_planes, leaf_plane_count, uint32_t)
};
#undef SLICE

static void *array_of(const ebpo_level *level, const slice *s)
{
    void *array;
    memcpy(&array, (const char *)level + s->array, sizeof array);
    return array;
}

static uint64_t count_of(const ebpo_level *level, const slice *s)
{
    uint64_t count;
    memcpy(&count, (const char *)level + s->count, sizeof count);
    return count;
}

static bool join_slice(const joiner *j, int level, const slice *s, ebpo_level *out)
{
    uint64_t total = 0;
    for (uint64_t i = 0; i < j->count; i++)
        total += count_of(&j->stretch[i][level].level, s);
    memcpy((char *)out + s->count, &total, sizeof total);
    if (!total)
        return true;
    char *to = ebpo_alloc(total, s->size);
    if (!to)
        return false;
    memcpy((char *)out + s->array, &to, sizeof to);
    for (uint64_t i = 0; i < j->count; i++) {
        ebpo_level *from = &j->stretch[i][level].level;
        void *array = array_of(from, s), *none = NULL;
        size_t bytes = (size_t)(count_of(from, s) * s->size);
        if (array)
            memcpy(to, array, bytes);
        to += bytes;
        free(array);
        memcpy((char *)from + s->array, &none, sizeof none);
    }
    return true;
}

/* Arrays that say only what is understood anyway are left out. */
static void drop_if_all(int32_t **array, uint64_t count, int32_t value)
{
    for (uint64_t i = 0; i < count; i++)
        if ((*array)[i] != value)
            return;
    free(*array);
    *array = NULL;
}

static void drop(void *array)
{
    void *block, *none = NULL;
    memcpy(&block, array, sizeof block);
    free(block);
    memcpy(array, &none, sizeof none);
}

static void leave_out(const ebpo_builder *b, ebpo_level *l)
{
    uint32_t parts = b->options->parts;
    drop_if_all(&l->black_winding, l->black_count, 1);
    drop_if_all(&l->white_winding, l->white_count, 0);
    if (!b->solid)
        drop(&l->leaf_winding);
    if (!(parts & EBPO_PART_LEAF_PLANES))
        drop(&l->leaf_plane_counts);
    if (!(parts & EBPO_PART_PLANES))
        drop(&l->plane_counts);
    if (parts & EBPO_PART_MESH)
        return;
    drop(&l->leaf_first);
    drop(&l->leaf_new);
    drop(&l->leaf_ref_count);
    drop(&l->leaf_refs);
    l->ref_count = l->new_count = 0;
}

static bool join_level(const joiner *j, int level, ebpo_level *out)
{
    for (size_t s = 0; s < sizeof slices / sizeof *slices; s++)
        if (!join_slice(j, level, &slices[s], out))
            return false;
    for (uint64_t i = 0; i < j->count; i++) {
        const ebpo_level *l = &j->stretch[i][level].level;
        out->gray_volume += l->gray_volume;
        out->leaf_volume += l->leaf_volume;
        out->new_count += l->new_count;
    }
    leave_out(j->b, out);
    return true;
}

static void summarise(ebpo_tree *out, int level)
{
    const ebpo_level *l = &out->level[level];
    out->info.level[level] = (ebpo_level_summary){
        .gray_count = l->gray_count, .leaf_count = l->leaf_count, .white_count = l->white_count, .black_count = l->black_count,
        .plane_count = l->plane_count, .leaf_plane_count = l->leaf_plane_count, .new_count = l->new_count,
        .ref_count = l->ref_count, .gray_volume = l->gray_volume, .leaf_volume = l->leaf_volume };
}

static bool root_group(joiner *j)
{
    ebpo_builder *b = j->b;
    ebpo_out *first = b->top.nodes[0].type == EBPO_LEAF ? b->sub[0].out : current(j);
    return first && ebpo_emit_group(&first[0], (uint16_t)type_of(b, &b->top.nodes[0], 0));
}

ebpo_status ebpo_build_levels(ebpo_builder *b, ebpo_tree *out, ebpo_error *error)
{
    joiner j = { .b = b };
    bool fine = root_group(&j) && walk(&j, 0, b->top.cell, 0);
    for (int level = 0; level < EBPO_LEVELS_MAX && fine; level++) {
        fine = join_level(&j, level, &out->level[level]);
        if (out->level[level].group_count)
            out->info.level_count = level + 1;
        summarise(out, level);
    }
    for (uint64_t i = 0; i < j.count; i++)
        ebpo_out_free(j.stretch[i]);
    free(j.stretch);
    return fine ? EBPO_OK : ebpo_fail(error, EBPO_E_MEMORY, "out of memory while joining levels");
}
