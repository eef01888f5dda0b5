/* The octree's cells are the same whatever is in memory of a model: so is every step of the search,
 * and the interval that it ends with. Level by level, and in each in the order of the file: then a
 * subtree is loaded about once for each of its levels that matter. */
#include "core/strict_fp.h"

#include "extras/collide/depth_cells.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "extras/collide/node_gaps.h"
#include "geometry/cells.h"
#include "query/query_node.h"

/* What is in a cell may be so deep. */
typedef struct open_cell {
    ebpo_cell cell;
    double most;
} open_cell;

typedef struct listed_face {
    uint64_t number; /* in the file */
    double corner[3][3];
} listed_face;

typedef struct going_down {
    ebpo_depth_search *s;
    ebpo_posed_subtrees at; /* the pose of the surface */
    open_cell *open, *next; /* of a level, and of the one below it */
    uint64_t open_count, open_capacity, next_count, next_capacity;
    listed_face *face; /* of leaves, waiting to be offered */
    uint64_t face_count, face_capacity;
} going_down;

/* So many wait at least. */
enum { FACES_AT_ONCE = 16384 };

/* --- faces --- */

static int by_number(const void *x, const void *y)
{
    const listed_face *a = x, *b = y;
    return (a->number > b->number) - (a->number < b->number);
}

/* Several leaves list one: once of those that wait. */
static ebpo_status offer_faces(going_down *g, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    if (g->face_count)
        qsort(g->face, g->face_count, sizeof *g->face, by_number);
    for (uint64_t i = 0; i < g->face_count && status == EBPO_OK; i++)
        if (i == 0 || g->face[i].number != g->face[i - 1].number)
            status = ebpo_depth_offer_face(g->s, (const double(*)[3])g->face[i].corner, error);
    g->face_count = 0;
    return status;
}

static bool add_face(going_down *g, const ebpo_accel *subtree, uint32_t slot)
{
    if (!ebpo_grow(&g->face, &g->face_capacity, g->face_count + 1, sizeof *g->face))
        return false;
    listed_face *f = &g->face[g->face_count++];
    f->number = ebpo_accel_file_face(subtree, ebpo_accel_slot_face(subtree, slot));
    ebpo_posed_triangle(subtree, &g->at.posing, slot, f->corner);
    return true;
}

static ebpo_status add_leaf(going_down *g, const ebpo_node *leaf, ebpo_error *error)
{
    const ebpo_accel *subtree = leaf->subtree;
    const ebpo_listed_block *list =
        subtree->list + subtree->leaf[ebpo_entry_value(leaf->entry)].list;
    for (uint64_t listed = 0; !(listed & EBPO_LISTED_LAST);) {
        listed = ebpo_listed(list++);
        for (unsigned lanes = ebpo_listed_lanes(listed); lanes; lanes &= lanes - 1) {
            uint32_t lane = (uint32_t)__builtin_ctz(lanes);
            if (!add_face(g, subtree, ebpo_listed_number(listed) * EBPO_BLOCK + lane))
                return ebpo_fail_memory(error, (g->face_count + 1) * sizeof *g->face);
        }
    }
    return g->face_count < FACES_AT_ONCE ? EBPO_OK : offer_faces(g, error);
}

/* --- cells --- */

static ebpo_status offer_cell(going_down *g, ebpo_cell cell, ebpo_error *error)
{
    ebpo_depth_search *s = g->s;
    double corner[8][3], middle[3], diagonal = ebpo_posed_diagonal(&g->at, cell);
    ebpo_depth_ball ball = { .radius = diagonal / 2 * (1 + 0x1p-17) + 2 * s->lost,
                             .far = INFINITY };
    ebpo_posed_cell(&g->at, cell, corner);
    for (int k = 0; k < 3; k++)
        middle[k] = corner[0][k] / 2 + corner[7][k] / 2;
    if (!g->at.model->info->pruned) /* a face has a point in the cell, or near it */
        ball.far = ball.radius + EBPO_NEAR_SHARE * diagonal;
    open_cell open = { .cell = cell };
    ebpo_status status = ebpo_depth_ask_ball(s, middle, &ball, error);
    if (status != EBPO_OK || !ball.open)
        return status;
    open.most = ball.most;
    if (!ebpo_grow(&g->next, &g->next_capacity, g->next_count + 1, sizeof *g->next))
        return ebpo_fail_memory(error, (g->next_count + 1) * sizeof *g->next);
    g->next[g->next_count++] = open;
    return EBPO_OK;
}

/* Subtrees on the way are loaded. */
static ebpo_status find_node(going_down *g, ebpo_cell cell, ebpo_node *out, ebpo_error *error)
{
    ebpo_context *context = g->s->from;
    *out = ebpo_model_root(context->model);
    for (int level = 0;; level++) {
        ebpo_status status = EBPO_OK;
        if (ebpo_node_is_below(out) && !out->pruned)
            status = ebpo_model_enter(context, out, error);
        if (status != EBPO_OK || level == cell.level)
            return status;
        *out = ebpo_model_child(context->model, out, ebpo_cell_octant(cell, level));
    }
}

static ebpo_status divide(going_down *g, ebpo_cell cell, ebpo_error *error)
{
    ebpo_node node;
    ebpo_status status = find_node(g, cell, &node, error);
    if (status != EBPO_OK || node.pruned) /* what it had is not in this file */
        return status;
    if (node.type != EBPO_GRAY)
        return add_leaf(g, &node, error);
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        ebpo_node child = ebpo_model_child(g->s->from->model, &node, octant);
        if (!ebpo_node_is_uniform(&child))
            status = offer_cell(g, child.cell, error);
    }
    return status;
}

/* --- levels --- */

static ebpo_status divide_level(going_down *g, ebpo_error *error)
{
    ebpo_depth_search *s = g->s;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < g->open_count && status == EBPO_OK; i++) {
        const open_cell *c = &g->open[i];
        if (!(c->most > s->lo + s->tolerance) || ebpo_depth_is_late(s))
            s->left = fmax(s->left, c->most);
        else if (i % 64 == 0 && !ebpo_progress_step(s->progress, "depth", 0, 0, error))
            return EBPO_E_CANCELLED;
        else
            status = divide(g, c->cell, error);
    }
    return status == EBPO_OK ? offer_faces(g, error) : status;
}

static void swap_levels(going_down *g)
{
    open_cell *open = g->open;
    uint64_t capacity = g->open_capacity;
    g->open = g->next;
    g->open_count = g->next_count;
    g->open_capacity = g->next_capacity;
    g->next = open;
    g->next_count = 0;
    g->next_capacity = capacity;
}

ebpo_status ebpo_depth_offer_cells(ebpo_depth_search *s, ebpo_error *error)
{
    going_down g = { .s = s, .at = { .model = s->from->model, .posing = *s->posing } };
    ebpo_node root = ebpo_model_root(g.at.model);
    ebpo_status status = ebpo_node_is_uniform(&root) ? EBPO_OK : offer_cell(&g, root.cell, error);
    for (swap_levels(&g); status == EBPO_OK && g.open_count > 0; swap_levels(&g))
        status = divide_level(&g, error);
    free(g.open);
    free(g.next);
    free(g.face);
    return status;
}
