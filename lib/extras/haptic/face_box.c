/* Loads the faces in a box around the proxy, with a tree of boxes over the faces. The proxy is the
 * ball, point or tool that follows the device and stays outside the surface. A haptic step (one
 * cycle of the force computation) reads no other geometry.
 *
 * The loading thread makes a box; a box never changes while a step uses it. Faces keep the order of
 * the file, which follows a space-filling curve, so the tree needs no sorting. Functions that steps
 * call allocate no memory; their callers limit their work.
 *
 * Distances are computed in doubles, with errors of a few ulps. Winding numbers are exact: along a
 * straight path from a point whose winding number is known, the winding number changes at each face
 * whose interior the path crosses. If the path crosses an edge, or begins in a face's plane, a
 * detour through another point replaces the path. Almost every other point is suitable. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "extras/haptic/face_box.h"
#include "geometry/vec3.h"
#include "geometry/predicates.h"

uint64_t ebpo_face_box_leaves(uint64_t count)
{
    uint64_t leaves = 1;
    while (leaves * EBPO_FACE_BOX_LEAF < count)
        leaves *= 2;
    return leaves;
}

uint64_t ebpo_face_box_bytes(uint64_t capacity)
{
    return capacity * (sizeof(double[3][3]) + sizeof(uint64_t) + sizeof(uint32_t)) +
           2 * ebpo_face_box_leaves(capacity) * sizeof(ebpo_extent);
}

/* Writes to all pages of the memory, so that no haptic step waits for the operating system. */
ebpo_status ebpo_face_box_new(ebpo_face_box *out, uint64_t capacity, ebpo_error *error)
{
    *out = (ebpo_face_box){ .capacity = capacity, .leaves = 1 };
    uint64_t nodes = 2 * ebpo_face_box_leaves(capacity);
    out->corner = ebpo_alloc(capacity, sizeof *out->corner);
    out->face = ebpo_alloc(capacity, sizeof *out->face);
    out->instance = ebpo_alloc(capacity, sizeof *out->instance);
    out->node = ebpo_alloc(nodes, sizeof *out->node);
    if (!out->corner || !out->face || !out->instance || !out->node) {
        ebpo_face_box_free(out);
        return ebpo_fail_memory(error, ebpo_face_box_bytes(capacity));
    }
    memset(out->corner, 0xff, capacity * sizeof *out->corner);
    memset(out->face, 0xff, capacity * sizeof *out->face);
    memset(out->instance, 0xff, capacity * sizeof *out->instance);
    /* NAN, so that nodes intersect nothing and the box contains nothing */
    memset(out->node, 0xff, nodes * sizeof *out->node);
    for (int i = 0; i < 3; i++)
        out->allowed.min[i] = out->allowed.max[i] = NAN;
    return EBPO_OK;
}

void ebpo_face_box_free(ebpo_face_box *box)
{
    free(box->corner);
    free(box->face);
    free(box->instance);
    free(box->node);
    *box = (ebpo_face_box){ 0 };
}

typedef struct loading {
    ebpo_face_box *box;
    const ebpo_posed_solid *posed; /* NULL: not posed */
    uint32_t instance;
    bool fits;
} loading;

static bool extents_intersect(const ebpo_extent *a, const ebpo_extent *b)
{
    for (int i = 0; i < 3; i++)
        if (!(a->min[i] <= b->max[i] && a->max[i] >= b->min[i]))
            return false;
    return true;
}

/* Do the same as fmin and fmax for numbers that are not NAN, without a call. */
static inline double smaller_of(double a, double b) { return a < b ? a : b; }
static inline double larger_of(double a, double b) { return a > b ? a : b; }

static void widen_extent(ebpo_extent *e, const double min[3], const double max[3])
{
    for (int i = 0; i < 3; i++) {
        e->min[i] = smaller_of(e->min[i], min[i]);
        e->max[i] = larger_of(e->max[i], max[i]);
    }
}

static bool face_intersects(const double face[3][3], const ebpo_extent *around)
{
    ebpo_extent e;
    ebpo_vec3_copy(face[0], e.min);
    ebpo_vec3_copy(face[0], e.max);
    widen_extent(&e, face[1], face[1]);
    widen_extent(&e, face[2], face[2]);
    return extents_intersect(&e, around);
}

/* Adds a face if it intersects box->loaded. Returns false if there is no space for it. */
static bool add_posed_face(loading *l, const double corner[3][3], uint64_t face)
{
    ebpo_face_box *box = l->box;
    double posed[3][3];
    for (int k = 0; k < 3; k++)
        ebpo_posing_apply(&l->posed->posing, corner[k], posed[k]);
    if (!face_intersects((const double(*)[3])posed, &box->loaded))
        return true;
    l->fits = box->count < box->capacity;
    if (!l->fits)
        return false;
    memcpy(box->corner[box->count], posed, sizeof posed);
    box->face[box->count] = face;
    box->instance[box->count++] = l->instance;
    return true;
}

static bool receive_triangles(void *user, const ebpo_triangles *triangles)
{
    loading *l = user;
    ebpo_face_box *box = l->box;
    for (uint64_t i = 0; l->posed && i < triangles->count; i++)
        if (!add_posed_face(l, triangles->corners[i], triangles->faces[i]))
            return false;
    if (l->posed)
        return true;
    l->fits = triangles->count <= box->capacity - box->count;
    if (!l->fits)
        return false;
    memcpy(box->corner + box->count, triangles->corners, triangles->count * sizeof *box->corner);
    memcpy(box->face + box->count, triangles->faces, triangles->count * sizeof *box->face);
    for (uint64_t i = 0; i < triangles->count; i++)
        box->instance[box->count + i] = l->instance;
    box->count += triangles->count;
    return true;
}

void ebpo_face_box_end(ebpo_face_box *box)
{
    static const ebpo_extent empty = { { INFINITY, INFINITY, INFINITY },
                                       { -INFINITY, -INFINITY, -INFINITY } };
    box->leaves = ebpo_face_box_leaves(box->count);
    for (uint64_t leaf = 0; leaf < box->leaves; leaf++) {
        ebpo_extent *e = &box->node[box->leaves + leaf];
        *e = empty;
        for (uint64_t f = leaf * EBPO_FACE_BOX_LEAF;
             f < box->count && f < (leaf + 1) * EBPO_FACE_BOX_LEAF; f++)
            for (int k = 0; k < 3; k++)
                widen_extent(e, box->corner[f][k], box->corner[f][k]);
    }
    for (uint64_t n = box->leaves - 1; n > 0; n--) {
        box->node[n] = box->node[2 * n];
        widen_extent(&box->node[n], box->node[2 * n + 1].min, box->node[2 * n + 1].max);
    }
}

void ebpo_face_box_begin(ebpo_face_box *box, uint64_t serial, const ebpo_extent *allowed,
                         double margin)
{
    box->serial = serial;
    box->count = 0;
    box->allowed = *allowed;
    for (int i = 0; i < 3; i++) {
        box->loaded.min[i] = allowed->min[i] - margin;
        box->loaded.max[i] = allowed->max[i] + margin;
    }
}

ebpo_status ebpo_face_box_add(ebpo_face_box *box, ebpo_context *context,
                              const ebpo_posed_solid *posed, uint32_t instance, bool *fits,
                              ebpo_error *error)
{
    loading l = { box, posed, instance, true };
    double min[3], max[3];
    ebpo_vec3_copy(box->loaded.min, min);
    ebpo_vec3_copy(box->loaded.max, max);
    if (posed)
        ebpo_unpose_box(posed, box->loaded.min, box->loaded.max, min, max);
    ebpo_status status = ebpo_triangles_in_box(context, min, max, receive_triangles, &l, error);
    *fits = l.fits;
    return status;
}

bool ebpo_face_box_find(const ebpo_face_box *box, const ebpo_extent *around, uint32_t *found,
                        uint32_t most, uint32_t *visits, uint32_t *count)
{
    uint64_t stack[64]; /* at most one node of each level waits */
    int depth = 0;
    *count = 0;
    stack[depth++] = 1;
    while (depth > 0) {
        uint64_t n = stack[--depth];
        if (*visits == 0)
            return false;
        --*visits;
        if (!extents_intersect(&box->node[n], around))
            continue;
        if (n < box->leaves) {
            stack[depth++] = 2 * n + 1;
            stack[depth++] = 2 * n;
            continue;
        }
        uint64_t f = (n - box->leaves) * EBPO_FACE_BOX_LEAF, end = f + EBPO_FACE_BOX_LEAF;
        for (; f < end && f < box->count; f++)
            if (face_intersects((const double(*)[3])box->corner[f], around)) {
                if (*count == most)
                    return false;
                found[(*count)++] = (uint32_t)f;
            }
    }
    return true;
}

/* Returns the squared distance of two boxes. */
static double box_square_distance(const ebpo_extent *a, const ebpo_extent *b)
{
    double square = 0;
    for (int i = 0; i < 3; i++) {
        double d = larger_of(0, larger_of(a->min[i] - b->max[i], b->min[i] - a->max[i]));
        square += d * d;
    }
    return square;
}

/* Returns the least squared distance of the boxes of a leaf's faces from `around`. */
static double min_square_of_leaf(const ebpo_face_box *box, uint64_t leaf, const ebpo_extent *around)
{
    double least = INFINITY;
    uint64_t f = leaf * EBPO_FACE_BOX_LEAF, end = f + EBPO_FACE_BOX_LEAF;
    for (; f < end && f < box->count; f++) {
        ebpo_extent e;
        ebpo_vec3_copy(box->corner[f][0], e.min);
        ebpo_vec3_copy(box->corner[f][0], e.max);
        widen_extent(&e, box->corner[f][1], box->corner[f][1]);
        widen_extent(&e, box->corner[f][2], box->corner[f][2]);
        least = smaller_of(least, box_square_distance(&e, around));
    }
    return least;
}

/* Returns a lower bound of the squared distance of `around` from the faces, at most `least`. *leaf:
 * see ebpo_face_box_gap. */
static double min_square_distance(const ebpo_face_box *box, const ebpo_extent *around, double least,
                                  uint32_t max_visits, uint64_t *leaf, uint64_t *visits)
{
    struct {
        uint64_t node;
        double lower;
    } stack[64]; /* at most one node of each level waits */
    int depth = 0;
    if (box->count == 0)
        return least;
    if (*leaf < box->leaves) {
        least = smaller_of(least, min_square_of_leaf(box, *leaf, around));
        ++*visits;
    }
    stack[depth].node = 1;
    stack[depth++].lower = box_square_distance(&box->node[1], around);
    for (uint32_t n = 0; depth > 0; n++) {
        uint64_t node = stack[--depth].node;
        double lower = stack[depth].lower;
        if (!(lower < least))
            continue;
        ++*visits;
        if (n >= max_visits) {
            least = lower;
        } else if (node >= box->leaves) {
            double square = min_square_of_leaf(box, node - box->leaves, around);
            if (square < least) {
                least = square;
                *leaf = node - box->leaves;
            }
        } else {
            double l = box_square_distance(&box->node[2 * node], around);
            double r = box_square_distance(&box->node[2 * node + 1], around);
            bool first = l <= r; /* the left child is nearer; the nearer child is pushed last, so
                                    that it is visited first */
            stack[depth].node = 2 * node + first;
            stack[depth++].lower = first ? r : l;
            stack[depth].node = 2 * node + !first;
            stack[depth++].lower = first ? l : r;
        }
    }
    return least;
}

double ebpo_face_box_gap(const ebpo_face_box *box, const ebpo_extent *around, double most,
                         uint32_t max_visits, uint64_t *leaf, uint64_t *visits)
{
    return sqrt(min_square_distance(box, around, most * most, max_visits, leaf, visits)) *
           (1 - 0x1p-48);
}

/* --- the nearest point of a face --- */

/* The nearest point of a face's edges to a point p. */
typedef struct nearest_edge_point {
    double square, offset[3]; /* offset: from the nearest point to p; square: offset . offset */
    int edge;                 /* edge from corner `edge` to the next corner */
    double fraction;          /* position on the edge: 0 at its first corner, 1 at its last */
} nearest_edge_point;

/* Replaces *best by the nearest point of edge k if that point is nearer. */
static void try_edge(const double p[3], const double face[3][3], int k, nearest_edge_point *best)
{
    const double *a = face[k], *b = face[(k + 1) % 3];
    double e[3], d[3], fraction = 0;
    ebpo_vec3_subtract(b, a, e);
    ebpo_vec3_subtract(p, a, d);
    double length = ebpo_vec3_dot(e, e);
    if (length > 0)
        fraction = fmin(fmax(ebpo_vec3_dot(d, e) / length, 0), 1);
    for (int i = 0; i < 3; i++)
        d[i] -= fraction * e[i];
    double square = ebpo_vec3_dot(d, d);
    if (square < best->square) {
        *best = (nearest_edge_point){ .square = square, .edge = k, .fraction = fraction };
        for (int i = 0; i < 3; i++)
            best->offset[i] = d[i];
    }
}

/* Computes the result if the nearest point is in the interior of the face. Otherwise returns
 * false. */
static bool nearest_in_interior(const double p[3], const double face[3][3], ebpo_face_near *out)
{
    double e[3], f[3], n[3], d[3], c[3];
    ebpo_vec3_subtract(face[1], face[0], e);
    ebpo_vec3_subtract(face[2], face[0], f);
    ebpo_vec3_subtract(p, face[0], d);
    ebpo_vec3_cross(e, f, n);
    double area = ebpo_vec3_dot(n, n);
    if (!(area > 0))
        return false;
    ebpo_vec3_cross(d, f, c);
    double u = ebpo_vec3_dot(c, n) / area;
    ebpo_vec3_cross(e, d, c);
    double v = ebpo_vec3_dot(c, n) / area;
    if (!(u >= 0 && v >= 0 && u + v <= 1))
        return false;
    double length = sqrt(area), height = ebpo_vec3_dot(d, n) / length;
    out->distance = fabs(height);
    for (int i = 0; i < 3; i++)
        out->away[i] = height > 0 ? n[i] / length : height < 0 ? -n[i] / length : 0;
    out->weight[0] = 1 - u - v;
    out->weight[1] = u;
    out->weight[2] = v;
    return true;
}

void ebpo_face_nearest(const double p[3], const double face[3][3], ebpo_face_near *out)
{
    if (nearest_in_interior(p, face, out))
        return;
    nearest_edge_point best = { .square = INFINITY };
    for (int k = 0; k < 3; k++)
        try_edge(p, face, k, &best);
    out->distance = sqrt(best.square);
    for (int i = 0; i < 3; i++) {
        out->away[i] = out->distance > 0 ? best.offset[i] / out->distance : 0;
        out->weight[i] = 0;
    }
    out->weight[best.edge] = 1 - best.fraction;
    out->weight[(best.edge + 1) % 3] = best.fraction;
}

/* Greatest number of steps of Newton's method. */
enum { STEPS = 24 };

static const double no_contact = 2; /* every fraction of the path is at most 1 */

/* Searches with Newton's method. A face is a convex set, so the distance from a face is a convex
 * function along a line. The graph of this function is above its tangents. So a step of Newton's
 * method never passes the point at which the ball first touches the face. */
double ebpo_ball_first_contact(const ebpo_ball_motion *ball, const double face[3][3],
                               double away[3])
{
    double fraction = 0;
    for (int step = 0; step < STEPS; step++) {
        double x[3];
        ebpo_face_near near;
        for (int i = 0; i < 3; i++)
            x[i] = ball->from[i] + fraction * ball->motion[i];
        ebpo_face_nearest(x, face, &near);
        double gap = near.distance - ball->radius;
        double slope = ebpo_vec3_dot(near.away, ball->motion);
        for (int i = 0; i < 3; i++)
            away[i] = near.away[i];
        if (slope >= -(gap > 0 ? ball->slack : ball->least_slack))
            return no_contact;
        if (gap <= ball->band)
            return fraction;
        fraction -= gap / slope;
        if (!(fraction <= 1))
            return no_contact;
    }
    return fraction;
}

/* Returns the exact sign of the volume of the tetrahedron a, b, c, d: -1, 0 or 1. Returns any other
 * value if the sign cannot be decided without allocating memory. */
static int volume_sign(const double a[3], const double b[3], const double c[3], const double d[3])
{
    double u[3], v[3], w[3], value = 0, sum = 0, last = 0;
    ebpo_vec3_subtract(b, a, u);
    ebpo_vec3_subtract(c, a, v);
    ebpo_vec3_subtract(d, a, w);
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        double l = u[j] * v[k], r = u[k] * v[j];
        value += (l - r) * w[i];
        sum += (fabs(l) + fabs(r)) * fabs(w[i]);
        last += fabs(w[i]);
    }
    /* the filter of ebpo_orient3d; that function is not called, because it may allocate memory */
    double bound = 0x1p-50 * sum + 0x1p-960 * (1 + last);
    return value > bound ? 1 : value < -bound ? -1 : ebpo_orient3d_expansion(a, b, c, d);
}

/* Returns false if the segment pq and the face, which are in one plane, certainly have no common
 * point, and true if they may have one. Projects along `axis`, and searches the lines of the face's
 * edges and of pq for a line that separates the segment and the face. */
static bool intersects_in_plane(const double p[3], const double q[3], const double face[3][3],
                                int axis)
{
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    double a[2] = { p[u], p[v] }, b[2] = { q[u], q[v] }, corner[3][2];
    int orientations[3]; /* of p, q and each corner */
    for (int k = 0; k < 3; k++) {
        corner[k][0] = face[k][u];
        corner[k][1] = face[k][v];
        orientations[k] = ebpo_orient2d_expansion(a, b, corner[k]);
    }
    int orientation = ebpo_orient2d_expansion(corner[0], corner[1], corner[2]);
    if (orientation != 1 && orientation != -1)
        return orientation != 0;
    if (orientations[0] == orientations[1] && orientations[1] == orientations[2] &&
        (orientations[0] == 1 || orientations[0] == -1))
        return false;
    for (int k = 0; k < 3; k++)
        if (ebpo_orient2d_expansion(corner[k], corner[(k + 1) % 3], a) == -orientation &&
            ebpo_orient2d_expansion(corner[k], corner[(k + 1) % 3], b) == -orientation)
            return false;
    /* if pq is on the line of an edge, none of these lines separates the segment from the face, so
     * compare intervals */
    for (int i = 0; i < 2; i++)
        if (fmax(a[i], b[i]) < fmin(corner[0][i], fmin(corner[1][i], corner[2][i])) ||
            fmin(a[i], b[i]) > fmax(corner[0][i], fmax(corner[1][i], corner[2][i])))
            return false;
    return true;
}

/* Does the same as intersects_in_plane, with the first axis along which the projection of the face
 * has an area. Returns false if the face has no area. */
static bool intersects_coplanar(const double p[3], const double q[3], const double face[3][3])
{
    for (int axis = 0; axis < 3; axis++) {
        int u = (axis + 1) % 3, v = (axis + 2) % 3;
        const double c[3][2] = { { face[0][u], face[0][v] },
                                 { face[1][u], face[1][v] },
                                 { face[2][u], face[2][v] } };
        if (ebpo_orient2d_expansion(c[0], c[1], c[2]) != 0)
            return intersects_in_plane(p, q, face, axis);
    }
    return false;
}

bool ebpo_segment_may_intersect(const double p[3], const double q[3], const double face[3][3])
{
    for (int i = 0; i < 3; i++)
        if (fmax(p[i], q[i]) < fmin(face[0][i], fmin(face[1][i], face[2][i])) ||
            fmin(p[i], q[i]) > fmax(face[0][i], fmax(face[1][i], face[2][i])))
            return false;
    int at_p = volume_sign(face[0], face[1], face[2], p);
    int at_q = volume_sign(face[0], face[1], face[2], q);
    if (at_p == at_q && (at_p == 1 || at_p == -1))
        return false;
    if (at_p == 0 && at_q == 0)
        return intersects_coplanar(p, q, face);
    bool left = false, right = false;
    for (int k = 0; k < 3; k++) {
        int sign = volume_sign(p, q, face[k], face[(k + 1) % 3]);
        left |= sign == 1;
        right |= sign == -1;
    }
    return !(left && right);
}

enum { CROSSES_DEGENERATE = 2 };

/* Returns the change of the winding number from p to q at this face: 1 from outside to inside, -1
 * from inside to outside, 0 if there is no common point. Returns CROSSES_DEGENERATE if the segment
 * crosses an edge or a corner, or begins or ends in the face's plane, or if the crossing cannot be
 * decided without allocating memory. */
static int segment_crosses(const double p[3], const double q[3], const double face[3][3])
{
    if (!ebpo_segment_may_intersect(p, q, face))
        return 0;
    int at_p = volume_sign(face[0], face[1], face[2], p);
    int at_q = volume_sign(face[0], face[1], face[2], q);
    if (at_p * at_q != -1)
        return CROSSES_DEGENERATE;
    for (int k = 0; k < 3; k++) {
        int sign = volume_sign(p, q, face[k], face[(k + 1) % 3]);
        if (sign != 1 && sign != -1)
            return CROSSES_DEGENERATE;
    }
    return at_p; /* 1: p is on the outer side */
}

void ebpo_near_push(ebpo_near_queue *queue, double key, uint64_t node)
{
    uint64_t at = queue->count++;
    for (; at > 0 && queue->item[(at - 1) / 2].key > key; at = (at - 1) / 2)
        queue->item[at] = queue->item[(at - 1) / 2];
    queue->item[at] = (ebpo_near_node){ key, node };
}

ebpo_near_node ebpo_near_pop(ebpo_near_queue *queue)
{
    ebpo_near_node first = queue->item[0], last = queue->item[--queue->count];
    uint64_t at = 0;
    for (uint64_t child = 1; child < queue->count; child = 2 * at + 1) {
        if (child + 1 < queue->count && queue->item[child + 1].key < queue->item[child].key)
            child++;
        if (!(queue->item[child].key < last.key))
            break;
        queue->item[at] = queue->item[child];
        at = child;
    }
    if (queue->count > 0)
        queue->item[at] = last;
    return first;
}

/* --- the winding number of a point --- */

/* Greatest number of attempts of ebpo_known_winding_move. */
enum { MOVES_MAX = 12 };

static void extent_of_segment(const double p[3], const double q[3], ebpo_extent *out)
{
    for (int i = 0; i < 3; i++) {
        out->min[i] = fmin(p[i], q[i]);
        out->max[i] = fmax(p[i], q[i]);
    }
}

typedef enum crossing {
    CROSSED,
    TOO_MANY,  /* more faces or nodes than the limits allow */
    DEGENERATE /* the segment crosses an edge or a corner, or touches a face */
} crossing;

/* Counts the crossings along the segment from start->at to `to`. If the result is CROSSED, *start
 * is now the point `to` with its winding number. With other results *start is unchanged. */
static crossing cross_faces(ebpo_known_winding *start, const ebpo_face_box *box, const double to[3],
                            uint32_t *found, uint32_t most, uint32_t visits, uint64_t *work)
{
    ebpo_extent around;
    uint32_t count;
    int32_t change = 0;
    extent_of_segment(start->at, to, &around);
    bool all = ebpo_face_box_find(box, &around, found, most, &visits, &count);
    *work += count;
    if (!all)
        return TOO_MANY;
    for (uint32_t i = 0; i < count; i++) {
        if (box->instance[found[i]] != start->instance)
            continue;
        int sign = segment_crosses(start->at, to, (const double(*)[3])box->corner[found[i]]);
        if (sign == CROSSES_DEGENERATE)
            return DEGENERATE;
        change += sign;
    }
    start->winding += change;
    ebpo_vec3_copy(to, start->at);
    return CROSSED;
}

/* Sets `via` to a pseudorandom point near the middle of the path, for a detour. Each call returns a
 * different point. */
static void choose_detour(ebpo_known_winding *start, const double to[3], const ebpo_extent *within,
                          double via[3])
{
    double length = 0;
    for (int i = 0; i < 3; i++)
        length = fmax(length, fabs(to[i] - start->at[i]));
    for (int i = 0; i < 3; i++) {
        start->random = start->random * 1664525u + 1013904223u;
        double off = (double)(start->random >> 8) * 0x1p-24 - 0.5;
        via[i] = 0.5 * (start->at[i] + to[i]) + 0.75 * off * length;
        via[i] = fmin(fmax(via[i], within->min[i]), within->max[i]);
    }
}

bool ebpo_known_winding_move(ebpo_known_winding *start, const ebpo_face_box *box,
                             const double place[3], uint32_t *found, uint32_t most, uint32_t visits,
                             uint64_t *work)
{
    double to[3];
    ebpo_vec3_copy(place, to);
    start->known = start->known && ebpo_extent_holds(&box->allowed, start->at);
    if (!start->known || !ebpo_extent_holds(&box->allowed, place))
        return false;
    for (int move = 0; move < MOVES_MAX; move++) {
        switch (cross_faces(start, box, to, found, most, visits, work)) {
        case CROSSED:
            if (to[0] == place[0] && to[1] == place[1] && to[2] == place[2])
                return true;
            ebpo_vec3_copy(place, to);
            break;
        case TOO_MANY:
            for (int i = 0; i < 3; i++)
                to[i] = start->at[i] + 0.25 * (to[i] - start->at[i]);
            break;
        case DEGENERATE: choose_detour(start, to, &box->allowed, to); break;
        }
    }
    return false;
}

bool ebpo_is_on_face(const ebpo_face_box *box, uint32_t instance, const double place[3],
                     uint32_t *found, uint32_t most, uint32_t visits)
{
    ebpo_extent around;
    uint32_t count;
    extent_of_segment(place, place, &around);
    (void)ebpo_face_box_find(box, &around, found, most, &visits, &count);
    for (uint32_t i = 0; i < count; i++)
        if (box->instance[found[i]] == instance &&
            ebpo_segment_may_intersect(place, place, (const double(*)[3])box->corner[found[i]]))
            return true;
    return false;
}
