/* Computes how deep the surface of one model is in another model, which is a solid. The depth of a
 * point inside the solid is its distance from the solid's boundary. The depth of the surface is the
 * greatest depth of the surface's points inside the solid.
 *
 * A branch-and-bound search visits the cells of the surface's octree, then faces and parts of
 * faces. A ball encloses each cell, face or part; the distance of the ball's centre from the
 * solid's boundary bounds the depth of all points in the ball. A heap returns the part that may be
 * deepest. The search ends at the deadline, or when no part can be deeper than the best point by
 * more than the tolerance; lo and hi then bound the depth. The order of the search does not depend
 * on which subtrees are in memory. A search runs in one thread. Bounds: docs/develop/collision.md,
 * "Depth". */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/os.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/sort.h"
#include "core/parallel.h"
#include "extras/collide/collider.h"
#include "extras/collide/subtree_search.h"
#include "extras/collide/posed_solid.h"
#include "geometry/cells.h"
#include "geometry/distance.h"
#include "geometry/vec3.h"
#include "query/query_model.h"
#include "query/query_node.h"

/* --- the search: balls, faces and parts of faces --- */

/* A triangle that is a face or a part of a face. */
typedef struct depth_part {
    double most;         /* upper bound of the depth of the part's points */
    double corner[3][3]; /* in world coordinates */
} depth_part;

typedef struct depth_search {
    /* Input: */
    ebpo_context *surface_context; /* context of the surface's model */
    const ebpo_posing *posing;     /* posing of the surface's model */
    double
        max_coordinate; /* upper bound of the absolute values of the surface's posed coordinates */
    const ebpo_posed_solid *solid;
    ebpo_context *solid_context; /* context of the solid's model */
    double tolerance;            /* greatest allowed difference of hi and lo */
    uint64_t deadline;           /* deadline, a time of ebpo_clock; UINT64_MAX: none */
    const ebpo_progress *progress;
    /* Output: lo <= depth <= hi. */
    double lo, hi;
    /* Initially 0: */
    double dropped_max; /* greatest `most` of the parts and cells that are not searched further */
    double position_error; /* greatest distance by which rounding moves points */
    depth_part *part;      /* [count] a heap; part[0] has the greatest `most` */
    uint64_t count, capacity;
    uint64_t evaluations; /* number of points whose depth was computed */
} depth_search;

/* A ball that contains a part of the surface. */
typedef struct depth_ball {
    double radius; /* all points of the part are within this distance of the centre */
    double far;    /* at least one point of the part is within this distance of the centre;
                    * INFINITY: unknown */
    /* Output: */
    bool open;   /* the part may have the deepest point */
    double most; /* if `open`: upper bound of the depth of the part's points */
} depth_ball;

/* --- one point --- */

/* Bounds the depth of the point w in the solid by *lo .. *hi; the depth is negative outside the
 * solid. *rounding: bound of the distance of w from its exact position. */
static ebpo_status depth_at(depth_search *s, const double w[3], double *lo, double *hi,
                            double *rounding, ebpo_error *error)
{
    double p[3], uncertainty, scale = s->solid->posing.scale;
    ebpo_distance_result r;
    ebpo_unpose(s->solid, w, p, &uncertainty);
    *rounding = uncertainty * scale;
    s->evaluations++;
    ebpo_status status = ebpo_distance(s->solid_context, p, NULL, &r, error);
    if (status != EBPO_OK)
        return status;
    double size = fabs(r.distance), error_bound = 2 * uncertainty + 0x1p-50 * size;
    *hi = (size + error_bound) * scale;
    *lo = -*hi;
    if (!(size > error_bound)) /* the rounded point may be on either side of a face */
        return EBPO_OK;
    if (r.distance < 0)
        *lo = (size - error_bound) * scale;
    else
        *hi = (error_bound - size) * scale;
    return EBPO_OK;
}

/* Returns an upper bound of the depth of a triangle's points: their greatest distance from the face
 * that was nearest to the last query point. This distance bounds the depth, because a point inside
 * the solid is not deeper than its distance from any face of the solid. The distance from a face is
 * a convex function, so it is greatest at a corner of the triangle. */
static double max_at_corners(const depth_search *s, const double corner[3][3])
{
    double most = 0, p[3], uncertainty;
    for (int i = 0; i < 3; i++) {
        ebpo_distance_bounds d;
        ebpo_unpose(s->solid, corner[i], p, &uncertainty);
        ebpo_triangle_distance_bounds(p, (const double(*)[3])s->solid_context->warm_triangle, &d);
        most = fmax(most, (d.hi + 2 * uncertainty) * s->solid->posing.scale + s->position_error);
    }
    return most * (1 + 0x1p-50);
}

/* --- the heap --- */

static bool is_deeper(const depth_part *a, const depth_part *b) { return a->most > b->most; }

EBPO_HEAP(heap, depth_part, is_deeper)

/* Adds a part to the heap. Returns false if memory is short. */
static bool push_part(depth_search *s, const depth_part *part)
{
    if (!ebpo_grow(&s->part, &s->capacity, s->count + 1, sizeof *s->part))
        return false;
    heap_add(s->part, s->count++, part);
    return true;
}

/* --- parts --- */

/* Returns true if the deadline has passed. */
static bool is_search_late(const depth_search *s)
{
    return s->deadline != UINT64_MAX && ebpo_clock() >= s->deadline;
}

/* Returns true if a part or cell with the bound `most` need not be divided, and records the bound
 * in s->dropped_max. A part whose depth is uncertain only because of rounding is not divided.
 * Otherwise the search would not end if a face of the surface is on a face of the solid. */
static bool is_settled(depth_search *s, double most, double rounding)
{
    if (most > s->lo + s->tolerance + 4 * (rounding + s->position_error))
        return false;
    s->dropped_max = fmax(s->dropped_max, most);
    return true;
}

/* Returns an upper bound of the depth in a ball. hi: upper bound of the depth at the ball's centre.
 */
static double max_within(double hi, double radius)
{
    return (hi + radius) * (hi + radius > 0 ? 1 + 0x1p-50 : 1);
}

/* Computes the depth at the centre of a ball, raises s->lo if possible, and sets the output of the
 * ball. */
static ebpo_status query_ball(depth_search *s, const double centre[3], depth_ball *ball,
                              ebpo_error *error)
{
    double lo, hi, rounding;
    ball->open = false;
    if (!ebpo_posed_solid_near(s->solid, centre, ball->radius))
        return EBPO_OK;
    ebpo_status status = depth_at(s, centre, &lo, &hi, &rounding, error);
    if (status != EBPO_OK)
        return status;
    s->lo = fmax(s->lo, (lo - ball->far) * (1 - 0x1p-50) - s->position_error);
    ball->most = max_within(hi, ball->radius);
    ball->open = !is_settled(s, ball->most, rounding);
    return EBPO_OK;
}

/* Adds a part to the heap if the part may have the deepest point. `centre` is a point of the part,
 * and all points of the part are within the distance `radius` of this point. */
static ebpo_status offer_part(depth_search *s, depth_part *part, const double centre[3],
                              double radius, ebpo_error *error)
{
    double lo, hi, rounding;
    if (!ebpo_posed_solid_near(s->solid, centre, radius))
        return EBPO_OK;
    ebpo_status status = depth_at(s, centre, &lo, &hi, &rounding, error);
    if (status != EBPO_OK)
        return status;
    s->lo = fmax(s->lo, lo - s->position_error);
    part->most = max_within(hi, radius);
    if (part->most > s->lo && s->solid_context->warm)
        part->most = fmin(part->most, max_at_corners(s, (const double(*)[3])part->corner));
    if (is_settled(s, part->most, rounding))
        return EBPO_OK;
    if (!(radius > 4 * s->position_error)) { /* the part is too small to be divided */
        s->dropped_max = fmax(s->dropped_max, part->most);
        return EBPO_OK;
    }
    return push_part(s, part) ? EBPO_OK : ebpo_fail_memory(error, s->capacity * sizeof *s->part);
}

/* Adds the posed triangle a, b, c to the heap if it may have the deepest point. */
static ebpo_status offer_triangle(depth_search *s, const double a[3], const double b[3],
                                  const double c[3], ebpo_error *error)
{
    depth_part part;
    double centre[3], radius = 0;
    const double *corner[3] = { a, b, c };
    for (int k = 0; k < 3; k++)
        centre[k] = a[k] + ((b[k] - a[k]) + (c[k] - a[k])) / 3;
    for (int i = 0; i < 3; i++) {
        memcpy(part.corner[i], corner[i], sizeof part.corner[i]);
        radius = fmax(radius, ebpo_vec3_scaled_distance(corner[i], centre));
    }
    return offer_part(s, &part, centre, radius * (1 + 0x1p-50) + s->position_error, error);
}

/* Adds a posed face to the heap if it may have the deepest point. */
static ebpo_status offer_face(depth_search *s, const double corner[3][3], ebpo_error *error)
{
    return offer_triangle(s, corner[0], corner[1], corner[2], error);
}

/* Computes the middle of edge k, from corner k to the next corner. */
static void middle_of(const depth_part *p, int k, double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = p->corner[k][i] + (p->corner[(k + 1) % 3][i] - p->corner[k][i]) / 2;
}

/* Divides the triangle into two at the middle of edge k. */
static ebpo_status halve_triangle(depth_search *s, const depth_part *p, int k, ebpo_error *error)
{
    double middle[3];
    const double *opposite = p->corner[(k + 2) % 3];
    middle_of(p, k, middle);
    ebpo_status status = offer_triangle(s, p->corner[k], middle, opposite, error);
    return status == EBPO_OK ? offer_triangle(s, middle, p->corner[(k + 1) % 3], opposite, error)
                             : status;
}

/* Divides the triangle into four at the middles of its edges. Divides a long triangle into two,
 * because its quarters would be long, too, and their number would grow without limit near another
 * face. */
static ebpo_status divide_triangle(depth_search *s, const depth_part *p, ebpo_error *error)
{
    double middle[3][3], length[3];
    int longest = 0, shortest = 0;
    for (int k = 0; k < 3; k++) {
        length[k] = ebpo_vec3_scaled_distance(p->corner[k], p->corner[(k + 1) % 3]);
        longest = length[k] > length[longest] ? k : longest;
        shortest = length[k] < length[shortest] ? k : shortest;
    }
    if (length[longest] > 2 * length[shortest])
        return halve_triangle(s, p, longest, error);
    for (int k = 0; k < 3; k++)
        middle_of(p, k, middle[k]);
    ebpo_status status = offer_triangle(s, middle[0], middle[1], middle[2], error);
    for (int k = 0; k < 3 && status == EBPO_OK; k++)
        status = offer_triangle(s, p->corner[k], middle[k], middle[(k + 2) % 3], error);
    return status;
}

/* Returns true if no part in the heap is deeper than the best known depth plus the tolerance. */
static bool is_search_done(const depth_search *s)
{
    return s->count == 0 || !(s->part[0].most > s->lo + s->tolerance);
}

/* Removes the part that may be deepest from the heap, and divides it. */
static ebpo_status divide_next(depth_search *s, ebpo_error *error)
{
    depth_part part = heap_take(s->part, s->count--);
    return divide_triangle(s, &part, error);
}

/* --- cells of the octree --- */

/* Cells are visited level by level, and in each level in file order. So a subtree is loaded about
 * once for each of its levels that has open cells (cells that may contain the deepest point).
 * Neither the visited cells nor the final interval depend on which subtrees are in memory. */

typedef struct open_cell {
    ebpo_cell cell;
    double most; /* upper bound of the depth of the cell's faces */
} open_cell;

/* A face that a leaf lists. */
typedef struct listed_face {
    uint64_t index;      /* index in the file */
    double corner[3][3]; /* posed */
} listed_face;

/* The search through the levels of the surface's octree. */
typedef struct level_search {
    depth_search *s;
    ebpo_posed_subtrees at; /* model and posing of the surface; all other members are 0 */
    open_cell *open, *next; /* open cells of the current level, and of the level below it */
    uint64_t open_count, open_capacity, next_count, next_capacity;
    listed_face *face; /* [face_count] faces of leaves that wait for offer_faces */
    uint64_t face_count, face_capacity;
} level_search;

/* Faces of leaves are evaluated when the number of waiting faces is at least this. */
enum { FACES_AT_ONCE = 16384 };

/* --- faces --- */

/* Compares the indices of two faces for qsort. */
static int by_index(const void *x, const void *y)
{
    const listed_face *a = x, *b = y;
    return (a->index > b->index) - (a->index < b->index);
}

/* Adds the waiting faces to the heap if they may have the deepest point. A face that several leaves
 * list is evaluated once. */
static ebpo_status offer_faces(level_search *g, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    if (g->face_count)
        qsort(g->face, g->face_count, sizeof *g->face, by_index);
    for (uint64_t i = 0; i < g->face_count && status == EBPO_OK; i++)
        if (i == 0 || g->face[i].index != g->face[i - 1].index)
            status = offer_face(g->s, (const double(*)[3])g->face[i].corner, error);
    g->face_count = 0;
    return status;
}

/* Adds the face at a slot of a subtree to the waiting faces. Returns false if memory is short. */
static bool add_face(level_search *g, const ebpo_accel *subtree, uint32_t slot)
{
    if (!ebpo_grow(&g->face, &g->face_capacity, g->face_count + 1, sizeof *g->face))
        return false;
    listed_face *f = &g->face[g->face_count++];
    f->index = ebpo_accel_file_face(subtree, ebpo_accel_slot_face(subtree, slot));
    ebpo_posed_triangle(subtree, &g->at.posing, slot, f->corner);
    return true;
}

/* Adds the faces that a leaf lists to the waiting faces. */
static ebpo_status add_leaf(level_search *g, const ebpo_node *leaf, ebpo_error *error)
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

/* Adds a cell to the next level if it may contain the deepest point. */
static ebpo_status offer_cell(level_search *g, ebpo_cell cell, ebpo_error *error)
{
    depth_search *s = g->s;
    double corner[8][3], centre[3], diagonal = ebpo_posed_diagonal(&g->at, cell);
    depth_ball ball = { .radius = diagonal / 2 * (1 + 0x1p-17) + 2 * s->position_error,
                        .far = INFINITY };
    ebpo_posed_cell(&g->at, cell, corner);
    for (int k = 0; k < 3; k++)
        centre[k] = corner[0][k] / 2 + corner[7][k] / 2;
    if (!g->at.model->info->pruned) /* a point of a face is in the cell or close to it */
        ball.far = ball.radius + EBPO_FACE_MARGIN * diagonal;
    open_cell open = { .cell = cell };
    ebpo_status status = query_ball(s, centre, &ball, error);
    if (status != EBPO_OK || !ball.open)
        return status;
    open.most = ball.most;
    if (!ebpo_grow(&g->next, &g->next_capacity, g->next_count + 1, sizeof *g->next))
        return ebpo_fail_memory(error, (g->next_count + 1) * sizeof *g->next);
    g->next[g->next_count++] = open;
    return EBPO_OK;
}

/* Finds the node of a cell, and loads the subtrees on the path from the root to the node. */
static ebpo_status find_node(level_search *g, ebpo_cell cell, ebpo_node *out, ebpo_error *error)
{
    ebpo_context *context = g->s->surface_context;
    *out = ebpo_model_root(context->model);
    for (int level = 0;; level++) {
        ebpo_status status = EBPO_OK;
        if (ebpo_node_is_subtree_root(out) && !out->pruned)
            status = ebpo_model_enter(context, out, error);
        if (status != EBPO_OK || level == cell.level)
            return status;
        *out = ebpo_model_child(context->model, out, ebpo_cell_octant(cell, level));
    }
}

/* Adds the children of a cell to the next level, or, if the cell's node is a leaf, adds the faces
 * of the leaf to the waiting faces. */
static ebpo_status divide_cell(level_search *g, ebpo_cell cell, ebpo_error *error)
{
    ebpo_node node;
    ebpo_status status = find_node(g, cell, &node, error);
    if (status != EBPO_OK || node.pruned) /* the faces of a pruned node are not in this file */
        return status;
    if (node.type != EBPO_GRAY)
        return add_leaf(g, &node, error);
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        ebpo_node child = ebpo_model_child(g->s->surface_context->model, &node, octant);
        if (!ebpo_node_is_uniform(&child))
            status = offer_cell(g, child.cell, error);
    }
    return status;
}

/* --- levels --- */

/* Divides the open cells of the current level. Drops a cell that cannot be deeper than the best
 * point by more than the tolerance. After the deadline, drops all cells. */
static ebpo_status divide_level(level_search *g, ebpo_error *error)
{
    depth_search *s = g->s;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < g->open_count && status == EBPO_OK; i++) {
        const open_cell *c = &g->open[i];
        if (!(c->most > s->lo + s->tolerance) || is_search_late(s))
            s->dropped_max = fmax(s->dropped_max, c->most);
        else if (i % 64 == 0 && !ebpo_progress_step(s->progress, "depth", 0, 0, error))
            return EBPO_E_CANCELLED;
        else
            status = divide_cell(g, c->cell, error);
    }
    return status == EBPO_OK ? offer_faces(g, error) : status;
}

/* Makes the next level the current level, and begins an empty next level. */
static void swap_levels(level_search *g)
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

/* Visits the cells level by level, and adds to the heap all faces that may have the deepest
 * point. */
static ebpo_status offer_cells(depth_search *s, ebpo_error *error)
{
    level_search g = { .s = s, .at = { .model = s->surface_context->model, .posing = *s->posing } };
    ebpo_node root = ebpo_model_root(g.at.model);
    ebpo_status status = ebpo_node_is_uniform(&root) ? EBPO_OK : offer_cell(&g, root.cell, error);
    for (swap_levels(&g); status == EBPO_OK && g.open_count > 0; swap_levels(&g))
        status = divide_level(&g, error);
    free(g.open);
    free(g.next);
    free(g.face);
    return status;
}

/* Visits the cells, then divides the parts in the heap until the search is done or late. */
static ebpo_status search_parts(depth_search *s, ebpo_error *error)
{
    ebpo_status status = offer_cells(s, error);
    while (status == EBPO_OK && !is_search_done(s) && !is_search_late(s)) {
        if (s->evaluations % 64 == 0 && !ebpo_progress_step(s->progress, "depth", 0, 0, error))
            return EBPO_E_CANCELLED;
        status = divide_next(s, error);
    }
    return status;
}

/* Runs a search whose input has been set, and sets its output. Fails with EBPO_E_MEMORY,
 * EBPO_E_CANCELLED and the errors of ebpo_distance. */
static ebpo_status run_depth_search(depth_search *s, ebpo_error *error)
{
    s->position_error = 0x1p-46 * s->max_coordinate;
    s->lo = 0;
    ebpo_status status = search_parts(s, error);
    s->hi = fmax(s->lo, s->dropped_max);
    if (s->count > 0)
        s->hi = fmax(s->hi, s->part[0].most);
    free(s->part);
    s->part = NULL;
    return status;
}

/* --- the query --- */

/* Computes how deep the surface of one model is in the other model. solid: index of this other
 * model, 0 for the caller's A, 1 for the caller's B. */
static ebpo_status depth_in(const ebpo_collision *q, int solid, double tolerance,
                            ebpo_value_bounds *out, ebpo_error *error)
{
    ebpo_collider *c = q->collider;
    ebpo_posed_solid posed;
    const ebpo_pose *pose = solid ? &q->options.pose_b : &q->options.pose_a;
    ebpo_status status = ebpo_check_solid(c->model[solid], error);
    if (status == EBPO_OK)
        status = ebpo_posed_solid_make(&posed, c->model[solid], pose, error);
    if (status != EBPO_OK)
        return status;
    depth_search s = { .surface_context = c->context[!solid],
                       .posing = &q->posing[solid == q->swapped].posing,
                       .max_coordinate = q->max_coordinate,
                       .solid = &posed,
                       .solid_context = c->context[solid],
                       .tolerance = tolerance,
                       .deadline = q->deadline,
                       .progress = &q->options.progress };
    status = run_depth_search(&s, error);
    if (status == EBPO_OK)
        *out = ebpo_value_bounds_of(s.lo, s.hi);
    return status;
}

/* Makes the collider's contexts if they do not exist yet. */
static ebpo_status make_contexts(ebpo_collider *c, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < 2 && status == EBPO_OK; i++)
        if (!c->context[i])
            status = ebpo_context_new(c->model[i], &c->context[i], error);
    return status;
}

/* Returns the number of subtrees that the collider's contexts have loaded. */
static uint64_t subtree_loads(const ebpo_collider *c)
{
    uint64_t sum = 0;
    for (int i = 0; i < 2; i++)
        sum += c->context[i] ? c->context[i]->loaded : 0;
    return sum;
}

ebpo_status ebpo_collide_depth(ebpo_collider *c, const ebpo_collide_options *options,
                               double tolerance, ebpo_value_bounds *a_in_b,
                               ebpo_value_bounds *b_in_a, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_collision q;
    if (!(tolerance > 0 && tolerance < INFINITY))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "expected a tolerance of the depth that is greater than 0 and finite");
    ebpo_status status = ebpo_collision_begin(&q, c, options, error);
    if (status != EBPO_OK)
        return status;
    uint64_t loaded = subtree_loads(c), read = ebpo_collision_bytes_read(&q);
    status = make_contexts(c, error);
    if (status == EBPO_OK && a_in_b)
        status = depth_in(&q, 1, tolerance, a_in_b, error);
    if (status == EBPO_OK && b_in_a)
        status = depth_in(&q, 0, tolerance, b_in_a, error);
    for (int i = 0; i < 2; i++)
        ebpo_context_let_go(c->context[i]);
    c->loads += subtree_loads(c) - loaded;
    c->bytes_read += ebpo_collision_bytes_read(&q) - read;
    return status;
}
