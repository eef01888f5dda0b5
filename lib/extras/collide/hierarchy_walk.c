/* Provides functions for the kernels of the two walks through hierarchies: pair_walk_kernels.c
 * searches for faces that intersect, gap_walk_kernels.c for the nearest faces. A walk has a stack
 * of pairs of nodes, and keeps the last nodes and blocks that it has transformed. Each walk is for
 * one thread.
 *
 * ebpo_pair_walk_decide exactly decides the pairs of faces that the filter, which uses floats,
 * leaves undecided. If all faces belong to one mesh, a corner or edge that neighbouring faces share
 * is no contact. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/pair.h>

#include "core/alloc.h"
#include "extras/collide/hierarchy_walk.h"
#include "geometry/predicates.h"
#include "geometry/triangle_pair.h"
#include "geometry/vec3.h"

void ebpo_pair_walk_free(ebpo_pair_walk *w)
{
    free(w->stack);
    free(w->found_pairs);
    w->stack = NULL;
    w->found_pairs = NULL;
    w->capacity = w->found_capacity = 0;
}

bool ebpo_pair_walk_capacity(ebpo_pair_walk *w, uint64_t more)
{
    return w->top + more <= w->capacity ||
           ebpo_grow(&w->stack, &w->capacity, w->top + more, sizeof *w->stack);
}

void ebpo_posed_triangle(const ebpo_accel *accel, const ebpo_posing *posing, uint32_t slot,
                         double out[3][3])
{
    double t[3][3];
    ebpo_accel_triangle(accel, slot, t);
    for (int i = 0; i < 3; i++)
        ebpo_posing_apply(posing, t[i], out[i]);
}

/* --- neighbours in one mesh --- */

/* Makes the edge opposite corner i, in the form of a face without area. */
static void edge_opposite(const double a[3][3], int i, double out[3][3])
{
    memcpy(out[0], a[(i + 1) % 3], sizeof out[0]);
    memcpy(out[1], a[(i + 2) % 3], sizeof out[1]);
    memcpy(out[2], out[1], sizeof out[2]);
}

/* Returns true if the edge of a opposite corner i has a common point with b. */
static bool edge_intersects(const double a[3][3], int i, const double b[3][3])
{
    double edge[3][3];
    edge_opposite(a, i, edge);
    return ebpo_triangle_pair((const double(*)[3])edge, b) != EBPO_PAIR_APART;
}

/* Returns true if n . (p - corner) certainly has the sign of `side`. Each difference has a relative
 * error of at most 2^-53, so the error of the sum is at most 2^-50 times the sum of the terms'
 * absolute values, except for underflow. */
static bool is_on_side(const double n[3], const double corner[3], const double p[3], double side)
{
    double sum = 0, size = 0;
    for (int k = 0; k < 3; k++) {
        double term = n[k] * (p[k] - corner[k]) * side;
        sum += term;
        size += fabs(term);
    }
    return sum > 0x1p-50 * size + 0x1p-1000;
}

/* Returns true if a plane through the common corner (corner i of a, corner k of b) certainly
 * separates the faces, so that they have only this corner in common. Of all pairs of an edge of a
 * and an edge of b at the corner, one pair forms the least angle. The plane bisects this angle. The
 * plane's normal may be rounded, because the sides of the plane are tested with an error bound. */
static bool separate_at_corner(const double a[3][3], int i, const double b[3][3], int k)
{
    const double *p[4] = { a[(i + 1) % 3], a[(i + 2) % 3], b[(k + 1) % 3], b[(k + 2) % 3] };
    double unit[4][3], n[3], most = -INFINITY;
    int first = 0, second = 2;
    for (int e = 0; e < 4; e++) {
        ebpo_vec3_subtract(p[e], a[i], unit[e]);
        double inverse = 1 / ebpo_vec3_length(unit[e]);
        for (int c = 0; c < 3; c++)
            unit[e][c] *= inverse;
    }
    for (int e = 0; e < 4; e++) {
        double cosine = ebpo_vec3_dot(unit[e / 2], unit[2 + e % 2]);
        if (cosine > most) {
            most = cosine;
            first = e / 2;
            second = 2 + e % 2;
        }
    }
    ebpo_vec3_subtract(unit[first], unit[second], n);
    return is_on_side(n, a[i], p[0], 1) && is_on_side(n, a[i], p[1], 1) &&
           is_on_side(n, a[i], p[2], -1) && is_on_side(n, a[i], p[3], -1);
}

/* Returns the kind of two faces with one common corner: corner i of a and corner k of b. If the
 * faces have a second common point, consider the ray from the corner through this point. The ray
 * leaves one of the faces, at the edge opposite the corner, at a point that the other face
 * contains. So it suffices to test these edges. */
static ebpo_pair_kind one_corner(const double a[3][3], int i, const double b[3][3], int k)
{
    if (separate_at_corner(a, i, b, k))
        return EBPO_PAIR_APART;
    ebpo_pair_kind kind = ebpo_triangle_pair(a, b);
    if (kind == EBPO_PAIR_TOUCHING && !edge_intersects(a, i, b) && !edge_intersects(b, k, a))
        return EBPO_PAIR_APART;
    return kind;
}

/* Returns the kind of two faces with a common edge. If the faces are in different planes, they have
 * no common point except on the edge. opposite: the corner of b that is not on the edge; -1: a face
 * has two equal corners. */
static ebpo_pair_kind one_edge(const double a[3][3], const double b[3][3], int opposite)
{
    if (opposite >= 0 && ebpo_orient3d(a[0], a[1], a[2], b[opposite]) != 0)
        return EBPO_PAIR_APART;
    return ebpo_triangle_pair(a, b) == EBPO_PAIR_COPLANAR ? EBPO_PAIR_COPLANAR : EBPO_PAIR_APART;
}

/* Returns the kind of a pair as ebpo_triangle_pair does, but EBPO_PAIR_APART if the only common
 * points are a corner or an edge that both faces have, with equal coordinates. The result does not
 * change when the faces are swapped. */
static ebpo_pair_kind neighbour_kind(const double a[3][3], const double b[3][3])
{
    /* [bits of corners] if exactly two bits are set, the corner whose bit is 0; otherwise -1 */
    static const int third[8] = { -1, -1, -1, 2, -1, 1, 0, -1 };
    int shared = 0, in_a = 0, in_b = 0;
    int shared_b = 0; /* bits of the corners of b that a has, too */
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            if (a[i][0] == b[k][0] && a[i][1] == b[k][1] && a[i][2] == b[k][2]) {
                shared++;
                in_a = i;
                in_b = k;
                shared_b |= 1 << k;
            }
    if (shared == 0)
        return ebpo_triangle_pair(a, b);
    return shared == 1 ? one_corner(a, in_a, b, in_b) : one_edge(a, b, third[shared_b]);
}

/* Faces of two blocks at their poses, computed when they are needed. */
typedef struct posed_blocks {
    double corner[2][EBPO_BLOCK][3][3];
    unsigned known[2]; /* a bit for each lane, 1: its face has been posed */
} posed_blocks;

/* Returns the posed corners of a face; poses the face at its first use. */
static const double (*posed_corners(posed_blocks *posed, const ebpo_pair_walk *w, int side,
                                    uint32_t block, uint32_t lane))[3]
{
    double(*corner)[3] = posed->corner[side][lane];
    if (!(posed->known[side] >> lane & 1))
        ebpo_posed_triangle(w->pair->accel[side], &w->pair->posing[side]->posing,
                            block * EBPO_BLOCK + lane, corner);
    posed->known[side] |= 1u << lane;
    return (const double(*)[3])corner;
}

bool ebpo_pair_walk_decide(ebpo_pair_walk *w, uint32_t block_a, uint32_t block_b,
                           const ebpo_block_pairs *pairs)
{
    const ebpo_accel *const *s = w->pair->accel;
    uint32_t face_a = ebpo_accel_meshlet(s[0], block_a)->face,
             face_b = ebpo_accel_meshlet(s[1], block_b)->face;
    posed_blocks posed;
    posed.known[0] = posed.known[1] = 0;
    if (!ebpo_grow(&w->found_pairs, &w->found_capacity, w->found_count + pairs->count,
                   sizeof *w->found_pairs))
        return false;
    for (unsigned i = 0; i < pairs->count; i++) {
        uint32_t lane_a = pairs->pair[i] & 7, lane_b = pairs->pair[i] >> 3 & 7;
        ebpo_found_pair found = { face_a + lane_a, face_b + lane_b, EBPO_PAIR_CROSSING };
        if (w->self) { /* pairs in one block come twice, others once, in either order */
            uint32_t a = found.a, b = found.b;
            if (block_a == block_b && a >= b)
                continue;
            found.a = a < b ? a : b;
            found.b = a < b ? b : a;
        }
        if (found.a < w->begin || found.a >= w->end)
            continue;
        if (w->neighbours || !(pairs->pair[i] & EBPO_CERTAINLY_CROSSING)) {
            const double(*a)[3] = posed_corners(&posed, w, 0, block_a, lane_a),
                  (*b)[3] = posed_corners(&posed, w, 1, block_b, lane_b);
            found.kind = (int32_t)(w->neighbours ? neighbour_kind(a, b) : ebpo_triangle_pair(a, b));
            w->exact++;
        }
        if (found.kind == EBPO_PAIR_APART)
            continue;
        w->found_slot[0] = block_a * EBPO_BLOCK + lane_a;
        w->found_slot[1] = block_b * EBPO_BLOCK + lane_b;
        w->found_pairs[w->found_count++] = found;
        if (w->first)
            break;
    }
    return true;
}

void ebpo_gap_begin(ebpo_gap_search *g, const ebpo_accel *const accel[2],
                    const ebpo_posing posing[2], double max_coordinate)
{
    for (int s = 0; s < 2; s++) {
        g->accel[s] = accel[s];
        ebpo_block_posing_make(&g->posing[s], &posing[s], max_coordinate);
        for (int i = 0; i < EBPO_GAP_NODES; i++)
            g->node[s][i].node = EBPO_NO_CHILD;
    }
    ebpo_posed_faces_forget(g->faces);
    ebpo_two_frames_make(&g->frames, accel, g->posing);
    g->count = g->waiting_count = 0;
    g->node_pairs = g->block_pairs = 0;
    g->ended = g->no_memory = g->is_heap = false;
    g->limit = g->square = g->best = INFINITY;
    g->tolerance = 0;
    g->direction_number = 0;
    for (int k = 0; k < 3; k++) /* the x axis is the direction for models whose centres are equal */
        g->direction[k] = k == 0;
    ebpo_gap_set_direction(g, g->direction);
    double centre[2][3];
    float direction[3];
    for (int s = 0; s < 2; s++)
        ebpo_posing_apply(&posing[s], accel[s]->centre, centre[s]);
    for (int k = 0; k < 3; k++)
        direction[k] = (float)((centre[1][k] - centre[0][k]) * g->posing[0].unit);
    ebpo_gap_set_direction(g, direction);
}

ebpo_gap_search *ebpo_gap_new(void) { return ebpo_alloc_lines(1, sizeof(ebpo_gap_search)); }

void ebpo_gap_free(ebpo_gap_search *g)
{
    if (g)
        free(g->stack);
    free(g);
}

void ebpo_gap_set_limit(ebpo_gap_search *g, float limit)
{
    if (!(limit < g->limit))
        return;
    g->limit = limit;
    g->square = limit < 0 ? -INFINITY : limit * limit * (1 + 0x1p-18f) + 0x1p-120f;
}

void ebpo_gap_set_best(ebpo_gap_search *g, float best, uint32_t slot_a, uint32_t slot_b)
{
    if (!(best < g->best))
        return;
    g->best = best;
    g->best_slot[0] = slot_a;
    g->best_slot[1] = slot_b;
    ebpo_gap_set_limit(g, best - g->tolerance);
}

/* Returns the scalar product of two vectors. */
static float float_dot(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Scales the direction to a length slightly less than 1, so that the computed gaps along the
 * direction are not too great. */
void ebpo_gap_set_direction(ebpo_gap_search *g, const float direction[3])
{
    float length = sqrtf(float_dot(direction, direction));
    if (!(length > 0x1p-50f && length < 0x1p60f))
        return;
    for (int k = 0; k < 3; k++)
        g->direction[k] = direction[k] * ((1 - 0x1p-19f) / length);
    g->direction_number++;
    for (int s = 0; s < 2; s++)
        for (int k = 0; k < 3; k++) {
            float sum = 0;
            for (int i = 0; i < 3; i++)
                sum += g->frames.frame[s].in_world[i][k] * g->direction[i];
            g->along[s][k] = s ? -sum : sum;
        }
    g->along_shift = float_dot(g->frames.frame[1].shift, g->along[0]);
}

bool ebpo_gap_capacity(ebpo_gap_search *g)
{
    if (ebpo_grow(&g->stack, &g->capacity, g->count + 64, sizeof *g->stack))
        return true;
    g->no_memory = g->ended = true;
    return false;
}

bool ebpo_gap_wait_capacity(ebpo_gap_search *g)
{
    unsigned kept = 0;
    if (g->waiting_count + 64 <= EBPO_GAP_CANDIDATES)
        return true;
    for (unsigned i = 0; i < g->waiting_count; i++)
        if (!(g->waiting[i].low > g->limit))
            g->waiting[kept++] = g->waiting[i];
    g->waiting_count = kept;
    return g->waiting_count + 64 <= EBPO_GAP_CANDIDATES || g->decide_waiting(g);
}
