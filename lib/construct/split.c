/* The top of the tree: cut until the pieces are small enough to be processed in parallel. That
 * depends on the model alone, never on the machine. What a piece must know of the others is
 * computed here: which of its faces no earlier piece lists, and the winding numbers at its corners.
 */
#include "core/strict_fp.h"

#include "construct/split.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "construct/branch.h"
#include "construct/corner_windings.h"
#include "construct/partition.h"
#include "construct/vertex_bounds.h"
#include "geometry/ray_triangle.h"
#include "construct/octants.h"

/* Pieces have at most this many faces, but there are no more than about PIECES_MOST pieces. */
enum { PIECE_FACES = 4096, PIECES_MOST = 2048, SPLIT_GRAIN = 1 << 13 };

static ebpo_status no_memory(const ebpo_builder *b, ebpo_error *error)
{
    return ebpo_workspace_fail_while(b->workspace, "while cutting the tree into pieces", error);
}

/* A node of the top: its faces are classified in blocks, which are then distributed to the
 * children's lists in parallel. */
typedef struct top_split {
    const ebpo_builder *b;
    ebpo_cell cell;
    const uint32_t *list;
    uint64_t count;
    uint64_t first_vertex, end_vertex; /* in the cell */
    uint16_t *mask;       /* bits 0 to 7: octants; bit 8: the face crosses the cell's walls */
    uint64_t (*begin)[9]; /* of each block: how many of each bit; then where they go */
    uint32_t *to[9];
} top_split;

/* Exact where it matters: each face that a piece lists must turn up in one of its leaves. */
static unsigned octants_exactly(const ebpo_builder *b, ebpo_cell cell, const ebpo_triangle *face)
{
    unsigned mask = ebpo_octants_touched(&b->box, cell, face);
    if ((mask & (mask - 1)) == 0)
        return mask;
    for (unsigned octant = 0; octant < 8; octant++) {
        if (!(mask >> octant & 1))
            continue;
        double low[3], high[3];
        ebpo_cell child = ebpo_cell_child(cell, octant);
        for (int k = 0; k < 3; k++) {
            low[k] = ebpo_wall(&b->box, k, child.level, child.at[k]);
            high[k] = ebpo_wall(&b->box, k, child.level, child.at[k] + 1);
        }
        if (!ebpo_triangle_meets_box(face->corner, low, high))
            mask &= ~(1u << octant);
    }
    return mask;
}

static ebpo_status make_masks(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    top_split *t = context;
    const ebpo_builder *b = t->b;
    uint64_t inside = t->end_vertex - t->first_vertex, *sizes = t->begin[begin / SPLIT_GRAIN];
    (void)worker, (void)error;
    memset(sizes, 0, sizeof t->begin[0]);
    EBPO_FOR_ITEMS_SCATTERED(b->workspace, i, begin, end) {
        ebpo_triangle face;
        ebpo_build_triangle(b, t->list[i], &face);
        const uint32_t *f = b->face[t->list[i]];
        bool within = f[0] - t->first_vertex < inside && f[1] - t->first_vertex < inside &&
                      f[2] - t->first_vertex < inside;
        unsigned mask = octants_exactly(b, t->cell, &face) | (unsigned)!within << 8;
        t->mask[i] = (uint16_t)mask;
        for (; mask; mask &= mask - 1)
            sizes[__builtin_ctz(mask)]++;
    }
    return EBPO_OK;
}

static ebpo_status hand_out(void *context, uint64_t begin, uint64_t end, unsigned worker,
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

/* Those that a piece lists already. */
static uint64_t faces_done(const ebpo_builder *b)
{
    const ebpo_branch *last = b->sub_count ? &b->sub[b->sub_count - 1] : NULL;
    return last ? last->first + last->fresh_count : 0;
}

/* Sizes of blocks to places of blocks. */
static void add_up(top_split *t, uint64_t sizes[9])
{
    memset(sizes, 0, 9 * sizeof *sizes);
    for (uint64_t block = 0; block * SPLIT_GRAIN < t->count; block++)
        for (int bit = 0; bit < 9; bit++) {
            uint64_t own = t->begin[block][bit];
            t->begin[block][bit] = sizes[bit];
            sizes[bit] += own;
        }
}

/* Those that cross the walls are appended to the top's. */
static ebpo_status make_room(ebpo_builder *b, top_split *t, uint32_t *lists[8], uint64_t sizes[9],
                             ebpo_error *error)
{
    ebpo_branch *s = &b->top;
    for (unsigned o = 0; o < 8; o++)
        if (!(t->to[o] = lists[o] = ebpo_array_alloc(b->workspace, sizes[o], sizeof *lists[o])))
            return no_memory(b, error);
    if (!ebpo_array_grow_late(b->workspace, &s->crossing, &s->cross_capacity,
                              s->cross_count + sizes[8], sizeof *s->crossing))
        return no_memory(b, error);
    /* without any, there is no array yet */
    t->to[8] = s->crossing ? s->crossing + s->cross_count : NULL;
    s->cross_count += sizes[8];
    return EBPO_OK;
}

static ebpo_status split_top(ebpo_builder *b, ebpo_cell cell, const uint32_t *list, uint64_t count,
                             uint32_t *lists[8], uint64_t sizes[9], ebpo_error *error)
{
    /* stays so for the node: asked for all the same, to be stopped */
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
    ebpo_status status = t.mask && t.begin ? EBPO_OK : no_memory(b, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(b->threads, b->workspace, count, SPLIT_GRAIN, make_masks, &t,
                                   &progress, "cutting into pieces", error);
    if (status == EBPO_OK) {
        add_up(&t, sizes);
        status = make_room(b, &t, lists, sizes, error);
    }
    if (status == EBPO_OK)
        status = ebpo_parallel_for(b->threads, b->workspace, count, SPLIT_GRAIN, hand_out, &t,
                                   &progress, "cutting into pieces", error);
    ebpo_array_free(b->workspace, t.mask);
    free(t.begin);
    return status;
}

/* Those of the piece's faces that no piece before it lists. */
static bool mark_fresh(ebpo_builder *b, ebpo_branch *s, uint8_t *listed)
{
    s->fresh = ebpo_alloc_zero(s->list_count / 8 + 1, 1);
    if (!s->fresh)
        return false;
    s->first =
        b->sub_count ? b->sub[b->sub_count - 1].first + b->sub[b->sub_count - 1].fresh_count : 0;
    EBPO_FOR_ITEMS(b->workspace, i, 0, s->list_count) {
        uint32_t f = s->list[i];
        unsigned before = listed[f / 8] >> f % 8 & 1;
        listed[f / 8] |= (uint8_t)(1u << f % 8);
        s->fresh[i / 8] |= (uint8_t)(!before << i % 8);
        s->fresh_count += !before;
    }
    return true;
}

typedef struct cutting {
    ebpo_builder *b;
    uint64_t piece;
    uint8_t *listed;  /* bit f: a piece lists face f */
    uint64_t entries; /* of the pieces' lists */
    ebpo_error *error;
} cutting;

/* Takes over `list`. A piece has a leaf at least, and its leaves list all of its faces: what is too
 * much for them is too much here, and found out before it is made. */
static ebpo_status add_piece(cutting *c, ebpo_build_node *node, ebpo_cell cell, uint32_t *list,
                             uint64_t count)
{
    ebpo_builder *b = c->b;
    ebpo_branch s = { .cell = cell, .list = list, .list_count = count, .workspace = b->workspace };
    ebpo_status status =
        ebpo_build_check_lists(b->face_count, b->sub_count + 1, c->entries += count, c->error);
    if (status == EBPO_OK &&
        (!ebpo_grow(&b->sub, &b->sub_capacity, b->sub_count + 1, sizeof *b->sub) ||
         !mark_fresh(b, &s, c->listed)))
        status = no_memory(b, c->error);
    if (status != EBPO_OK) {
        ebpo_array_free(b->workspace, list);
        return status;
    }
    node->type = EBPO_LEAF;
    node->detail = (uint32_t)b->sub_count; /* fewer than the top's nodes */
    b->sub[b->sub_count++] = s;
    return EBPO_OK;
}

/* Takes over `list`. */
static ebpo_status grow_top(cutting *c, uint32_t index, ebpo_cell cell, uint32_t *list,
                            uint64_t count)
{
    ebpo_builder *b = c->b;
    ebpo_branch *s = &b->top;
    if (count <= c->piece || ebpo_build_is_leaf(b, cell.level, count)) {
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
        status = no_memory(b, c->error);
    if (status == EBPO_OK) {
        s->nodes[index] = (ebpo_build_node){ EBPO_GRAY, child, detail };
        s->details[detail] = (ebpo_build_detail){ .entry_begin = b->sub_count,
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
        s->details[detail].entry_end = b->sub_count; /* in the top, entries are pieces */
    return status;
}

static ebpo_status cut(ebpo_builder *b, ebpo_error *error)
{
    uint32_t *all = ebpo_array_alloc(b->workspace, b->face_count, sizeof *all);
    cutting c = { b,
                  b->face_count / PIECES_MOST > PIECE_FACES ? b->face_count / PIECES_MOST
                                                            : PIECE_FACES,
                  ebpo_array_zero(b->workspace, b->face_count / 8 + 1, 1), 0, error };
    if (c.piece < 2 * (uint64_t)b->options
                          ->leaf_faces) /* so that no node of the top can turn out to be a leaf */
        c.piece = 2 * (uint64_t)b->options->leaf_faces;
    ebpo_status status = EBPO_OK;
    if (!all || !c.listed ||
        !ebpo_array_grow_late(b->workspace, &b->top.nodes, &b->top.node_capacity, 1,
                              sizeof *b->top.nodes)) {
        ebpo_array_free(b->workspace, all);
        status = no_memory(b, error);
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

/* --- corners --- */

static ebpo_status corners_of_pieces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                     ebpo_error *error)
{
    ebpo_builder *b = context;
    (void)worker;
    ebpo_triangle *faces = ebpo_alloc(EBPO_CORNER_FACES, sizeof *faces);
    if (!faces)
        return no_memory(b, error);
    for (uint64_t i = begin; i < end; i++) {
        ebpo_branch *s = &b->sub[i];
        ebpo_branch_corners(b, s, s->cell, NULL, s->list_count, faces, s->root_delta);
    }
    free(faces);
    return EBPO_OK;
}

/* A piece is processed in its thread's own memory, and cells of the deepest level are not cut,
 * however many faces they list: so no more threads than fit into half of the budget. */
static ebpo_status fit_largest_piece(ebpo_builder *b, ebpo_error *error)
{
    /* points that a hull is made of; measured: a million faces at one vertex */
    enum { BYTES_A_FACE = 160 };
    ebpo_workspace_stats figures = EBPO_WORKSPACE_STATS_INIT;
    figures.memory = 0;
    uint64_t most = 1;
    if (b->workspace)
        ebpo_workspace_get_stats(b->workspace, &figures);
    if (figures.memory < EBPO_WORKSPACE_MIN)
        return EBPO_OK; /* none, or a test's */
    for (uint64_t i = 0; i < b->sub_count; i++)
        most = b->sub[i].list_count > most ? b->sub[i].list_count : most;
    uint64_t fit = figures.memory / 2 / BYTES_A_FACE / most;
    if (fit < 1)
        return ebpo_fail(
            error, EBPO_E_LIMIT,
            "a cell of level %d, the deepest that was allowed, lists %llu faces, for which half of "
            "the memory budget of %llu bytes is too little; allow more levels or more memory",
            b->max_level, (unsigned long long)most, (unsigned long long)figures.memory);
    b->threads = b->threads < fit ? b->threads : (unsigned)fit;
    return EBPO_OK;
}

ebpo_status ebpo_build_split(ebpo_builder *b, ebpo_error *error)
{
    b->top.cell = (ebpo_cell){ 0, { 0, 0, 0 } };
    ebpo_status status = cut(b, error);
    if (status == EBPO_OK)
        status = fit_largest_piece(b, error);
    b->number = ebpo_array_alloc(b->workspace, b->face_count, sizeof *b->number);
    if (status == EBPO_OK && !b->number)
        status = no_memory(b, error);
    if (status == EBPO_OK)
        ebpo_array_fill(b->workspace, b->number, 0xff, b->face_count * sizeof *b->number);
    if (status == EBPO_OK && b->solid)
        status = ebpo_parallel_for(b->threads, b->workspace, b->sub_count, 1, corners_of_pieces, b,
                                   &b->options->progress, "winding numbers", error);
    return status;
}
