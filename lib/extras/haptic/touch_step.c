/* The proxy's way of a tick: straight on until a ball touches, then along what it touches, a few
 * times. Each straight piece is decided twice: by distances, which say where the ball stops, and by
 * exact arithmetic, which says that the centre went through nothing. A piece may take several
 * ticks, if very many faces are around. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "extras/haptic/touch_parts.h"
#include "extras/haptic/vectors.h"

typedef struct step {
    ebpo_touch *t;
    const double *goal;
    double way[3], slack, least_slack;
    uint32_t flags;
    ebpo_ball_work *work;
} step;

static void swept(const double p[3], const double way[3], double wider, ebpo_extent *out)
{
    for (int i = 0; i < 3; i++) {
        out->min[i] = fmin(p[i], p[i] + way[i]) - wider;
        out->max[i] = fmax(p[i], p[i] + way[i]) + wider;
    }
}

static bool apart(const ebpo_extent *a, const ebpo_extent *b)
{
    for (int i = 0; i < 3; i++)
        if (a->min[i] > b->max[i] || a->max[i] < b->min[i])
            return true;
    return false;
}

static void shorten(double way[3], double part)
{
    for (int i = 0; i < 3; i++)
        way[i] *= part;
}

/* Part of the way until the wall of `e`, from within; a hair less, so that rounding stays inside.
 */
static double part_inside(const double p[3], const double way[3], const ebpo_extent *e)
{
    double part = 1;
    for (int i = 0; i < 3; i++) {
        double to = p[i] + way[i];
        if (to > e->max[i])
            part = fmin(part, (e->max[i] - p[i]) / way[i]);
        else if (to < e->min[i])
            part = fmin(part, (e->min[i] - p[i]) / way[i]);
    }
    return part < 1 ? fmax(0, part * (1 - 0x1p-20)) : 1;
}

double ebpo_touch_known_part(const ebpo_touch *t, const double way[3], double reach)
{
    const ebpo_extent *centres = &t->box[t->at].centres;
    ebpo_extent all;
    swept(t->proxy, way, reach, &all);
    if (apart(&all, &t->root))
        return 1;
    return ebpo_extent_holds(centres, t->proxy) ? part_inside(t->proxy, way, centres) : 0;
}

/* Cuts the way to where all faces around it are known. False: there is no such part. */
static bool keep_known(step *s)
{
    ebpo_touch *t = s->t;
    double part = ebpo_touch_known_part(t, s->way, t->reach + t->band);
    if (part < 1) {
        t->cut = EBPO_TOUCH_WAITS;
        shorten(s->way, part);
    }
    if (part <= 0 && !ebpo_extent_holds(&t->box[t->at].centres, t->proxy)) {
        s->flags |= EBPO_TOUCH_WAITS;
        return false;
    }
    return true;
}

static bool differ(const double a[3], const double b[3])
{
    return a[0] != b[0] || a[1] != b[1] || a[2] != b[2];
}

/* The next piece. False: the proxy is where it stays. */
static bool set_out(step *s)
{
    ebpo_touch *t = s->t;
    ebpo_ball_walk *w = &t->walk;
    double want[3];
    (void)ebpo_touch_take_box(t);
    if (memcmp(t->along_at, t->proxy, sizeof t->along_at) != 0)
        t->along.count = 0;
    difference(s->goal, t->proxy, want);
    s->slack = ebpo_hold_back(&t->along, want, s->way);
    if (differ(s->way, want))
        s->flags |= EBPO_TOUCH_CONTACT;
    s->least_slack = 0x1p-44 * sqrt(dot(want, want));
    double whole = sqrt(dot(s->way, s->way));
    if (whole <= 0x1p-12 * t->options.skin)
        return false;
    t->cut = 0;
    if (!keep_known(s))
        return false;
    /* Slacks are those of the whole way: of a hand far away they would be those of long strides. */
    double share = sqrt(dot(s->way, s->way)) / whole;
    const ebpo_face_box *box = &t->box[t->at];
    copy(t->proxy, w->from);
    copy(s->way, w->way);
    w->box = ebpo_extent_holds(&box->centres, t->proxy) ? box : NULL; /* see keep_known */
    w->reach = t->reach;
    w->band = t->band;
    w->slack = s->slack * share;
    w->least_slack = s->least_slack * share;
    ebpo_ball_set_out(w);
    return true;
}

/* Of planes that hold back, three do: those along which the last way did not go make room. */
static void make_room(ebpo_held_planes *along, const double way[3])
{
    double length = sqrt(dot(way, way));
    int kept = 0;
    for (int i = 0; i < along->count; i++)
        if (dot(along->normal[i], way) <= 0x1p-30 * length)
            copy(along->normal[i], along->normal[kept++]);
    along->count = kept < EBPO_PLANES_MOST ? kept : kept - 1;
}

static void add_planes(ebpo_touch *t)
{
    const ebpo_ball_walk *w = &t->walk;
    if (w->part > 0)
        t->along.count = 0;
    else if (t->along.count + w->met.count > EBPO_PLANES_MOST)
        make_room(&t->along, w->way);
    for (int i = 0; i < w->met.count; i++)
        ebpo_held_planes_add(&t->along, w->met.normal[i]);
    copy(t->proxy, t->along_at);
}

/* The proxy is at the piece's end. What the ball touches there is what it slides along; after a
 * way, only that. False: it touches nothing, and goes no farther in this tick. */
static bool settle(step *s)
{
    ebpo_touch *t = s->t;
    const ebpo_ball_walk *w = &t->walk;
    bool touches = !w->cut && w->part < 1;
    if (w->part > 0) {
        copy(w->to, t->proxy);
        copy(w->to, t->way[t->way_count++]);
    }
    if (touches)
        add_planes(t);
    s->flags |= touches ? EBPO_TOUCH_CONTACT : w->cut ? EBPO_TOUCH_SHORT : t->cut;
    t->planes = t->along;
    t->felt = true;
    return touches;
}

/* Until more is known, what held the proxy holds it still. */
static uint32_t still_held(const step *s)
{
    const ebpo_touch *t = s->t;
    double want[3], way[3];
    if (t->felt)
        return 0;
    difference(s->goal, t->proxy, want);
    (void)ebpo_hold_back(&t->planes, want, way);
    return differ(way, want) ? EBPO_TOUCH_CONTACT : 0;
}

static uint32_t go_by_pieces(step *s)
{
    ebpo_touch *t = s->t;
    bool resumed = t->walk.stage != EBPO_BALL_STANDS;
    for (int piece = 0; piece < EBPO_TOUCH_PIECES; piece++) {
        if (t->walk.stage == EBPO_BALL_STANDS && !set_out(s))
            return s->flags;
        ebpo_ball_end end = ebpo_ball_go_on(&t->walk, s->work);
        if (end == EBPO_BALL_LATER)
            return s->flags | EBPO_TOUCH_SHORT | still_held(s);
        if (end == EBPO_BALL_THROUGH)
            return s->flags | EBPO_TOUCH_SHORT;
        if (!settle(s)) {
            if (!resumed)
                return s->flags;
            s->flags = 0; /* that was on the way to where the hand was */
            t->felt = false;
        }
        resumed = false;
    }
    return s->flags | EBPO_TOUCH_SHORT;
}

uint32_t ebpo_touch_go(ebpo_touch *t, const double goal[3], ebpo_ball_work *work)
{
    step s = { .t = t, .goal = goal, .work = work };
    double left[3];
    t->felt = false;
    t->way_count = 0;
    copy(t->proxy, t->way[t->way_count++]);
    uint32_t flags = go_by_pieces(&s);
    difference(goal, t->proxy, left);
    bool there = sqrt(dot(left, left)) <= 0x1p-12 * t->options.skin;
    return there ? flags & ~(uint32_t)EBPO_TOUCH_CONTACT : flags;
}
