/* Simplifies the triangles of a patch by collapsing edges in the order of their quadric error.
 *
 * The quadric of a vertex is a function of a position: the sum of the squared distances from the
 * planes of the vertex's triangles, weighted by area. A collapse replaces two neighbours by one
 * vertex and removes the triangles that have both. The cost of a collapse is mainly the sum of the
 * quadrics of both vertices at the new vertex, which is placed where this sum is small. For each
 * edge with only one triangle, the quadrics of its two vertices also have a plane that contains the
 * edge and is perpendicular to the triangle. These planes keep open borders in place. A corner is
 * one of the three uses of a vertex by a triangle: corner c is entry c of the array `triangle`. The
 * corners of each vertex are a circular list, and a collapse joins two lists. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "construct/simplify.h"
#include "core/alloc.h"
#include "geometry/vec3.h"

#define NONE UINT32_MAX
/* Two vertices do not collapse if their lists have more corners than this number together, because
 * each attempt walks along the lists. */
enum { MOST_CORNERS = 512 };
/* OPEN_WEIGHT: weight of the planes at open edges (edges with one triangle). LENGTH_WEIGHT: weight
 * of the squared length of an edge in the cost. PLACE_WEIGHT: weight of the squared distance of a
 * new vertex from the middle of its edge. LEAST_WEIGHT: the same, as a part of the sum of all
 * weights; it is greater only for long thin triangles, whose equations would have no certain
 * digits. LEAST_COSINE: least cosine between the normals of a triangle before and after a collapse.
 * COARSE: greatest change of the surface by a collapse, divided by `fine`. */
static const double OPEN_WEIGHT = 10, LENGTH_WEIGHT = 1e-4, PLACE_WEIGHT = 1e-3,
                    LEAST_WEIGHT = 1e-9, LEAST_COSINE = 0.25, COARSE = 16;

/* Weighted sums over planes n . x + d = 0. nn: products of two coordinates of n; nd: n times d; dd:
 * d squared. Together they are a symmetric 4 x 4 matrix. area: sum of the areas of the vertex's
 * triangles. */
typedef struct quadric {
    double nn[6], nd[3], dd, area;
} quadric;

/* A collapse that may be done: vertex `to` moves and replaces vertex `from`. The candidate is valid
 * while simplifier.age of both vertices is equal to from_age and to_age. */
typedef struct candidate {
    double cost;
    uint32_t from, to, from_age, to_age;
} candidate;

typedef struct simplifier {
    ebpo_patch_mesh *mesh;
    quadric *sum;   /* [vertices] */
    uint32_t *next; /* [3 * triangles] next corner of the same vertex */
    uint32_t *head; /* [vertices] a corner of the vertex's list; NONE: it has no list */
    /* [vertices] upper bound of the number of corners in the vertex's list whose triangles are not
     * removed */
    uint32_t *corners;
    uint32_t *age;  /* [vertices] number of collapses that changed the vertex */
    uint32_t *mark; /* [vertices] last mark that was set */
    /* the current mark; a vertex counts as marked if its element of `mark` has this value */
    uint32_t marks;
    bool *dead;      /* [triangles] the triangle is removed */
    candidate *heap; /* the cheapest candidate first */
    uint64_t heap_count, heap_capacity;
    uint64_t alive; /* number of triangles that are not removed */
    bool short_of_memory;
} simplifier;

void ebpo_patch_mesh_free(ebpo_patch_mesh *mesh)
{
    free(mesh->vertex);
    free(mesh->triangle);
    memset(mesh, 0, sizeof *mesh);
}

static const double *position_of(const simplifier *s, uint32_t v) { return s->mesh->vertex[v].at; }

/* Adds the plane n . x + d = 0 with a weight. */
static void add_plane(quadric *q, const double n[3], double d, double weight)
{
    static const int row[6] = { 0, 0, 0, 1, 1, 2 }, column[6] = { 0, 1, 2, 1, 2, 2 };
    for (int i = 0; i < 6; i++)
        q->nn[i] += weight * n[row[i]] * n[column[i]];
    for (int k = 0; k < 3; k++)
        q->nd[k] += weight * n[k] * d;
    q->dd += weight * d * d;
}

static void add_quadric(quadric *to, const quadric *q)
{
    for (int i = 0; i < 6; i++)
        to->nn[i] += q->nn[i];
    for (int k = 0; k < 3; k++)
        to->nd[k] += q->nd[k];
    to->dd += q->dd;
    to->area += q->area;
}

/* Sets `out` to the point at which a quadric, plus the weighted squared distance from `middle`, is
 * least. The three linear equations are solved by the decomposition L D L^T of their symmetric
 * matrix. */
static void find_least(const quadric *q, const double middle[3], double out[3])
{
    const double *a = q->nn,
                 weight = fmax(PLACE_WEIGHT * q->area, LEAST_WEIGHT * (a[0] + a[3] + a[5]));
    double r[3] = { a[0] * middle[0] + a[1] * middle[1] + a[2] * middle[2] + q->nd[0],
                    a[1] * middle[0] + a[3] * middle[1] + a[4] * middle[2] + q->nd[1],
                    a[2] * middle[0] + a[4] * middle[1] + a[5] * middle[2] + q->nd[2] };
    double d0 = a[0] + weight, l1 = a[1] / d0, l2 = a[2] / d0, d1 = a[3] + weight - l1 * a[1],
           m = a[4] - l1 * a[2], l3 = m / d1, d2 = a[5] + weight - l2 * a[2] - l3 * m;
    double y1 = r[1] - l1 * r[0], y2 = r[2] - l2 * r[0] - l3 * y1, z = y2 / d2,
           y = y1 / d1 - l3 * z, x = r[0] / d0 - l1 * y - l2 * z;
    out[0] = middle[0] - x;
    out[1] = middle[1] - y;
    out[2] = middle[2] - z;
}

/* Returns the sum of the weighted squared distances of p from the planes of a quadric. */
static double quadric_value(const quadric *q, const double p[3])
{
    return q->nn[0] * p[0] * p[0] + q->nn[3] * p[1] * p[1] + q->nn[5] * p[2] * p[2] +
           2 * (q->nn[1] * p[0] * p[1] + q->nn[2] * p[0] * p[2] + q->nn[4] * p[1] * p[2]) +
           2 * ebpo_vec3_dot(q->nd, p) + q->dd;
}

/* Computes the normal of a triangle. The length of the normal is twice the triangle's area. */
static void cross_of(const double a[3], const double b[3], const double c[3], double out[3])
{
    double u[3], v[3];
    ebpo_vec3_subtract(b, a, u);
    ebpo_vec3_subtract(c, a, v);
    ebpo_vec3_cross(u, v, out);
}

/* Returns the number of remaining triangles that have both vertices, at most 2. */
static unsigned count_shared(const simplifier *s, uint32_t a, uint32_t b)
{
    unsigned count = 0;
    if (s->corners[b] < s->corners[a]) { /* walk along the shorter list */
        uint32_t other = a;
        a = b;
        b = other;
    }
    uint32_t c = s->head[a];
    if (c == NONE)
        return 0;
    do {
        const uint32_t *t = s->mesh->triangle + c / 3 * 3;
        if (!s->dead[c / 3] && (t[0] == b || t[1] == b || t[2] == b))
            count++;
        c = s->next[c];
    } while (c != s->head[a] && count < 2);
    return count;
}

/* Adds the plane of an open edge to the quadrics of its vertices `a` and `b`. `normal`: unit normal
 * of the edge's triangle. */
static void add_open_edge(simplifier *s, uint32_t a, uint32_t b, const double normal[3])
{
    double edge[3], n[3];
    ebpo_vec3_subtract(position_of(s, b), position_of(s, a), edge);
    ebpo_vec3_cross(edge, normal, n);
    double length = ebpo_vec3_length(n), square = ebpo_vec3_dot(edge, edge);
    if (!(length > 0))
        return;
    for (int k = 0; k < 3; k++)
        n[k] /= length;
    double d = -ebpo_vec3_dot(n, position_of(s, a));
    add_plane(&s->sum[a], n, d, OPEN_WEIGHT * square);
    add_plane(&s->sum[b], n, d, OPEN_WEIGHT * square);
}

/* Adds the plane of triangle i, and the planes at its open edges, to the quadrics of its vertices.
 */
static void add_triangle(simplifier *s, uint64_t i)
{
    const uint32_t *t = s->mesh->triangle + 3 * i;
    double n[3];
    cross_of(position_of(s, t[0]), position_of(s, t[1]), position_of(s, t[2]), n);
    double twice_area = ebpo_vec3_length(n);
    if (!(twice_area > 0))
        return;
    for (int k = 0; k < 3; k++)
        n[k] /= twice_area;
    double d = -ebpo_vec3_dot(n, position_of(s, t[0]));
    for (int k = 0; k < 3; k++) {
        add_plane(&s->sum[t[k]], n, d, twice_area / 2);
        s->sum[t[k]].area += twice_area / 2;
        uint32_t b = t[(k + 1) % 3];
        if (!(s->mesh->vertex[t[k]].fixed && s->mesh->vertex[b].fixed) &&
            count_shared(s, t[k], b) == 1)
            add_open_edge(s, t[k], b, n);
    }
}

/* --- the heap of candidates, the cheapest first --- */

static bool is_before(const candidate *a, const candidate *b)
{
    if (a->cost != b->cost)
        return a->cost < b->cost;
    return a->from != b->from ? a->from < b->from : a->to < b->to;
}

static void push_candidate(simplifier *s, candidate c)
{
    if (!ebpo_grow(&s->heap, &s->heap_capacity, s->heap_count + 1, sizeof *s->heap)) {
        s->short_of_memory = true;
        return;
    }
    uint64_t i = s->heap_count++;
    for (; i > 0 && is_before(&c, &s->heap[(i - 1) / 2]); i = (i - 1) / 2)
        s->heap[i] = s->heap[(i - 1) / 2];
    s->heap[i] = c;
}

static candidate pop_candidate(simplifier *s)
{
    candidate top = s->heap[0], last = s->heap[--s->heap_count];
    uint64_t i = 0;
    for (uint64_t child = 1; child < s->heap_count; child = 2 * i + 1) {
        if (child + 1 < s->heap_count && is_before(&s->heap[child + 1], &s->heap[child]))
            child++;
        if (!is_before(&s->heap[child], &last))
            break;
        s->heap[i] = s->heap[child];
        i = child;
    }
    s->heap[i] = last;
    return top;
}

/* Sets `out` to the position of the vertex that replaces `from` and `to`: the position of `to` if
 * it is fixed, otherwise the point with the least quadrics near the middle of the edge. Returns the
 * sum of both quadrics at this point. */
static double place_vertex(const simplifier *s, uint32_t from, uint32_t to, double out[3])
{
    const double *p = position_of(s, from), *q = position_of(s, to);
    quadric sum = s->sum[from];
    double middle[3];
    add_quadric(&sum, &s->sum[to]);
    memcpy(out, q, sizeof middle);
    if (!s->mesh->vertex[to].fixed && sum.area > 0) {
        for (int k = 0; k < 3; k++)
            middle[k] = (p[k] + q[k]) / 2;
        find_least(&sum, middle, out);
    }
    return quadric_value(&sum, out);
}

/* Adds the collapse of an edge to the heap. Does nothing if both vertices are fixed. */
static void offer_collapse(simplifier *s, uint32_t from, uint32_t to)
{
    double at[3], edge[3];
    if (s->mesh->vertex[from].fixed) {
        uint32_t other = from;
        from = to;
        to = other;
    }
    if (s->mesh->vertex[from].fixed)
        return;
    ebpo_vec3_subtract(position_of(s, to), position_of(s, from), edge);
    double cost = place_vertex(s, from, to, at) +
                  LENGTH_WEIGHT * ebpo_vec3_dot(edge, edge) * (s->sum[from].area + s->sum[to].area);
    push_candidate(s, (candidate){ cost, from, to, s->age[from], s->age[to] });
}

/* Removes the corners of removed triangles from the list of a vertex; keeps one corner if all
 * triangles are removed. */
static void remove_dead_corners(simplifier *s, uint32_t v)
{
    uint32_t begin = s->head[v], c = begin, first = NONE, last = NONE, count = 0;
    do {
        uint32_t after = s->next[c];
        if (!s->dead[c / 3]) {
            if (first == NONE)
                first = c;
            else
                s->next[last] = c;
            last = c;
            count++;
        }
        c = after;
    } while (c != begin);
    if (first == NONE)
        first = last = begin;
    s->next[last] = first;
    s->head[v] = first;
    s->corners[v] = count;
}

/* Calls offer_collapse for each edge of vertex v. If `upwards` is true, omits edges whose other
 * vertex has a lower index than v. */
static void offer_edges(simplifier *s, uint32_t v, bool upwards)
{
    uint32_t c = s->head[v];
    if (c == NONE)
        return;
    s->marks++;
    do {
        for (int k = 0; k < 3 && !s->dead[c / 3]; k++) {
            uint32_t w = s->mesh->triangle[c / 3 * 3 + (uint32_t)k];
            if (w == v || s->mark[w] == s->marks || (upwards && w < v))
                continue;
            s->mark[w] = s->marks;
            offer_collapse(s, v, w);
        }
        c = s->next[c];
    } while (c != s->head[v]);
}

/* --- collapses --- */

/* Increases s->marks, and marks v and its neighbours with this new value. */
static void mark_neighbours(simplifier *s, uint32_t v)
{
    uint32_t c = s->head[v];
    s->marks++;
    do {
        for (int k = 0; k < 3 && !s->dead[c / 3]; k++)
            s->mark[s->mesh->triangle[c / 3 * 3 + (uint32_t)k]] = s->marks;
        c = s->next[c];
    } while (c != s->head[v]);
}

/* Returns true if no triangle of vertex v without vertex `other` is flipped when v moves to `at`.
 */
static bool stays_unflipped(const simplifier *s, uint32_t v, uint32_t other, const double at[3])
{
    uint32_t c = s->head[v];
    do {
        const uint32_t *t = s->mesh->triangle + c / 3 * 3;
        if (!s->dead[c / 3] && t[0] != other && t[1] != other && t[2] != other) {
            const double *p[3], *q[3];
            double before[3], after[3];
            for (int k = 0; k < 3; k++) {
                p[k] = position_of(s, t[k]);
                q[k] = t[k] == v ? at : p[k];
            }
            cross_of(p[0], p[1], p[2], before);
            cross_of(q[0], q[1], q[2], after);
            double square = ebpo_vec3_dot(before, before);
            if (square > 0 && !(ebpo_vec3_dot(before, after) >
                                LEAST_COSINE * sqrt(square * ebpo_vec3_dot(after, after))))
                return false;
        }
        c = s->next[c];
    } while (c != s->head[v]);
    return true;
}

/* Returns true if the vertex has an edge with one triangle. */
static bool is_open(const simplifier *s, uint32_t v)
{
    uint32_t c = s->head[v];
    do {
        for (int k = 0; k < 3 && !s->dead[c / 3]; k++) {
            uint32_t w = s->mesh->triangle[c / 3 * 3 + (uint32_t)k];
            if (w != v && count_shared(s, v, w) == 1)
                return true;
        }
        c = s->next[c];
    } while (c != s->head[v]);
    return false;
}

/* Returns true if the collapse of `from` and `to` to the point `at` flips no triangle and does not
 * change the topology. The topology stays the same if each common neighbour of `from` and `to` is a
 * vertex of a triangle that has both, and if the edge is open or one of its vertices is not. */
static bool is_possible(simplifier *s, uint32_t from, uint32_t to, const double at[3])
{
    /* shared: number of triangles that have `from` and `to`; common: number of common neighbours */
    unsigned shared = 0, common = 0;
    if ((uint64_t)s->corners[from] + s->corners[to] > MOST_CORNERS)
        return false;
    mark_neighbours(s, to);
    uint32_t to_mark = s->marks, seen_mark = ++s->marks, c = s->head[from];
    do {
        const uint32_t *t = s->mesh->triangle + c / 3 * 3;
        if (!s->dead[c / 3]) {
            shared += t[0] == to || t[1] == to || t[2] == to;
            for (int k = 0; k < 3; k++) {
                uint32_t w = t[k];
                if (w == from || w == to || s->mark[w] != to_mark)
                    continue;
                common++;
                s->mark[w] = seen_mark;
            }
        }
        c = s->next[c];
    } while (c != s->head[from]);
    return shared > 0 && common == shared && stays_unflipped(s, from, to, at) &&
           (s->mesh->vertex[to].fixed || stays_unflipped(s, to, from, at)) &&
           (shared == 1 || !is_open(s, from) || !is_open(s, to));
}

/* Replaces `from` and `to` by `to` at the point `at`. */
static void collapse_edge(simplifier *s, uint32_t from, uint32_t to, const double at[3])
{
    ebpo_patch_vertex *u = &s->mesh->vertex[from], *v = &s->mesh->vertex[to];
    uint32_t c = s->head[from];
    do {
        uint32_t *t = s->mesh->triangle + c / 3 * 3;
        if (!s->dead[c / 3] && (t[0] == to || t[1] == to || t[2] == to)) {
            s->dead[c / 3] = true;
            s->alive--;
        }
        t[c % 3] = to;
        c = s->next[c];
    } while (c != s->head[from]);
    uint32_t after = s->next[s->head[to]];
    s->next[s->head[to]] = s->next[s->head[from]];
    s->next[s->head[from]] = after;
    s->head[from] = NONE;
    remove_dead_corners(s, to);
    add_quadric(&s->sum[to], &s->sum[from]);
    memcpy(v->at, at, sizeof v->at);
    /* neighbouring patches need equal normals and colours of vertices that they share */
    for (int k = 0; k < 3 && !v->fixed; k++) {
        v->normal[k] += u->normal[k];
        v->colour[k] += u->colour[k];
    }
    v->weight += v->fixed ? 0 : u->weight;
    s->age[from]++;
    s->age[to]++;
}

/* Deletes removed triangles from the mesh's arrays. Also deletes unused vertices that are not
 * fixed. `new_index`: [vertices] space for new indices. */
static void compact_mesh(simplifier *s, uint32_t *new_index)
{
    ebpo_patch_mesh *m = s->mesh;
    uint64_t triangles = 0, vertices = 0;
    for (uint64_t v = 0; v < m->vertex_count; v++)
        new_index[v] = m->vertex[v].fixed ? 0 : NONE;
    for (uint64_t t = 0; t < m->triangle_count; t++)
        for (int k = 0; k < 3 && !s->dead[t]; k++)
            new_index[m->triangle[3 * t + (uint64_t)k]] = 0;
    for (uint64_t v = 0; v < m->vertex_count; v++)
        if (new_index[v] != NONE) {
            new_index[v] = (uint32_t)vertices;
            m->vertex[vertices++] = m->vertex[v];
        }
    for (uint64_t t = 0; t < m->triangle_count; t++) {
        if (s->dead[t])
            continue;
        for (uint64_t k = 0; k < 3; k++)
            m->triangle[3 * triangles + k] = new_index[m->triangle[3 * t + k]];
        triangles++;
    }
    m->triangle_count = triangles;
    m->vertex_count = vertices;
}

/* Makes the lists, quadrics and candidates, and collapses edges. */
static void collapse_edges(simplifier *s, uint64_t target, double fine)
{
    ebpo_patch_mesh *m = s->mesh;
    for (uint64_t v = 0; v < m->vertex_count; v++)
        s->head[v] = NONE;
    for (uint32_t c = 0; c < 3 * m->triangle_count; c++) {
        uint32_t *head = &s->head[m->triangle[c]];
        s->next[c] = *head == NONE ? c : s->next[*head];
        if (*head != NONE)
            s->next[*head] = c;
        *head = c;
        s->corners[m->triangle[c]]++;
    }
    for (uint64_t t = 0; t < m->triangle_count; t++)
        add_triangle(s, t);
    for (uint32_t v = 0; v < m->vertex_count; v++)
        offer_edges(s, v, true);
    while (s->heap_count && !s->short_of_memory) {
        candidate c = pop_candidate(s);
        double at[3];
        if (s->age[c.from] != c.from_age || s->age[c.to] != c.to_age || s->head[c.from] == NONE ||
            s->head[c.to] == NONE)
            continue;
        double most = s->alive <= target ? fine : COARSE * fine;
        if (c.cost > most * most * (s->sum[c.from].area + s->sum[c.to].area))
            continue;
        (void)place_vertex(s, c.from, c.to, at);
        if (!is_possible(s, c.from, c.to, at))
            continue;
        collapse_edge(s, c.from, c.to, at);
        offer_edges(s, c.to, false);
    }
}

ebpo_status ebpo_simplify(ebpo_patch_mesh *mesh, uint64_t target, double fine, ebpo_error *error)
{
    uint64_t vertices = mesh->vertex_count, triangles = mesh->triangle_count;
    if (triangles > UINT32_MAX / 3)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "a node has %" PRIu64
                         " faces and no nodes below; a simplified surface can "
                         "be made of at most %" PRIu32 ", so convert without the part surface",
                         triangles, UINT32_MAX / 3);
    simplifier s = { .mesh = mesh, .alive = triangles };
    s.sum = ebpo_alloc_zero(vertices, sizeof *s.sum);
    s.next = ebpo_alloc(triangles, 3 * sizeof *s.next);
    s.head = ebpo_alloc(vertices, sizeof *s.head);
    s.corners = ebpo_alloc_zero(vertices, sizeof *s.corners);
    s.age = ebpo_alloc_zero(vertices, sizeof *s.age);
    s.mark = ebpo_alloc_zero(vertices, sizeof *s.mark);
    s.dead = ebpo_alloc_zero(triangles, sizeof *s.dead);
    bool made = s.sum && s.next && s.head && s.corners && s.age && s.mark && s.dead;
    if (made) {
        collapse_edges(&s, target, fine);
        compact_mesh(&s, s.head);
    }
    free(s.sum);
    free(s.next);
    free(s.head);
    free(s.corners);
    free(s.age);
    free(s.mark);
    free(s.dead);
    free(s.heap);
    return made && !s.short_of_memory ? EBPO_OK : ebpo_fail_memory(error, vertices * sizeof *s.sum);
}
