/* A tick. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "core/fp_env.h"
#include "core/error.h"
#include "extras/haptic/tool.h"
#include "extras/haptic/touch_parts.h"
#include "extras/haptic/vectors.h"

void ebpo_touch_tell(ebpo_touch *t, const double hand[3])
{
    for (int i = 0; i < 3; i++) {
        atomic_store_explicit(&t->proxy_told[i], t->proxy[i], memory_order_relaxed);
        atomic_store_explicit(&t->hand_told[i], hand[i], memory_order_relaxed);
    }
}

uint32_t ebpo_touch_stopped(const ebpo_touch *t)
{
    return atomic_load_explicit(&t->stopped, memory_order_acquire) ? EBPO_TOUCH_STOPPED : 0;
}

static bool stands(const ebpo_touch *t) { return t->walk.stage == EBPO_BALL_STANDS; }

/* Coulomb: the proxy, which slid from `from` without friction, follows only as far as the
 * tangential part of the spring is more than friction takes. */
static uint32_t rub(ebpo_touch *t, const double from[3], const double hand[3], ebpo_ball_work *work)
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
    if (part > 0)
        return ebpo_touch_go(t, goal, work);
    if (length > 0 && memcmp(from, t->along_at, sizeof t->along_at) == 0)
        t->planes = t->along; /* it is there again */
    return 0;
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

/* The way from hand to proxy is not quite along the faces' normals: by what the proxy has still to
 * go, by rounding far from 0, and by friction, which puts it askew. Damping across that way may
 * pull towards faces, and huge damping with all force: what does so is taken out, and the force no
 * greater. What was touched first may be the edge of a face that the ball is beside, by next to
 * nothing: so the nearest face counts, too. A face that the spring itself pulls to is another one
 * of a narrow corner. */
static void keep_from_faces(const ebpo_touch *t, bool near, const double depth[3], double force[3])
{
    ebpo_held_planes off = { .count = 0 };
    double wanted[3];
    if (near && dot(t->away, depth) >= 0)
        ebpo_held_planes_add(&off, t->away);
    for (int i = 0; i < t->planes.count; i++)
        if (dot(t->planes.normal[i], depth) >= 0)
            ebpo_held_planes_add(&off, t->planes.normal[i]);
    copy(force, wanted);
    (void)ebpo_hold_back(&off, wanted, force);
}

void ebpo_touch_count(ebpo_touch *t, uint32_t flags, uint64_t work)
{
    ebpo_touch_stats *s = &t->stats;
    s->ticks++;
    s->contacts += (flags & EBPO_TOUCH_CONTACT) != 0;
    s->waits += (flags & EBPO_TOUCH_WAITS) != 0;
    s->shorts += (flags & EBPO_TOUCH_SHORT) != 0;
    s->partly += (flags & EBPO_TOUCH_PARTLY) != 0;
    s->stopped += (flags & EBPO_TOUCH_STOPPED) != 0;
    s->work_most = work > s->work_most ? work : s->work_most;
    s->given_most = fmax(s->given_most, t->passive.given);
}

void ebpo_touch_move(ebpo_touch *t, const double hand[3], ebpo_touch_result *out)
{
    EBPO_DEFAULT_FP;
    double at[3], from[3], moved[3], along_at[3];
    bool astray = false;
    ebpo_ball_work work = { 0 };
    if (t->options.kind != EBPO_TOUCH_BALL) {
        *out = (ebpo_touch_result){ .face = EBPO_NO_FACE, .flags = EBPO_TOUCH_OTHER };
        return;
    }
    for (int i = 0; i < 3; i++)
        astray |= !(fabs(hand[i]) <= 0x1p200);
    copy(astray ? t->hand : hand, at);
    *out = (ebpo_touch_result){ .flags = astray ? EBPO_TOUCH_ASTRAY : 0 };
    difference(at, t->hand, moved);
    ebpo_passive_moved(&t->passive, t->force, moved, 3);
    copy(t->proxy, from);
    copy(t->along_at, along_at);
    ebpo_held_planes along = t->along;
    uint32_t flags = ebpo_touch_go(t, at, &work);
    if (t->touching && (flags & EBPO_TOUCH_CONTACT) && t->options.friction > 0 && stands(t)) {
        t->along = along;
        copy(along_at, t->along_at);
        flags |= rub(t, from, at, &work);
    }
    out->work = work.faces;
    out->flags |= flags | ebpo_touch_stopped(t);
    ebpo_touch_look(t, out);
    t->touching = (flags & EBPO_TOUCH_CONTACT) != 0;
    if (t->touching) {
        double depth[3];
        find_depth(t, at, flags, depth);
        ebpo_passive_push(&t->passive, t->options.damping / t->options.tick, depth, moved, 3,
                          out->force);
        keep_from_faces(t, out->face != EBPO_NO_FACE, depth, out->force);
        out->depth = sqrt(dot(depth, depth));
    }
    copy(t->proxy, out->proxy);
    copy(out->force, t->force);
    copy(at, t->hand);
    if ((flags & EBPO_TOUCH_WAITS) && stands(t))
        ebpo_touch_try_other(t);
    ebpo_touch_count(t, out->flags, out->work);
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
    s.given = t->passive.given;
    s.step_most = t->passive.step_most;
    if (t->options.kind == EBPO_TOUCH_BALL)
        s.memory += ebpo_ball_walk_bytes(t->options.faces);
    if (t->tool)
        s.memory += ebpo_tool_bytes(t->tool);
    return EBPO_GIVE(ebpo_touch_stats, out, &s);
}

uint32_t ebpo_touch_way(const ebpo_touch *t, double way[EBPO_TOUCH_WAY_MOST][3])
{
    for (uint32_t i = 0; i < t->way_count; i++)
        copy(t->way[i], way[i]);
    return t->way_count;
}
