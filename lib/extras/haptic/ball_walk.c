/* Follows a ball along a straight piece of its path to the first face in contact, and checks that
 * the ball's centre crosses no face.
 *
 * Nodes of the tree over the faces are visited in the order of their earliest possible contact. The
 * search ends when the earliest possible contact of the next node is later than the first contact
 * found. The distance from a box or a face is convex along a line, so Newton's method never passes
 * the point at which the distance is equal to the ball's radius. Among nodes that are already in
 * contact, the closest node is visited first.
 *
 * The work of a haptic step is bounded. If the limit is reached, the piece ends where the next node
 * may be in contact; or, if that place is near the beginning, the next haptic step continues the
 * search. The search also ends if the contacts found so far hold the ball in its position.
 *
 * The planes of the contacts bound a cone of allowed motions. The walk needs the motion in the cone
 * that is nearest to the wanted motion. This nearest motion is the wanted motion itself, its
 * projection onto a plane or onto the line of two planes, or 0. All these candidates are tried,
 * because there are few planes. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "extras/haptic/ball_walk.h"
#include "extras/haptic/face_box.h"
#include "geometry/vec3.h"

/* The search for the allowed motion that is nearest to `want`. */
typedef struct motion_search {
    const ebpo_held_planes *planes;
    const double *want; /* [3] */
    double length;      /* length of `want` */
    double best;        /* squared distance of `out` from `want` */
    double slack;       /* tolerance with which `out` satisfies the planes */
    double *out;        /* [3] */
} motion_search;

/* Keeps the motion if all planes allow it with the tolerance `slack`, and it is nearer to `want`
 * than the best motion so far. */
static void try_motion(motion_search *t, const double motion[3], double slack)
{
    double lost[3];
    for (int i = 0; i < t->planes->count; i++)
        if (ebpo_vec3_dot(motion, t->planes->normal[i]) < -slack)
            return;
    ebpo_vec3_subtract(t->want, motion, lost);
    double square = ebpo_vec3_dot(lost, lost);
    if (square < t->best) {
        t->best = square;
        t->slack = slack;
        ebpo_vec3_copy(motion, t->out);
    }
}

/* Tries the projection of `want` onto the plane with the normal n. */
static void try_plane(motion_search *t, const double n[3], double slack)
{
    double motion[3], into = ebpo_vec3_dot(t->want, n);
    for (int i = 0; i < 3; i++)
        motion[i] = t->want[i] - into * n[i];
    try_motion(t, motion, slack);
}

/* Tries the projection of `want` onto the line of two planes. */
static void try_line(motion_search *t, const double m[3], const double n[3], double slack)
{
    double line[3], motion[3];
    ebpo_vec3_cross(m, n, line);
    double square = ebpo_vec3_dot(line, line);
    if (!(square > 0x1p-40))
        return;
    double fraction = ebpo_vec3_dot(t->want, line) / square;
    for (int i = 0; i < 3; i++)
        motion[i] = fraction * line[i];
    try_motion(t, motion, slack / sqrt(square));
}

double ebpo_project_motion(const ebpo_held_planes *planes, const double want[3], double out[3])
{
    double length = sqrt(ebpo_vec3_dot(want, want)), slack = 0x1p-44 * length;
    motion_search t = { planes, want, length, INFINITY, slack, out };
    for (int i = 0; i < 3; i++)
        out[i] = 0;
    try_motion(&t, want, slack);
    if (t.best == 0)
        return slack;
    for (int i = 0; i < planes->count; i++)
        try_plane(&t, planes->normal[i], slack);
    for (int i = 0; i < planes->count; i++)
        for (int j = 0; j < i; j++)
            try_line(&t, planes->normal[i], planes->normal[j], slack);
    return t.slack;
}

void ebpo_held_planes_add(ebpo_held_planes *planes, const double normal[3])
{
    for (int k = 0; k < planes->count; k++)
        if (memcmp(planes->normal[k], normal, sizeof planes->normal[k]) == 0)
            return;
    if (planes->count < EBPO_PLANES_LIMIT)
        ebpo_vec3_copy(normal, planes->normal[planes->count++]);
}

/* --- the walk --- */

enum {
    STEPS = 6, /* greatest number of steps of Newton's method */
    /* Numbers of faces and nodes of a haptic step that are reserved for the check of crossings. */
    KEPT_FACES = 64,
    KEPT_NODES = 256,
    /* Number of further faces that are visited after a face holds the ball in its position. */
    HELD_FACES = 48
};

/* Least fraction of a piece at which the piece may end before its contact is known. */
static const double least_fraction = 1.0 / 32;

/* Returns the capacity of the queue. The subtrees of waiting nodes are disjoint, so their number is
 * at most the number of leaves. */
static uint64_t capacity_for(uint64_t faces) { return ebpo_face_box_leaves(faces) + 1; }

uint64_t ebpo_ball_walk_bytes(uint64_t faces)
{
    return capacity_for(faces) * sizeof(ebpo_near_node);
}

ebpo_status ebpo_ball_walk_new(ebpo_ball_walk *w, uint64_t faces, ebpo_error *error)
{
    *w = (ebpo_ball_walk){ .stage = EBPO_BALL_IDLE };
    w->queue.item = ebpo_alloc(capacity_for(faces), sizeof *w->queue.item);
    if (!w->queue.item)
        return ebpo_fail_memory(error, ebpo_ball_walk_bytes(faces));
    memset(w->queue.item, 0xff, ebpo_ball_walk_bytes(faces));
    return EBPO_OK;
}

void ebpo_ball_walk_free(ebpo_ball_walk *w)
{
    free(w->queue.item);
    w->queue.item = NULL;
}

/* Returns true if the ball's motion leads nearer to no point of `e`. Rounding is ignored, because
 * it is less than the slacks of ebpo_ball_motion. */
static bool moves_away(const ebpo_ball_walk *w, const ebpo_extent *e)
{
    double least = 0;
    for (int i = 0; i < 3; i++)
        least += w->motion[i] * (w->from[i] - (w->motion[i] > 0 ? e->max[i] : e->min[i]));
    return least >= 0;
}

/* Returns a lower bound of the fraction of the path after which the ball touches faces in `e`.
 * Returns minus the overlap if the ball may touch faces at the beginning, and INFINITY if it
 * touches none before the fraction w->fraction. */
static double earliest_contact(const ebpo_ball_walk *w, const ebpo_extent *e)
{
    double fraction = 0;
    for (int step = 0; step < STEPS; step++) {
        double off[3];
        for (int i = 0; i < 3; i++) {
            double x = w->from[i] + fraction * w->motion[i];
            off[i] = x > e->max[i] ? x - e->max[i] : x < e->min[i] ? x - e->min[i] : 0;
        }
        double distance = sqrt(ebpo_vec3_dot(off, off)),
               gap = distance - (w->contact_distance + 2 * w->band);
        if (gap <= 0)
            return fraction > 0 ? fraction : moves_away(w, e) ? INFINITY : gap;
        double slope = ebpo_vec3_dot(off, w->motion) / distance;
        if (!(slope < 0))
            return INFINITY;
        fraction -= gap / slope;
        if (!(fraction <= w->fraction))
            return INFINITY;
    }
    return fraction;
}

/* Adds a node to the queue if the ball may touch its faces before the contact found so far. */
static void push_node(ebpo_ball_walk *w, uint64_t node)
{
    double key = earliest_contact(w, &w->box->node[node]);
    if (key < w->fraction)
        ebpo_near_push(&w->queue, key, node);
}

void ebpo_ball_begin(ebpo_ball_walk *w)
{
    w->stage = EBPO_BALL_SEARCHES;
    w->fraction = 1;
    w->contacts.count = 0;
    w->work_limited = false;
    w->queue.count = 0;
    if (w->box && w->box->count > 0)
        push_node(w, 1);
}

static void inspect_leaf(ebpo_ball_walk *w, uint64_t leaf, ebpo_ball_work *work)
{
    const ebpo_ball_motion motion = { w->from, w->motion, w->contact_distance,
                                      w->band, w->slack,  w->least_slack };
    uint64_t f = leaf * EBPO_FACE_BOX_LEAF, end = f + EBPO_FACE_BOX_LEAF;
    for (; f < end && f < w->box->count; f++) {
        double away[3];
        double fraction =
            ebpo_ball_first_contact(&motion, (const double(*)[3])w->box->corner[f], away);
        work->faces++;
        if (fraction > w->fraction)
            continue;
        if (fraction < w->fraction)
            w->contacts.count = 0;
        w->fraction = fraction;
        ebpo_held_planes_add(&w->contacts, away);
    }
}

/* Ends the piece where the first node of the queue may be in contact; the other nodes of the queue
 * may be in contact only later. Returns false, and changes nothing, if the piece would be too
 * short. */
static bool end_before_waiting(ebpo_ball_walk *w)
{
    if (w->fraction <= 0)
        return true;
    if (!(w->queue.item[0].key >= least_fraction))
        return false;
    w->fraction = w->queue.item[0].key;
    w->contacts.count = 0;
    w->work_limited = true;
    return true;
}

/* Searches for the first contact. Returns false if the next haptic step must continue. */
static bool find_contact(ebpo_ball_walk *w, ebpo_ball_work *work)
{
    uint32_t held = work->faces; /* work->faces when a face first held the ball in its position */
    while (w->queue.count > 0 && w->queue.item[0].key < w->fraction) {
        if (w->fraction <= 0 &&
            (w->contacts.count == EBPO_PLANES_LIMIT || work->faces >= held + HELD_FACES))
            break;
        if (work->faces + EBPO_FACE_BOX_LEAF + KEPT_FACES > EBPO_BALL_FACES ||
            work->nodes + 2 + KEPT_NODES > EBPO_BALL_NODES) {
            if (!end_before_waiting(w))
                return false;
            break;
        }
        uint64_t node = ebpo_near_pop(&w->queue).node;
        if (node >= w->box->leaves) {
            held = w->fraction > 0 ? work->faces : held;
            inspect_leaf(w, node - w->box->leaves, work);
            continue;
        }
        work->nodes += 2;
        push_node(w, 2 * node);
        push_node(w, 2 * node + 1);
    }
    return true;
}

static void begin_check(ebpo_ball_walk *w)
{
    w->stage = EBPO_BALL_CHECKS;
    for (int i = 0; i < 3; i++)
        w->to[i] = w->from[i] + w->fraction * w->motion[i];
    w->depth = 0;
    if (w->fraction > 0 && w->box && w->box->count > 0)
        w->stack[w->depth++] = 1;
}

/* Returns true if the segment of the centre may intersect `e`. `e` is widened by more than the
 * rounding errors, but less than the ball's distance from faces. */
static bool may_cross(const ebpo_ball_walk *w, const ebpo_extent *e)
{
    double enters = 0, leaves = 1, wider = 16 * w->band;
    for (int i = 0; i < 3; i++) {
        double d = w->to[i] - w->from[i];
        double low = e->min[i] - wider - w->from[i], high = e->max[i] + wider - w->from[i];
        if (d == 0) {
            if (low > 0 || high < 0)
                return false;
            continue;
        }
        enters = fmax(enters, (d > 0 ? low : high) / d);
        leaves = fmin(leaves, (d > 0 ? high : low) / d);
    }
    return enters <= leaves;
}

static bool crosses_leaf(const ebpo_ball_walk *w, uint64_t leaf, ebpo_ball_work *work)
{
    uint64_t f = leaf * EBPO_FACE_BOX_LEAF, end = f + EBPO_FACE_BOX_LEAF;
    for (; f < end && f < w->box->count; f++) {
        work->faces++;
        if (ebpo_segment_may_intersect(w->from, w->to, (const double(*)[3])w->box->corner[f]))
            return true;
    }
    return false;
}

/* Checks that the segment of the centre intersects no face. */
static ebpo_ball_end check_segment(ebpo_ball_walk *w, ebpo_ball_work *work)
{
    while (w->depth > 0) {
        if (work->faces + EBPO_FACE_BOX_LEAF > EBPO_BALL_FACES || work->nodes >= EBPO_BALL_NODES)
            return EBPO_BALL_UNFINISHED;
        uint64_t node = w->stack[--w->depth];
        work->nodes++;
        if (!may_cross(w, &w->box->node[node]))
            continue;
        if (node < w->box->leaves) {
            w->stack[w->depth++] = 2 * node + 1;
            w->stack[w->depth++] = 2 * node;
        } else if (crosses_leaf(w, node - w->box->leaves, work)) {
            return EBPO_BALL_CROSSED;
        }
    }
    return EBPO_BALL_ARRIVED;
}

ebpo_ball_end ebpo_ball_continue(ebpo_ball_walk *w, ebpo_ball_work *work)
{
    if (w->stage == EBPO_BALL_SEARCHES) {
        if (!find_contact(w, work))
            return EBPO_BALL_UNFINISHED;
        begin_check(w);
    }
    ebpo_ball_end end = check_segment(w, work);
    if (end != EBPO_BALL_UNFINISHED)
        w->stage = EBPO_BALL_IDLE;
    return end;
}
