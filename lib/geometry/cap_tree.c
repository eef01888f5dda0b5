/* Makes a tree over the caps of a border. The upper nodes are groups of loops. Each group is halved
 * until it has a single loop. The nodes below are stretches of this loop, that is, paths along it
 * (cap_triangles.h). Each node has a ball around its triangles, and sums over its triangles for the
 * bounds in cap_bounds.c. Radii, lengths and areas are upper bounds, because they are enlarged by a
 * factor of 1 + 2^-40. */
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

/* Integrals over triangles, of the difference x between the triangles' points and a centre. */
typedef struct cap_moments {
    double mean[3];   /* of weight * x */
    double square;    /* of weight * |x|^2 */
    double matrix[6]; /* of weight * x * normal^T: the symmetric part, as ebpo_cap_node.moment */
} cap_moments;

/* Adds the integrals over the triangles of a node to `sum`, whose centre is `centre`. The centre of
 * `of` is that of the node. */
static void add_moments(cap_moments *sum, const double centre[3], const ebpo_cap_node *n,
                        const cap_moments *of)
{
    double d[3];
    ebpo_vec3_subtract(n->centre, centre, d);
    sum->square += of->square + 2 * ebpo_vec3_dot(d, of->mean) + ebpo_vec3_dot(d, d) * n->area;
    for (int k = 0; k < 3; k++) {
        int j = k == 2 ? 0 : k + 1;
        sum->mean[k] += of->mean[k] + d[k] * n->area;
        sum->matrix[k] += of->matrix[k] + d[k] * n->vector[k];
        sum->matrix[3 + k] += of->matrix[3 + k] + (d[k] * n->vector[j] + d[j] * n->vector[k]) / 2;
    }
}

/* Sets `spread` and `moment` of a node by integrals with the node's centre. The rounding errors of
 * the integrals are below 2^-40 area * radius^2 (square) and 2^-40 area * radius (matrix). */
static void set_moments(ebpo_cap_node *n, const cap_moments *of)
{
    double unit = n->area * n->radius, unit2 = unit * n->radius,
           square = of->square / unit2 + 0x1p-36;
    n->spread = !(unit2 > 0x1p-900) ? INFINITY /* `square` may underflow */
                : square < 0.999    ? (float)sqrt(square) * (1 + 0x1p-20f)
                                    : 1;
    for (int k = 0; k < 6; k++)
        n->moment[k] = unit > 0 ? (float)(of->matrix[k] / unit) : 0;
}

typedef struct growing {
    ebpo_cap_tree *tree;
    const uint64_t *first;  /* [loops + 1] first position of each loop */
    const uint32_t *weight; /* [loops] */
    uint64_t *order;        /* [loops] the loops, in the order of the tree */
} growing;

/* Sets the node's ball to a ball around these positions. */
static void enclose_positions(ebpo_cap_node *n, double (*position)[3], uint64_t count)
{
    double low[3], high[3], most = 0;
    ebpo_vec3_copy(position[0], low);
    ebpo_vec3_copy(position[0], high);
    for (uint64_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], position[i][k]);
            high[k] = fmax(high[k], position[i][k]);
        }
    for (int k = 0; k < 3; k++)
        n->centre[k] = low[k] / 2 + high[k] / 2;
    for (uint64_t i = 0; i < count; i++) {
        double d[3];
        ebpo_vec3_subtract(position[i], n->centre, d);
        most = fmax(most, ebpo_vec3_length(d));
    }
    n->radius = most * ENLARGE + 0x1p-500;
}

/* Adds the sums of a part to the sums of the node. */
static void add_part(ebpo_cap_node *n, const ebpo_cap_node *part)
{
    n->area = (n->area + part->area) * (1 + 0x1p-50);
    n->slack = (n->slack + part->slack) * (1 + 0x1p-50) + 0x1p-50 * n->area;
    n->length = (n->length + part->length) * (1 + 0x1p-50);
    n->most += part->most;
    for (int k = 0; k < 3; k++)
        n->vector[k] += part->vector[k];
}

/* Sets the sums of the node to the sums of the triangle (from, m, to), and `moments` to its
 * integrals with the node's centre. The rounding error of the triangle's vector area is below 2^-49
 * times the product of two edges. The square of an area may underflow, so lengths are scaled. */
static void set_triangle(const ebpo_cap_tree *t, ebpo_cap_node *n, uint64_t m, cap_moments *moments)
{
    double u[3], v[3], cross[3], weight = n->weight;
    ebpo_vec3_subtract(t->position[m], t->position[n->from], u);
    ebpo_vec3_subtract(t->position[n->to], t->position[n->from], v);
    ebpo_vec3_cross(u, v, cross);
    n->slack = weight * 0x1p-48 * ebpo_vec3_scaled_length(u) * ebpo_vec3_scaled_length(v);
    n->area = weight * ebpo_vec3_scaled_length(cross) / 2 * ENLARGE + n->slack;
    n->most = weight * EBPO_PI_HIGH * ENLARGE;
    for (int k = 0; k < 3; k++)
        n->vector[k] = weight * cross[k] / 2;
    /* the integrals with the centroid (u + v) / 3 as centre, then with the node's centre */
    ebpo_cap_node at_centroid = *n;
    for (int k = 0; k < 3; k++)
        at_centroid.centre[k] = t->position[n->from][k] + (u[k] + v[k]) / 3;
    cap_moments of = {
        .square = n->area * (ebpo_vec3_dot(u, u) + ebpo_vec3_dot(v, v) - ebpo_vec3_dot(u, v)) / 18
    };
    *moments = (cap_moments){ .square = 0 };
    add_moments(moments, n->centre, &at_centroid, &of);
}

void ebpo_cap_triangle_node(const ebpo_cap_tree *tree, const ebpo_cap_node *stretch,
                            ebpo_cap_node *out)
{
    uint64_t m = ebpo_cap_middle(stretch->from, stretch->to),
             at[3] = { stretch->from, m, stretch->to };
    double corner[3][3];
    cap_moments moments;
    *out = (ebpo_cap_node){ .from = stretch->from, .to = stretch->to, .weight = stretch->weight };
    for (int i = 0; i < 3; i++)
        ebpo_vec3_copy(tree->position[at[i]], corner[i]);
    enclose_positions(out, corner, 3);
    set_triangle(tree, out, m, &moments);
    set_moments(out, &moments);
}

/* Adds the length of a border edge to a node. */
static void add_edge(const ebpo_cap_tree *t, ebpo_cap_node *n, uint64_t i, uint64_t j)
{
    double edge[3];
    ebpo_vec3_subtract(t->position[j], t->position[i], edge);
    n->length += n->weight * (ebpo_vec3_length(edge) * ENLARGE + 0x1p-500);
}

/* Makes the nodes of the stretch from position i to position j, in preorder: the order in which
 * ebpo_cap_triangle numbers triangles. Sets `moments` to the integrals of the first node.
 * Recursive, at most 32 deep. */
static void make_stretch(ebpo_cap_tree *t, uint64_t i, uint64_t j, uint32_t weight,
                         cap_moments *moments)
{
    cap_moments of_half;
    ebpo_cap_node *n = &t->node[t->node_count++];
    uint64_t m = ebpo_cap_middle(i, j);
    *n = (ebpo_cap_node){ .from = (uint32_t)i, .to = (uint32_t)j, .weight = weight };
    enclose_positions(n, t->position + i, j - i + 1);
    set_triangle(t, n, m, moments);
    for (int half = 0; half < 2; half++) {
        uint64_t a = half ? m : i, b = half ? j : m;
        if (ebpo_cap_count(a, b) == 0) {
            add_edge(t, n, a, b);
            continue;
        }
        const ebpo_cap_node *part = &t->node[t->node_count];
        make_stretch(t, a, b, weight, &of_half);
        add_part(n, part);
        add_moments(moments, n->centre, part, &of_half);
    }
    set_moments(n, moments);
}

/* Returns the mean coordinate of a loop's first and middle vertex on the axis, which roughly
 * approximates the loop's centre. */
static double loop_key(const growing *g, uint64_t loop, int axis)
{
    uint64_t a = g->first[loop], b = ebpo_cap_middle(a, g->first[loop + 1]);
    return g->tree->position[a][axis] / 2 + g->tree->position[b][axis] / 2;
}

/* Moves the loops with the least keys to the first half of order[begin .. end), by quickselect.
 * Loops with equal keys are ordered by their indices. */
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

/* Returns the axis along which the keys of the loops differ most. */
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

/* Makes the nodes of the loops order[begin .. end). Sets `moments` to the integrals of the first
 * node. Recursive: each half has half of the loops. */
static void make_group(growing *g, uint64_t begin, uint64_t end, cap_moments *moments)
{
    ebpo_cap_tree *t = g->tree;
    cap_moments of_half[2];
    if (end - begin == 1) {
        uint64_t loop = g->order[begin];
        ebpo_cap_node *n = &t->node[t->node_count];
        make_stretch(t, g->first[loop], g->first[loop + 1] - 1, g->weight[loop], moments);
        add_edge(t, n, n->to, n->from);
        return;
    }
    ebpo_cap_node *n = &t->node[t->node_count++];
    *n = (ebpo_cap_node){ .weight = 0 };
    divide_loops(g, begin, end, longest_axis(g, begin, end));
    for (int half = 0; half < 2; half++) {
        uint64_t middle = begin + (end - begin) / 2, at = t->node_count;
        make_group(g, half ? middle : begin, half ? end : middle, &of_half[half]);
        *(half ? &n->to : &n->from) = (uint32_t)at;
        add_part(n, &t->node[at]);
    }
    const ebpo_cap_node *a = &t->node[n->from], *b = &t->node[n->to];
    double d[3];
    for (int k = 0; k < 3; k++)
        n->centre[k] = a->centre[k] / 2 + b->centre[k] / 2;
    ebpo_vec3_subtract(a->centre, n->centre, d);
    double radius_a = ebpo_vec3_length(d) + a->radius;
    ebpo_vec3_subtract(b->centre, n->centre, d);
    n->radius = fmax(radius_a, ebpo_vec3_length(d) + b->radius) * ENLARGE + 0x1p-500;
    *moments = (cap_moments){ .square = 0 };
    add_moments(moments, n->centre, a, &of_half[0]);
    add_moments(moments, n->centre, b, &of_half[1]);
    set_moments(n, moments);
}

ebpo_status ebpo_cap_tree_make(ebpo_cap_tree *out, double (*position)[3], const uint64_t *first,
                               const uint32_t *weight, uint64_t loop_count, ebpo_error *error)
{
    *out = (ebpo_cap_tree){ .position = position };
    if (loop_count == 0)
        return EBPO_OK;
    uint64_t positions = first[loop_count], triangles = positions - 2 * loop_count;
    growing g = { out, first, weight, ebpo_alloc(loop_count, sizeof *g.order) };
    cap_moments all;
    ebpo_status status = EBPO_OK;
    if (positions > INT32_MAX)
        status = ebpo_fail(error, EBPO_E_LIMIT, "%llu border edges, but 2^31 is the limit",
                           (unsigned long long)positions);
    else if (!g.order ||
             !(out->node = ebpo_alloc_lines(triangles + loop_count - 1, sizeof *out->node)))
        status = ebpo_fail_memory(error, (triangles + loop_count) * sizeof *out->node);
    if (status == EBPO_OK) {
        for (uint64_t i = 0; i < loop_count; i++)
            g.order[i] = i;
        out->position_count = positions;
        out->triangle_count = triangles;
        make_group(&g, 0, loop_count, &all);
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
