/* Makes a tree over the caps of a border, with bounds of their solid angles.
 *
 * Bounds. Let the triangles of a node, of area a (with weights) and vector area V, be in a ball of
 * centre c and radius R. With r = |x - p|, the solid angle is the integral of f . dA,
 * f(x) = (x - p) / r^3, where |f| = 1 / r^2 and the derivative of f has the norm 2 / r^3. For all p
 * of a box with the centre q and half the diagonal s, whose distance from the ball is g > 0, the
 * half angle therefore is at most a / (2 g^2), and differs from V . f(c) / 2 at q by at most
 * a (R + s) / g^3: the differences x - p form a convex set, in which the norm is at least g.
 * Triangles may also be bounded by pi each.
 *
 * Rounding. Each quantity is computed with a relative error below 2^-45, except V, whose error
 * `slack` bounds; radii, areas and errors are enlarged by a factor of 1 + 2^-40. Distances are used
 * only between 2^-300 and 2^300, and lengths below 2^-500 or areas below 2^-900, which may
 * underflow, change the results by less than the constant that is added. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "geometry/cap_triangles.h"
#include "geometry/vec3.h"
#include "geometry/cap_tree.h"

static const double ENLARGE = 1 + 0x1p-40;

/* --- construction --- */

typedef struct growing {
    ebpo_cap_tree *tree;
    const uint64_t *first;
    const uint32_t *weight;
    uint64_t *order; /* loops */
} growing;

/* Sets the ball around the positions from .. to. */
static void enclose_positions(const ebpo_cap_tree *t, ebpo_cap_node *n)
{
    double low[3], high[3], most = 0;
    ebpo_vec3_copy(t->position[n->from], low);
    ebpo_vec3_copy(t->position[n->from], high);
    for (uint64_t i = n->from; i <= n->to; i++)
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], t->position[i][k]);
            high[k] = fmax(high[k], t->position[i][k]);
        }
    for (int k = 0; k < 3; k++)
        n->centre[k] = low[k] / 2 + high[k] / 2;
    for (uint64_t i = n->from; i <= n->to; i++) {
        double d[3];
        ebpo_vec3_subtract(t->position[i], n->centre, d);
        most = fmax(most, ebpo_vec3_length(d));
    }
    n->radius = most * ENLARGE + 0x1p-500;
}

/* Adds the sums of a part. */
static void add_part(ebpo_cap_node *n, const ebpo_cap_node *part)
{
    n->area = (n->area + part->area) * (1 + 0x1p-50);
    n->slack = (n->slack + part->slack) * (1 + 0x1p-50) + 0x1p-50 * n->area;
    n->most += part->most;
    for (int k = 0; k < 3; k++)
        n->vector[k] += part->vector[k];
}

/* Sets the sums to those of the triangle (from, m, to). The rounding error of its vector area is
 * below 2^-49 times the product of two edges. */
static void set_triangle(const ebpo_cap_tree *t, ebpo_cap_node *n, uint64_t m)
{
    double u[3], v[3], cross[3], weight = n->weight;
    ebpo_vec3_subtract(t->position[m], t->position[n->from], u);
    ebpo_vec3_subtract(t->position[n->to], t->position[n->from], v);
    ebpo_vec3_cross(u, v, cross);
    n->slack = weight * 0x1p-48 * ebpo_vec3_length(u) * ebpo_vec3_length(v);
    n->area = weight * ebpo_vec3_length(cross) / 2 * ENLARGE + n->slack;
    n->most = weight * EBPO_PI_HIGH * ENLARGE;
    for (int k = 0; k < 3; k++)
        n->vector[k] = weight * cross[k] / 2;
}

/* Makes the nodes of the stretch [i, j], in preorder: ebpo_cap_triangle. Recursive, at most 32
 * deep. */
static void make_stretch(ebpo_cap_tree *t, uint64_t i, uint64_t j, uint32_t weight)
{
    ebpo_cap_node *n = &t->node[t->node_count++];
    uint64_t m = ebpo_cap_middle(i, j);
    *n = (ebpo_cap_node){ .from = (uint32_t)i, .to = (uint32_t)j, .weight = weight };
    enclose_positions(t, n);
    set_triangle(t, n, m);
    for (int half = 0; half < 2; half++) {
        uint64_t a = half ? m : i, b = half ? j : m;
        if (ebpo_cap_count(a, b) == 0)
            continue;
        const ebpo_cap_node *part = &t->node[t->node_count];
        make_stretch(t, a, b, weight);
        add_part(n, part);
    }
}

/* Returns twice the middle of a loop's first and middle vertex along the axis: a cheap centre. */
static double loop_key(const growing *g, uint64_t loop, int axis)
{
    uint64_t a = g->first[loop], b = ebpo_cap_middle(a, g->first[loop + 1]);
    return g->tree->position[a][axis] / 2 + g->tree->position[b][axis] / 2;
}

/* Moves the loops with the least keys to the first half of order[begin .. end): quickselect; equal
 * keys are ordered by loop. */
static void divide_loops(growing *g, uint64_t begin, uint64_t end, int axis)
{
    uint64_t half = begin + (end - begin) / 2, low = begin, high = end - 1;
    while (low < high) {
        uint64_t pivot = g->order[low + (high - low) / 2], i = low, j = high;
        double at = loop_key(g, pivot, axis);
        for (;;) {
            for (;; i++) {
                double key = loop_key(g, g->order[i], axis);
                if (!(key < at || (key == at && g->order[i] < pivot)))
                    break;
            }
            for (;; j--) {
                double key = loop_key(g, g->order[j], axis);
                if (!(key > at || (key == at && g->order[j] > pivot)))
                    break;
            }
            if (i >= j)
                break;
            uint64_t t = g->order[i];
            g->order[i++] = g->order[j];
            g->order[j--] = t;
        }
        if (half <= j)
            high = j;
        else
            low = j + 1;
    }
}

static int longest_axis(const growing *g, uint64_t begin, uint64_t end)
{
    double side[3];
    for (int k = 0; k < 3; k++) {
        double low = INFINITY, high = -INFINITY;
        for (uint64_t i = begin; i < end; i++) {
            low = fmin(low, loop_key(g, g->order[i], k));
            high = fmax(high, loop_key(g, g->order[i], k));
        }
        side[k] = high / 2 - low / 2;
    }
    return side[0] >= side[1] && side[0] >= side[2] ? 0 : side[1] >= side[2] ? 1 : 2;
}

/* Makes the nodes of the loops order[begin .. end). Recursive: each half has half of the loops. */
static void make_group(growing *g, uint64_t begin, uint64_t end)
{
    ebpo_cap_tree *t = g->tree;
    if (end - begin == 1) {
        uint64_t loop = g->order[begin];
        make_stretch(t, g->first[loop], g->first[loop + 1] - 1, g->weight[loop]);
        return;
    }
    ebpo_cap_node *n = &t->node[t->node_count++];
    *n = (ebpo_cap_node){ .weight = 0 };
    divide_loops(g, begin, end, longest_axis(g, begin, end));
    for (int half = 0; half < 2; half++) {
        uint64_t middle = begin + (end - begin) / 2, at = t->node_count;
        make_group(g, half ? middle : begin, half ? end : middle);
        *(half ? &n->to : &n->from) = (uint32_t)at;
        add_part(n, &t->node[at]);
    }
    const ebpo_cap_node *a = &t->node[n->from], *b = &t->node[n->to];
    double d[3];
    for (int k = 0; k < 3; k++)
        n->centre[k] = a->centre[k] / 2 + b->centre[k] / 2;
    ebpo_vec3_subtract(a->centre, n->centre, d);
    double reach = ebpo_vec3_length(d) + a->radius;
    ebpo_vec3_subtract(b->centre, n->centre, d);
    n->radius = fmax(reach, ebpo_vec3_length(d) + b->radius) * ENLARGE + 0x1p-500;
}

ebpo_status ebpo_cap_tree_make(ebpo_cap_tree *out, double (*position)[3], const uint64_t *first,
                               const uint32_t *weight, uint64_t loop_count, ebpo_error *error)
{
    *out = (ebpo_cap_tree){ .position = position };
    if (loop_count == 0)
        return EBPO_OK;
    uint64_t positions = first[loop_count], triangles = positions - 2 * loop_count;
    growing g = { out, first, weight, ebpo_alloc(loop_count, sizeof *g.order) };
    ebpo_status status = EBPO_OK;
    if (positions > INT32_MAX)
        status = ebpo_fail(error, EBPO_E_LIMIT, "%llu border edges, but 2^31 is the limit",
                           (unsigned long long)positions);
    else if (!g.order || !(out->node = ebpo_alloc(triangles + loop_count - 1, sizeof *out->node)))
        status = ebpo_fail_memory(error, (triangles + loop_count) * sizeof *out->node);
    if (status == EBPO_OK) {
        for (uint64_t i = 0; i < loop_count; i++)
            g.order[i] = i;
        out->position_count = positions;
        out->triangle_count = triangles;
        make_group(&g, 0, loop_count);
    } else {
        ebpo_cap_tree_free(out);
    }
    free(g.order);
    return status;
}

ebpo_status ebpo_cap_tree_of_loops(ebpo_cap_tree *out, const ebpo_border_loops *loops,
                                   ebpo_error *error)
{
    uint64_t count = loops->loop_count;
    *out = (ebpo_cap_tree){ .node = NULL };
    if (count == 0)
        return EBPO_OK;
    double(*position)[3] = ebpo_alloc(loops->point_count, sizeof *position);
    uint64_t *first = ebpo_alloc_zero(count + 1, sizeof *first);
    uint32_t *weight = ebpo_alloc(count, sizeof *weight);
    ebpo_status status = EBPO_OK;
    if (position && first && weight) {
        memcpy(position, loops->point, loops->point_count * sizeof *position);
        for (uint64_t i = 0; i < count; i++) {
            first[i + 1] = first[i] + loops->loop[2 * i];
            weight[i] = loops->loop[2 * i + 1];
        }
        status = ebpo_cap_tree_make(out, position, first, weight, count, error);
    } else {
        free(position);
        status = ebpo_fail_memory(error, loops->point_count * sizeof *position);
    }
    free(first);
    free(weight);
    return status;
}

void ebpo_cap_tree_free(ebpo_cap_tree *tree)
{
    free(tree->position);
    free(tree->node);
    *tree = (ebpo_cap_tree){ .node = NULL };
}

/* --- bounds --- */

/* A box of points; or, if the radius is 0, one point. */
typedef struct point_box {
    const double *p;
    double half[3], radius;
} point_box;

static ebpo_bounded bound_node(const ebpo_cap_node *n, const point_box *q)
{
    const ebpo_bounded unknown = { 0, n->most };
    double x[3], apart[3];
    ebpo_vec3_subtract(n->centre, q->p, x);
    double d2 = ebpo_vec3_dot(x, x), d = sqrt(d2), ball = (n->radius + q->radius) * ENLARGE,
           least = d;
    if (q->radius > 0) {
        for (int k = 0; k < 3; k++)
            apart[k] = fmax(fabs(x[k]) * (1 - 0x1p-50) - q->half[k], 0);
        least = ebpo_vec3_length(apart);
    }
    double gap = least * (1 - 0x1p-40) - n->radius * ENLARGE;
    if (!(gap > 0x1p-300) || !(d < 0x1p300))
        return unknown;
    double inverse = 1 / (gap * gap), simple = n->area * inverse / 2,
           middle = ebpo_vec3_dot(n->vector, x) / (d2 * d) / 2,
           error = (n->area * (ball / gap + 0x1p-44) + n->slack) * inverse;
    if (!(error < simple)) {
        middle = 0;
        error = simple;
    }
    error = error * ENLARGE + 0x1p-250;
    return error < n->most && fabs(middle) <= 2 * n->most ? (ebpo_bounded){ middle, error }
                                                          : unknown;
}

/* Returns the bounds of the triangle that belongs to a stretch alone. */
static ebpo_bounded bound_triangle(const ebpo_cap_tree *t, const ebpo_cap_node *n,
                                   const point_box *q)
{
    double weight = n->weight;
    if (q->radius > 0)
        return (ebpo_bounded){ 0, weight * EBPO_PI_HIGH };
    ebpo_bounded b =
        ebpo_half_angle(q->p, t->position[n->from], t->position[ebpo_cap_middle(n->from, n->to)],
                        t->position[n->to]);
    return (ebpo_bounded){ weight * b.middle, weight * b.error };
}

/* Adds to a sum; the error includes the rounding of both sums. */
static inline void add_bounded(ebpo_bounded *sum, ebpo_bounded term)
{
    sum->middle += term.middle;
    sum->error += term.error + 0x1p-52 * (fabs(sum->middle) + fabs(term.middle) + sum->error);
}

ebpo_bounded ebpo_cap_tree_bound(const ebpo_cap_tree *tree, const double p[3], const double half[3],
                                 double tolerance)
{
    enum { STACK = 160 }; /* two for each level: at most 32 of groups and 32 of stretches */
    uint32_t stack[STACK], count = 0;
    ebpo_bounded sum = { 0, 0 };
    point_box q = { .p = p };
    if (half) {
        for (int k = 0; k < 3; k++)
            q.half[k] = half[k] * ENLARGE;
        q.radius = ebpo_vec3_length(q.half) * ENLARGE + 0x1p-500;
    }
    if (tree->node_count > 0)
        stack[count++] = 0;
    while (count > 0) {
        uint32_t at = stack[--count];
        const ebpo_cap_node *n = &tree->node[at];
        ebpo_bounded b = bound_node(n, &q);
        bool alone = n->weight && n->to - n->from == 2;
        if (b.error <= tolerance || (alone && half)) {
            add_bounded(&sum, b);
        } else if (n->weight == 0) {
            stack[count++] = n->to;
            stack[count++] = n->from;
        } else {
            uint64_t m = ebpo_cap_middle(n->from, n->to), first = ebpo_cap_count(n->from, m);
            add_bounded(&sum, bound_triangle(tree, n, &q));
            if (ebpo_cap_count(m, n->to))
                stack[count++] = (uint32_t)(at + 1 + first);
            if (first)
                stack[count++] = at + 1;
        }
    }
    return sum;
}
