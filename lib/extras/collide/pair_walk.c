#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/pair.h>

#include "core/alloc.h"
#include "extras/collide/pair_walk.h"
#include "geometry/predicates.h"
#include "geometry/triangle_pair.h"

/* Faces of one mesh: what neighbours have in common by being neighbours is no meeting. */

/* The edge against corner i, as a face without area. */
static void neighbours_opposite(const double a[3][3], int i, double out[3][3])
{
    memcpy(out[0], a[(i + 1) % 3], sizeof out[0]);
    memcpy(out[1], a[(i + 2) % 3], sizeof out[1]);
    memcpy(out[2], out[1], sizeof out[2]);
}

static bool edge_meets(const double a[3][3], int i, const double b[3][3])
{
    double edge[3][3];
    neighbours_opposite(a, i, edge);
    return ebpo_triangle_pair((const double(*)[3])edge, b) != EBPO_PAIR_APART;
}

/* Two convex sets with one corner in common have more if, going from there to another common point
 * and on, one comes to an edge against that corner while still in the other face. */
static ebpo_pair_kind one_corner(const double a[3][3], int i, const double b[3][3], int k)
{
    ebpo_pair_kind kind = ebpo_triangle_pair(a, b);
    if (kind == EBPO_PAIR_TOUCHING && !edge_meets(a, i, b) && !edge_meets(b, k, a))
        return EBPO_PAIR_APART;
    return kind;
}

/* With an edge in common, planes that differ have no other point. */
static ebpo_pair_kind one_edge(const double a[3][3], const double b[3][3])
{
    for (int k = 0; k < 3; k++)
        if (ebpo_orient3d(a[0], a[1], a[2], b[k]) != 0)
            return EBPO_PAIR_APART;
    return ebpo_triangle_pair(a, b) == EBPO_PAIR_COPLANAR ? EBPO_PAIR_COPLANAR : EBPO_PAIR_APART;
}

/* As ebpo_triangle_pair, but EBPO_PAIR_APART where the common points are the corner, or the edge
 * between corners, that both faces have (equal coordinates). Swapping changes nothing. */
static ebpo_pair_kind ebpo_neighbours(const double a[3][3], const double b[3][3])
{
    int shared = 0, in_a = 0, in_b = 0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            if (ebpo_corner_order(a[i], b[k]) == 0) {
                shared++;
                in_a = i;
                in_b = k;
            }
    if (shared == 0)
        return ebpo_triangle_pair(a, b);
    return shared == 1 ? one_corner(a, in_a, b, in_b) : one_edge(a, b);
}

/* 3x3 matrices in doubles, near rotations. */
static void accel_pair_inverse(const double m[3][3], double out[3][3])
{
    double det = 0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            int r1 = (k + 1) % 3, r2 = (k + 2) % 3, c1 = (i + 1) % 3, c2 = (i + 2) % 3;
            out[i][k] = m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1];
        }
    for (int k = 0; k < 3; k++)
        det += m[0][k] * out[k][0];
    for (int i = 0; i < 9; i++)
        out[i / 3][i % 3] /= det;
}

static void accel_pair_turn(const double m[3][3], const double x[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = m[i][0] * x[0] + m[i][1] * x[1] + m[i][2] * x[2];
}

static void to_floats(const double m[3][3], float out[3][3], float size[3][3])
{
    for (int i = 0; i < 9; i++) {
        out[i / 3][i % 3] = (float)m[i / 3][i % 3];
        size[i / 3][i % 3] = fabsf(out[i / 3][i % 3]) * (1 + 0x1p-22f);
    }
}

/* Frames too different or too strange for floats: every pair of nodes is looked at. */
static void look_at_all(ebpo_accel_pair *out)
{
    out->unit[0] = out->unit[1] = 1;
    for (int i = 0; i < 9; i++)
        out->turn[i / 3][i % 3] = i % 4 == 0;
    out->place[0] = out->place[1] = out->place[2] = 0;
    to_floats((const double(*)[3])out->turn, out->into[0], out->size[0]);
    to_floats((const double(*)[3])out->turn, out->into[1], out->size[1]);
    out->doubt = INFINITY;
    out->slabs = out->apart = false;
}

/* By the axes of the first's frame; spheres would not do better. */
static bool boxes_apart(const ebpo_accel_pair *p)
{
    double first = p->accel[0]->reach * (double)p->unit[0],
           second = p->accel[1]->reach * (double)p->unit[1];
    for (int i = 0; i < 3; i++) {
        double size = first + (double)p->doubt;
        for (int k = 0; k < 3; k++)
            size += fabs(p->turn[i][k]) * second;
        if (fabs(p->place[i]) > size * (1 + 0x1p-40))
            return true;
    }
    return false;
}

/* per_world: lengths of each frame for one of the world. */
static void choose_units(ebpo_accel_pair *out, const double per_world[2])
{
    double ratio = per_world[0] / per_world[1];
    out->slabs = ratio > 0x1p-60 && ratio < 0x1p60;
    out->unit[0] = ratio > 1 ? (float)fmax(1 / ratio, 0x1p-60) : 1;
    out->unit[1] = ratio > 1 ? 1 : (float)fmax(ratio, 0x1p-60);
}

void ebpo_accel_pair_make(ebpo_accel_pair *out, const ebpo_accel *const accel[2],
                          const ebpo_block_posing *const posing[2], double reach)
{
    double per_world[2], rotation[2][3][3], back[3][3], middle[3], seen[3];
    for (int i = 0; i < 2; i++) {
        out->accel[i] = accel[i];
        out->posing[i] = posing[i];
        per_world[i] = accel[i]->scale / posing[i]->posing.scale;
        ebpo_posing_rotation(&posing[i]->posing, rotation[i]);
    }
    choose_units(out, per_world);
    double unit = (double)out->unit[0] * per_world[0],
           ratio = unit / ((double)out->unit[1] * per_world[1]);
    if (!(unit > 0x1p-900 && unit < 0x1p900 && ratio > 0x1p-900 && ratio < 0x1p900 &&
          reach * unit < 0x1p100)) {
        look_at_all(out);
        return;
    }
    accel_pair_inverse((const double(*)[3])rotation[0], back);
    for (int k = 0; k < 3; k++) {
        double column[3] = { rotation[1][0][k], rotation[1][1][k], rotation[1][2][k] };
        accel_pair_turn((const double(*)[3])back, column, seen);
        for (int i = 0; i < 3; i++)
            out->turn[i][k] = seen[i] * ratio;
    }
    ebpo_posing_apply(&posing[1]->posing, accel[1]->centre, middle);
    for (int i = 0; i < 3; i++)
        middle[i] -= posing[0]->posing.translation[i];
    accel_pair_turn((const double(*)[3])back, middle, seen);
    for (int i = 0; i < 3; i++)
        out->place[i] = seen[i] * unit - accel[0]->centre[i] * (posing[0]->posing.scale * unit);
    to_floats((const double(*)[3])out->turn, out->into[0], out->size[0]);
    accel_pair_inverse((const double(*)[3])out->turn, back);
    to_floats((const double(*)[3])back, out->into[1], out->size[1]);
    double deviation = posing[0]->posing.deviation + posing[1]->posing.deviation;
    out->doubt = (float)(0x1p-44 * reach * unit) + 0x1p-100f;
    out->slab_share = (float)(0x1p-17 + 8 * deviation);
    out->sine_room = (float)(0x1p-17 + 16 * deviation);
    out->apart = boxes_apart(out);
}

void ebpo_pair_walk_free(ebpo_pair_walk *w)
{
    free(w->stack);
    free(w->met);
    w->stack = NULL;
    w->met = NULL;
    w->capacity = w->met_capacity = 0;
}

bool ebpo_pair_walk_room(ebpo_pair_walk *w, uint64_t more)
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

static ebpo_pair_kind exact_kind(ebpo_pair_walk *w, uint32_t slot_a, uint32_t slot_b)
{
    const ebpo_accel_pair *p = w->pair;
    double a[3][3], b[3][3];
    ebpo_posed_triangle(p->accel[0], &p->posing[0]->posing, slot_a, a);
    ebpo_posed_triangle(p->accel[1], &p->posing[1]->posing, slot_b, b);
    w->exact++;
    return w->neighbours ? ebpo_neighbours((const double(*)[3])a, (const double(*)[3])b)
                         : ebpo_triangle_pair((const double(*)[3])a, (const double(*)[3])b);
}

bool ebpo_pair_walk_decide(ebpo_pair_walk *w, uint32_t block_a, uint32_t block_b,
                           const ebpo_block_pairs *pairs)
{
    const ebpo_accel *const *s = w->pair->accel;
    uint32_t face_a = ebpo_accel_meshlet(s[0], block_a)->face,
             face_b = ebpo_accel_meshlet(s[1], block_b)->face;
    if (!ebpo_grow(&w->met, &w->met_capacity, w->met_count + pairs->count, sizeof *w->met))
        return false;
    for (unsigned i = 0; i < pairs->count; i++) {
        uint32_t lane_a = pairs->pair[i] & 7, lane_b = pairs->pair[i] >> 3 & 7;
        ebpo_met_pair met = { face_a + lane_a, face_b + lane_b, EBPO_PAIR_CROSSING };
        if (met.a < w->begin || met.a >= w->end || (w->self && met.a >= met.b))
            continue;
        if (w->neighbours || !(pairs->pair[i] & EBPO_CERTAINLY_CROSSING))
            met.kind = (int32_t)exact_kind(w, block_a * EBPO_BLOCK + lane_a,
                                           block_b * EBPO_BLOCK + lane_b);
        if (met.kind == EBPO_PAIR_APART)
            continue;
        w->met_slot[0] = block_a * EBPO_BLOCK + lane_a;
        w->met_slot[1] = block_b * EBPO_BLOCK + lane_b;
        w->met[w->met_count++] = met;
        if (w->first)
            break;
    }
    return true;
}
