/* All stretches of level arrays joined in depth-first order, which is octcode order in each level.
 */
#include "construct/join_levels.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "construct/construct_top.h"
#include "construct/corner_windings.h"
#include "construct/pack.h"
#include "construct/piece_levels.h"
#include "geometry/node_types.h"

typedef struct joiner {
    ebpo_builder *b;
    ebpo_piece_level **stretch; /* depth first: pieces of the top and whole subtrees by turns */
    uint64_t count, capacity;
    ebpo_piece_level *current;
    ebpo_level *level; /* what comes out */
} joiner;

static const char stage[] = "joining levels";

static ebpo_status no_memory(const ebpo_builder *b, ebpo_error *error)
{
    return ebpo_workspace_fail_while(b->workspace, "while joining levels", error);
}

static bool push(joiner *j, ebpo_piece_level *out)
{
    if (!ebpo_grow(&j->stretch, &j->capacity, j->count + 1, sizeof *j->stretch))
        return false;
    j->stretch[j->count++] = out;
    return true;
}

static ebpo_piece_level *current(joiner *j)
{
    if (j->current)
        return j->current;
    ebpo_piece_level *out = ebpo_array_zero(j->b->workspace, EBPO_LEVELS_MAX, sizeof *out);
    if (!out || !push(j, out)) {
        ebpo_array_free(j->b->workspace, out);
        return NULL;
    }
    for (int level = 0; level < EBPO_LEVELS_MAX; level++)
        out[level].level.workspace = j->b->workspace;
    return j->current = out;
}

static ebpo_node_type type_of(const ebpo_builder *b, const ebpo_build_node *n, int32_t winding)
{
    ebpo_node_type type = n->type == EBPO_LEAF ? b->sub[n->detail].root_type : n->type;
    if (type == EBPO_WHITE && b->solid && ebpo_rule_inside(b->options->rule, winding))
        return EBPO_BLACK;
    return type;
}

static bool walk(joiner *j, uint32_t index, ebpo_cell cell, int32_t winding)
{
    ebpo_builder *b = j->b;
    ebpo_build_node node = b->top.nodes[index];
    if (node.type == EBPO_LEAF) {
        ebpo_piece_level *out = b->sub[node.detail].out;
        b->sub[node.detail].out = NULL;
        if (!push(j, out)) {
            ebpo_piece_levels_free(out);
            return false;
        }
        j->current = NULL;
        return true;
    }
    ebpo_piece_level *out = current(j);
    if (!out)
        return false;
    if (node.type == EBPO_WHITE)
        return ebpo_piece_level_add_empty(&out[cell.level],
                                          b->solid && ebpo_rule_inside(b->options->rule, winding),
                                          winding);
    const ebpo_top_envelope *t = &b->top_envelope[node.detail];
    int32_t offset[8];
    ebpo_child_windings(b, &b->top, node.child, offset);
    uint16_t types = 0;
    for (uint32_t o = 0; o < 8; o++)
        types |= ebpo_group_of(type_of(b, &b->top.nodes[node.child + o], winding + offset[o]), o);
    if (!ebpo_piece_level_add_gray(&out[cell.level], t->codes, t->count, t->volume) ||
        !ebpo_piece_level_add_group(&out[cell.level + 1], types))
        return false;
    for (uint32_t o = 0; o < 8; o++)
        if (!walk(j, node.child + o, ebpo_cell_child(cell, o), winding + offset[o]))
            return false;
    return true;
}

static void add_counts(const joiner *j, int level, int per)
{
    uint64_t total = 0;
    for (uint64_t i = 0; i < j->count; i++)
        total += ebpo_level_count(&j->stretch[i][level].level, (ebpo_per)per);
    ebpo_level_set_count(&j->level[level], (ebpo_per)per, total);
}

static bool any_has(const joiner *j, int level, int id)
{
    for (uint64_t i = 0; i < j->count; i++)
        if (ebpo_level_array(&j->stretch[i][level].level, id))
            return true;
    return false;
}

static void fill_usual(const joiner *j, char *to, uint64_t bytes, int id)
{
    int64_t usual = ebpo_schema[id].usual; /* files are little-endian, and so are we */
    EBPO_FOR_ITEMS(j->b->workspace, i, 0, bytes / ebpo_schema[id].held_size)
        memcpy(to + i * ebpo_schema[id].held_size, &usual, ebpo_schema[id].held_size);
}

/* An array that none of the stretches has stays away. */
static bool join_array(const joiner *j, int level, int id, ebpo_level *out)
{
    uint64_t total = ebpo_level_rows(out, id), size = ebpo_schema[id].held_size;
    if (!total || !any_has(j, level, id))
        return true;
    char *to = ebpo_array_alloc(j->b->workspace, total, size);
    if (!to)
        return false;
    ebpo_level_set_array(out, id, to);
    EBPO_FOR_ITEMS_EVERY(j->b->workspace, 1, i, 0, j->count) {
        ebpo_level *from = &j->stretch[i][level].level;
        void *array = ebpo_level_array(from, id);
        size_t bytes = (size_t)(ebpo_level_rows(from, id) * size);
        if (array)
            ebpo_array_copy(j->b->workspace, to, array, bytes);
        else /* a stretch in which all elements have the usual value */
            fill_usual(j, to, bytes, id);
        to += bytes;
        if (!j->stretch[i][level].packed)
            ebpo_array_free(j->b->workspace, array);
        ebpo_level_set_array(from, id, NULL);
    }
    return true;
}

static int compare_numbers(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

static void sort_numbers(uint32_t *a, uint64_t n)
{
    if (n > 32) {
        qsort(a, n, sizeof *a, compare_numbers);
        return;
    }
    for (uint64_t i = 1; i < n; i++) {
        uint32_t v = a[i];
        uint64_t j = i;
        for (; j > 0 && a[j - 1] > v; j--)
            a[j] = a[j - 1];
        a[j] = v;
    }
}

enum { LEAF_GRAIN = 1 << 13 };

typedef struct numbering {
    const ebpo_builder *b;
    ebpo_level *level;
    uint64_t *first; /* of each block of leaves: its start in leaf_refs */
} numbering;

/* Leaves refer to faces by their numbers along the curve, as other pieces' final ones were not
 * known: now they are. */
static ebpo_status number_block(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                ebpo_error *error)
{
    numbering *n = context;
    ebpo_level *l = n->level;
    uint32_t *refs = l->leaf_refs + n->first[begin / LEAF_GRAIN];
    (void)worker, (void)error;
    EBPO_FOR_ITEMS_SCATTERED(n->b->workspace, i, begin, end) {
        for (uint32_t k = 0; k < l->leaf_ref_count[i]; k++)
            refs[k] = n->b->number[refs[k]];
        sort_numbers(refs, l->leaf_ref_count[i]);
        refs += l->leaf_ref_count[i];
    }
    return EBPO_OK;
}

/* `all`: references of all levels, of which `before` have been numbered. */
static ebpo_status number_refs(const ebpo_builder *b, ebpo_level *l, uint64_t before, uint64_t all,
                               ebpo_error *error)
{
    if (!l->ref_count)
        return EBPO_OK;
    numbering n = { b, l, ebpo_alloc(l->leaf_count / LEAF_GRAIN + 1, sizeof *n.first) };
    if (!n.first)
        return no_memory(b, error);
    uint64_t refs = 0;
    EBPO_FOR_ITEMS(b->workspace, i, 0, l->leaf_count) {
        if (i % LEAF_GRAIN == 0)
            n.first[i / LEAF_GRAIN] = refs;
        refs += l->leaf_ref_count[i];
    }
    ebpo_pass pass = { &b->options->progress, all + before, all + before + l->ref_count, 2 * all };
    ebpo_progress progress = ebpo_pass_progress(&pass);
    ebpo_status status = ebpo_parallel_for(b->threads, NULL, l->leaf_count, LEAF_GRAIN,
                                           number_block, &n, &progress, stage, error);
    free(n.first);
    return status;
}

/* Arrays that say only what is understood anyway, or that belong to parts that are not wanted, are
 * left out. */
static void leave_out(const ebpo_builder *b, ebpo_level *l)
{
    uint32_t parts = b->options->parts;
    ebpo_level_drop(l, ~(parts | (b->solid ? EBPO_NEEDS_SOLID : 0) | EBPO_NEEDS_ALWAYS));
    for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
        if (ebpo_schema[id].if_needed && ebpo_level_is_usual(l, id)) {
            ebpo_array_free(l->workspace, ebpo_level_array(l, id));
            ebpo_level_set_array(l, id, NULL);
        }
    if (!(parts & EBPO_PART_MESH))
        l->ref_count = l->new_count = 0;
}

static ebpo_status join_arrays(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    joiner *j = context;
    (void)worker;
    for (uint64_t i = begin; i < end; i++) {
        int level = (int)(i / EBPO_LEVEL_ARRAYS), id = (int)(i % EBPO_LEVEL_ARRAYS);
        if (ebpo_schema_is_held(id) && !join_array(j, level, id, &j->level[level]))
            return no_memory(j->b, error);
    }
    return EBPO_OK;
}

/* Volumes are added in a fixed order, whatever the number of threads. */
static ebpo_status finish_level(const joiner *j, int level, uint64_t before, uint64_t all,
                                ebpo_error *error)
{
    ebpo_level *out = &j->level[level];
    for (uint64_t i = 0; i < j->count; i++) {
        const ebpo_level *l = &j->stretch[i][level].level;
        out->gray_volume += l->gray_volume;
        out->leaf_volume += l->leaf_volume;
    }
    ebpo_status status = j->b->options->parts & EBPO_PART_MESH
                             ? number_refs(j->b, out, before, all, error)
                             : EBPO_OK;
    leave_out(j->b, out);
    return status;
}

static bool root_group(joiner *j)
{
    ebpo_builder *b = j->b;
    ebpo_piece_level *first = current(j); /* never a piece's, whose arrays may be packed */
    return first &&
           ebpo_piece_level_add_group(&first[0], (uint16_t)type_of(b, &b->top.nodes[0], 0));
}

ebpo_status ebpo_build_levels(ebpo_builder *b, ebpo_tree *out, ebpo_error *error)
{
    joiner j = { .b = b, .level = out->level };
    ebpo_status status =
        root_group(&j) && walk(&j, 0, b->top.cell, 0) ? EBPO_OK : no_memory(b, error);
    uint64_t refs = 0, all = 0;
    for (int level = 0; level < EBPO_LEVELS_MAX && status == EBPO_OK; level++) {
        for (int per = 0; per <= EBPO_PER_GROUP; per++)
            add_counts(&j, level, per);
        all += out->level[level].ref_count;
    }
    ebpo_pass pass = { &b->options->progress, 0, all, 2 * all };
    ebpo_progress progress = ebpo_pass_progress(&pass);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(b->threads, NULL, EBPO_LEVELS_MAX * EBPO_LEVEL_ARRAYS, 1,
                                   join_arrays, &j, &progress, stage, error);
    for (int level = 0; level < EBPO_LEVELS_MAX && status == EBPO_OK; level++) {
        uint64_t own = out->level[level].ref_count;
        status = finish_level(&j, level, refs, all, error);
        refs += own;
        if (out->level[level].group_count)
            out->info.level_count = level + 1;
        out->info.level[level] = ebpo_level_summarise(&out->level[level], ~0u);
    }
    for (uint64_t i = 0; i < j.count; i++)
        ebpo_piece_levels_free(j.stretch[i]);
    free(j.stretch);
    ebpo_store_free(b->store);
    b->store = NULL;
    return status;
}
