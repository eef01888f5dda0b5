/* Finds the nearest face: the search in one accel (acceleration structure of a subtree, accel.h),
 * and the comparison of two faces.
 *
 * The search walks down the hierarchy over blocks of faces depth first, the nearest child first.
 * The search drops nodes that are certainly farther than the best face. Bounds of nodes and faces
 * are in single precision with bounded errors (nearest_kernels.c). The remaining faces are compared
 * by guaranteed bounds in double precision. If the bounds of two faces overlap, exact arithmetic
 * compares the faces. If several faces are equally near, the result is the face with the lowest
 * index in the file. If the point is so far from the subtree that single precision does not
 * suffice, the search uses boxes in double precision. A far point is so far from the model that its
 * distances are nearly equal as doubles. For a far point, the search compares keys in place of
 * distances: the smaller the distance, the smaller the key (point_bounds.h). One search
 * (ebpo_nearest) may visit several accels one after the other. */
#include "core/strict_fp.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/os.h"
#include "core/error.h"
#include "query/nearest.h"
#include "query/query_kernels.h"

static bool same_corner(const double a[3], const double b[3])
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

static bool is_edge(ebpo_feature feature)
{
    return feature >= EBPO_NEAR_EDGE0 && feature <= EBPO_NEAR_EDGE2;
}

/* Returns true if the nearest features (corner or edge) of both faces are the same vertex or edge,
 * so that the distances are equal. Most equal distances are of this kind. */
static bool same_feature(const double a[3][3], ebpo_feature of_a, const double b[3][3],
                         ebpo_feature of_b)
{
    if (of_a <= EBPO_NEAR_CORNER2 && of_b <= EBPO_NEAR_CORNER2)
        return same_corner(a[of_a], b[of_b]);
    if (!is_edge(of_a) || !is_edge(of_b))
        return false;
    const double *a0 = a[of_a - EBPO_NEAR_EDGE0], *a1 = a[(of_a - EBPO_NEAR_EDGE0 + 1) % 3],
                 *b0 = b[of_b - EBPO_NEAR_EDGE0], *b1 = b[(of_b - EBPO_NEAR_EDGE0 + 1) % 3];
    return (same_corner(a0, b1) && same_corner(a1, b0)) ||
           (same_corner(a0, b0) && same_corner(a1, b1));
}

int ebpo_near_compare(const double p[3], const double a[3][3], const ebpo_distance_bounds *a_bounds,
                      const double b[3][3], const ebpo_distance_bounds *b_bounds)
{
    if (a_bounds->hi < b_bounds->lo)
        return -1;
    if (a_bounds->lo > b_bounds->hi)
        return 1;
    return same_feature(a, a_bounds->feature, b, b_bounds->feature)
               ? 0
               : ebpo_triangle_distance_compare(p, a, b);
}

/* --- the search --- */

/* If a coordinate of a point in the subtree's frame (in which the subtree is about -1 .. 1) is at
 * least this value, single precision does not distinguish the distances of the subtree's faces. */
#define FAR_COORDINATE 32.0

void ebpo_nearest_begin(ebpo_nearest *n, const ebpo_model *model, const double p[3],
                        double max_distance)
{
    ebpo_box box = ebpo_model_box(model);
    memset(n, 0, sizeof *n);
    memcpy(n->p, p, sizeof n->p);
    ebpo_far_make(&n->far, &box, p);
    n->key_limit = n->far.far ? ebpo_far_limit(&n->far, max_distance) : INFINITY;
    n->limit = max_distance;
    n->upper = INFINITY;
    n->passed_over = INFINITY;
    n->block = n->first_block = EBPO_NO_BLOCK;
}

/* Makes a face the nearest face so far, and lowers the limits of the search. */
static void set_nearest_face(ebpo_nearest *n, const double triangle[3][3],
                             const ebpo_distance_bounds *bounds, const ebpo_far_keys *keys,
                             uint64_t file_face)
{
    n->found = true;
    n->bounds = *bounds;
    n->keys = *keys;
    n->key_limit = fmin(n->key_limit, keys->hi);
    n->file_face = file_face;
    memcpy(n->triangle, triangle, sizeof n->triangle);
    n->upper = fmin(n->upper, bounds->hi);
    n->limit = fmin(n->limit, bounds->hi);
}

/* Returns bounds of the face's key for a far point, otherwise -INFINITY .. INFINITY. */
static ebpo_far_keys keys_of(const ebpo_nearest *n, const double triangle[3][3])
{
    return n->far.far ? ebpo_far_face(&n->far, triangle) : (ebpo_far_keys){ -INFINITY, INFINITY };
}

/* Returns the exact sign of the face's distance minus the distance of the nearest face so far. */
static int compare_with_nearest(const ebpo_nearest *n, const double triangle[3][3],
                                const ebpo_distance_bounds *b, const ebpo_far_keys *keys)
{
    if (keys->hi < n->keys.lo)
        return -1;
    if (keys->lo > n->keys.hi)
        return 1;
    return ebpo_near_compare(n->p, triangle, b, (const double(*)[3])n->triangle, &n->bounds);
}

void ebpo_nearest_begin_with(ebpo_nearest *n, const double triangle[3][3], uint64_t file_face)
{
    ebpo_distance_bounds b;
    ebpo_far_keys keys = keys_of(n, triangle);
    ebpo_triangle_distance_bounds(n->p, (const double(*)[3])triangle, &b);
    if (b.lo <= n->limit && keys.lo <= n->key_limit)
        set_nearest_face(n, triangle, &b, &keys, file_face);
}

/* Tests a face. If the face is the nearest so far, keeps it and returns true. */
static bool try_face(ebpo_nearest *n, const ebpo_accel *s, uint32_t slot)
{
    uint32_t local = ebpo_accel_slot_face(s, slot);
    if (local == EBPO_NO_SLOT)
        return false;
    uint64_t file_face = ebpo_accel_file_face(s, local);
    if (n->found && file_face == n->file_face)
        return false;
    double triangle[3][3];
    ebpo_distance_bounds b;
    ebpo_accel_triangle(s, slot, triangle);
    ebpo_far_keys keys = keys_of(n, (const double(*)[3])triangle);
    if (keys.lo > n->key_limit)
        return false;
    ebpo_triangle_distance_bounds(n->p, (const double(*)[3])triangle, &b);
    if (b.lo > n->limit)
        return false;
    if (n->found) {
        int sign = compare_with_nearest(n, (const double(*)[3])triangle, &b, &keys);
        if (sign > 0 || (sign == 0 && file_face > n->file_face))
            return false;
    }
    set_nearest_face(n, (const double(*)[3])triangle, &b, &keys, file_face);
    return true;
}

void ebpo_nearest_leaf(ebpo_nearest *n, const ebpo_accel *s, const ebpo_accel_leaf *leaf)
{
    for (const ebpo_listed_block *at = s->list + leaf->list;; at++) {
        uint64_t listed = ebpo_listed(at);
        for (unsigned lanes = ebpo_listed_lanes(listed); lanes; lanes &= lanes - 1)
            try_face(n, s,
                     ebpo_listed_number(listed) * EBPO_BLOCK + (unsigned)__builtin_ctz(lanes));
        if (listed & EBPO_LISTED_LAST)
            return;
    }
}

/* --- near: single precision --- */

/* Converts the point for kernels. Returns false if the point is too far for single precision. */
static bool make_probe(const ebpo_accel *s, const double p[3], ebpo_probe *out)
{
    double greatest = 1;
    for (int k = 0; k < 3; k++) {
        double local = (p[k] - s->centre[k]) * s->scale;
        if (!(fabs(local) < FAR_COORDINATE))
            return false;
        greatest = fmax(greatest, fabs(local));
        out->p[k] = p[k];
        out->high[k] = (float)p[k];
        out->low[k] = (float)(p[k] - (double)out->high[k]);
        out->local[k] = (float)local;
    }
    out->scale = (float)s->scale;
    out->scale64 = s->scale;
    /* On each axis, the rounding error of `local` is at most 2^-24 times `greatest`. The error of
     * the position in space is at most 1.74 times as much. The factor is 2^-22 to include the
     * rounding of limits: docs/develop/bounds.md, "Limits of points". */
    out->error = (float)greatest * 0x1p-22f;
    return true;
}

/* Returns the search's limit of distances in the subtree's frame, rounded up. */
static float frame_limit(const ebpo_near_search *g)
{
    const ebpo_nearest *n = g->user;
    double limit = n->limit * g->probe.scale64 * (1 + 0x1p-20) + DBL_MIN;
    return limit < 0x1p60 ? (float)limit * (1 + 0x1p-20f) + FLT_MIN : 0x1p60f;
}

/* Tests all waiting candidates, beginning with the candidate that has the least lower bound. */
static void judge_waiting(ebpo_near_search *g)
{
    ebpo_nearest *n = g->user;
    ebpo_near_drop_far(g);
    while (g->count) {
        int first = 0;
        for (int i = 1; i < g->count; i++)
            first = g->waiting[i].low < g->waiting[first].low ? i : first;
        ebpo_near_candidate c = g->waiting[first];
        g->waiting[first] = g->waiting[--g->count];
        if (c.low > g->best)
            continue;
        double before = n->limit;
        if (try_face(n, g->s, c.slot)) {
            n->block = c.slot / EBPO_BLOCK;
            n->node = c.node;
        }
        if (n->limit < before) {
            float limit = frame_limit(g);
            if (limit < g->best)
                ebpo_near_set_best(g, limit);
        }
    }
}

/* Ends the search at the deadline. Lowers n->passed_over to the bounds of the nodes on the stack.
 */
static void give_up(const ebpo_near_search *g)
{
    ebpo_nearest *n = g->user;
    n->late = true;
    for (uint32_t i = 0; i < g->top; i++) {
        double lower =
            (sqrt((double)ebpo_visit_key(g->stack[i])) * (1 - 0x1p-20) - (double)g->probe.error) /
            g->probe.scale64;
        n->passed_over = fmin(n->passed_over, fmax(lower, 0));
    }
}

static bool is_search_late(ebpo_near_search *g)
{
    const ebpo_nearest *n = g->user;
    return ebpo_clock() > n->deadline;
}

/* Searches an accel that is near enough for single precision. */
static void search_near(ebpo_nearest *n, const ebpo_nearest_kernels *kernels, ebpo_near_search *g)
{
    g->user = n;
    g->judge = judge_waiting;
    g->late = n->deadline ? is_search_late : NULL;
    g->count = 0;
    g->first_block = n->first_block;
    g->first_node = n->first_node;
    ebpo_near_set_best(g, frame_limit(g));
    kernels->walk(g);
    if (g->top)
        give_up(g);
    judge_waiting(g);
}

/* --- blocks and lanes, for the searches in double precision --- */

static void try_block(ebpo_nearest *n, const ebpo_accel *s, uint32_t child)
{
    for (uint32_t lane = 0; lane < EBPO_BLOCK; lane++)
        try_face(n, s, (child & ~EBPO_IS_BLOCK) * EBPO_BLOCK + lane);
}

/* Removes the lane with the least lower bound from `lanes`, which is not empty, and returns it. */
static int remove_nearest_lane(unsigned *lanes, const double lower[8])
{
    int best = __builtin_ctz(*lanes);
    for (int lane = best + 1; lane < 8; lane++)
        if (*lanes >> lane & 1 && lower[lane] < lower[best])
            best = lane;
    *lanes &= ~(1u << best);
    return best;
}

/* --- far from the model: by keys --- */

typedef struct far_search {
    ebpo_nearest *n;
    const ebpo_accel *s;
    ebpo_far_frame frame;
} far_search;

/* Returns a bit for each child of a node whose bound is within the limit. Tests boxes first, then
 * the bounding cylinders of the remaining children, because a cylinder takes more time. */
static unsigned far_children(const far_search *g, uint32_t node, double lower[8])
{
    const ebpo_nearest *n = g->n;
    const ebpo_bound *b = &g->s->bound[node];
    unsigned lanes = 0;
    ebpo_far_boxes(&n->far, &g->frame, b, lower);
    for (int lane = 0; lane < b->count; lane++) {
        if (lower[lane] <= n->key_limit)
            lower[lane] = fmax(lower[lane], ebpo_far_cylinder(&n->far, &g->frame, b,
                                                              &g->s->cylinder[node], lane));
        lanes |= (unsigned)(lower[lane] <= n->key_limit) << lane;
    }
    return lanes;
}

/* Searches the faces below a child (node or block). */
static void search_by_keys(const far_search *g, uint32_t child)
{
    ebpo_nearest *n = g->n;
    if (child & EBPO_IS_BLOCK) {
        try_block(n, g->s, child);
        return;
    }
    double lower[8];
    unsigned lanes = far_children(g, child, lower);
    while (lanes) {
        int best = remove_nearest_lane(&lanes, lower);
        if (ebpo_nearest_is_late(n)) {
            ebpo_nearest_pass_over(n, lower[best]);
        } else if (lower[best] <= n->key_limit) {
            search_by_keys(g, g->s->bound[child].child[best]);
        }
    }
}

/* --- far from a subtree: double precision, boxes only --- */

/* Returns a lower bound of the distance to a child's box, in the model's unit. */
static double box_distance(const ebpo_accel *s, const ebpo_bound *b, int lane, const double p[3])
{
    double greatest = 0, sum = 0, d[3];
    for (int k = 0; k < 3; k++) {
        ebpo_bound_sides sides = ebpo_bound_side(b, lane, k);
        double low = s->centre[k] + sides.low / s->scale,
               high = s->centre[k] + sides.high / s->scale;
        d[k] = fmax(fmax(low - p[k], p[k] - high), 0);
        greatest = fmax(greatest, d[k]);
    }
    if (!(greatest > 0) || isinf(greatest))
        return greatest;
    for (int k = 0; k < 3; k++)
        sum += d[k] / greatest * (d[k] / greatest);
    /* On at least one axis of the subtree's frame, p is at least FAR_COORDINATE away from the
     * centre. So the rounding error of the box sides is far below 2^-40 of the distance. */
    return greatest * sqrt(sum) * (1 - 0x1p-40);
}

/* Searches the faces below a child (node or block), with boxes in double precision. */
static void search_far(ebpo_nearest *n, const ebpo_accel *s, uint32_t child)
{
    if (child & EBPO_IS_BLOCK) {
        try_block(n, s, child);
        return;
    }
    const ebpo_bound *b = &s->bound[child];
    double lower[8];
    unsigned lanes = 0;
    for (int lane = 0; lane < b->count; lane++) {
        lower[lane] = box_distance(s, b, lane, n->p);
        lanes |= 1u << lane;
    }
    while (lanes) {
        int best = remove_nearest_lane(&lanes, lower);
        if (ebpo_nearest_is_late(n)) {
            ebpo_nearest_pass_over(n, lower[best]);
        } else if (lower[best] <= n->limit) {
            search_far(n, s, b->child[best]);
        }
    }
}

void ebpo_nearest_search(ebpo_nearest *n, const ebpo_context *context, const ebpo_accel *s)
{
    ebpo_near_search g;
    g.s = s;
    if (s->bound_count == 0)
        return;
    if (n->far.far) {
        far_search far = { n, s,
                           ebpo_far_frame_of(&n->far, s->centre, s->scale, s->largest_coordinate) };
        search_by_keys(&far, s->root_bound);
    } else if (make_probe(s, n->p, &g.probe))
        search_near(n, context->model->kernels.nearest, &g);
    else
        search_far(n, s, s->root_bound);
}

ebpo_status ebpo_nearest_end(const ebpo_nearest *n, const ebpo_model *model, double max_distance,
                             ebpo_distance_result *out, ebpo_error *error)
{
    *out = (ebpo_distance_result){ INFINITY,          max_distance, INFINITY,
                                   { NAN, NAN, NAN }, { 0, 0, 0 },  EBPO_NO_FACE };
    if (!n->found || (n->bounds.hi > max_distance &&
                      ebpo_triangle_distance_compare_to(n->p, (const double(*)[3])n->triangle,
                                                        max_distance) > 0))
        return EBPO_OK;
    ebpo_triangle_nearest exact;
    ebpo_triangle_nearest_exact(n->p, (const double(*)[3])n->triangle, &n->bounds, out->normal,
                                &exact);
    out->distance = out->lo = out->hi = exact.distance;
    memcpy(out->point, exact.point, sizeof out->point);
    return ebpo_model_source_face(model, n->file_face, &out->face, error);
}
