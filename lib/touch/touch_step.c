/* The proxy's way of a tick: straight on until a ball touches, then along what it touches, a few
 * times. Each straight piece is decided twice: by distances, which say where the ball stops, and by
 * exact arithmetic, which says that the centre went through nothing. */
#include "geom/strict_fp.h"

#include <math.h>

#include "touch/face_near.h"
#include "touch/touch_parts.h"
#include "touch/vectors.h"

enum { HALVINGS = 6 };

typedef struct step {
    ebpo_touch *t;
    const double *goal;
    double way[3], slack, least_slack;
    uint32_t count, flags, cut, *work; /* cut: flags if the end of the way is reached */
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
        s->cut = EBPO_TOUCH_WAITS; /* whether or not it was short */
        shorten(s->way, part);
    }
    if (part <= 0 && !ebpo_extent_holds(&t->box[t->at].centres, t->proxy)) {
        s->flags |= EBPO_TOUCH_WAITS;
        return false;
    }
    return true;
}

/* Not farther than the last time that there were few enough faces around a way, or twice that. */
static void keep_short(step *s)
{
    double length = sqrt(dot(s->way, s->way));
    if (length <= s->t->stride)
        return;
    s->cut = EBPO_TOUCH_SHORT;
    shorten(s->way, s->t->stride / length);
}

/* The faces around the way, which is made shorter where they are too many. The stride stays above
 * 0: it would never grow again. */
static bool find_faces(step *s)
{
    ebpo_touch *t = s->t;
    ebpo_extent around;
    for (int i = 0; i < HALVINGS && *s->work < EBPO_TOUCH_WORK; i++) {
        uint32_t visits = EBPO_TOUCH_VISITS;
        swept(t->proxy, s->way, t->reach + 2 * t->band, &around);
        bool all = ebpo_extent_holds(&t->box[t->at].centres, t->proxy)
                       ? ebpo_face_box_find(&t->box[t->at], &around, t->found, EBPO_TOUCH_FACES,
                                            &visits, &s->count)
                       : (s->count = 0, true); /* outside of all, see keep_known */
        *s->work += all ? s->count : EBPO_TOUCH_FACES;
        if (all) {
            if (s->count < EBPO_TOUCH_FACES / 8 && t->stride < t->diagonal)
                t->stride *= 2;
            return true;
        }
        s->cut = EBPO_TOUCH_SHORT;
        shorten(s->way, 0.25);
        t->stride = fmax(sqrt(dot(s->way, s->way)), 0x1p-8 * t->options.skin);
    }
    s->flags |= EBPO_TOUCH_SHORT;
    return false;
}

static double first_touch(step *s)
{
    ebpo_touch *t = s->t;
    const ebpo_ball_way w = { t->proxy, s->way, t->reach, t->band, s->slack, s->least_slack };
    double first = 1;
    for (uint32_t i = 0; i < s->count; i++) {
        t->met[i] =
            ebpo_ball_meets(&w, (const double(*)[3])t->box[t->at].corner[t->found[i]], t->away[i]);
        first = fmin(first, t->met[i]);
    }
    return first;
}

/* What the ball touches now is what it slides along; after a way, only that. */
static void add_planes(step *s, double part)
{
    ebpo_touch *t = s->t;
    if (part > 0)
        s->t->planes.count = 0;
    for (uint32_t i = 0; i < s->count && s->t->planes.count < EBPO_PLANES_MOST; i++) {
        bool known = t->met[i] > part;
        for (int k = 0; k < s->t->planes.count && !known; k++)
            known = t->away[i][0] == s->t->planes.normal[k][0] &&
                    t->away[i][1] == s->t->planes.normal[k][1] &&
                    t->away[i][2] == s->t->planes.normal[k][2];
        if (!known)
            copy(t->away[i], s->t->planes.normal[s->t->planes.count++]);
    }
}

static bool goes_through(const step *s, const double to[3])
{
    const ebpo_touch *t = s->t;
    for (uint32_t i = 0; i < s->count; i++)
        if (ebpo_segment_may_meet(t->proxy, to,
                                  (const double(*)[3])t->box[t->at].corner[t->found[i]]))
            return true;
    return false;
}

/* One straight piece. False: the proxy is where it stays. */
static bool go_on(step *s)
{
    ebpo_touch *t = s->t;
    double want[3], to[3];
    difference(s->goal, t->proxy, want);
    s->slack = ebpo_hold_back(&s->t->planes, want, s->way);
    s->least_slack = 0x1p-44 * sqrt(dot(want, want));
    if (sqrt(dot(s->way, s->way)) <= 0x1p-12 * t->options.skin)
        return false;
    s->cut = 0;
    double whole = sqrt(dot(s->way, s->way));
    keep_short(s);
    if (!keep_known(s) || !find_faces(s))
        return false;
    /* Slacks are those of the whole way: of a hand far away they would be those of long strides. */
    double share = sqrt(dot(s->way, s->way)) / whole;
    s->slack *= share;
    s->least_slack *= share;
    double part = first_touch(s);
    for (int i = 0; i < 3; i++)
        to[i] = t->proxy[i] + part * s->way[i];
    if (part > 0) {
        if (goes_through(s, to)) {
            s->flags |= EBPO_TOUCH_SHORT;
            return false;
        }
        copy(to, t->proxy);
        copy(to, t->way[t->way_count++]);
    }
    if (part >= 1) {
        s->flags |= s->cut;
        return false; /* it is there, or where the way was cut */
    }
    s->flags |= EBPO_TOUCH_CONTACT;
    add_planes(s, part);
    return s->t->planes.count < EBPO_PLANES_MOST;
}

uint32_t ebpo_touch_go(ebpo_touch *t, const double goal[3], uint32_t *work)
{
    step s = { .t = t, .goal = goal, .work = work };
    int piece = 0;
    t->planes.count = 0;
    t->way_count = 0;
    copy(t->proxy, t->way[t->way_count++]);
    while (piece < EBPO_TOUCH_PIECES && go_on(&s))
        piece++;
    if (piece == EBPO_TOUCH_PIECES)
        s.flags |= EBPO_TOUCH_SHORT;
    return s.flags;
}
