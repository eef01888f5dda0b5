/* A probe that nothing stops: its bounds hold the exact distance, with its sign, wherever it jumps
 * and however little is loaded; and nothing is called in a tick that could make it late. */
#include <stdlib.h>
#include <ebpo/touch.h>
#include <math.h>

#include "check_main.h"
#include "query_kit.h"
#include "touch_watch.h"

typedef struct probe {
    query_model *m;
    ebpo_touch *touch;
    ebpo_rule rule;
    double rounding, look, least[3], wide[3];
    uint64_t ticks, close, sided;
} probe;

static bool rule_inside(ebpo_rule rule, int32_t winding)
{
    return rule == EBPO_RULE_POSITIVE  ? winding > 0
           : rule == EBPO_RULE_EVENODD ? winding % 2 != 0
                                       : winding != 0;
}

/* The same as the library tells it: judged by integers of any size. */
static double exact(probe *p, const double place[3], int32_t *where)
{
    oracle_nearest near;
    oracle_find_nearest(p->m->judge, place, &near);
    *where = EBPO_OUT;
    if (!p->m->info.solid)
        return near.distance;
    *where = near.on                                                    ? EBPO_ON
             : rule_inside(p->rule, oracle_winding(p->m->judge, place)) ? EBPO_IN
                                                                        : EBPO_OUT;
    return *where == EBPO_IN ? -near.distance : near.distance;
}

static ebpo_touch_sensed sense(probe *p, const double place[3])
{
    ebpo_touch_sensed r;
    int32_t where;
    in_tick = true;
    ebpo_touch_sense(p->touch, place, &r);
    in_tick = false;
    double truth = exact(p, place, &where);
    const char *name = p->m->name;
    ck_assert_msg(r.lo <= truth + p->rounding && truth <= r.hi + p->rounding,
                  "%s: %.17g is not from %.17g to %.17g", name, truth, r.lo, r.hi);
    ck_assert_msg(r.where == EBPO_MAYBE || r.where == where, "%s: where %d, not %d", name, r.where,
                  where);
    if (r.flags & EBPO_TOUCH_CLOSE)
        ck_assert_msg(fabs(r.distance - truth) <= p->rounding, "%s: %.17g, not %.17g", name,
                      r.distance, truth);
    else
        ck_assert(isnan(r.distance));
    if (r.face != EBPO_NO_FACE)
        ck_assert_double_le(fabs(r.weight[0] + r.weight[1] + r.weight[2] - 1), 1e-12);
    p->ticks++;
    p->close += (r.flags & EBPO_TOUCH_CLOSE) != 0;
    p->sided += r.where != EBPO_MAYBE;
    return r;
}

static void choose(probe *p, uint64_t *state, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = p->least[k] + (1.4 * ebpo_test_random_unit(state) - 0.2) * p->wide[k];
}

/* In steps or at once; then it rests until all is known. */
static void roam(probe *p, uint64_t ticks, uint64_t *state)
{
    double at[3], goal[3], from[3];
    choose(p, state, at);
    while (p->ticks < ticks) {
        uint64_t steps = ebpo_test_random(state) % 3 ? 1 + ebpo_test_random(state) % 40 : 1;
        choose(p, state, goal);
        for (int k = 0; k < 3; k++)
            from[k] = at[k];
        for (uint64_t s = 1; s <= steps; s++) {
            for (int k = 0; k < 3; k++)
                at[k] = from[k] + (goal[k] - from[k]) * (double)s / (double)steps;
            sense(p, at);
            if (s % 4 == 0)
                pause_a_little();
        }
        int patience = 20000;
        for (ebpo_touch_sensed r = sense(p, at); !(r.flags & EBPO_TOUCH_CLOSE); r = sense(p, at)) {
            ck_assert_msg(patience-- > 0, "%s: nothing becomes known", p->m->name);
            pause_a_little();
        }
    }
}

static void begin(probe *p, query_model *m)
{
    const ebpo_info *info = ebpo_file_info(m->file);
    ebpo_touch_options options = EBPO_TOUCH_OPTIONS_INIT;
    double diagonal = 0, most = 0, middle[3];
    *p = (probe){ .m = m, .rule = info->rule };
    for (int k = 0; k < 3; k++) {
        p->least[k] = info->box_origin[k];
        p->wide[k] = info->box_size[k];
        middle[k] = p->least[k] + p->wide[k] / 2;
        diagonal = hypot(diagonal, p->wide[k]);
        most = fmax(most, fabs(p->least[k]));
    }
    p->rounding = 0x1p-36 * (diagonal + most);
    options.kind = EBPO_TOUCH_PROBE;
    options.look = 0.05 * diagonal;
    options.faces = 1 << 10;
    ASSERT_OK(ebpo_touch_new(m->model, &options, middle, &p->touch, error));
}

static const char *const wild[] = { "sphere",      "thin_wall",      "cavity",         "staircase",
                                    "blob",        "cone_slivers",   "open_box",       "mobius",
                                    "far_away",    "zero_area_face", "gap_of_one_ulp", "l_shape",
                                    "turned_boxes" };
enum { WILD = sizeof wild / sizeof *wild };

START_TEST(bounds_hold_the_exact_distance)
{
    query_model m;
    probe p;
    uint64_t state = 500 + (uint64_t)_i;
    query_model_make(&m, wild[_i], query_solid_by_name(wild[_i]),
                     &query_variants[_i % query_variant_count]);
    begin(&p, &m);
    roam(&p, query_scaled(4000), &state);
    ck_assert_uint_gt(p.close, 0); /* it rests until it is */
    ck_assert_uint_ge(p.sided, p.close);
    ck_assert_msg(forbidden == 0, "%lu calls in ticks that may not be", forbidden);
    ASSERT_OK(ebpo_touch_check(p.touch, error));
    ebpo_touch_free(p.touch);
    query_model_free(&m);
}
END_TEST

/* Far away a place is known to less than the model's size. What was learnt there says nothing about
 * a place near the model, and bounds there are wider by what rounding of lengths adds. */
START_TEST(bounds_hold_after_a_jump_from_afar)
{
    static const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    static const double afar[] = { 1e3, 1e6, 1e9, 1e13, 1e17, 1e30, 1e60 };
    enum { FAR = sizeof afar / sizeof *afar, JUMPS = 20 };
    query_model m;
    probe p;
    uint64_t state = 77;
    query_model_make(&m, "box", ebpo_test_box(low, high, 4), &query_variants[0]);
    begin(&p, &m);
    for (int i = 0; i < FAR * JUMPS; i++) {
        double far = afar[i / JUMPS], at[3], near[3];
        ebpo_touch_sensed r;
        for (int k = 0; k < 3; k++)
            at[k] = far * (2 * ebpo_test_random_unit(&state) - 1);
        choose(&p, &state, near);
        ebpo_touch_sense(p.touch, at, &r);
        for (int n = 0; n < 20000 && !(r.flags & EBPO_TOUCH_CLOSE); n++) {
            pause_a_little();
            ebpo_touch_sense(p.touch, at, &r);
        }
        ck_assert_msg((r.flags & EBPO_TOUCH_CLOSE) != 0, "nothing becomes known");
        ck_assert_double_ge(r.hi - r.lo, far * 0x1p-52);
        sense(&p, near);
    }
    ebpo_touch_free(p.touch);
    query_model_free(&m);
}
END_TEST

/* On faces, edges and corners of a cube, and straight through them along its planes. */
START_TEST(a_cube_is_sensed_on_its_faces)
{
    static const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    static const double level[] = { -0.5, 0, 0.25, 0.5, 1, 1.5 };
    enum { LEVELS = sizeof level / sizeof *level };
    query_model m;
    probe p;
    query_model_make(&m, "box", ebpo_test_box(low, high, 4), &query_variants[0]);
    begin(&p, &m);
    for (int i = 0; i < LEVELS * LEVELS * LEVELS; i++) {
        const double at[3] = { level[i % LEVELS], level[i / LEVELS % LEVELS],
                               level[i / LEVELS / LEVELS] };
        ebpo_touch_sensed r = sense(&p, at);
        for (int n = 0; n < 20000 && !(r.flags & EBPO_TOUCH_CLOSE); n++) {
            pause_a_little();
            r = sense(&p, at);
        }
        ck_assert_msg((r.flags & EBPO_TOUCH_CLOSE) != 0, "nothing becomes known");
    }
    ck_assert_uint_eq(forbidden, 0);
    ebpo_touch_free(p.touch);
    query_model_free(&m);
}
END_TEST

START_TEST(a_probe_has_no_other_ticks)
{
    static const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    const double place[3] = { 0.5, 0.5, 0.5 };
    query_model m;
    probe p;
    ebpo_touch *none;
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_touch_result moved;
    ebpo_touch_options options = EBPO_TOUCH_OPTIONS_INIT;
    query_model_make(&m, "box", ebpo_test_box(low, high, 4), &query_variants[0]);
    begin(&p, &m);
    ebpo_touch_move(p.touch, place, &moved);
    ck_assert_uint_eq(moved.flags, EBPO_TOUCH_OTHER);
    options.kind = EBPO_TOUCH_PROBE;
    options.radius = 0.1;
    ck_assert_int_eq(ebpo_touch_new(m.model, &options, place, &none, &why), EBPO_E_ARGUMENT);
    options.radius = 0;
    options.kind = 3;
    ck_assert_int_eq(ebpo_touch_new(m.model, &options, place, &none, &why), EBPO_E_ARGUMENT);
    ebpo_touch_free(p.touch);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(touch_probe)
{
    Suite *suite = suite_create("touch_probe");
    TCase *probes = tcase_create("probe");
    watch_gmp();
    tcase_set_timeout(probes, 600);
    tcase_add_loop_test(probes, bounds_hold_the_exact_distance, 0, WILD);
    tcase_add_test(probes, bounds_hold_after_a_jump_from_afar);
    tcase_add_test(probes, a_cube_is_sensed_on_its_faces);
    tcase_add_test(probes, a_probe_has_no_other_ticks);
    suite_add_tcase(suite, probes);
    return suite;
}
