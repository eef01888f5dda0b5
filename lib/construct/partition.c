/* Faces to cells: a piece becomes a subtree, depth first. What a node is depends on its cell and
 * its faces alone, so neither the pieces nor the threads show in the result. Source: EBP 2017, 3.3
 * (assignment of faces to leaves); BP 2008, 3.3.1 (coalescing). */
#include "construct/partition.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"
#include "construct/branch.h"
#include "construct/corner_windings.h"
#include "construct/vertex_bounds.h"
#include "construct/octants.h"

enum { RELEASE_FACES = 1 << 13 };

/* A mesh with huge faces and a deep maximum level would list every face in millions of cells. */
static const uint64_t leaves_per_face = 64, leaves_always = 1 << 22, entries_per_face = 512,
                      entries_always = 1 << 26;

/* Faces seen below a node; a round number saves clearing. */
typedef struct face_set {
    struct {
        uint32_t face, round;
    } * slots;
    uint64_t mask, count;
    uint32_t round;
} face_set;

typedef struct grower {
    ebpo_builder *b;
    ebpo_branch *s;
    uint32_t *stack; /* lists of the nodes on the way down, one behind the other */
    uint64_t stack_used, stack_capacity;
    uint8_t *mask;
    uint64_t mask_capacity;
    ebpo_triangle *faces; /* room for a leaf's */
    uint64_t faces_capacity;
    face_set set;
    ebpo_error *error;
} grower;

bool ebpo_build_is_leaf(const ebpo_builder *b, int level, uint64_t count)
{
    return level == b->max_level || count <= b->options->leaf_faces;
}

ebpo_status ebpo_build_check_lists(uint64_t face_count, uint64_t leaves, uint64_t entries,
                                   ebpo_error *error)
{
    uint64_t most_leaves = leaves_always + leaves_per_face * face_count,
             most_entries = entries_always + entries_per_face * face_count;
    if (leaves <= most_leaves && entries <= most_entries)
        return EBPO_OK;
    return ebpo_fail(error, EBPO_E_LIMIT,
                     "the faces touch too many cells (more than %llu leaves or %llu listed faces): "
                     "lower --max-level or raise --leaf-faces",
                     (unsigned long long)most_leaves, (unsigned long long)most_entries);
}

static ebpo_status no_memory(ebpo_error *error)
{
    return ebpo_fail(error, EBPO_E_MEMORY, "out of memory while assigning faces to cells");
}

/* Faces with a vertex outside the cell's run of vertices reach over its walls (or touch an upper
 * one). */
bool ebpo_build_crossing(const ebpo_builder *b, ebpo_branch *s, ebpo_cell cell,
                         const uint32_t *list, uint64_t count, ebpo_build_detail *detail)
{
    uint64_t begin, end;
    ebpo_build_vertex_range(b, cell, &begin, &end);
    detail->cross_begin = s->cross_count;
    EBPO_FOR_ITEMS_SCATTERED(b->workspace, i, 0, count) {
        const uint32_t *f = b->face[ebpo_branch_face(s, list[i])];
        if (f[0] - begin < end - begin && f[1] - begin < end - begin && f[2] - begin < end - begin)
            continue;
        if (!ebpo_array_grow_late(b->workspace, &s->crossing, &s->cross_capacity,
                                  s->cross_count + 1, sizeof *s->crossing))
            return false;
        s->crossing[s->cross_count++] = list[i];
    }
    detail->cross_end = s->cross_count;
    return true;
}

static ebpo_status grow_leaf(grower *g, ebpo_build_node *node, ebpo_cell cell, uint64_t at,
                             uint64_t count)
{
    ebpo_builder *b = g->b;
    ebpo_branch *s = g->s;
    node->type = EBPO_LEAF;
    if (!ebpo_branch_detail(g->b, s, &node->detail) ||
        !ebpo_array_grow_late(g->b->workspace, &s->entries, &s->entry_capacity,
                              s->entry_count + count, sizeof *s->entries))
        return no_memory(g->error);
    ebpo_build_detail *d = &s->details[node->detail];
    d->entry_begin = s->entry_count;
    ebpo_array_copy(b->workspace, s->entries + s->entry_count, g->stack + at,
                    count * sizeof *g->stack);
    s->entry_count += count;
    d->entry_end = s->entry_count;
    uint64_t leaves = atomic_fetch_add(&b->leaf_count, 1) + 1,
             entries = atomic_fetch_add(&b->entry_count, count) + count;
    ebpo_status status = ebpo_build_check_lists(b->face_count, leaves, entries, g->error);
    if (status != EBPO_OK || !b->solid)
        return status;
    if (!ebpo_grow(&g->faces, &g->faces_capacity,
                   count < EBPO_CORNER_FACES ? count : EBPO_CORNER_FACES, sizeof *g->faces))
        return no_memory(g->error);
    ebpo_branch_corners(b, s, cell, g->stack + at, count, g->faces, d->delta);
    return EBPO_OK;
}

/* Splits the list at stack[at] into eight lists at stack[top]. */
static ebpo_status split(grower *g, ebpo_cell cell, uint64_t at, uint64_t count, uint64_t top,
                         uint64_t begin[9])
{
    const ebpo_builder *b = g->b;
    if (!ebpo_array_grow_late(g->b->workspace, &g->mask, &g->mask_capacity, count, 1))
        return no_memory(g->error);
    uint64_t sizes[8] = { 0 };
    EBPO_FOR_ITEMS_EVERY(b->workspace, RELEASE_FACES, i, 0, count) {
        ebpo_triangle face;
        ebpo_branch_triangle(b, g->s, g->stack[at + i], &face);
        unsigned mask = ebpo_octants_touched(&b->box, cell, &face);
        g->mask[i] = (uint8_t)mask;
        for (int o = 0; o < 8; o++)
            sizes[o] += mask >> o & 1;
    }
    begin[0] = top;
    for (int o = 0; o < 8; o++)
        begin[o + 1] = begin[o] + sizes[o];
    if (!ebpo_array_grow_late(g->b->workspace, &g->stack, &g->stack_capacity, begin[8],
                              sizeof *g->stack))
        return no_memory(g->error);
    uint64_t next[8];
    memcpy(next, begin, sizeof next);
    EBPO_FOR_ITEMS_EVERY(b->workspace, RELEASE_FACES, i, 0, count)
        for (unsigned mask = g->mask[i]; mask; mask &= mask - 1)
            g->stack[next[__builtin_ctz(mask)]++] = g->stack[at + i];
    return EBPO_OK;
}

/* --- coalescing what turned out to be few --- */

static uint64_t set_slot(const face_set *set, uint32_t face)
{
    uint64_t at;
    EBPO_HASH_FIND(at, ebpo_hash_number(face), set->mask,
                   set->slots[at].round != set->round || set->slots[at].face == face);
    return at;
}

static bool set_has(const face_set *set, uint32_t face)
{
    return set->slots[set_slot(set, face)].round == set->round;
}

/* Room for one face more than a leaf may list. */
static bool set_start(face_set *set, uint64_t most)
{
    if (!set->slots) {
        uint64_t size = ebpo_hash_slots(2 * (most + 2));
        set->slots = ebpo_alloc_zero(size, sizeof *set->slots);
        set->mask = size - 1;
    }
    set->round++;
    set->count = 0;
    return set->slots != NULL;
}

/* A face that passes by at the distance of a rounding error may be listed here and, where cells are
 * smaller, no more. When the leaves below a gray node list no more faces than one leaf may, the
 * node is a leaf of just those; when they list none, it is empty. */
static ebpo_status collapse_if_few(grower *g, uint32_t index, ebpo_cell cell, uint64_t at,
                                   uint64_t count)
{
    ebpo_branch *s = g->s;
    ebpo_build_node gray = s->nodes[index];
    ebpo_build_detail d = s->details[gray.detail];
    uint64_t most =
        g->b->options->leaf_faces < g->b->face_count ? g->b->options->leaf_faces : g->b->face_count;
    if (!set_start(&g->set, most))
        return no_memory(g->error);
    for (uint64_t i = d.entry_begin; i < d.entry_end; i++) {
        uint64_t slot = set_slot(&g->set, s->entries[i]);
        if (g->set.slots[slot].round == g->set.round)
            continue;
        if (g->set.count++ == most)
            return EBPO_OK; /* gray it stays */
        g->set.slots[slot].face = s->entries[i];
        g->set.slots[slot].round = g->set.round;
    }
    s->node_count = gray.child;
    s->detail_count = gray.detail;
    s->entry_count = d.entry_begin;
    s->cross_count = d.cross_begin;
    uint64_t kept = 0;
    for (uint64_t i = 0; i < count; i++)
        if (set_has(&g->set, g->stack[at + i]))
            g->stack[at + kept++] = g->stack[at + i];
    ebpo_build_node node = { 0 };
    ebpo_status status = kept ? grow_leaf(g, &node, cell, at, kept) : EBPO_OK;
    s->nodes[index] = node;
    return status;
}

/* The node's list is stack[at] to stack[at + count - 1]; the stack is free from `top` on. */
static ebpo_status grow(grower *g, uint32_t index, ebpo_cell cell, uint64_t at, uint64_t count,
                        uint64_t top)
{
    ebpo_branch *s = g->s;
    if (count == 0)
        return EBPO_OK; /* stays white until the labels are known */
    if (ebpo_build_is_leaf(g->b, cell.level, count)) {
        ebpo_build_node node = { 0 };
        ebpo_status status = grow_leaf(g, &node, cell, at, count);
        s->nodes[index] = node;
        return status;
    }
    uint64_t begin[9];
    uint32_t detail, child;
    ebpo_status status = split(g, cell, at, count, top, begin);
    if (status == EBPO_OK)
        status = ebpo_build_check_branch(s, g->error);
    if (status != EBPO_OK)
        return status;
    if (s->detail_count % EBPO_ITEMS_SCATTERED == 0)
        ebpo_release_pages(g->b->workspace);
    if (!ebpo_branch_detail(g->b, s, &detail) || !ebpo_branch_children(g->b, s, &child))
        return no_memory(g->error);
    s->nodes[index] = (ebpo_build_node){ EBPO_GRAY, child, detail };
    ebpo_build_detail d = { .entry_begin = s->entry_count };
    if (!ebpo_build_crossing(g->b, s, cell, g->stack + at, count, &d))
        status = no_memory(g->error);
    for (unsigned o = 0; o < 8 && status == EBPO_OK; o++)
        status = grow(g, child + o, ebpo_cell_child(cell, o), begin[o], begin[o + 1] - begin[o],
                      begin[8]);
    if (status != EBPO_OK)
        return status;
    d.entry_end = s->entry_count;
    if (g->b->solid)
        ebpo_gather_delta(g->b, s, child, d.delta);
    s->details[detail] = d;
    return collapse_if_few(g, index, cell, at, count);
}

static ebpo_status grow_from_list(grower *g)
{
    ebpo_branch *s = g->s;
    if (!ebpo_array_grow_late(g->b->workspace, &g->stack, &g->stack_capacity, s->list_count,
                              sizeof *g->stack) ||
        !ebpo_array_grow_late(g->b->workspace, &s->nodes, &s->node_capacity, 1, sizeof *s->nodes))
        return no_memory(g->error);
    for (uint64_t i = 0; i < s->list_count; i++)
        g->stack[i] = (uint32_t)i;
    memset(&s->nodes[0], 0, sizeof s->nodes[0]);
    s->node_count = 1;
    return grow(g, 0, s->cell, 0, s->list_count, s->list_count);
}

ebpo_status ebpo_build_partition(ebpo_builder *b, ebpo_branch *s, ebpo_error *error)
{
    grower g = { .b = b, .s = s, .error = error };
    ebpo_status status = grow_from_list(&g);
    if (status == EBPO_OK)
        s->root_type = s->nodes[0].type;
    ebpo_array_free(b->workspace, g.stack);
    ebpo_array_free(b->workspace, g.mask);
    free(g.faces);
    free(g.set.slots);
    return status;
}
