/* Faces to cells. The top of the tree is split until the pieces are small enough to be worked on side by side; each piece then
 * becomes a subtree, depth first. What a node is depends on its cell and its faces alone, so neither the pieces nor the threads show in the result.
 * Source: EBP 2017, 3.3 (assignment of faces to leaves); BP 2008, 3.3.1 (coalescing). */
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/parallel.h"
#include "build/propose.h"
#include "morton/octcode.h"
#include "planes/octants.h"

/* Pieces of at most so many faces, but not more than about PIECES_MOST pieces: fixed by the model, never by the machine. */
enum { PIECE_FACES = 4096, PIECES_MOST = 2048, SPLIT_GRAIN = 1 << 13 };

/* A mesh with huge faces and a deep maximum level would list every face in millions of cells. */
static const uint64_t leaves_per_face = 64, leaves_always = 1 << 22, entries_per_face = 512, entries_always = 1 << 26;

/* Faces seen below a node; a round number saves clearing. */
typedef struct face_set {
    struct { uint32_t face, round; } *slots;
    uint64_t mask, count;
    uint32_t round;
} face_set;

typedef struct grower {
    ebpo_builder *b;
    ebpo_branch *s;
    uint32_t *stack;  /* lists of the nodes on the way down, one behind the other */
    uint64_t stack_used, stack_capacity;
    uint8_t *mask;
    uint64_t mask_capacity;
    ebpo_triangle *faces; /* of one leaf */
    uint64_t faces_capacity;
    face_set set;
    ebpo_error *error;
} grower;

void ebpo_subtree_release(ebpo_branch *s)
{
    free(s->list);
    free(s->nodes);
    free(s->details);
    free(s->entries);
    free(s->crossing);
    free(s->above);
    ebpo_proposals_free(s->proposals);
    s->proposals = NULL;
    s->list = NULL;
    s->nodes = NULL;
    s->details = NULL;
    s->entries = s->crossing = NULL;
    s->above = NULL;
}

void ebpo_branch_free(ebpo_branch *s)
{
    ebpo_subtree_release(s);
    ebpo_out_free(s->out);
    memset(s, 0, sizeof *s);
}

static bool is_leaf(const ebpo_builder *b, int level, uint64_t count)
{
    return level == b->max_level || count <= b->options->leaf_faces;
}

static ebpo_status no_memory(ebpo_error *error)
{
    return ebpo_fail(error, EBPO_E_MEMORY, "out of memory while assigning faces to cells");
}

static bool new_detail(ebpo_branch *s, uint32_t *index)
{
    if (!ebpo_grow(&s->details, &s->detail_capacity, s->detail_count + 1, sizeof *s->details))
        return false;
    memset(&s->details[s->detail_count], 0, sizeof s->details[0]);
    *index = (uint32_t)s->detail_count++;
    return true;
}

static bool new_children(ebpo_branch *s, uint32_t *first)
{
    if (!ebpo_grow(&s->nodes, &s->node_capacity, s->node_count + 8, sizeof *s->nodes))
        return false;
    *first = (uint32_t)s->node_count;
    memset(&s->nodes[s->node_count], 0, 8 * sizeof s->nodes[0]);
    s->node_count += 8;
    return true;
}

/* Faces with a vertex outside the cell's run of vertices reach over its walls (or touch an upper one). */
static ebpo_status list_crossing(const ebpo_builder *b, ebpo_branch *s, ebpo_cell cell, const uint32_t *list, uint64_t count,
                                 ebpo_build_detail *detail, ebpo_error *error)
{
    uint64_t begin, end;
    ebpo_build_vertex_range(b, cell, &begin, &end);
    detail->cross_begin = s->cross_count;
    for (uint64_t i = 0; i < count; i++) {
        const uint32_t *f = b->face[list[i]];
        if (f[0] - begin < end - begin && f[1] - begin < end - begin && f[2] - begin < end - begin)
            continue;
        if (!ebpo_grow(&s->crossing, &s->cross_capacity, s->cross_count + 1, sizeof *s->crossing))
            return no_memory(error);
        s->crossing[s->cross_count++] = list[i];
    }
    detail->cross_end = s->cross_count;
    return EBPO_OK;
}

static ebpo_status grow_leaf(grower *g, ebpo_build_node *node, ebpo_cell cell, uint64_t at, uint64_t count)
{
    ebpo_builder *b = g->b;
    ebpo_branch *s = g->s;
    node->type = EBPO_LEAF;
    if (!new_detail(s, &node->detail) || !ebpo_grow(&s->entries, &s->entry_capacity, s->entry_count + count, sizeof *s->entries))
        return no_memory(g->error);
    ebpo_build_detail *d = &s->details[node->detail];
    d->entry_begin = s->entry_count;
    memcpy(s->entries + s->entry_count, g->stack + at, (size_t)count * sizeof *g->stack);
    s->entry_count += count;
    d->entry_end = s->entry_count;
    uint64_t leaves = atomic_fetch_add(&b->leaf_count, 1) + 1, entries = atomic_fetch_add(&b->entry_count, count) + count;
    if (leaves > leaves_always + leaves_per_face * b->face_count || entries > entries_always + entries_per_face * b->face_count)
        return ebpo_fail(g->error, EBPO_E_LIMIT,
                         "the faces touch too many cells (more than %llu leaves or %llu listed faces): lower --max-level or raise --leaf-faces",
                         (unsigned long long)(leaves_always + leaves_per_face * b->face_count),
                         (unsigned long long)(entries_always + entries_per_face * b->face_count));
    if (!b->solid)
        return EBPO_OK;
    if (!ebpo_grow(&g->faces, &g->faces_capacity, count, sizeof *g->faces))
        return no_memory(g->error);
    for (uint64_t i = 0; i < count; i++)
        ebpo_build_triangle(b, g->stack[at + i], &g->faces[i]);
    ebpo_corner_windings(&b->box, cell, g->faces, count, d->delta);
    return EBPO_OK;
}

/* Splits the list at stack[at] into eight lists at stack[top]. */
static ebpo_status split(grower *g, ebpo_cell cell, uint64_t at, uint64_t count, uint64_t top, uint64_t begin[9])
{
    const ebpo_builder *b = g->b;
    if (!ebpo_grow(&g->mask, &g->mask_capacity, count, 1))
        return no_memory(g->error);
    uint64_t sizes[8] = { 0 };
    for (uint64_t i = 0; i < count; i++) {
        ebpo_triangle face;
        ebpo_build_triangle(b, g->stack[at + i], &face);
        unsigned mask = ebpo_octants_touched(&b->box, cell, &face);
        g->mask[i] = (uint8_t)mask;
        for (int o = 0; o < 8; o++)
            sizes[o] += mask >> o & 1;
    }
    begin[0] = top;
    for (int o = 0; o < 8; o++)
        begin[o + 1] = begin[o] + sizes[o];
    if (!ebpo_grow(&g->stack, &g->stack_capacity, begin[8], sizeof *g->stack))
        return no_memory(g->error);
    uint64_t next[8];
    memcpy(next, begin, sizeof next);
    for (uint64_t i = 0; i < count; i++)
        for (unsigned mask = g->mask[i]; mask; mask &= mask - 1)
            g->stack[next[__builtin_ctz(mask)]++] = g->stack[at + i];
    return EBPO_OK;
}

/* --- coalescing what turned out to be few --- */

static uint64_t set_slot(const face_set *set, uint32_t face)
{
    uint64_t slot = (face * UINT64_C(0x9e3779b97f4a7c15)) >> 32 & set->mask;
    while (set->slots[slot].round == set->round && set->slots[slot].face != face)
        slot = (slot + 1) & set->mask;
    return slot;
}

static bool set_has(const face_set *set, uint32_t face)
{
    return set->slots[set_slot(set, face)].round == set->round;
}

/* Room for one face more than a leaf may list. */
static bool set_start(face_set *set, uint64_t most)
{
    if (!set->slots) {
        uint64_t size = 8;
        while (size < 2 * (most + 2))
            size *= 2;
        set->slots = ebpo_alloc_zero(size, sizeof *set->slots);
        set->mask = size - 1;
    }
    set->round++;
    set->count = 0;
    return set->slots != NULL;
}

/* A face that passes by at the distance of a rounding error may be listed here and, where cells are smaller, no more. When the leaves
 * below a gray node list no more faces than one leaf may, the node is a leaf of just those; when they list none, it is empty. */
static ebpo_status collapse_if_few(grower *g, uint32_t index, ebpo_cell cell, uint64_t at, uint64_t count)
{
    ebpo_branch *s = g->s;
    ebpo_build_node gray = s->nodes[index];
    ebpo_build_detail d = s->details[gray.detail];
    uint64_t most = g->b->options->leaf_faces < g->b->face_count ? g->b->options->leaf_faces : g->b->face_count;
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
static ebpo_status grow(grower *g, uint32_t index, ebpo_cell cell, uint64_t at, uint64_t count, uint64_t top)
{
    ebpo_branch *s = g->s;
    if (count == 0)
        return EBPO_OK; /* stays white until the labels are known */
    if (is_leaf(g->b, cell.level, count)) {
        ebpo_build_node node = { 0 };
        ebpo_status status = grow_leaf(g, &node, cell, at, count);
        s->nodes[index] = node;
        return status;
    }
    uint64_t begin[9];
    uint32_t detail, child;
    ebpo_status status = split(g, cell, at, count, top, begin);
    if (status != EBPO_OK)
        return status;
    if (!new_detail(s, &detail) || !new_children(s, &child))
        return no_memory(g->error);
    s->nodes[index] = (ebpo_build_node){ EBPO_GRAY, child, detail };
    ebpo_build_detail d = { .entry_begin = s->entry_count };
    status = list_crossing(g->b, s, cell, g->stack + at, count, &d, g->error);
    for (unsigned o = 0; o < 8 && status == EBPO_OK; o++)
        status = grow(g, child + o, ebpo_child_cell(cell, o), begin[o], begin[o + 1] - begin[o], begin[8]);
    if (status != EBPO_OK)
        return status;
    d.entry_end = s->entry_count;
    if (g->b->solid) {
        const int32_t *child_delta[8];
        static const int32_t none[8];
        for (unsigned o = 0; o < 8; o++) {
            const ebpo_build_node *n = &s->nodes[child + o];
            child_delta[o] = n->type == EBPO_WHITE ? none : s->details[n->detail].delta;
        }
        ebpo_gather_delta(child_delta, d.delta);
    }
    s->details[detail] = d;
    return collapse_if_few(g, index, cell, at, count);
}

static ebpo_status grow_subtrees(void *context, uint64_t begin, uint64_t end, unsigned worker, ebpo_error *error)
{
    ebpo_builder *b = context;
    (void)worker;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++) {
        ebpo_branch *s = &b->sub[i];
        grower g = { .b = b, .s = s, .error = error, .stack = s->list, .stack_capacity = s->list_count };
        s->list = NULL;
        if (!ebpo_grow(&s->nodes, &s->node_capacity, 1, sizeof *s->nodes))
            status = no_memory(error);
        if (status == EBPO_OK) {
            memset(&s->nodes[0], 0, sizeof s->nodes[0]);
            s->node_count = 1;
            status = grow(&g, 0, s->cell, 0, s->list_count, s->list_count);
        }
        if (status == EBPO_OK) {
            s->root_type = s->nodes[0].type;
            if (s->root_type != EBPO_WHITE)
                memcpy(s->root_delta, s->details[s->nodes[0].detail].delta, sizeof s->root_delta);
        }
        free(g.stack);
        free(g.mask);
        free(g.faces);
        free(g.set.slots);
    }
    return status;
}

/* --- the top --- */

typedef struct top_split {
    const ebpo_builder *b;
    ebpo_cell cell;
    const uint32_t *list;
    uint8_t *mask;
} top_split;

static ebpo_status make_masks(void *context, uint64_t begin, uint64_t end, unsigned worker, ebpo_error *error)
{
    top_split *t = context;
    (void)worker, (void)error;
    for (uint64_t i = begin; i < end; i++) {
        ebpo_triangle face;
        ebpo_build_triangle(t->b, t->list[i], &face);
        t->mask[i] = (uint8_t)ebpo_octants_touched(&t->b->box, t->cell, &face);
    }
    return EBPO_OK;
}

static ebpo_status split_top(ebpo_builder *b, ebpo_cell cell, const uint32_t *list, uint64_t count, uint32_t *lists[8],
                             uint64_t sizes[8], ebpo_error *error)
{
    top_split t = { b, cell, list, ebpo_alloc(count, 1) };
    if (!t.mask)
        return no_memory(error);
    ebpo_status status = ebpo_parallel_for(b->threads, count, SPLIT_GRAIN, make_masks, &t, NULL, "", error);
    for (unsigned o = 0; o < 8 && status == EBPO_OK; o++) {
        sizes[o] = 0;
        for (uint64_t i = 0; i < count; i++)
            sizes[o] += t.mask[i] >> o & 1;
        lists[o] = ebpo_alloc(sizes[o], sizeof *lists[o]);
        if (!lists[o]) {
            status = no_memory(error);
            break;
        }
        for (uint64_t i = 0, n = 0; i < count; i++)
            if (t.mask[i] >> o & 1)
                lists[o][n++] = list[i];
    }
    free(t.mask);
    return status;
}

static ebpo_status add_subtree(ebpo_builder *b, ebpo_build_node *node, ebpo_cell cell, uint32_t *list, uint64_t count,
                               ebpo_error *error)
{
    if (!ebpo_grow(&b->sub, &b->sub_capacity, b->sub_count + 1, sizeof *b->sub)) {
        free(list);
        return no_memory(error);
    }
    node->type = EBPO_LEAF;
    node->detail = (uint32_t)b->sub_count;
    b->sub[b->sub_count++] = (ebpo_branch){ .cell = cell, .list = list, .list_count = count };
    return EBPO_OK;
}

/* Takes over `list`. */
static ebpo_status grow_top(ebpo_builder *b, uint32_t index, ebpo_cell cell, uint32_t *list, uint64_t count, uint64_t piece,
                            ebpo_error *error)
{
    ebpo_branch *s = &b->top;
    if (count <= piece || is_leaf(b, cell.level, count)) {
        ebpo_build_node node = { 0 };
        ebpo_status status = add_subtree(b, &node, cell, list, count, error);
        s->nodes[index] = node;
        return status;
    }
    uint32_t *lists[8] = { NULL }, detail = 0, child = 0;
    uint64_t sizes[8] = { 0 };
    ebpo_status status = split_top(b, cell, list, count, lists, sizes, error);
    if (status == EBPO_OK && (!new_detail(s, &detail) || !new_children(s, &child)))
        status = no_memory(error);
    if (status == EBPO_OK) {
        s->nodes[index] = (ebpo_build_node){ EBPO_GRAY, child, detail };
        ebpo_build_detail d = { .entry_begin = b->sub_count };
        status = list_crossing(b, s, cell, list, count, &d, error);
        s->details[detail] = d;
    }
    free(list);
    for (unsigned o = 0; o < 8; o++) {
        if (status == EBPO_OK && sizes[o])
            status = grow_top(b, child + o, ebpo_child_cell(cell, o), lists[o], sizes[o], piece, error);
        else
            free(lists[o]);
    }
    if (status == EBPO_OK)
        s->details[detail].entry_end = b->sub_count; /* in the top, entries are subtrees */
    return status;
}

ebpo_status ebpo_build_partition(ebpo_builder *b, ebpo_error *error)
{
    uint32_t *all = ebpo_alloc(b->face_count, sizeof *all);
    b->top.cell = (ebpo_cell){ 0, { 0, 0, 0 } };
    if (!all || !ebpo_grow(&b->top.nodes, &b->top.node_capacity, 1, sizeof *b->top.nodes)) {
        free(all);
        return no_memory(error);
    }
    memset(&b->top.nodes[0], 0, sizeof b->top.nodes[0]);
    b->top.node_count = 1;
    for (uint64_t i = 0; i < b->face_count; i++)
        all[i] = (uint32_t)i;
    uint64_t piece = b->face_count / PIECES_MOST > PIECE_FACES ? b->face_count / PIECES_MOST : PIECE_FACES;
    if (piece < 2 * (uint64_t)b->options->leaf_faces) /* so that no node of the top can turn out to be a leaf */
        piece = 2 * (uint64_t)b->options->leaf_faces;
    ebpo_status status = grow_top(b, 0, b->top.cell, all, b->face_count, piece, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(b->threads, b->sub_count, 1, grow_subtrees, b, &b->options->progress, "cells", error);
    return status;
}
