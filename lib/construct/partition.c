/* Assigns faces to cells. First the root is divided into nodes with few faces. Each of these nodes
 * is the root of a piece, a subtree that one thread builds; the nodes above the pieces are the top.
 * Then the nodes of each piece are made, depth first.
 *
 * A node depends on its cell and its faces alone, and the pieces depend on the model alone, so the
 * result does not depend on the number of threads or the machine. Sources: EBP 2017, 3.3
 * (assignment of faces to leaves); BP 2008, 3.3.1 (coalescing nodes with few faces).
 *
 * Two inputs of each piece depend on other pieces, so they are computed together with the top: the
 * piece's *fresh* faces, which no earlier piece lists, and the winding numbers at the corners of
 * its root. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "construct/planes.h"
#include "construct/construct_stages.h"
#include "construct/pieces.h"
#include "construct/supports.h"
#include "construct/thesis_levels.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"
#include "core/parallel.h"
#include "geometry/ray.h"

/* --- a piece: limits and lists --- */

/* Number of faces after which pages of the workspace are released. */
enum { RELEASE_FACES = 1 << 13 };

/* Limits of the number of leaves and of the number of entries in their lists. Without limits, a
 * mesh with huge faces and a deep maximum level could list every face in millions of cells. For F
 * faces, the limits are leaves_always + leaves_per_face * F, and entries_always + entries_per_face
 * * F. */
static const uint64_t leaves_per_face = 64, leaves_always = 1 << 22, entries_per_face = 512,
                      entries_always = 1 << 26;

/* A set of faces, as a hash table. A slot is occupied if its round is equal to the set's round. So
 * increasing the set's round empties the set without clearing the slots. */
typedef struct face_set {
    struct {
        uint32_t face, round;
    } * slots;
    uint64_t mask, count; /* number of slots - 1; number of faces */
    uint32_t round;
} face_set;

/* State while the nodes of a piece are made. */
typedef struct grower {
    ebpo_builder *b;
    ebpo_branch *s;
    /* face lists of the nodes on the path from the root and of their children: indices in s->list
     */
    uint32_t *stack;
    uint64_t stack_used, stack_capacity;
    /* [face in the list of the node that is being divided] octants that the face touches, one bit
     * each */
    uint8_t *mask;
    uint64_t mask_capacity;
    ebpo_triangle *faces; /* faces of a leaf */
    uint64_t faces_capacity;
    face_set set;
    ebpo_error *error;
} grower;

/* Returns true if a criterion of the theses decides which nodes become leaves. Then each node is
 * divided first. After its children have been made, the node may become a leaf (collapse_if_few).
 */
static bool coalesces_late(const ebpo_builder *b)
{
    return b->thesis && b->thesis->coalesce != EBPO_COALESCE_DISTINCT;
}

/* Returns true if a node with `count` faces in its list is not divided. */
static bool is_leaf(const ebpo_builder *b, int level, uint64_t count)
{
    return level == b->max_level || (count <= b->options->leaf_faces && !coalesces_late(b));
}

ebpo_status ebpo_build_check_lists(uint64_t face_count, uint64_t leaves, uint64_t entries,
                                   ebpo_error *error)
{
    uint64_t max_leaves = leaves_always + leaves_per_face * face_count,
             max_entries = entries_always + entries_per_face * face_count;
    if (leaves <= max_leaves && entries <= max_entries)
        return EBPO_OK;
    return ebpo_fail(error, EBPO_E_LIMIT,
                     "the faces touch too many cells (more than %llu leaves, or more than %llu "
                     "faces in the lists of leaves): lower --max-level or raise --leaf-faces",
                     (unsigned long long)max_leaves, (unsigned long long)max_entries);
}

static ebpo_status no_memory_for_cells(ebpo_error *error)
{
    return ebpo_fail(error, EBPO_E_MEMORY, "out of memory while assigning faces to cells");
}

/* Adds to s->crossing the faces of the list that have a vertex outside the cell's range of
 * vertices. These faces cross a cell face or touch an upper cell face. Returns false when out of
 * memory. */
static bool record_crossing(const ebpo_builder *b, ebpo_branch *s, ebpo_cell cell,
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

/* Makes a leaf with the list stack[at] to stack[at + count - 1]. */
static ebpo_status grow_leaf(grower *g, ebpo_build_node *node, ebpo_cell cell, uint64_t at,
                             uint64_t count)
{
    ebpo_builder *b = g->b;
    ebpo_branch *s = g->s;
    node->type = EBPO_LEAF;
    if (!ebpo_branch_detail(g->b, s, &node->detail) ||
        !ebpo_array_grow_late(g->b->workspace, &s->entries, &s->entry_capacity,
                              s->entry_count + count, sizeof *s->entries))
        return no_memory_for_cells(g->error);
    ebpo_build_detail *d = &s->details[node->detail];
    d->entry_begin = s->entry_count;
    ebpo_array_copy(b->workspace, s->entries + s->entry_count, g->stack + at,
                    count * sizeof *g->stack);
    s->entry_count += count;
    d->entry_end = s->entry_count;
    uint64_t leaves = atomic_fetch_add(&b->leaf_count, 1) + 1,
             entries = atomic_fetch_add(&b->entry_count, count) + count;
    ebpo_status status = ebpo_build_check_lists(b->face_count, leaves, entries, g->error);
    if (status != EBPO_OK || !ebpo_build_closed(b))
        return status;
    if (!ebpo_grow(&g->faces, &g->faces_capacity,
                   count < EBPO_CORNER_FACES ? count : EBPO_CORNER_FACES, sizeof *g->faces))
        return no_memory_for_cells(g->error);
    ebpo_branch_corners(b, s, cell, g->stack + at, count, g->faces, d->delta);
    return EBPO_OK;
}

/* Splits the list stack[at] to stack[at + count - 1] of a cell into eight lists, one for each
 * octant. The lists are stored from stack[top] on. The list of octant o is stack[begin[o]] to
 * stack[begin[o + 1] - 1]. */
static ebpo_status split_list(grower *g, ebpo_cell cell, uint64_t at, uint64_t count, uint64_t top,
                              uint64_t begin[9])
{
    const ebpo_builder *b = g->b;
    if (!ebpo_array_grow_late(g->b->workspace, &g->mask, &g->mask_capacity, count, 1))
        return no_memory_for_cells(g->error);
    uint64_t sizes[8] = { 0 };
    const ebpo_sweep_cell prepared = ebpo_octants_prepare(&b->box, cell);
    EBPO_FOR_ITEMS_EVERY(b->workspace, RELEASE_FACES, i, 0, count) {
        ebpo_triangle face;
        ebpo_branch_triangle(b, g->s, g->stack[at + i], &face);
        unsigned mask = ebpo_octants_visited(&prepared, &face);
        g->mask[i] = (uint8_t)mask;
        for (int o = 0; o < 8; o++)
            sizes[o] += mask >> o & 1;
    }
    begin[0] = top;
    for (int o = 0; o < 8; o++)
        begin[o + 1] = begin[o] + sizes[o];
    if (!ebpo_array_grow_late(g->b->workspace, &g->stack, &g->stack_capacity, begin[8],
                              sizeof *g->stack))
        return no_memory_for_cells(g->error);
    uint64_t next[8];
    memcpy(next, begin, sizeof next);
    EBPO_FOR_ITEMS_EVERY(b->workspace, RELEASE_FACES, i, 0, count)
        for (unsigned mask = g->mask[i]; mask; mask &= mask - 1)
            g->stack[next[__builtin_ctz(mask)]++] = g->stack[at + i];
    return EBPO_OK;
}

/* --- coalescing nodes with few faces --- */

/* Returns the index of the face's slot, or of the slot where it can be inserted. */
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

/* Empties the set, and makes space for faces_max + 1 faces. Returns false when out of memory. */
static bool set_start(face_set *set, uint64_t faces_max)
{
    if (!set->slots || set->mask < 2 * (faces_max + 2) - 1) {
        uint64_t size = ebpo_hash_slots(2 * (faces_max + 2));
        free(set->slots);
        set->slots = ebpo_alloc_zero(size, sizeof *set->slots);
        set->mask = size - 1;
    }
    set->round++;
    set->count = 0;
    return set->slots != NULL;
}

/* Replaces a gray node by a leaf, or by an empty node, if the leaves below the node list no more
 * different faces than a leaf may list. The leaves below may list fewer faces than the node does,
 * because a face in the node's list may miss the cell by a rounding error. The node's list is
 * stack[at] to stack[at + count - 1]. */
static ebpo_status collapse_if_few(grower *g, uint32_t index, ebpo_cell cell, uint64_t at,
                                   uint64_t count)
{
    ebpo_branch *s = g->s;
    ebpo_build_node gray = s->nodes[index];
    ebpo_build_detail d = s->details[gray.detail];
    uint64_t faces_max =
        g->b->options->leaf_faces < g->b->face_count ? g->b->options->leaf_faces : g->b->face_count;
    if (coalesces_late(g->b) && !ebpo_thesis_coalesces(g->b, s, index, &faces_max))
        return EBPO_OK;
    if (!set_start(&g->set, faces_max))
        return no_memory_for_cells(g->error);
    for (uint64_t i = d.entry_begin; i < d.entry_end; i++) {
        uint64_t slot = set_slot(&g->set, s->entries[i]);
        if (g->set.slots[slot].round == g->set.round)
            continue;
        if (g->set.count++ == faces_max)
            return EBPO_OK; /* the node stays gray */
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

/* Makes the subtree of a node. The node's list is stack[at] to stack[at + count - 1]; the stack is
 * free from `top` on. */
static ebpo_status grow_node(grower *g, uint32_t index, ebpo_cell cell, uint64_t at, uint64_t count,
                             uint64_t top)
{
    ebpo_branch *s = g->s;
    if (count == 0)
        return EBPO_OK; /* the node stays white until winding numbers are known */
    if (is_leaf(g->b, cell.level, count)) {
        ebpo_build_node node = { 0 };
        ebpo_status status = grow_leaf(g, &node, cell, at, count);
        s->nodes[index] = node;
        return status;
    }
    uint64_t begin[9];
    uint32_t detail, child;
    ebpo_status status = split_list(g, cell, at, count, top, begin);
    if (status == EBPO_OK)
        status = ebpo_build_check_branch(s, g->error);
    if (status != EBPO_OK)
        return status;
    if (s->detail_count % EBPO_ITEMS_SCATTERED == 0)
        ebpo_release_pages(g->b->workspace);
    if (!ebpo_branch_detail(g->b, s, &detail) || !ebpo_branch_children(g->b, s, &child))
        return no_memory_for_cells(g->error);
    s->nodes[index] = (ebpo_build_node){ EBPO_GRAY, child, detail };
    ebpo_build_detail d = { .entry_begin = s->entry_count };
    if (!record_crossing(g->b, s, cell, g->stack + at, count, &d))
        status = no_memory_for_cells(g->error);
    for (unsigned o = 0; o < 8 && status == EBPO_OK; o++)
        status = grow_node(g, child + o, ebpo_cell_child(cell, o), begin[o],
                           begin[o + 1] - begin[o], begin[8]);
    if (status != EBPO_OK)
        return status;
    d.entry_end = s->entry_count;
    if (ebpo_build_closed(g->b))
        ebpo_gather_delta(g->b, s, cell, child, d.delta);
    s->details[detail] = d;
    return collapse_if_few(g, index, cell, at, count);
}

/* Makes the nodes of a piece from the faces in its list. */
static ebpo_status grow_from_list(grower *g)
{
    ebpo_branch *s = g->s;
    if (!ebpo_array_grow_late(g->b->workspace, &g->stack, &g->stack_capacity, s->list_count,
                              sizeof *g->stack) ||
        !ebpo_array_grow_late(g->b->workspace, &s->nodes, &s->node_capacity, 1, sizeof *s->nodes))
        return no_memory_for_cells(g->error);
    for (uint64_t i = 0; i < s->list_count; i++)
        g->stack[i] = (uint32_t)i;
    memset(&s->nodes[0], 0, sizeof s->nodes[0]);
    s->node_count = 1;
    return grow_node(g, 0, s->cell, 0, s->list_count, s->list_count);
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

/* --- the top of the tree --- */

/* PIECE_FACES: maximum number of faces of a piece, if about PIECES_MAX pieces suffice for the
 * model; otherwise the maximum is larger. SPLIT_GRAIN: number of faces of a parallel task. */
enum { PIECE_FACES = 4096, PIECES_MAX = 2048, SPLIT_GRAIN = 1 << 13 };

static ebpo_status no_memory_for_pieces(const ebpo_builder *b, ebpo_error *error)
{
    return ebpo_workspace_fail_while(b->workspace, "while cutting the tree into pieces", error);
}

/* Data for dividing a node of the top. First each block of SPLIT_GRAIN faces is classified
 * (make_masks), then its faces are copied to the children's lists (distribute_faces). The blocks of
 * one step are processed in parallel. */
typedef struct top_split {
    const ebpo_builder *b;
    ebpo_cell cell;
    const uint32_t *list;
    uint64_t count;
    uint64_t first_vertex, end_vertex; /* range of the vertices in the cell */
    /* [face of the list] bits 0 to 7: octants that the face touches; bit 8: the face has a vertex
     * outside the cell's range of vertices ("crossing") */
    uint16_t *mask;
    /* [block][bit of `mask`] before add_up: the number of the block's faces with this bit;
     * afterwards: the index in to[bit] of the block's next face */
    uint64_t (*begin)[9];
    uint32_t *to[9]; /* [bit of `mask`] the list that gets the faces */
} top_split;

/* Returns a mask of the octants that the face touches. If several octants are possible, an exact
 * test decides. Without this test, a piece could list a face that misses the piece's cell by a
 * rounding error; no leaf of the piece would list this face. */
static unsigned octants_exactly(const ebpo_builder *b, ebpo_cell cell,
                                const ebpo_sweep_cell *prepared, const ebpo_triangle *face)
{
    unsigned mask = ebpo_octants_visited(prepared, face);
    if ((mask & (mask - 1)) == 0)
        return mask;
    for (unsigned octant = 0; octant < 8; octant++) {
        if (!(mask >> octant & 1))
            continue;
        double low[3], high[3];
        ebpo_cell child = ebpo_cell_child(cell, octant);
        for (int k = 0; k < 3; k++) {
            low[k] = ebpo_cell_face(&b->box, k, child.level, child.at[k]);
            high[k] = ebpo_cell_face(&b->box, k, child.level, child.at[k] + 1);
        }
        if (!ebpo_triangle_intersects_box(face->corner, low, high))
            mask &= ~(1u << octant);
    }
    return mask;
}

/* Sets the masks of a block's faces, and counts the faces with each bit. */
static ebpo_status make_masks(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    top_split *t = context;
    const ebpo_builder *b = t->b;
    uint64_t inside = t->end_vertex - t->first_vertex, *sizes = t->begin[begin / SPLIT_GRAIN];
    const ebpo_sweep_cell prepared = ebpo_octants_prepare(&b->box, t->cell);
    (void)worker, (void)error;
    memset(sizes, 0, sizeof t->begin[0]);
    EBPO_FOR_ITEMS_SCATTERED(b->workspace, i, begin, end) {
        ebpo_triangle face;
        ebpo_build_triangle(b, t->list[i], &face);
        const uint32_t *f = b->face[t->list[i]];
        bool within = f[0] - t->first_vertex < inside && f[1] - t->first_vertex < inside &&
                      f[2] - t->first_vertex < inside;
        unsigned mask = octants_exactly(b, t->cell, &prepared, &face) | (unsigned)!within << 8;
        t->mask[i] = (uint16_t)mask;
        for (; mask; mask &= mask - 1)
            sizes[__builtin_ctz(mask)]++;
    }
    return EBPO_OK;
}

/* Copies a block's faces to the lists of their bits. */
static ebpo_status distribute_faces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                    ebpo_error *error)
{
    top_split *t = context;
    uint64_t *next = t->begin[begin / SPLIT_GRAIN];
    (void)worker, (void)error;
    for (uint64_t i = begin; i < end; i++)
        for (unsigned mask = t->mask[i]; mask; mask &= mask - 1) {
            int bit = __builtin_ctz(mask);
            t->to[bit][next[bit]++] = t->list[i];
        }
    return EBPO_OK;
}

/* Returns the number of different faces that the pieces list so far. */
static uint64_t faces_done(const ebpo_builder *b)
{
    const ebpo_branch *last = b->piece_count ? &b->piece[b->piece_count - 1] : NULL;
    return last ? last->first + last->fresh_count : 0;
}

/* Replaces, for each block and bit, the number of faces by the index in to[bit] of the block's
 * first face. Sets `sizes` to the lengths of the lists to[0] to to[8]. */
static void add_up(top_split *t, uint64_t sizes[9])
{
    memset(sizes, 0, 9 * sizeof *sizes);
    for (uint64_t block = 0; block * SPLIT_GRAIN < t->count; block++)
        for (int bit = 0; bit < 9; bit++) {
            uint64_t faces = t->begin[block][bit];
            t->begin[block][bit] = sizes[bit];
            sizes[bit] += faces;
        }
}

/* Allocates the children's lists, and extends the top's list of crossing faces. */
static ebpo_status reserve_space(ebpo_builder *b, top_split *t, uint32_t *lists[8],
                                 uint64_t sizes[9], ebpo_error *error)
{
    ebpo_branch *s = &b->top;
    for (unsigned o = 0; o < 8; o++)
        if (!(t->to[o] = lists[o] = ebpo_array_alloc(b->workspace, sizes[o], sizeof *lists[o])))
            return no_memory_for_pieces(b, error);
    if (!ebpo_array_grow_late(b->workspace, &s->crossing, &s->cross_capacity,
                              s->cross_count + sizes[8], sizeof *s->crossing))
        return no_memory_for_pieces(b, error);
    /* `crossing` is NULL until a face crosses */
    t->to[8] = s->crossing ? s->crossing + s->cross_count : NULL;
    s->cross_count += sizes[8];
    return EBPO_OK;
}

/* Splits the list of a node of the top into the lists of its eight children, and adds crossing
 * faces to the top's list. `sizes`: lengths of the lists, and number of crossing faces. */
static ebpo_status split_top(ebpo_builder *b, ebpo_cell cell, const uint32_t *list, uint64_t count,
                             uint32_t *lists[8], uint64_t sizes[9], ebpo_error *error)
{
    /* the reported progress does not change while this node is divided; the reports only allow the
     * caller to cancel */
    uint64_t done = faces_done(b);
    ebpo_pass pass = { &b->options->progress, done, done, b->face_count };
    ebpo_progress progress = ebpo_pass_progress(&pass);
    top_split t = { .b = b,
                    .cell = cell,
                    .list = list,
                    .count = count,
                    .mask = ebpo_array_alloc(b->workspace, count, sizeof *t.mask),
                    .begin = ebpo_alloc(count / SPLIT_GRAIN + 1, sizeof *t.begin) };
    ebpo_build_vertex_range(b, cell, &t.first_vertex, &t.end_vertex);
    ebpo_status status = t.mask && t.begin ? EBPO_OK : no_memory_for_pieces(b, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(b->threads, b->workspace, count, SPLIT_GRAIN, make_masks, &t,
                                   &progress, "cutting into pieces", error);
    if (status == EBPO_OK) {
        add_up(&t, sizes);
        status = reserve_space(b, &t, lists, sizes, error);
    }
    if (status == EBPO_OK)
        status = ebpo_parallel_for(b->threads, b->workspace, count, SPLIT_GRAIN, distribute_faces,
                                   &t, &progress, "cutting into pieces", error);
    ebpo_array_free(b->workspace, t.mask);
    free(t.begin);
    return status;
}

/* Marks the fresh faces of a piece, and adds the piece's faces to `listed`. Fresh faces are faces
 * that no earlier piece lists. `listed`: bit f is set if an earlier piece lists face f. Returns
 * false when out of memory. */
static bool mark_fresh(ebpo_builder *b, ebpo_branch *s, uint8_t *listed)
{
    s->fresh = ebpo_alloc_zero(s->list_count / 8 + 1, 1);
    if (!s->fresh)
        return false;
    s->first = b->piece_count
                   ? b->piece[b->piece_count - 1].first + b->piece[b->piece_count - 1].fresh_count
                   : 0;
    EBPO_FOR_ITEMS(b->workspace, i, 0, s->list_count) {
        uint32_t f = s->list[i];
        unsigned before = listed[f / 8] >> f % 8 & 1;
        listed[f / 8] |= (uint8_t)(1u << f % 8);
        s->fresh[i / 8] |= (uint8_t)(!before << i % 8);
        s->fresh_count += !before;
    }
    return true;
}

/* State while the tree is divided into pieces. */
typedef struct cutting {
    ebpo_builder *b;
    uint64_t piece_faces; /* a node with at most this number of faces becomes a piece */
    uint8_t *listed;      /* bit f: a piece lists face f */
    uint64_t entries;     /* number of entries in the lists of all pieces so far */
    ebpo_error *error;
} cutting;

/* Adds a piece; takes over `list`. A piece has at least one leaf, and its leaves list all of its
 * faces. So the function can check lower bounds of the counts of leaves and entries against the
 * limits before the piece's nodes are made. */
static ebpo_status add_piece(cutting *c, ebpo_build_node *node, ebpo_cell cell, uint32_t *list,
                             uint64_t count)
{
    ebpo_builder *b = c->b;
    ebpo_branch s = { .cell = cell, .list = list, .list_count = count, .workspace = b->workspace };
    ebpo_status status =
        ebpo_build_check_lists(b->face_count, b->piece_count + 1, c->entries += count, c->error);
    if (status == EBPO_OK &&
        (!ebpo_grow(&b->piece, &b->piece_capacity, b->piece_count + 1, sizeof *b->piece) ||
         !mark_fresh(b, &s, c->listed)))
        status = no_memory_for_pieces(b, c->error);
    if (status != EBPO_OK) {
        ebpo_array_free(b->workspace, list);
        return status;
    }
    node->type = EBPO_LEAF;
    /* fits in 32 bits: each piece has its own node in the top, and these have 32-bit indices */
    node->detail = (uint32_t)b->piece_count;
    b->piece[b->piece_count++] = s;
    return EBPO_OK;
}

/* Makes a piece of a node of the top, or divides the node; takes over `list`. */
static ebpo_status grow_top(cutting *c, uint32_t index, ebpo_cell cell, uint32_t *list,
                            uint64_t count)
{
    ebpo_builder *b = c->b;
    ebpo_branch *s = &b->top;
    if (count <= c->piece_faces || is_leaf(b, cell.level, count)) {
        ebpo_build_node node = { 0 };
        ebpo_status status = add_piece(c, &node, cell, list, count);
        s->nodes[index] = node;
        return status;
    }
    uint32_t *lists[8] = { NULL }, detail = 0, child = 0;
    uint64_t sizes[9] = { 0 }, crossing = s->cross_count;
    ebpo_status status = ebpo_build_check_branch(s, c->error);
    if (status == EBPO_OK)
        status = split_top(b, cell, list, count, lists, sizes, c->error);
    if (status == EBPO_OK &&
        (!ebpo_branch_detail(b, s, &detail) || !ebpo_branch_children(b, s, &child)))
        status = no_memory_for_pieces(b, c->error);
    if (status == EBPO_OK) {
        s->nodes[index] = (ebpo_build_node){ EBPO_GRAY, child, detail };
        s->details[detail] = (ebpo_build_detail){ .entry_begin = b->piece_count,
                                                  .cross_begin = crossing,
                                                  .cross_end = s->cross_count };
    }
    ebpo_array_free(b->workspace, list);
    for (unsigned o = 0; o < 8; o++) {
        if (status == EBPO_OK && sizes[o])
            status = grow_top(c, child + o, ebpo_cell_child(cell, o), lists[o], sizes[o]);
        else
            ebpo_array_free(b->workspace, lists[o]);
    }
    if (status == EBPO_OK)
        s->details[detail].entry_end = b->piece_count; /* in the top, entries are pieces */
    return status;
}

/* Divides the root into pieces. */
static ebpo_status cut_top(ebpo_builder *b, ebpo_error *error)
{
    uint32_t *all = ebpo_array_alloc(b->workspace, b->face_count, sizeof *all);
    cutting c = { b,
                  b->face_count / PIECES_MAX > PIECE_FACES ? b->face_count / PIECES_MAX
                                                           : PIECE_FACES,
                  ebpo_array_zero(b->workspace, b->face_count / 8 + 1, 1), 0, error };
    /* with this minimum, each node of the top has too many faces for collapse_if_few to replace it
     * by a leaf */
    if (c.piece_faces < 2 * (uint64_t)b->options->leaf_faces)
        c.piece_faces = 2 * (uint64_t)b->options->leaf_faces;
    ebpo_status status = EBPO_OK;
    if (!all || !c.listed ||
        !ebpo_array_grow_late(b->workspace, &b->top.nodes, &b->top.node_capacity, 1,
                              sizeof *b->top.nodes)) {
        ebpo_array_free(b->workspace, all);
        status = no_memory_for_pieces(b, error);
    } else {
        memset(&b->top.nodes[0], 0, sizeof b->top.nodes[0]);
        b->top.node_count = 1;
        EBPO_FOR_ITEMS(b->workspace, i, 0, b->face_count)
            all[i] = (uint32_t)i;
        status = grow_top(&c, 0, b->top.cell, all, b->face_count);
    }
    ebpo_array_free(b->workspace, c.listed);
    return status;
}

/* --- winding numbers at the corners of pieces --- */

/* Computes the corner differences of the roots of pieces. */
static ebpo_status corners_of_pieces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                     ebpo_error *error)
{
    ebpo_builder *b = context;
    (void)worker;
    ebpo_triangle *faces = ebpo_alloc(EBPO_CORNER_FACES, sizeof *faces);
    if (!faces)
        return no_memory_for_pieces(b, error);
    for (uint64_t i = begin; i < end; i++) {
        ebpo_branch *s = &b->piece[i];
        ebpo_branch_corners(b, s, s->cell, NULL, s->list_count, faces, s->root_delta);
    }
    free(faces);
    return EBPO_OK;
}

/* Limits the number of threads so that half of the memory budget is sufficient if each thread
 * processes a piece as large as the largest one. This limit is needed because a piece is processed
 * in memory, and a cell of the deepest level is not divided, however many faces it lists. */
static ebpo_status fit_largest_piece(ebpo_builder *b, ebpo_error *error)
{
    /* memory for each face of a piece, mostly for the points of a hull; measured with a million
     * faces at one vertex */
    enum { BYTES_A_FACE = 160 };
    ebpo_workspace_stats stats = EBPO_WORKSPACE_STATS_INIT;
    stats.memory = 0;
    uint64_t largest = 1;
    if (b->workspace)
        ebpo_workspace_get_stats(b->workspace, &stats);
    if (stats.memory < EBPO_WORKSPACE_MIN)
        return EBPO_OK; /* no budget, or a small budget of a test */
    for (uint64_t i = 0; i < b->piece_count; i++)
        largest = b->piece[i].list_count > largest ? b->piece[i].list_count : largest;
    uint64_t fit = stats.memory / 2 / BYTES_A_FACE / largest;
    if (fit < 1)
        return ebpo_fail(
            error, EBPO_E_LIMIT,
            "a cell of level %d, the deepest allowed level, lists %llu faces, for which half of "
            "the memory budget of %llu bytes is too small; allow more levels or more memory",
            b->max_level, (unsigned long long)largest, (unsigned long long)stats.memory);
    b->threads = b->threads < fit ? b->threads : (unsigned)fit;
    return EBPO_OK;
}

ebpo_status ebpo_build_split(ebpo_builder *b, ebpo_error *error)
{
    b->top.cell = (ebpo_cell){ 0, { 0, 0, 0 } };
    ebpo_status status = cut_top(b, error);
    if (status == EBPO_OK)
        status = fit_largest_piece(b, error);
    b->final_index = ebpo_array_alloc(b->workspace, b->face_count, sizeof *b->final_index);
    if (status == EBPO_OK && !b->final_index)
        status = no_memory_for_pieces(b, error);
    if (status == EBPO_OK)
        ebpo_array_fill(b->workspace, b->final_index, 0xff, /* EBPO_NO_INDEX */
                        b->face_count * sizeof *b->final_index);
    if (status == EBPO_OK && ebpo_build_closed(b))
        status = ebpo_parallel_for(b->threads, b->workspace, b->piece_count, 1, corners_of_pieces,
                                   b, &b->options->progress, "winding numbers", error);
    return status;
}
