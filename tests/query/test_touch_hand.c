/* A hand that touches: never through a face and never closer than its radius, judged by arithmetic
 * that does not round, however wildly it is moved; forces on a plane, by formula; friction; energy;
 * and nothing is called in a tick that could make it late. */
#include <stdlib.h>
#include <ebpo/touch.h>
#include <math.h>
#include <string.h>

#include "check_main.h"
#include "query_kit.h"
#include "extras/haptic/touch_parts.h"
#include "touch_watch.h"

static void tick(ebpo_touch *touch, const double hand[3], ebpo_touch_result *out)
{
    in_tick = true;
    ebpo_touch_move(touch, hand, out);
    in_tick = false;
}

/* --- a wild hand, judged --- */

typedef struct judged {
    query_model *m;
    ebpo_touch *touch;
    ebpo_touch_options options;
    double skin, proxy[3], hand[3], force[3];
    double given, step; /* energy; the longest step */
    bool placed;
} judged;

static bool has_area(judged *j, uint32_t face)
{
    double n[3];
    oracle_normal(j->m->judge, face, n);
    return n[0] != 0 || n[1] != 0 || n[2] != 0;
}

static void judge_piece(judged *j, const double from[3], const double to[3])
{
    const oracle_hit *hits;
    uint32_t count;
    double way[3];
    for (int i = 0; i < 3; i++)
        way[i] = to[i] - from[i];
    if (way[0] == 0 && way[1] == 0 && way[2] == 0)
        return;
    oracle_ray(j->m->judge, from, way, 1, &hits, &count);
    for (uint32_t i = 0; i < count; i++)
        ck_assert_msg(!has_area(j, hits[i].face), "%s: the proxy went through face %u", j->m->name,
                      hits[i].face);
    oracle_nearest near;
    oracle_find_nearest(j->m->judge, to, &near);
    ck_assert_msg(near.distance >= j->options.radius + j->skin / 2,
                  "%s: %g from a face, radius %g, skin %g", j->m->name, near.distance,
                  j->options.radius, j->skin);
}

/* All pieces, which are one way from where the proxy was. */
static void judge_way(judged *j, const double to[3])
{
    double way[EBPO_TOUCH_WAY_MOST][3];
    uint32_t count = ebpo_touch_way(j->touch, way);
    ck_assert_uint_ge(count, 1);
    ck_assert_mem_eq(way[0], j->proxy, sizeof way[0]);
    ck_assert_mem_eq(way[count - 1], to, sizeof way[0]);
    for (uint32_t i = 1; i < count; i++)
        judge_piece(j, way[i - 1], way[i]);
}

static double apart(const double a[3], const double b[3])
{
    return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

static void judge_face(judged *j, const ebpo_touch_result *r)
{
    oracle_nearest near;
    if (r->flags & EBPO_TOUCH_PARTLY)
        return;
    oracle_find_nearest(j->m->judge, r->proxy, &near);
    double gap = near.distance - j->options.radius;
    if (r->face == EBPO_NO_FACE) {
        ck_assert_double_ge(gap, j->options.look * (1 - 1e-9));
        return;
    }
    ck_assert_double_le(fabs(r->weight[0] + r->weight[1] + r->weight[2] - 1), 1e-12);
    ck_assert_double_le(fabs(apart(r->proxy, r->point) - near.distance), j->skin / 16);
    if (!(r->flags & EBPO_TOUCH_CONTACT))
        ck_assert_double_le(fabs(r->depth + gap), j->skin / 16);
}

static void judge_tick(judged *j, const double hand[3], bool closely)
{
    ebpo_touch_result r;
    tick(j->touch, hand, &r);
    double work = 0;
    for (int i = 0; i < 3; i++)
        work += j->force[i] * (hand[i] - j->hand[i]);
    j->given += work;
    j->step = fmax(j->step, apart(hand, j->hand));
    ck_assert_msg(j->given <= j->options.stiffness * j->step * j->step,
                  "%s: the wall gave %g, the longest step is %g", j->m->name, j->given, j->step);
    judge_way(j, r.proxy);
    if (closely)
        judge_face(j, &r);
    if (!(r.flags & (EBPO_TOUCH_CONTACT | EBPO_TOUCH_WAITS | EBPO_TOUCH_SHORT)))
        ck_assert_msg(apart(r.proxy, hand) <= j->skin, "%s: nothing holds the proxy", j->m->name);
    for (int i = 0; i < 3; i++) {
        j->proxy[i] = r.proxy[i];
        j->hand[i] = hand[i];
        j->force[i] = r.force[i];
    }
}

/* A place outside, far enough from faces; false: this is none. */
static bool begin(judged *j, uint64_t *state)
{
    const ebpo_info *info = ebpo_file_info(j->m->file);
    double place[3], diagonal = 0;
    for (int i = 0; i < 3; i++) {
        place[i] =
            info->box_origin[i] + (1.4 * ebpo_test_random_unit(state) - 0.2) * info->box_size[i];
        diagonal = hypot(diagonal, info->box_size[i]);
    }
    j->skin = 1e-5 * diagonal;
    j->options = (ebpo_touch_options)EBPO_TOUCH_OPTIONS_INIT;
    j->options.skin = j->skin;
    j->options.look = 0.05 * diagonal;
    j->options.faces = 1 << 10;
    j->options.radius = ebpo_test_random(state) % 2 ? 0.02 * diagonal : 0;
    j->options.friction = ebpo_test_random(state) % 2 ? 0.3 : 0;
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_status status = ebpo_touch_new(j->m->model, &j->options, place, &j->touch, &why);
    ck_assert_msg(status == EBPO_OK || status == EBPO_E_ARGUMENT, "%s", why.message);
    for (int i = 0; i < 3; i++) {
        j->proxy[i] = j->hand[i] = place[i];
        j->force[i] = 0;
    }
    return status == EBPO_OK;
}

/* Goes to random places, slowly or at once; through the solid, too. */
static void wave(judged *j, uint64_t ticks, uint64_t *state)
{
    const ebpo_info *info = ebpo_file_info(j->m->file);
    double goal[3], hand[3];
    for (uint64_t i = 0; i < ticks;) {
        uint64_t steps = ebpo_test_random(state) % 3 ? 1 + ebpo_test_random(state) % 40 : 1;
        for (int k = 0; k < 3; k++)
            goal[k] = info->box_origin[k] +
                      (1.4 * ebpo_test_random_unit(state) - 0.2) * info->box_size[k];
        double from[3] = { j->hand[0], j->hand[1], j->hand[2] };
        for (uint64_t s = 1; s <= steps && i < ticks; s++, i++) {
            for (int k = 0; k < 3; k++)
                hand[k] = from[k] + (goal[k] - from[k]) * (double)s / (double)steps;
            judge_tick(j, hand, i % 8 == 0);
            if (i % 4 == 0)
                pause_a_little(); /* as a device does: boxes come meanwhile */
        }
    }
}

static const char *const wild[] = {
    "sphere",         "thin_wall",    "thin_hollow",    "cavity",   "staircase", "blob",
    "needle",         "cone_slivers", "giant_and_dust", "open_box", "mobius",    "far_away",
    "zero_area_face", "turned_boxes", "gap_of_one_ulp", "l_shape"
};
enum { WILD = sizeof wild / sizeof *wild };

START_TEST(a_wild_hand_goes_through_nothing)
{
    query_model m;
    uint64_t state = 77 + (uint64_t)_i;
    query_model_make(&m, wild[_i], query_solid_by_name(wild[_i]), &query_variants[0]);
    uint64_t ticks = query_scaled(3000);
    for (int turn = 0, begun = 0; turn < 40 && begun < 2; turn++) {
        judged j = { .m = &m };
        if (!begin(&j, &state))
            continue;
        begun++;
        wave(&j, ticks, &state);
        ebpo_touch_stats stats = EBPO_TOUCH_STATS_INIT;
        ck_assert_int_eq(ebpo_touch_get_stats(j.touch, &stats), EBPO_OK);
        ck_assert_uint_eq(stats.ticks, ticks);
        ck_assert_uint_gt(stats.loads, 0);
        ASSERT_OK(ebpo_touch_check(j.touch, error));
        ebpo_touch_free(j.touch);
    }
    ck_assert_msg(forbidden == 0, "%lu calls in ticks that may not be", forbidden);
    query_model_free(&m);
}
END_TEST

/* --- on a cube of 1: by formula --- */

typedef struct cube_hand {
    query_model m;
    ebpo_touch *touch;
    ebpo_touch_options options;
    ebpo_touch_result r;
} cube_hand;

static void cube_begin(cube_hand *c, double radius, double friction)
{
    static const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    const double above[3] = { 0.3, 0.4, 1.5 };
    query_model_make(&c->m, "box", ebpo_test_box(low, high, 4), &query_variants[0]);
    c->options = (ebpo_touch_options)EBPO_TOUCH_OPTIONS_INIT;
    c->options.radius = radius;
    c->options.friction = friction;
    c->options.skin = 1e-6;
    c->options.stiffness = 100;
    c->options.damping = 0;
    ASSERT_OK(ebpo_touch_new(c->m.model, &c->options, above, &c->touch, error));
}

static void cube_end(cube_hand *c)
{
    ASSERT_OK(ebpo_touch_check(c->touch, error));
    ebpo_touch_free(c->touch);
    query_model_free(&c->m);
}

/* Goes there in steps, and stays until nothing waits any more. */
static void cube_move(cube_hand *c, double x, double y, double z, int steps)
{
    ebpo_touch_stats stats = EBPO_TOUCH_STATS_INIT;
    static double at[3] = { 0.3, 0.4, 1.5 };
    double from[3] = { at[0], at[1], at[2] };
    const double to[3] = { x, y, z };
    ck_assert_int_eq(ebpo_touch_get_stats(c->touch, &stats), EBPO_OK);
    if (stats.ticks == 0) {
        const double above[3] = { 0.3, 0.4, 1.5 };
        for (int k = 0; k < 3; k++)
            from[k] = above[k];
    }
    for (int s = 1; s <= steps; s++) {
        for (int k = 0; k < 3; k++)
            at[k] = s == steps ? to[k] : from[k] + (to[k] - from[k]) * s / steps;
        int patience = 20000;
        do {
            ck_assert_msg(patience-- > 0, "flags %u", c->r.flags);
            tick(c->touch, at, &c->r);
            if (c->r.flags & (EBPO_TOUCH_WAITS | EBPO_TOUCH_PARTLY))
                pause_a_little();
        } while (c->r.flags & (EBPO_TOUCH_WAITS | EBPO_TOUCH_SHORT | EBPO_TOUCH_PARTLY));
    }
}

static void check_vector(const double got[3], double x, double y, double z, double within)
{
    ck_assert_msg(fabs(got[0] - x) <= within && fabs(got[1] - y) <= within &&
                      fabs(got[2] - z) <= within,
                  "(%g, %g, %g), not (%g, %g, %g)", got[0], got[1], got[2], x, y, z);
}

START_TEST(a_cube_holds_the_hand_as_its_planes_do)
{
    cube_hand c;
    double radius = _i ? 0.1 : 0;
    cube_begin(&c, radius, 0);
    cube_move(&c, 0.3, 0.4, 1.2, 10);
    ck_assert_uint_eq(c.r.flags, 0);
    check_vector(c.r.proxy, 0.3, 0.4, 1.2, 1e-6);
    check_vector(c.r.force, 0, 0, 0, 0);
    ck_assert_double_le(fabs(c.r.depth + (0.2 - radius)), 1e-9);
    cube_move(&c, 0.35, 0.4, 0.9, 30); /* into the top */
    ck_assert_uint_eq(c.r.flags, EBPO_TOUCH_CONTACT);
    check_vector(c.r.proxy, 0.35, 0.4, 1 + radius, 3e-6);
    check_vector(c.r.force, 0, 0, 100 * (0.1 + radius), 3e-4);
    ck_assert_double_le(fabs(c.r.depth - (0.1 + radius)), 3e-6);
    cube_move(&c, 0.7, 0.6, 0.8, 50); /* along it: edges within the plane do not matter */
    check_vector(c.r.proxy, 0.7, 0.6, 1 + radius, 3e-6);
    cube_move(&c, 0.7, 0.6, -3, 1); /* out at the bottom: still on top */
    check_vector(c.r.proxy, 0.7, 0.6, 1 + radius, 3e-6);
    cube_move(&c, 1.5, 0.6, -3, 40); /* over the edge, and down outside */
    check_vector(c.r.proxy, 1.5, 0.6, -3, 3e-6);
    ck_assert_uint_eq(c.r.flags, 0);
    ck_assert_uint_eq(forbidden, 0);
    cube_end(&c);
}
END_TEST

/* How far a place is from a box, from outside. */
static double off_box(const double at[3], const double low[3], const double high[3])
{
    double sum = 0;
    for (int i = 0; i < 3; i++) {
        double beyond = fmax(fmax(low[i] - at[i], at[i] - high[i]), 0);
        sum += beyond * beyond;
    }
    return sqrt(sum);
}

/* A ball slides on one box towards another. Its way is cut to what is near: what rounding does to
 * the whole way, which is long, is no measure of what the ball does to a face. */
START_TEST(a_hand_far_away_brings_the_ball_no_nearer)
{
    static const double floor_low[3] = { 0, 0, 0 }, floor_high[3] = { 1, 1, 1 };
    static const double wall_low[3] = { 1.3, 0, 0 }, wall_high[3] = { 2, 1, 2 };
    static const double hands[][3] = { { 1e3, 0.4, -1e3 }, { 1e13, 0.4, -1e13 } };
    const double start[3] = { 0.3, 0.4, 1.5 };
    for (int h = 0; h < 2; h++) {
        query_model m;
        ebpo_touch *touch;
        ebpo_touch_result r;
        ebpo_touch_options options = EBPO_TOUCH_OPTIONS_INIT;
        ebpo_mesh both = ebpo_test_box(floor_low, floor_high, 2);
        ebpo_mesh wall = ebpo_test_box(wall_low, wall_high, 2);
        ebpo_test_append(&both, &wall);
        ebpo_mesh_free(&wall);
        query_model_make(&m, "corner", both, &query_variants[0]);
        options.radius = 0.2;
        options.skin = 1e-6;
        ASSERT_OK(ebpo_touch_new(m.model, &options, start, &touch, error));
        /* until it has come between the boxes, and then some */
        for (int i = 0, there = 0; there < 100; i++) {
            ck_assert_msg(i < 20000, "the ball stays at %g, flags %u", r.proxy[0], r.flags);
            tick(touch, hands[h], &r);
            if (r.flags & (EBPO_TOUCH_WAITS | EBPO_TOUCH_PARTLY))
                pause_a_little();
            there += r.proxy[0] > 1;
            double least = fmin(off_box(r.proxy, floor_low, floor_high),
                                off_box(r.proxy, wall_low, wall_high));
            ck_assert_msg(least >= 0.2, "%.17g after %d", least, i);
        }
        ebpo_touch_free(touch);
        query_model_free(&m);
    }
}
END_TEST

START_TEST(friction_holds_as_coulomb_says)
{
    cube_hand c;
    cube_begin(&c, 0, 0.5);
    cube_move(&c, 0.3, 0.4, 1.1, 10);
    cube_move(&c, 0.3, 0.4, 0.9, 20); /* straight down: depth 0.1 */
    double x = c.r.proxy[0];
    cube_move(&c, 0.34, 0.4, 0.9, 10); /* 0.04 < 0.5 * 0.1 */
    check_vector(c.r.proxy, x, 0.4, 1, 3e-6);
    check_vector(c.r.force, 100 * (x - 0.34), 0, 10, 1e-3);
    cube_move(&c, 0.6, 0.4, 0.9, 100); /* pulled along, 0.05 behind */
    check_vector(c.r.proxy, 0.55, 0.4, 1, 1e-4);
    cube_end(&c);
}
END_TEST

/* Over the top of a cube, around its edge x = z = 1 and down its side: at part 0 to 3. */
static void around_edge(double part, double at[3])
{
    double turn = fmin(fmax(part - 1, 0), 1) * 1.5707963267948966;
    at[0] = 1 + 0.15 * sin(turn) - 0.3 * fmax(1 - part, 0);
    at[1] = 0.4;
    at[2] = 1 + 0.15 * cos(turn) - 0.3 * fmax(part - 2, 0);
}

/* Where faces' normals jump by a right angle. */
START_TEST(normals_turn_steadily)
{
    cube_hand c;
    double before[3] = { 0, 0, 1 }, most = 0, at[3];
    cube_begin(&c, 0.1, 0);
    cube_move(&c, 0.7, 0.4, 1.15, 10);
    for (int i = 0; i <= 600; i++) {
        around_edge(i / 200.0, at);
        cube_move(&c, at[0], at[1], at[2], 1);
        most = i ? fmax(most, apart(before, c.r.normal)) : 0;
        for (int k = 0; k < 3; k++)
            before[k] = c.r.normal[k];
    }
    ck_assert_double_le(most, 0.05);
    ck_assert_double_ge(before[0], 0.99);
    cube_end(&c);
}
END_TEST

START_TEST(what_makes_no_sense_is_refused)
{
    cube_hand c;
    ebpo_touch *none;
    ebpo_error why = EBPO_ERROR_INIT;
    cube_begin(&c, 0, 0);
    const double inside[3] = { 0.5, 0.5, 0.5 }, close[3] = { 0.5, 0.5, 1 + 1e-7 };
    const double far[3] = { 0.5, 0.5, NAN }, fine[3] = { 0.5, 0.5, 2 };
    ck_assert_int_eq(ebpo_touch_place(c.touch, inside, &why), EBPO_E_ARGUMENT);
    ck_assert_int_eq(ebpo_touch_place(c.touch, close, &why), EBPO_E_ARGUMENT);
    ck_assert_int_eq(ebpo_touch_place(c.touch, far, &why), EBPO_E_ARGUMENT);
    tick(c.touch, far, &c.r);
    ck_assert_uint_eq(c.r.flags, EBPO_TOUCH_ASTRAY);
    check_vector(c.r.proxy, 0.3, 0.4, 1.5, 0);
    ASSERT_OK(ebpo_touch_place(c.touch, fine, error));
    tick(c.touch, fine, &c.r);
    check_vector(c.r.proxy, 0.5, 0.5, 2, 0);
    for (int i = 0; i < 9; i++) {
        ebpo_touch_options o = c.options;
        double *const value[] = { &o.radius,  &o.skin,     &o.look, &o.stiffness,
                                  &o.damping, &o.friction, &o.tick };
        if (i < 7)
            *value[i] = i == 6 ? 0 : -1;
        o.faces = i == 7 ? 63 : o.faces;
        o.skin = i == 8 ? 1e-12 : o.skin;
        ck_assert_int_eq(ebpo_touch_new(c.m.model, &o, fine, &none, &why), EBPO_E_ARGUMENT);
        ck_assert_ptr_null(none);
    }
    cube_end(&c);
}
END_TEST

/* However strong damping is, and however much rounding turns the way from hand to proxy, as it does
 * far from 0 and as friction does: no force towards a face that the spring pushes away from.
 * Whether a face or an edge of it is the nearest is known to the root of what rounding does, 1e-7.
 */
START_TEST(damping_never_pulls_towards_faces)
{
    static const double offsets[] = { 0, 1e7, 1e13 }, factors[] = { 1, 1e3, 1e6 };
    double offset = offsets[_i % 3], factor = factors[_i / 3 % 3];
    double size = offset > 1e10 ? 1000 : 1;
    const double low[3] = { offset, offset, offset };
    const double high[3] = { offset + size, offset + size, offset + size };
    const double start[3] = { offset + size / 2, offset + size / 2, offset + 2 * size };
    uint64_t state = 11 + (uint64_t)_i, touched = 0;
    query_model m;
    ebpo_touch *touch;
    ebpo_touch_result r;
    ebpo_touch_options o = EBPO_TOUCH_OPTIONS_INIT;
    query_model_make(&m, "box", ebpo_test_box(low, high, 4), &query_variants[0]);
    o.damping = o.stiffness * factor;
    o.radius = _i % 2 ? 0.1 * size : 0;
    o.friction = _i / 9 ? 0.3 : 0;
    ASSERT_OK(ebpo_touch_new(m.model, &o, start, &touch, error));
    for (int i = 0; i < 3000; i++) {
        double hand[3];
        for (int k = 0; k < 2; k++)
            hand[k] = offset + size * (0.5 + 0.2 * (ebpo_test_random_unit(&state) - 0.5));
        hand[2] = offset + size * (1 + 0.3 * (ebpo_test_random_unit(&state) - 0.5));
        tick(touch, hand, &r);
        if (r.flags & EBPO_TOUCH_WAITS)
            pause_a_little();
        if (!(r.flags & EBPO_TOUCH_CONTACT))
            continue;
        double length = hypot(hypot(r.force[0], r.force[1]), r.force[2]);
        touched += length > 0;
        ck_assert_msg(r.force[2] >= -1e-7 * length, "towards the face by %g of itself",
                      -r.force[2] / length);
    }
    ck_assert_uint_gt(touched, 300);
    ebpo_touch_free(touch);
    query_model_free(&m);
}
END_TEST

/* More faces around one place than a box has room for: told, and the hand stays outside. */
START_TEST(a_crowd_of_faces_is_refused)
{
    query_model m;
    ebpo_touch *none;
    ebpo_error why = EBPO_ERROR_INIT;
    const double above[3] = { 0, 0, 1.0001 }, zero[3] = { 0, 0, 0 };
    query_model_make(&m, "sphere", ebpo_test_sphere(zero, 1, 4), &query_variants[0]);
    ebpo_touch_options o = EBPO_TOUCH_OPTIONS_INIT;
    o.faces = 64;
    o.look = 1;
    ck_assert_int_eq(ebpo_touch_new(m.model, &o, above, &none, &why), EBPO_E_LIMIT);
    query_model_free(&m);
}
END_TEST

/* --- loading that has failed --- */

static uint32_t tick_of(ebpo_touch *touch, uint64_t kind, const double at[3], double proxy[3])
{
    static const double turn[4] = { 0, 0, 0, 1 };
    ebpo_touch_result ball;
    ebpo_touch_sensed probe;
    ebpo_touch_turned tool;
    in_tick = true;
    ebpo_touch_move(touch, at, &ball);
    ebpo_touch_sense(touch, at, &probe);
    ebpo_touch_turn(touch, at, turn, &tool);
    in_tick = false;
    memcpy(proxy, kind == EBPO_TOUCH_TOOL ? tool.proxy : ball.proxy, sizeof ball.proxy);
    return kind == EBPO_TOUCH_BALL    ? ball.flags
           : kind == EBPO_TOUCH_PROBE ? probe.flags
                                      : tool.flags;
}

/* Far away all is well; around where the hand goes then, there are more faces than a box has room
 * for. Each tick tells it from then on, and what is there is kept to. */
START_TEST(a_hand_is_told_that_loading_has_stopped)
{
    static const double zero[3] = { 0, 0, 0 }, points[2][3] = { { 0.6, 0, 0 }, { -0.6, 0, 0 } };
    const double far[3] = { 0, 0, 5 }, near[3] = { 0, 0, 1.05 };
    uint64_t kind = (uint64_t)_i, told = 0;
    query_model m;
    ebpo_touch *touch;
    ebpo_touch_stats stats = EBPO_TOUCH_STATS_INIT;
    ebpo_error why = EBPO_ERROR_INIT;
    double proxy[3];
    query_model_make(&m, "sphere", ebpo_test_sphere(zero, 1, 4), &query_variants[0]);
    ebpo_touch_options o = EBPO_TOUCH_OPTIONS_INIT;
    o.kind = kind;
    o.faces = 64;
    o.look = 1;
    o.radius = kind == EBPO_TOUCH_BALL ? 0.5 : 0;
    o.points = kind == EBPO_TOUCH_TOOL ? points : NULL;
    o.point_count = kind == EBPO_TOUCH_TOOL ? 2 : 0;
    ASSERT_OK(ebpo_touch_new(m.model, &o, far, &touch, error));
    ck_assert_uint_eq(tick_of(touch, kind, far, proxy) & EBPO_TOUCH_STOPPED, 0);
    for (int i = 0; told < 3; i++) {
        ck_assert_msg(i < 20000, "nothing is told");
        uint32_t flags = tick_of(touch, kind, near, proxy);
        ck_assert(told == 0 || flags & EBPO_TOUCH_STOPPED);
        told += (flags & EBPO_TOUCH_STOPPED) != 0;
        if (kind == EBPO_TOUCH_BALL)
            ck_assert_double_ge(hypot(hypot(proxy[0], proxy[1]), proxy[2]), 1.49);
        pause_a_little();
    }
    ck_assert_int_eq(ebpo_touch_check(touch, &why), EBPO_E_LIMIT);
    ck_assert_ptr_nonnull(strstr(why.message, "more than 64 faces around one place"));
    ck_assert_int_eq(ebpo_touch_get_stats(touch, &stats), EBPO_OK);
    ck_assert_uint_eq(stats.stopped, told);
    ck_assert_uint_eq(forbidden, 0);
    ebpo_touch_free(touch);
    query_model_free(&m);
}
END_TEST

/* The last box that was loaded may be the one before, when a tick has laid it aside; as the hand is
 * put there again, no other is loaded for it. What lays it aside takes a loader that is slow: so it
 * is done by hand here. */
START_TEST(a_hand_is_put_where_the_box_before_is)
{
    cube_hand c;
    const double beside[3] = { 0.5, 0.5, 1.6 };
    cube_begin(&c, 0, 0);
    ASSERT_OK(ebpo_touch_place(c.touch, beside, error));
    for (int quiet = 0; quiet < 300; quiet++) { /* until nothing is being loaded any more */
        if (ebpo_touch_take_box(c.touch))
            quiet = 0;
        pause_a_little();
    }
    unsigned last = c.touch->at;
    c.touch->at = c.touch->seen;
    c.touch->seen = last;
    c.touch->box[c.touch->at].centres.min[0] = INFINITY;
    ASSERT_OK(ebpo_touch_place(c.touch, beside, error));
    ck_assert_uint_eq(c.touch->at, last);
    cube_end(&c);
}
END_TEST

/* Around which there are more faces than a tick looks at; and so it is put elsewhere. */
START_TEST(a_ball_goes_away_from_many_faces)
{
    static const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    const double edge[3] = { 1.3, 0.5, 1.3 }, above[3] = { 0.5, 0.5, 2 }, away[3] = { 0.5, 0.5, 3 };
    query_model m;
    ebpo_touch *touch;
    ebpo_touch_result r = { 0 };
    query_model_make(&m, "box", ebpo_test_box(low, high, 40), &query_variants[0]);
    ebpo_touch_options o = EBPO_TOUCH_OPTIONS_INIT;
    o.radius = 0.4;
    ASSERT_OK(ebpo_touch_new(m.model, &o, edge, &touch, error));
    for (int i = 0; i < 5000 && r.proxy[2] != away[2]; i++) {
        tick(touch, away, &r);
        if (r.flags & EBPO_TOUCH_WAITS)
            pause_a_little();
    }
    check_vector(r.proxy, away[0], away[1], away[2], 1e-6);
    ASSERT_OK(ebpo_touch_place(touch, above, error));
    for (int i = 0; i < 5000 && r.proxy[2] != away[2]; i++) {
        tick(touch, away, &r);
        if (r.flags & EBPO_TOUCH_WAITS)
            pause_a_little();
    }
    check_vector(r.proxy, away[0], away[1], away[2], 1e-6);
    ebpo_touch_free(touch);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(touch_hand)
{
    Suite *suite = suite_create("touch_hand");
    TCase *hand = tcase_create("hand");
    watch_gmp();
    tcase_set_timeout(hand, 600);
    tcase_add_loop_test(hand, a_wild_hand_goes_through_nothing, 0, WILD);
    tcase_add_loop_test(hand, a_cube_holds_the_hand_as_its_planes_do, 0, 2);
    tcase_add_test(hand, a_hand_far_away_brings_the_ball_no_nearer);
    tcase_add_test(hand, friction_holds_as_coulomb_says);
    tcase_add_test(hand, normals_turn_steadily);
    tcase_add_loop_test(hand, damping_never_pulls_towards_faces, 0, 18);
    tcase_add_test(hand, what_makes_no_sense_is_refused);
    tcase_add_test(hand, a_crowd_of_faces_is_refused);
    tcase_add_test(hand, a_ball_goes_away_from_many_faces);
    tcase_add_loop_test(hand, a_hand_is_told_that_loading_has_stopped, 0, 3);
    suite_add_tcase(suite, hand);
    TCase *placed = tcase_create("placed"); /* without the mend it would wait for ever */
    tcase_set_timeout(placed, 60);
    tcase_add_test(placed, a_hand_is_put_where_the_box_before_is);
    suite_add_tcase(suite, placed);
    return suite;
}
