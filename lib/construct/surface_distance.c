/* Bounds the greatest distance of the points of a surface from another surface.
 *
 * The distance of a point from a fixed triangle is a convex function of the point, so over another
 * triangle it is greatest at a corner. Let T be a triangle of the first surface. There are two
 * upper bounds of the distance of the points of T from the second surface. The first bound is the
 * greatest distance of the corners of T from one triangle of the second surface. The second bound
 * is the distance of the centre of T from the second surface, plus the greatest distance of a
 * corner of T from the centre. The triangle with the greatest bound is cut, again and again, until
 * this bound is close enough to the greatest distance of a point that was found so far. If
 * possible, a triangle is cut by the sides of the prism over a near triangle of the second surface;
 * otherwise it is halved. Halving alone would make very many parts if both surfaces divide a plane
 * into slivers. The second surface is stored in a complete binary tree of boxes.
 *
 * Most triangles need no cuts, because ebpo_cover_bound gives a bound that is close enough.
 *
 * If many triangles are long and overlap, a search visits most boxes, and there are very many
 * parts. So the number of visited boxes and the number of parts are limited, in proportion to the
 * number of triangles. At the limit, the greatest bound is the result. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "construct/simplify.h"
#include "construct/surface_cover.h"
#include "core/alloc.h"
#include "geometry/vec3.h"

/* LEAF_TRIANGLES: number of triangles of a leaf of the box tree. DEEPEST: maximum depth of this
 * tree. MOST_CUTS: maximum number of times that a triangle is cut. PRISM_CUTS: after this number of
 * cuts, triangles are only halved, because each cut by a prism moves points by a rounding error.
 * SAMPLED: at the beginning, the distance of one vertex of every SAMPLED-th triangle is computed.
 * MOST_VISITS: maximum number of boxes that a search visits. STEPS: number of boxes, for each
 * triangle, that are visited until no more triangles are cut; most models need less than 200.
 * MORE_PARTS: greatest number of stored parts minus the number of triangles. */
enum {
    LEAF_TRIANGLES = 2,
    DEEPEST = 64,
    MOST_CUTS = 64,
    PRISM_CUTS = 20,
    SAMPLED = 8,
    MOST_VISITS = 4096,
    STEPS = 256,
    MORE_PARTS = 1 << 19
};
/* allowed ratio of the bound and the greatest distance of a point that was found */
static const double CLOSE_ENOUGH = 1.05;

typedef struct bounds {
    double low[3], high[3];
} bounds;

/* The box tree of a surface. */
typedef struct search {
    const ebpo_patch_mesh *mesh;
    /* [2 * leaves] boxes. Node 1 is the root, node i has the children 2*i and 2*i+1, and the nodes
     * from `leaves` on are leaves; node 0 is not used */
    bounds *node;
    uint64_t leaves; /* number of leaves, a power of two */
    uint64_t steps;  /* number of boxes that were visited so far */
} search;

/* A near triangle of the second surface, and the squared distance of a point from it. */
typedef struct hit {
    double square;
    uint64_t triangle;
    bool nearest; /* false: another triangle may be nearer */
} hit;

static void get_corner(const ebpo_patch_mesh *mesh, uint64_t triangle, int k, double out[3])
{
    memcpy(out, mesh->vertex[mesh->triangle[3 * triangle + (uint64_t)k]].at, 3 * sizeof *out);
}

/* Returns the squared distance of the point v from the points t d with 0 <= t <= 1. */
static double segment_square(const double v[3], const double d[3])
{
    double w[3], along = ebpo_vec3_dot(v, d), length = ebpo_vec3_dot(d, d),
                 t = along <= 0        ? 0
                     : along >= length ? 1
                                       : along / length;
    for (int k = 0; k < 3; k++)
        w[k] = v[k] - t * d[k];
    return ebpo_vec3_dot(w, w);
}

/* Returns the squared distance of p from a point of triangle t. Except for rounding errors, this
 * point is the nearest one to p. */
static double triangle_square(const double p[3], const double t[3][3])
{
    double edge[3][3], n[3], v[3][3], best = INFINITY;
    for (int k = 0; k < 3; k++) {
        ebpo_vec3_subtract(t[(k + 1) % 3], t[k], edge[k]);
        ebpo_vec3_subtract(p, t[k], v[k]);
    }
    ebpo_vec3_cross(edge[0], edge[1], n);
    double area = ebpo_vec3_dot(n, n);
    for (int k = 0; k < 3; k++) {
        double across[3];
        ebpo_vec3_cross(edge[k], v[k], across);
        if (area > 0 && ebpo_vec3_dot(across, n) >= 0)
            continue; /* p is on the inner side of the edge, so another point is nearer */
        double square = segment_square(v[k], edge[k]);
        best = square < best ? square : best;
    }
    if (best < INFINITY)
        return best;
    double height = ebpo_vec3_dot(v[0], n); /* p is inside of the prism over t */
    return height * height / area;
}

/* Returns the squared distance of p from a triangle of the second surface. */
static double square_to(const search *s, uint64_t triangle, const double p[3])
{
    double t[3][3];
    for (int k = 0; k < 3; k++)
        get_corner(s->mesh, triangle, k, t[k]);
    return triangle_square(p, (const double(*)[3])t);
}

/* Makes the box tree of a surface. Returns false when out of memory. */
static bool make_search(search *s, const ebpo_patch_mesh *mesh)
{
    s->mesh = mesh;
    s->leaves = 1;
    while (s->leaves * LEAF_TRIANGLES < mesh->triangle_count)
        s->leaves *= 2;
    s->node = ebpo_alloc(2 * s->leaves, sizeof *s->node);
    for (uint64_t i = 2 * s->leaves; s->node && --i > 0;) {
        bounds *b = &s->node[i];
        for (int k = 0; k < 3; k++)
            b->low[k] = INFINITY, b->high[k] = -INFINITY;
        if (i < s->leaves) {
            for (int k = 0; k < 3; k++) {
                b->low[k] = fmin(s->node[2 * i].low[k], s->node[2 * i + 1].low[k]);
                b->high[k] = fmax(s->node[2 * i].high[k], s->node[2 * i + 1].high[k]);
            }
            continue;
        }
        uint64_t first = (i - s->leaves) * LEAF_TRIANGLES;
        for (uint64_t t = first; t < first + LEAF_TRIANGLES && t < mesh->triangle_count; t++)
            for (int c = 0; c < 3; c++) {
                double p[3];
                get_corner(mesh, t, c, p);
                for (int k = 0; k < 3; k++) {
                    b->low[k] = fmin(b->low[k], p[k]);
                    b->high[k] = fmax(b->high[k], p[k]);
                }
            }
    }
    return s->node != NULL;
}

/* Returns the squared distance of p from a box. */
static double box_square(const bounds *b, const double p[3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        double d = p[k] < b->low[k] ? b->low[k] - p[k] : p[k] > b->high[k] ? p[k] - b->high[k] : 0;
        sum += d * d;
    }
    return sum;
}

/* Returns the triangle nearest to p, or a triangle whose squared distance is at most `good`, or a
 * triangle that is near if MOST_VISITS boxes were visited. `guess`: a triangle that is probably
 * near. */
static hit find_nearest(search *s, const double p[3], uint64_t guess, double good)
{
    hit best = { square_to(s, guess, p), guess, false };
    uint64_t last = s->steps + MOST_VISITS;
    struct {
        uint64_t node;
        double square;
    } stack[DEEPEST];
    int depth = 0;
    stack[depth].node = 1;
    stack[depth++].square = box_square(&s->node[1], p);
    while (depth && best.square > good && s->steps < last) {
        s->steps++;
        uint64_t i = stack[--depth].node;
        if (!(stack[depth].square < best.square))
            continue;
        if (i < s->leaves) {
            double left = box_square(&s->node[2 * i], p),
                   right = box_square(&s->node[2 * i + 1], p);
            bool swap = left < right; /* the nearer child is pushed last */
            stack[depth].node = 2 * i + swap;
            stack[depth++].square = swap ? right : left;
            stack[depth].node = 2 * i + !swap;
            stack[depth++].square = swap ? left : right;
            continue;
        }
        uint64_t first = (i - s->leaves) * LEAF_TRIANGLES;
        for (uint64_t t = first; t < first + LEAF_TRIANGLES && t < s->mesh->triangle_count; t++) {
            double square = square_to(s, t, p);
            if (square < best.square)
                best = (hit){ square, t, false };
        }
    }
    best.nearest = depth == 0;
    return best;
}

/* Returns the greatest squared distance of the three points `p` from a triangle of the second
 * surface. */
static double corners_square(const search *s, uint64_t triangle, double p[3][3])
{
    return ebpo_max3(square_to(s, triangle, p[0]), square_to(s, triangle, p[1]),
                     square_to(s, triangle, p[2]));
}

/* A part of a triangle of the first surface. */
typedef struct part {
    double at[3][3];
    double over;   /* upper bound of the distance of its points from the second surface */
    uint64_t near; /* a triangle of the second surface near the centre of the part */
    int cuts;      /* number of cuts that made the part */
} part;

typedef struct bounding {
    search to;          /* the second surface */
    ebpo_cover cover;   /* also the second surface */
    double point_most;  /* greatest distance of a point that was found so far */
    double fine, known; /* as for ebpo_bound_distance */
    double bound;       /* upper bound of the distance over all triangles so far, except `heap` */
    /* a triangle of the second surface that was near the triangle processed last */
    uint64_t guess;
    part *heap; /* parts to cut; the greatest upper bound first */
    uint64_t count, capacity;
    bool short_of_memory;
} bounding;

/* Returns the bound that is sufficient: the greatest of `known` and of the values that are close
 * enough to point_most. */
static double enough_of(const bounding *b)
{
    return fmax(b->known, fmax(b->point_most * CLOSE_ENOUGH, b->point_most + b->fine));
}

/* Maximum number of a polygon's corners. Rounding errors can make the corners of a thin polygon
 * alternate between the sides of a plane. So a plane can cut a polygon of n corners into parts of
 * up to 3 n / 2 corners. After the first, second and third plane, a part of a triangle has at most
 * 4, 6 and 9 corners. */
enum { CORNERS = 9 };
typedef struct polygon {
    int count;
    double at[CORNERS][3];
} polygon;

/* Cuts a polygon by the plane through the point `on` with normal n. Adds the part in direction n to
 * `front`, and the other part to `back`. Both polygons must be empty before the call. */
static void cut_polygon(const polygon *p, const double n[3], const double on[3], polygon *front,
                        polygon *back)
{
    for (int i = 0; i < p->count; i++) {
        const double *a = p->at[i], *b = p->at[(i + 1) % p->count];
        double v[3], w[3], height, next;
        ebpo_vec3_subtract(a, on, v);
        ebpo_vec3_subtract(b, on, w);
        height = ebpo_vec3_dot(v, n);
        next = ebpo_vec3_dot(w, n);
        if (height >= 0)
            memcpy(front->at[front->count++], a, sizeof v);
        if (height <= 0)
            memcpy(back->at[back->count++], a, sizeof v);
        if ((height > 0 && next < 0) || (height < 0 && next > 0)) {
            for (int k = 0; k < 3; k++)
                v[k] = a[k] + (b[k] - a[k]) * (height / (height - next));
            memcpy(front->at[front->count++], v, sizeof v);
            memcpy(back->at[back->count++], v, sizeof v);
        }
    }
}

static void push_part(bounding *b, const part *p)
{
    if (!ebpo_grow(&b->heap, &b->capacity, b->count + 1, sizeof *b->heap)) {
        b->short_of_memory = true;
        return;
    }
    uint64_t i = b->count++;
    for (; i > 0 && p->over > b->heap[(i - 1) / 2].over; i = (i - 1) / 2)
        b->heap[i] = b->heap[(i - 1) / 2];
    b->heap[i] = *p;
}

static part pop_part(bounding *b)
{
    part top = b->heap[0], last = b->heap[--b->count];
    uint64_t i = 0;
    for (uint64_t child = 1; child < b->count; child = 2 * i + 1) {
        if (child + 1 < b->count && b->heap[child + 1].over > b->heap[child].over)
            child++;
        if (!(b->heap[child].over > last.over))
            break;
        b->heap[i] = b->heap[child];
        i = child;
    }
    b->heap[i] = last;
    return top;
}

static void get_centre(const double p[3][3], double centre[3])
{
    for (int k = 0; k < 3; k++)
        centre[k] = (p[0][k] + p[1][k] + p[2][k]) / 3;
}

/* Bounds the distance over a triangle, and stores the triangle as a part to cut if the bound is not
 * sufficient. `most`: an upper bound that is known. `cuts`: number of cuts that made the triangle.
 */
static void bound_triangle(bounding *b, double p[3][3], double most, int cuts)
{
    part made = { .cuts = cuts };
    double centre[3], radius = 0;
    get_centre((const double(*)[3])p, centre);
    for (int i = 0; i < 3; i++) {
        double v[3];
        ebpo_vec3_subtract(p[i], centre, v);
        radius = fmax(radius, ebpo_vec3_length(v));
    }
    double enough = enough_of(b), good = fmax(enough - radius, enough / 2);
    hit near = find_nearest(&b->to, centre, b->guess, good * good);
    b->guess = made.near = near.triangle;
    if (near.nearest)
        b->point_most = fmax(b->point_most, sqrt(near.square));
    made.over = fmin(sqrt(corners_square(&b->to, near.triangle, p)), sqrt(near.square) + radius);
    made.over = fmin(made.over, most);
    if (made.over <= enough_of(b)) {
        b->bound = fmax(b->bound, made.over);
        return;
    }
    memcpy(made.at, p, sizeof made.at);
    push_part(b, &made);
}

/* Cuts a polygon of a part into triangles, and bounds the distance over these triangles. */
static void bound_polygon(bounding *b, const polygon *p, const part *of)
{
    for (int i = 2; i < p->count; i++) {
        double t[3][3];
        memcpy(t[0], p->at[0], sizeof t[0]);
        memcpy(t[1], p->at[i - 1], sizeof t[1]);
        memcpy(t[2], p->at[i], sizeof t[2]);
        bound_triangle(b, t, of->over, of->cuts + 1);
    }
}

/* Cuts a part by the sides of the prism over the triangle p->near. These are the three planes that
 * contain the edges of this triangle and are perpendicular to it. The part of p inside the prism is
 * bounded by the distances of its corners from the triangle. The parts outside the prism are
 * divided into triangles, which are bounded by bound_triangle. Returns false and changes nothing if
 * the centre of p is outside the prism, because the part inside may then be empty. Returns false
 * also if a corner of the part inside is too far from the triangle. */
static bool cut_by_prism(bounding *b, const part *p)
{
    double t[3][3], edge[3][3], n[3], outward[3][3], centre[3];
    get_centre((const double(*)[3])p->at, centre);
    for (int k = 0; k < 3; k++)
        get_corner(b->to.mesh, p->near, k, t[k]);
    for (int k = 0; k < 3; k++)
        ebpo_vec3_subtract(t[(k + 1) % 3], t[k], edge[k]);
    ebpo_vec3_cross(edge[0], edge[1], n);
    for (int k = 0; k < 3; k++) {
        double v[3];
        ebpo_vec3_cross(edge[k], n, outward[k]);
        ebpo_vec3_subtract(centre, t[k], v);
        if (!(ebpo_vec3_dot(v, outward[k]) < 0))
            return false;
    }
    polygon within = { .count = 3 }, outside[3] = { 0 };
    memcpy(within.at, p->at, sizeof p->at);
    for (int k = 0; k < 3; k++) {
        polygon inside = { 0 };
        cut_polygon(&within, outward[k], t[k], &outside[k], &inside);
        within = inside;
    }
    double over = 0;
    for (int i = 0; i < within.count; i++)
        over = fmax(over, sqrt(square_to(&b->to, p->near, within.at[i])));
    if (over > enough_of(b))
        return false;
    b->bound = fmax(b->bound, over);
    for (int k = 0; k < 3; k++)
        bound_polygon(b, &outside[k], p);
    return true;
}

/* Cuts a part into two by a plane through its longest edge's middle and the opposite corner. */
static void halve_part(bounding *b, const part *p)
{
    int longest = 0;
    double length = -1, half[3][3];
    for (int i = 0; i < 3; i++) {
        double v[3];
        ebpo_vec3_subtract(p->at[(i + 1) % 3], p->at[i], v);
        if (ebpo_vec3_dot(v, v) > length) {
            length = ebpo_vec3_dot(v, v);
            longest = i;
        }
    }
    int next = (longest + 1) % 3;
    for (int side = 0; side < 2; side++) {
        memcpy(half, p->at, sizeof half);
        for (int k = 0; k < 3; k++)
            half[side ? longest : next][k] = (p->at[longest][k] + p->at[next][k]) / 2;
        bound_triangle(b, half, p->over, p->cuts + 1);
    }
}

/* Cuts parts until all bounds are sufficient, or until `steps` boxes were visited or `parts` parts
 * are stored. Then the heap is empty. */
static void cut_parts(bounding *b, uint64_t steps, uint64_t parts)
{
    while (b->count && !b->short_of_memory) {
        part p = pop_part(b);
        if (p.over <= enough_of(b) || b->to.steps >= steps || b->count >= parts) {
            b->bound = fmax(b->bound, p.over); /* the other parts have no greater bound */
            b->count = 0;
        } else if (p.cuts == MOST_CUTS) {
            b->bound = fmax(b->bound, p.over);
        } else {
            b->guess = p.near;
            if (p.cuts >= PRISM_CUTS || !cut_by_prism(b, &p))
                halve_part(b, &p);
        }
    }
}

/* Returns true if the bound of a triangle of the first surface by a triangle of the second one is
 * sufficient, and notes the bound. */
static bool is_near(bounding *b, double p[3][3], uint64_t triangle)
{
    double enough = enough_of(b), square = 0;
    for (int k = 0; k < 3 && square <= enough * enough; k++)
        square = fmax(square, square_to(&b->to, triangle, p[k]));
    if (square > enough * enough)
        return false;
    b->guess = triangle;
    b->bound = fmax(b->bound, sqrt(square));
    return true;
}

/* Bounds the distance over triangle t of `a`. First tries the triangles of the second surface that
 * were near the neighbours of t. `near`: [vertex of a] such a triangle, or UINT64_MAX. */
static void bound_from_neighbours(bounding *b, const ebpo_patch_mesh *a, uint64_t t, uint64_t *near)
{
    const uint32_t *corners = a->triangle + 3 * t;
    uint64_t guess[EBPO_COVER_GUESSES] = { near[corners[0]], near[corners[1]], near[corners[2]],
                                           b->guess };
    double p[3][3], far[3];
    bool close = false;
    for (int k = 0; k < 3; k++)
        get_corner(a, t, k, p[k]);
    for (int i = EBPO_COVER_GUESSES; i-- > 0 && !close;) {
        bool repeated = guess[i] == UINT64_MAX;
        for (int k = i + 1; k < EBPO_COVER_GUESSES; k++)
            repeated = repeated || guess[k] == guess[i];
        close = !repeated && is_near(b, p, guess[i]);
    }
    if (!close) {
        double over = ebpo_cover_bound(&b->cover, (const double(*)[3])p, guess,
                                       fmax(b->bound, b->known), &b->guess, far);
        if (over > enough_of(b) && over < INFINITY) {
            hit h = find_nearest(&b->to, far, b->guess, 0);
            if (h.nearest)
                b->point_most = fmax(b->point_most, sqrt(h.square));
        }
        if (over <= enough_of(b))
            b->bound = fmax(b->bound, over);
        else
            bound_triangle(b, p, over, 0);
    }
    for (int k = 0; k < 3; k++)
        near[corners[k]] = b->guess;
}

ebpo_status ebpo_bound_distance(const ebpo_patch_mesh *a, const ebpo_patch_mesh *b, double fine,
                                double known, double *out, ebpo_error *error)
{
    bounding all = { .fine = fine, .known = known };
    uint64_t triangles = a->triangle_count + b->triangle_count, *near;
    *out = 0;
    near = ebpo_alloc(a->vertex_count, sizeof *near);
    if (!near || !make_search(&all.to, b) || !ebpo_cover_make(&all.cover, b)) {
        free(near);
        free(all.to.node);
        ebpo_cover_free(&all.cover);
        return ebpo_fail_memory(error, b->triangle_count * sizeof *all.to.node);
    }
    for (uint64_t v = 0; v < a->vertex_count; v++)
        near[v] = UINT64_MAX;
    /* the distances of some points are computed first: a greater point_most means that fewer
     * triangles are cut */
    for (uint64_t t = 0; t < a->triangle_count; t += SAMPLED) {
        uint32_t v = a->triangle[3 * t];
        hit h = find_nearest(&all.to, a->vertex[v].at, all.guess, 0);
        near[v] = all.guess = h.triangle;
        if (h.nearest)
            all.point_most = fmax(all.point_most, sqrt(h.square));
    }
    for (uint64_t t = 0; t < a->triangle_count; t++)
        bound_from_neighbours(&all, a, t, near);
    cut_parts(&all, STEPS * triangles, a->triangle_count + MORE_PARTS);
    *out = fmax(all.bound, all.point_most);
    free(near);
    free(all.heap);
    free(all.to.node);
    ebpo_cover_free(&all.cover);
    return all.short_of_memory ? ebpo_fail_memory(error, all.capacity * sizeof *all.heap) : EBPO_OK;
}
