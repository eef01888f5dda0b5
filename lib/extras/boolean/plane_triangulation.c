/* Triangulates points of a plane.
 *
 * Points are added in the order of their coordinates. So each point is outside the convex hull of
 * the earlier points, and is joined to all edges of the hull that it sees. Then edges are flipped
 * (replaced by the other diagonal of their two triangles) if this improves the shape. The test of
 * the shape is approximate. But an edge is flipped only if its two triangles form a strictly convex
 * quadrangle, which is tested exactly, so every triangle always has an area. A segment becomes an
 * edge by flipping the edges that it crosses (Sloan, "A fast algorithm for generating constrained
 * Delaunay triangulations", 1993). Invariant: triangles are counter-clockwise and cover the hull
 * once. */
#include "core/strict_fp.h"

#include "extras/boolean/plane_triangulation.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/sort.h"

static inline int next_index(int i) { return i == 2 ? 0 : i + 1; }

static inline int last_index(int i) { return i == 0 ? 2 : i - 1; }

/* Returns the turn of three points: 1 if they are counter-clockwise (ebpo_exact_turn). */
static int turn_of(const ebpo_triangulation *t, uint32_t a, uint32_t b, uint32_t c)
{
    return ebpo_exact_turn(t->axis, &t->point[a], &t->point[b], &t->point[c]);
}

/* --- the hull --- */

static int order_points(const void *a, const void *b, void *context)
{
    const ebpo_triangulation *t = context;
    const ebpo_exact_point *p = &t->point[*(const uint32_t *)a],
                           *q = &t->point[*(const uint32_t *)b];
    int u = t->axis == 2 ? 0 : t->axis + 1, v = t->axis == 0 ? 2 : t->axis - 1;
    int order = ebpo_exact_compare(p, q, u);
    return order ? order : ebpo_exact_compare(p, q, v);
}

static bool grow_arrays(ebpo_triangulation *t)
{
    uint64_t n = t->points;
    bool grown = ebpo_grow(&t->any, &t->any_capacity, n, sizeof *t->any) &&
                 ebpo_grow(&t->next, &t->next_capacity, n, sizeof *t->next) &&
                 ebpo_grow(&t->last, &t->last_capacity, n, sizeof *t->last) &&
                 ebpo_grow(&t->inside, &t->inside_capacity, n, sizeof *t->inside) &&
                 ebpo_grow(&t->order, &t->order_capacity, n, sizeof *t->order) &&
                 ebpo_grow(&t->triangle, &t->capacity, 2 * n, sizeof *t->triangle);
    for (uint32_t i = 0; i < n && grown; i++)
        t->order[i] = i;
    return grown;
}

static void add_triangle(ebpo_triangulation *t, uint32_t a, uint32_t b, uint32_t c)
{
    uint32_t number = (uint32_t)t->count++;
    t->triangle[number] =
        (ebpo_plane_triangle){ { a, b, c },
                               { EBPO_NO_TRIANGLE, EBPO_NO_TRIANGLE, EBPO_NO_TRIANGLE } };
    t->any[a] = t->any[b] = t->any[c] = number;
}

/* Returns the edge of the triangle that begins at the corner. */
static int edge_from(const ebpo_triangulation *t, uint32_t triangle, uint32_t corner)
{
    const uint32_t *c = t->triangle[triangle].corner;
    return c[0] == corner ? 0 : c[1] == corner ? 1 : 2;
}

/* Connects edge i of a triangle with the edge of another triangle that begins at `from`. */
static void connect_edge(ebpo_triangulation *t, uint32_t triangle, int i, uint32_t other,
                         uint32_t from)
{
    t->triangle[triangle].across[i] = other;
    t->triangle[other].across[edge_from(t, other, from)] = triangle;
}

/* Makes an edge of the hull. inside: the triangle that has this edge. */
static void join_hull(ebpo_triangulation *t, uint32_t from, uint32_t to, uint32_t inside)
{
    t->next[from] = to;
    t->last[to] = from;
    t->inside[from] = inside;
}

/* Makes the first triangles. In the order, the first n points are on a line, and the next point is
 * not on this line. */
static void begin_hull(ebpo_triangulation *t, uint32_t n)
{
    const uint32_t *p = t->order;
    bool left = turn_of(t, p[0], p[1], p[n]) > 0;
    for (uint32_t i = 0; i + 1 < n; i++) {
        uint32_t number = (uint32_t)t->count;
        if (left)
            add_triangle(t, p[i], p[i + 1], p[n]);
        else
            add_triangle(t, p[i + 1], p[i], p[n]);
        if (left)
            join_hull(t, p[i], p[i + 1], number);
        else
            join_hull(t, p[i + 1], p[i], number);
        if (i > 0) /* the previous triangle has the edge between p[i] and p[n] reversed */
            connect_edge(t, number, left ? 2 : 1, number - 1, left ? p[i] : p[n]);
    }
    uint32_t most = (uint32_t)t->count - 1;
    if (left) {
        join_hull(t, p[n - 1], p[n], most);
        join_hull(t, p[n], p[0], 0);
    } else {
        join_hull(t, p[n], p[n - 1], most);
        join_hull(t, p[0], p[n], 0);
    }
}

/* Adds the point p, which follows all added points in the order. newest: the point that was added
 * last. */
static void enlarge_hull(ebpo_triangulation *t, uint32_t newest, uint32_t p)
{
    uint32_t begin = newest, end = newest;
    while (turn_of(t, t->last[begin], begin, p) < 0)
        begin = t->last[begin];
    while (turn_of(t, end, t->next[end], p) < 0)
        end = t->next[end];
    uint32_t first = (uint32_t)t->count;
    for (uint32_t a = begin; a != end; a = t->next[a]) {
        uint32_t number = (uint32_t)t->count;
        add_triangle(t, a, p, t->next[a]);
        connect_edge(t, number, 2, t->inside[a], a);
        if (number > first)
            connect_edge(t, number, 0, number - 1, p);
    }
    join_hull(t, begin, p, first);
    join_hull(t, p, end, (uint32_t)t->count - 1);
}

/* --- flips --- */

/* Flips edge i of the triangle `first`. The edge runs from a to b; p and q are the third corners of
 * `first` and of the triangle across. The two triangles become (a, q, p) and (b, p, q). */
static void flip_edge(ebpo_triangulation *t, uint32_t first, int i)
{
    uint32_t second = t->triangle[first].across[i];
    ebpo_plane_triangle *x = &t->triangle[first], *y = &t->triangle[second];
    int j = edge_from(t, second, x->corner[next_index(i)]);
    uint32_t a = x->corner[i], b = y->corner[j], p = x->corner[last_index(i)],
             q = y->corner[last_index(j)];
    uint32_t bp = x->across[next_index(i)], pa = x->across[last_index(i)],
             aq = y->across[next_index(j)], qb = y->across[last_index(j)];
    *x = (ebpo_plane_triangle){ { a, q, p }, { aq, second, pa } };
    *y = (ebpo_plane_triangle){ { b, p, q }, { bp, first, qb } };
    if (aq != EBPO_NO_TRIANGLE)
        t->triangle[aq].across[edge_from(t, aq, q)] = first;
    if (bp != EBPO_NO_TRIANGLE)
        t->triangle[bp].across[edge_from(t, bp, p)] = second;
    t->any[a] = t->any[q] = first;
    t->any[b] = t->any[p] = second;
}

/* Returns true if the two triangles of edge i form a strictly convex quadrangle. */
static bool is_convex(const ebpo_triangulation *t, uint32_t triangle, int i)
{
    const ebpo_plane_triangle *x = &t->triangle[triangle], *y = &t->triangle[x->across[i]];
    int j = edge_from(t, x->across[i], x->corner[next_index(i)]);
    uint32_t a = x->corner[i], b = y->corner[j], p = x->corner[last_index(i)],
             q = y->corner[last_index(j)];
    return turn_of(t, a, q, p) > 0 && turn_of(t, b, p, q) > 0;
}

static bool push_edge(ebpo_triangulation *t, uint64_t edge)
{
    if (!ebpo_grow(&t->queue, &t->queue_capacity, t->queue_end + 1, sizeof *t->queue))
        return false;
    t->queue[t->queue_end++] = edge;
    return true;
}

/* --- shape --- */

/* Computes the approximate position of a point, with coordinates from -1 to 1. */
static void frame_position(const ebpo_triangulation *t, uint32_t point, double out[2])
{
    const double *at = t->point[point].at;
    out[0] = (at[t->axis == 2 ? 0 : t->axis + 1] - t->origin[0]) / t->size;
    out[1] = (at[t->axis == 0 ? 2 : t->axis - 1] - t->origin[1]) / t->size;
}

static void make_frame(ebpo_triangulation *t)
{
    double p[2];
    t->origin[0] = t->origin[1] = 0;
    t->size = 1;
    frame_position(t, 0, t->origin);
    double most = 0;
    for (uint32_t i = 1; i < t->points; i++) {
        frame_position(t, i, p);
        most = fmax(most, fmax(fabs(p[0]), fabs(p[1])));
    }
    t->size = most > 0 ? most : 1;
}

/* Returns true if a flip of edge i approximately improves the shape: the fourth corner is inside
 * the circle through the triangle's corners. */
static bool is_better_flipped(const ebpo_triangulation *t, uint32_t triangle, int i)
{
    const ebpo_plane_triangle *x = &t->triangle[triangle], *y = &t->triangle[x->across[i]];
    int j = edge_from(t, x->across[i], x->corner[next_index(i)]);
    double p[3][2], q[2], square[3];
    for (int c = 0; c < 3; c++)
        frame_position(t, x->corner[c], p[c]);
    frame_position(t, y->corner[last_index(j)], q);
    for (int c = 0; c < 3; c++) {
        p[c][0] -= q[0];
        p[c][1] -= q[1];
        square[c] = p[c][0] * p[c][0] + p[c][1] * p[c][1];
    }
    double part[3], sum = 0, size = 0;
    for (int c = 0; c < 3; c++) {
        const double *m = p[next_index(c)], *n = p[last_index(c)];
        part[c] = square[c] * (m[0] * n[1] - m[1] * n[0]);
        sum += part[c];
        size += fabs(part[c]);
    }
    return sum > 0x1p-30 * size;
}

/* Maximum number of flips for each point. Without a maximum, edges could flip for ever because of
 * rounding. */
enum { FLIPS_MAX = 64 };

static bool improve_shape(ebpo_triangulation *t)
{
    uint64_t flips = (uint64_t)FLIPS_MAX * t->points;
    make_frame(t);
    t->queue_end = 0;
    for (uint64_t e = 0; e < 3 * t->count; e++)
        if (t->triangle[e / 3].across[e % 3] > e / 3 && !push_edge(t, e))
            return false;
    while (t->queue_end > 0 && flips > 0) {
        uint64_t e = t->queue[--t->queue_end];
        uint32_t first = (uint32_t)(e / 3), second = t->triangle[first].across[e % 3];
        if (second == EBPO_NO_TRIANGLE || !is_better_flipped(t, first, (int)(e % 3)) ||
            !is_convex(t, first, (int)(e % 3)))
            continue;
        flip_edge(t, first, (int)(e % 3));
        flips--;
        const uint64_t outer[] = { 3 * (uint64_t)first, 3 * (uint64_t)first + 2,
                                   3 * (uint64_t)second, 3 * (uint64_t)second + 2 };
        for (int i = 0; i < 4; i++)
            if (!push_edge(t, outer[i]))
                return false;
    }
    return true;
}

bool ebpo_triangulate_points(ebpo_triangulation *t, int axis, const ebpo_exact_point *point,
                             uint32_t points)
{
    t->point = point;
    t->points = points;
    t->axis = axis;
    t->count = 0;
    if (!grow_arrays(t))
        return false;
    ebpo_sort_with(t->order, points, sizeof *t->order, order_points, t);
    uint32_t n = 2;
    while (n + 1 < points && turn_of(t, t->order[0], t->order[1], t->order[n]) == 0)
        n++;
    begin_hull(t, n);
    for (uint32_t i = n + 1; i < points; i++)
        enlarge_hull(t, t->order[i - 1], t->order[i]);
    return improve_shape(t);
}

/* --- segments --- */

/* Finds the triangle with the corner `from` that the segment enters, and the edge through which the
 * segment leaves it. Returns false if the segment is an edge already. */
static bool find_entry(const ebpo_triangulation *t, uint32_t from, uint32_t to, uint32_t *triangle,
                       int *edge)
{
    for (int backward = 0; backward < 2; backward++) {
        uint32_t at = t->any[from];
        do {
            const ebpo_plane_triangle *x = &t->triangle[at];
            int i = edge_from(t, at, from);
            uint32_t right = x->corner[next_index(i)], left = x->corner[last_index(i)];
            if (right == to || left == to)
                return false;
            if (turn_of(t, from, right, to) > 0 && turn_of(t, from, to, left) > 0) {
                *triangle = at;
                *edge = next_index(i);
                return true;
            }
            at = x->across[backward ? i : last_index(i)];
        } while (at != EBPO_NO_TRIANGLE && at != t->any[from]);
    }
    return false;
}

/* Queues the edges that the segment crosses, as point << 32 | point. */
static bool queue_crossed(ebpo_triangulation *t, uint32_t from, uint32_t to)
{
    uint32_t triangle;
    int edge;
    t->queue_begin = t->queue_end = 0;
    if (!find_entry(t, from, to, &triangle, &edge))
        return true;
    for (;;) {
        const ebpo_plane_triangle *x = &t->triangle[triangle];
        uint32_t right = x->corner[edge], left = x->corner[next_index(edge)];
        if (!push_edge(t, (uint64_t)right << 32 | left))
            return false;
        triangle = x->across[edge];
        int j = edge_from(t, triangle, left);
        uint32_t ahead = t->triangle[triangle].corner[last_index(j)];
        if (ahead == to)
            return true;
        edge = turn_of(t, from, to, ahead) > 0 ? next_index(j) : last_index(j);
    }
}

/* Finds the triangle with the edge from a to b. */
static uint32_t find_edge(const ebpo_triangulation *t, uint32_t a, uint32_t b, int *edge)
{
    for (int backward = 0; backward < 2; backward++) {
        uint32_t at = t->any[a];
        do {
            const ebpo_plane_triangle *x = &t->triangle[at];
            int i = edge_from(t, at, a);
            *edge = i;
            if (x->corner[next_index(i)] == b)
                return at;
            at = x->across[backward ? i : last_index(i)];
        } while (at != EBPO_NO_TRIANGLE && at != t->any[a]);
    }
    return EBPO_NO_TRIANGLE;
}

bool ebpo_triangulation_insert(ebpo_triangulation *t, uint32_t from, uint32_t to)
{
    if (!queue_crossed(t, from, to))
        return false;
    while (t->queue_begin < t->queue_end) {
        uint64_t crossed = t->queue[t->queue_begin++];
        int i;
        uint32_t triangle = find_edge(t, (uint32_t)(crossed >> 32), (uint32_t)crossed, &i);
        if (!is_convex(t, triangle, i)) {
            if (!push_edge(t, crossed))
                return false;
            continue;
        }
        flip_edge(t, triangle, i); /* the new edge is edge 1 of this triangle */
        uint32_t q = t->triangle[triangle].corner[1], p = t->triangle[triangle].corner[2];
        if (q == from || q == to || p == from || p == to)
            continue;
        if (turn_of(t, from, to, q) * turn_of(t, from, to, p) < 0 &&
            !push_edge(t, (uint64_t)q << 32 | p))
            return false;
    }
    return true;
}

void ebpo_triangulation_free(ebpo_triangulation *t)
{
    free(t->triangle);
    free(t->any);
    free(t->next);
    free(t->last);
    free(t->inside);
    free(t->order);
    free(t->queue);
    *t = (ebpo_triangulation){ 0 };
}
