/* A tick. */
#include "geom/strict_fp.h"

#include <math.h>

#include "base/fp_env.h"
#include "base/sized.h"
#include "touch/touch_parts.h"
#include "touch/vectors.h"

static void swap_boxes(ebpo_touch *t)
{
    unsigned before = t->at;
    t->at = t->seen;
    t->seen = before;
}

bool ebpo_touch_take_box(ebpo_touch *t)
{
    if (!(atomic_load_explicit(&t->between, memory_order_relaxed) & EBPO_TOUCH_FRESH))
        return false;
    unsigned got = atomic_exchange_explicit(&t->between, t->seen, memory_order_acq_rel);
    t->seen = got & ~(unsigned)EBPO_TOUCH_FRESH;
    if (!ebpo_extent_holds(&t->box[t->seen].centres, t->proxy))
        return false; /* it was made for another place */
    swap_boxes(t);
    t->stats.taken++;
    return true;
}

void ebpo_touch_tell(ebpo_touch *t, const double hand[3])
{
    for (int i = 0; i < 3; i++) {
        atomic_store_explicit(&t->proxy_told[i], t->proxy[i], memory_order_relaxed);
        atomic_store_explicit(&t->hand_told[i], hand[i], memory_order_relaxed);
    }
}

/* Coulomb: the proxy, which slid from `from` without friction, follows only as far as the
 * tangential part of the spring is more than friction takes. */
static uint32_t rub(ebpo_touch *t, const double from[3], const double hand[3], uint32_t *work)
{
    double slid[3], depth[3], goal[3];
    difference(t->proxy, from, slid);
    difference(hand, t->proxy, depth);
    double length = sqrt(dot(slid, slid));
    double holds = t->options.friction * sqrt(dot(depth, depth));
    double part = length > holds ? 1 - holds / length : 0;
    for (int i = 0; i < 3; i++)
        goal[i] = from[i] + part * slid[i] + (part > 0 ? depth[i] : 0);
    copy(from, t->proxy);
    t->way_count = 1;
    return part > 0 ? ebpo_touch_go(t, goal, work) : 0;
}

/* So that what is given in sum, `given`, never exceeds A = stiffness s^2, s being the longest step
 * that the hand ever made in a tick. With g = -given, a step of s' gives at most F s', and F s' - g
 * must not exceed stiffness max(s, s')^2. That is so for all s' where F^2 <= 4 stiffness g; and
 * where F <= 2 stiffness s and F s - g <= A, as from s on the right side then grows faster than the
 * left one. A spring that was pressed steadily to the depth d has F = stiffness d and g at least
 * stiffness d^2 / 2: there the one or the other holds, and nothing is taken off. */
static double most_force(const ebpo_touch *t)
{
    double k = t->options.stiffness, g = -t->given, s = t->stats.step_most;
    double by_step = s > 0 ? fmin(2 * k * s, k * s + g / s) : 0;
    double by_store = g > 0 ? 2 * sqrt(k * g) : 0;
    return fmax(fmax(by_step, by_store) * (1 - 0x1p-40), 0);
}

static void keep_passive(const ebpo_touch *t, double force[3])
{
    double length = sqrt(dot(force, force)), most = most_force(t);
    if (length > most)
        for (int i = 0; i < 3; i++)
            force[i] *= most / length;
}

/* From the hand to the proxy; where the proxy waits, what faces hold back of that. */
static void find_depth(const ebpo_touch *t, const double hand[3], uint32_t flags, double out[3])
{
    double want[3], way[3];
    difference(t->proxy, hand, out);
    if (!(flags & (EBPO_TOUCH_WAITS | EBPO_TOUCH_SHORT)))
        return;
    difference(hand, t->proxy, want);
    (void)ebpo_hold_back(&t->planes, want, way);
    difference(way, want, out);
}

static void push(ebpo_touch *t, const double out[3], const double moved[3], double force[3])
{
    for (int i = 0; i < 3; i++)
        force[i] = t->options.stiffness * out[i] - t->options.damping * moved[i] / t->options.tick;
    double into = dot(force, out), square = dot(out, out);
    if (into < 0 && square > 0) /* what pulls towards the faces is taken out */
        for (int i = 0; i < 3; i++)
            force[i] -= into / square * out[i];
    keep_passive(t, force);
}

static void count(ebpo_touch *t, const ebpo_touch_result *r)
{
    ebpo_touch_stats *s = &t->stats;
    s->ticks++;
    s->contacts += (r->flags & EBPO_TOUCH_CONTACT) != 0;
    s->waits += (r->flags & EBPO_TOUCH_WAITS) != 0;
    s->shorts += (r->flags & EBPO_TOUCH_SHORT) != 0;
    s->partly += (r->flags & EBPO_TOUCH_PARTLY) != 0;
    s->work_most = r->work > s->work_most ? r->work : s->work_most;
    s->given_most = fmax(s->given_most, t->given);
}

void ebpo_touch_move(ebpo_touch *t, const double hand[3], ebpo_touch_result *out)
{
    EBPO_DEFAULT_FP;
    double at[3], from[3], moved[3];
    bool astray = false;
    for (int i = 0; i < 3; i++)
        astray |= !(fabs(hand[i]) <= 0x1p200);
    copy(astray ? t->hand : hand, at);
    *out = (ebpo_touch_result){ .flags = astray ? EBPO_TOUCH_ASTRAY : 0 };
    difference(at, t->hand, moved);
    t->given += dot(t->force, moved);
    t->stats.step_most = fmax(t->stats.step_most, sqrt(dot(moved, moved)));
    (void)ebpo_touch_take_box(t);
    copy(t->proxy, from);
    uint32_t flags = ebpo_touch_go(t, at, &out->work);
    if (t->touching && (flags & EBPO_TOUCH_CONTACT) && t->options.friction > 0)
        flags |= rub(t, from, at, &out->work);
    out->flags |= flags;
    ebpo_touch_look(t, out);
    t->touching = (flags & EBPO_TOUCH_CONTACT) != 0;
    if (t->touching) {
        double depth[3];
        find_depth(t, at, flags, depth);
        push(t, depth, moved, out->force);
        out->depth = sqrt(dot(depth, depth));
    }
    copy(t->proxy, out->proxy);
    copy(out->force, t->force);
    copy(at, t->hand);
    if ((flags & EBPO_TOUCH_WAITS) && ebpo_extent_holds(&t->box[t->seen].centres, t->proxy))
        swap_boxes(t); /* perhaps that one reaches further */
    count(t, out);
    ebpo_touch_tell(t, at);
}

ebpo_status ebpo_touch_get_stats(const ebpo_touch *t, ebpo_touch_stats *out)
{
    ebpo_touch_stats s = t->stats;
    s.loads = atomic_load(&t->loads);
    s.too_many = atomic_load(&t->too_many);
    s.load_seconds = 1e-9 * (double)atomic_load(&t->load_ns);
    s.load_seconds_most = 1e-9 * (double)atomic_load(&t->load_ns_most);
    s.faces = t->box[t->at].count;
    s.memory = EBPO_TOUCH_BOXES * ebpo_face_box_bytes(t->options.faces);
    s.given = t->given;
    return EBPO_GIVE(ebpo_touch_stats, out, &s);
}

uint32_t ebpo_touch_way(const ebpo_touch *t, double way[EBPO_TOUCH_WAY_MOST][3])
{
    for (uint32_t i = 0; i < t->way_count; i++)
        copy(t->way[i], way[i]);
    return t->way_count;
}
