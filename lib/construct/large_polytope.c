/* Cuts convex polytopes with any number of faces, by the method of geometry/polytope.c (BP 2008,
 * section 3.4.3) on arrays that grow. A shape is the list of the polytope's faces with their
 * vertices. A cut builds a second shape, which replaces the first shape if the cut succeeds. The
 * new face in the cutting plane is called the cap. The rim consists of the edges that the other
 * faces have in the cutting plane. A vertex that is nearer to the cutting plane than a tolerance
 * counts as a vertex on the plane. If rounding errors would make the new shape inconsistent, the
 * cut is refused; so the polytope is never too small. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "construct/large_polytope.h"
#include "core/alloc.h"
#include "core/hash.h"
#include "geometry/vec3.h"

static const double tolerance = 1e-10; /* in cells */
/* A cut is refused if it would leave only points nearer to the plane than this distance, in cells.
 */
static const double least_depth = 1e-7;

static const uint32_t no_vertex = UINT32_MAX;

/* An edge that the plane cuts between its ends. */
struct ebpo_large_edge {
    uint64_t key;    /* 1 + (kept end << 32 | end that is cut off); 0: empty slot */
    uint32_t vertex; /* index in `next` of the new vertex */
};

/* --- shapes --- */

static bool shape_begin(ebpo_large_shape *s)
{
    s->vertex_count = s->corner_count = s->face_count = 0;
    if (!ebpo_grow(&s->first, &s->first_capacity, 1, sizeof *s->first))
        return false;
    s->first[0] = 0;
    return true;
}

/* Adds a vertex, and returns its index. Sets p->no_memory when out of memory. */
static uint32_t shape_vertex(ebpo_large_polytope *p, ebpo_large_shape *s, const double x[3])
{
    if (!ebpo_grow(&s->vertex, &s->vertex_capacity, s->vertex_count + 1, sizeof *s->vertex)) {
        p->no_memory = true;
        return 0;
    }
    memcpy(s->vertex[s->vertex_count], x, sizeof *s->vertex);
    return (uint32_t)s->vertex_count++;
}

/* Adds a corner to the loop of the current face. Does nothing if the previous corner is the same
 * vertex. */
static void shape_corner(ebpo_large_polytope *p, ebpo_large_shape *s, uint32_t vertex)
{
    uint64_t start = s->first[s->face_count];
    if (s->corner_count > start && s->corner[s->corner_count - 1] == vertex)
        return;
    if (!ebpo_grow(&s->corner, &s->corner_capacity, s->corner_count + 1, sizeof *s->corner)) {
        p->no_memory = true;
        return;
    }
    s->corner[s->corner_count++] = vertex;
}

/* Ends the loop of a face; drops a face with fewer than three corners. */
static void shape_face(ebpo_large_polytope *p, ebpo_large_shape *s, int32_t tag)
{
    uint64_t start = s->first[s->face_count];
    while (s->corner_count > start + 1 && s->corner[s->corner_count - 1] == s->corner[start])
        s->corner_count--;
    if (s->corner_count - start < 3) {
        s->corner_count = start;
        return;
    }
    if (!ebpo_grow(&s->first, &s->first_capacity, s->face_count + 2, sizeof *s->first) ||
        !ebpo_grow(&s->tag, &s->tag_capacity, s->face_count + 1, sizeof *s->tag)) {
        p->no_memory = true;
        return;
    }
    s->tag[s->face_count++] = tag;
    s->first[s->face_count] = s->corner_count;
}

static void shape_free(ebpo_large_shape *s)
{
    free(s->vertex);
    free(s->corner);
    free(s->first);
    free(s->tag);
    *s = (ebpo_large_shape){ 0 };
}

bool ebpo_large_cube(ebpo_large_polytope *p)
{
    ebpo_polytope cube;
    ebpo_polytope_cube(&cube);
    p->no_memory = false;
    if (!shape_begin(&p->now))
        return false;
    for (int i = 0; i < cube.vertex_count; i++)
        shape_vertex(p, &p->now, cube.vertex[i]);
    for (int f = 0; f < cube.face_count && !p->no_memory; f++) {
        for (int i = cube.first[f]; i < cube.first[f + 1]; i++)
            shape_corner(p, &p->now, cube.corner[i]);
        shape_face(p, &p->now, cube.tag[f]);
    }
    return !p->no_memory;
}

void ebpo_large_free(ebpo_large_polytope *p)
{
    shape_free(&p->now);
    shape_free(&p->next);
    free(p->distance);
    free(p->next_index);
    free(p->cap);
    free(p->on);
    free(p->edge);
    free(p->rim);
    *p = (ebpo_large_polytope){ 0 };
}

double ebpo_large_volume(const ebpo_large_polytope *p)
{
    const ebpo_large_shape *s = &p->now;
    double sum = 0;
    for (uint64_t f = 0; f < s->face_count; f++) {
        double a[3], b[3], c[3], n[3];
        ebpo_vec3_subtract(s->vertex[s->corner[s->first[f]]], s->vertex[0], a);
        for (uint64_t i = s->first[f] + 1; i + 1 < s->first[f + 1]; i++) {
            ebpo_vec3_subtract(s->vertex[s->corner[i]], s->vertex[0], b);
            ebpo_vec3_subtract(s->vertex[s->corner[i + 1]], s->vertex[0], c);
            ebpo_vec3_cross(b, c, n);
            sum += ebpo_vec3_dot(a, n);
        }
    }
    return sum / 6;
}

/* --- clipping --- */

/* Returns true if the plane cuts off the vertex v of `now`. */
static bool is_out(const ebpo_large_polytope *p, uint32_t v) { return p->distance[v] > tolerance; }

/* Returns the index in `next` of the point at which the plane cuts the edge from the kept vertex
 * `in` to the removed vertex `out`. Both faces at the edge get the same index. */
static uint32_t edge_vertex(ebpo_large_polytope *p, uint32_t in, uint32_t out)
{
    uint64_t key = ((uint64_t)in << 32 | out) + 1, at, mask = p->edge_slots - 1;
    if (p->distance[in] >= -tolerance)
        return p->next_index[in];
    EBPO_HASH_FIND(at, ebpo_hash_number(key), mask, !p->edge[at].key || p->edge[at].key == key);
    if (!p->edge[at].key) {
        double x[3], t = p->distance[in] / (p->distance[in] - p->distance[out]);
        const double *a = p->now.vertex[in], *b = p->now.vertex[out];
        for (int k = 0; k < 3; k++)
            x[k] = a[k] + t * (b[k] - a[k]);
        p->edge[at] = (struct ebpo_large_edge){ key, shape_vertex(p, &p->next, x) };
    }
    return p->edge[at].vertex;
}

/* Adds an edge of a kept face to the rim if both ends are on the plane. */
static void record_rim(ebpo_large_polytope *p, uint32_t from, uint32_t to)
{
    if (from == to || !p->on[from] || !p->on[to])
        return;
    if (!ebpo_grow(&p->rim, &p->rim_capacity, p->rims + 1, sizeof *p->rim))
        p->no_memory = true;
    else
        p->rim[p->rims++] = (struct ebpo_large_rim){ from, to };
}

/* Copies the part of face f within the half-space to `next`, and adds the edges of this part that
 * are on the plane to the rim. */
static void clip_loop(ebpo_large_polytope *p, uint64_t f)
{
    const ebpo_large_shape *s = &p->now;
    ebpo_large_shape *to = &p->next;
    const uint32_t *loop = s->corner + s->first[f];
    uint64_t count = s->first[f + 1] - s->first[f], start = to->corner_count;
    bool inside = false;
    for (uint64_t i = 0; i < count; i++)
        inside |= p->distance[loop[i]] < -tolerance;
    for (uint64_t i = 0; i < count && inside && !p->no_memory; i++) {
        uint32_t a = loop[i], b = loop[i + 1 < count ? i + 1 : 0];
        if (!is_out(p, a))
            shape_corner(p, to, p->next_index[a]);
        if (is_out(p, a) != is_out(p, b))
            shape_corner(p, to, is_out(p, a) ? edge_vertex(p, b, a) : edge_vertex(p, a, b));
    }
    if (!inside || p->no_memory)
        return;
    shape_face(p, to, s->tag[f]);
    for (uint64_t i = start; i < to->corner_count; i++)
        record_rim(p, to->corner[i], to->corner[i + 1 < to->corner_count ? i + 1 : start]);
}

/* Returns true if the rim contains edge i in both directions. Then the edge is between two kept
 * faces. */
static bool is_paired(const ebpo_large_polytope *p, uint64_t i)
{
    for (uint64_t j = 0; p->touched && j < p->rims; j++)
        if (p->rim[i].from == p->rim[j].to && p->rim[i].to == p->rim[j].from)
            return true;
    return false;
}

/* Adds the cap. Its loop consists of the reversed edges of the rim, except edges that are paired
 * (is_paired). Returns false if these edges do not form one loop. */
static bool add_cap(ebpo_large_polytope *p, int32_t tag)
{
    uint64_t open = 0, steps = 0;
    uint32_t begin = no_vertex;
    if (!ebpo_grow(&p->cap, &p->cap_capacity, p->next.vertex_count, sizeof *p->cap))
        return !(p->no_memory = true);
    for (uint64_t i = 0; i < p->next.vertex_count; i++)
        p->cap[i] = no_vertex;
    for (uint64_t i = 0; i < p->rims; i++) {
        if (is_paired(p, i))
            continue;
        if (p->cap[p->rim[i].to] != no_vertex)
            return false;
        p->cap[p->rim[i].to] = p->rim[i].from;
        begin = p->rim[i].to;
        open++;
    }
    if (open < 3)
        return false;
    uint32_t at = begin;
    do {
        shape_corner(p, &p->next, at);
        at = p->cap[at];
        steps++;
    } while (at != no_vertex && at != begin && steps <= open);
    shape_face(p, &p->next, tag);
    return at == begin && steps == open;
}

/* Prepares a cut: copies the kept vertices to `next`, and empties the table of cut edges. Returns
 * false when out of memory. */
static bool begin_cut(ebpo_large_polytope *p)
{
    uint64_t edges = p->now.corner_count / 2 + 1;
    p->rims = 0;
    p->touched = false;
    p->edge_slots = ebpo_hash_slots(2 * edges);
    if (!shape_begin(&p->next) ||
        !ebpo_grow(&p->next_index, &p->next_index_capacity, p->now.vertex_count,
                   sizeof *p->next_index) ||
        !ebpo_grow(&p->on, &p->on_capacity, p->now.vertex_count + edges, sizeof *p->on) ||
        !ebpo_grow(&p->edge, &p->edge_capacity, p->edge_slots, sizeof *p->edge))
        return !(p->no_memory = true);
    memset(p->edge, 0, (size_t)p->edge_slots * sizeof *p->edge);
    memset(p->on, true, (size_t)(p->now.vertex_count + edges)); /* new vertices are on the plane */
    for (uint64_t i = 0; i < p->now.vertex_count; i++) {
        if (is_out(p, (uint32_t)i))
            continue;
        bool on = p->distance[i] >= -tolerance;
        p->next_index[i] = shape_vertex(p, &p->next, p->now.vertex[i]);
        p->on[p->next_index[i]] = on;
        p->touched |= on;
    }
    return !p->no_memory;
}

ebpo_clip ebpo_large_clip(ebpo_large_polytope *p, const double n[3], double d, int32_t tag)
{
    double greatest = -1e300, least = 1e300;
    if (!ebpo_grow(&p->distance, &p->distance_capacity, p->now.vertex_count, sizeof *p->distance)) {
        p->no_memory = true;
        return EBPO_CLIP_REFUSED;
    }
    for (uint64_t i = 0; i < p->now.vertex_count; i++) {
        double e = ebpo_vec3_dot(n, p->now.vertex[i]) - d;
        p->distance[i] = e;
        greatest = e > greatest ? e : greatest;
        least = e < least ? e : least;
    }
    if (greatest <= tolerance)
        return EBPO_CLIP_NONE;
    if (least >= -least_depth || !begin_cut(p))
        return EBPO_CLIP_REFUSED;
    for (uint64_t f = 0; f < p->now.face_count && !p->no_memory; f++)
        clip_loop(p, f);
    if (p->no_memory || !add_cap(p, tag) || p->no_memory || p->next.face_count < 4)
        return EBPO_CLIP_REFUSED;
    ebpo_large_shape old = p->now;
    p->now = p->next;
    p->next = old;
    return EBPO_CLIP_CUT;
}
