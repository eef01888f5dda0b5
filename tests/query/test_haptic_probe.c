/* Tests a probe without constraints. Its bounds contain the exact signed distance for any jump and
 * any part in memory, and a haptic step makes no call that could delay it. */
#include <stdlib.h>
#include <ebpo/haptic.h>
#include <math.h>

#include "check_main.h"
#include "query_support.h"
#include "haptic_watch.h"

typedef struct probe {
    query_model *m;
    ebpo_haptic *haptic;
    ebpo_rule rule;
    double rounding, search_radius, least[3], wide[3];
    uint64_t step_count, close, sided;
} probe;

static bool rule_inside(ebpo_rule rule, int32_t winding)
{
    return rule == EBPO_RULE_POSITIVE  ? winding > 0
           : rule == EBPO_RULE_EVENODD ? winding % 2 != 0
                                       : winding != 0;
}

/* Returns the exact value of the library's result, by integers of any size. */
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

static ebpo_haptic_probe_result sense(probe *p, const double place[3])
{
    ebpo_haptic_probe_result r;
    int32_t where;
    in_step = true;
    ebpo_haptic_step_probe(p->haptic, place, &r);
    in_step = false;
    double truth = exact(p, place, &where);
    const char *name = p->m->name;
    ck_assert_msg(r.lo <= truth + p->rounding && truth <= r.hi + p->rounding,
                  "%s: %.17g is not from %.17g to %.17g", name, truth, r.lo, r.hi);
    ck_assert_msg(r.where == EBPO_MAYBE || r.where == where, "%s: where %d, not %d", name, r.where,
                  where);
    if (r.flags & EBPO_HAPTIC_ACCURATE)
        ck_assert_msg(fabs(r.distance - truth) <= p->rounding, "%s: %.17g, not %.17g", name,
                      r.distance, truth);
    else
        ck_assert(isnan(r.distance));
    if (r.face != EBPO_NO_FACE)
        ck_assert_double_le(fabs(r.weight[0] + r.weight[1] + r.weight[2] - 1), 1e-12);
    p->step_count++;
    p->close += (r.flags & EBPO_HAPTIC_ACCURATE) != 0;
    p->sided += r.where != EBPO_MAYBE;
    return r;
}

static void choose(probe *p, uint64_t *state, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = p->least[k] + (1.4 * ebpo_test_random_unit(state) - 0.2) * p->wide[k];
}

/* Moves in steps or at once; then rests until everything is known. */
static void roam(probe *p, uint64_t step_count, uint64_t *state)
{
    double at[3], goal[3], from[3];
    choose(p, state, at);
    while (p->step_count < step_count) {
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
        for (ebpo_haptic_probe_result r = sense(p, at); !(r.flags & EBPO_HAPTIC_ACCURATE);
             r = sense(p, at)) {
            ck_assert_msg(patience-- > 0, "%s: the bounds do not become accurate", p->m->name);
            pause_a_little();
        }
    }
}

static void begin(probe *p, query_model *m)
{
    const ebpo_info *info = ebpo_file_info(m->file);
    ebpo_haptic_options options = EBPO_HAPTIC_OPTIONS_INIT;
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
    options.kind = EBPO_HAPTIC_PROBE;
    options.search_radius = 0.05 * diagonal;
    options.faces = 1 << 10;
    ASSERT_OK(ebpo_haptic_new(m->model, &options, middle, &p->haptic, error));
}

static const char *const wild[] = { "sphere",      "thin_wall",      "cavity",         "staircase",
                                    "blob",        "cone_slivers",   "open_box",       "mobius",
                                    "far_away",    "zero_area_face", "gap_of_one_ulp", "l_shape",
                                    "turned_boxes" };
enum { WILD = sizeof wild / sizeof *wild };

START_TEST(test_haptic_probe_bounds_exact_distance)
{
    query_model m;
    probe p;
    uint64_t state = 500 + (uint64_t)_i;
    query_model_make(&m, wild[_i], query_solid_by_name(wild[_i]),
                     &query_variants[_i % query_variant_count]);
    begin(&p, &m);
    roam(&p, query_scaled(4000), &state);
    ck_assert_uint_gt(p.close, 0); /* the probe rests until its bounds are close */
    ck_assert_uint_ge(p.sided, p.close);
    ck_assert_msg(forbidden == 0, "%lu forbidden calls in haptic steps", forbidden);
    ASSERT_OK(ebpo_haptic_check(p.haptic, error));
    ebpo_haptic_free(p.haptic);
    query_model_free(&m);
}
END_TEST

/* Far away, a distance is known with an error of less than the size of the model. Such a bound
 * gives no information about positions near the model. Rounding of lengths widens bounds there. */
START_TEST(test_haptic_probe_bounds_after_long_jump)
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
        ebpo_haptic_probe_result r;
        for (int k = 0; k < 3; k++)
            at[k] = far * (2 * ebpo_test_random_unit(&state) - 1);
        choose(&p, &state, near);
        ebpo_haptic_step_probe(p.haptic, at, &r);
        for (int n = 0; n < 20000 && !(r.flags & EBPO_HAPTIC_ACCURATE); n++) {
            pause_a_little();
            ebpo_haptic_step_probe(p.haptic, at, &r);
        }
        ck_assert_msg((r.flags & EBPO_HAPTIC_ACCURATE) != 0, "the bounds do not become accurate");
        ck_assert_double_ge(r.hi - r.lo, far * 0x1p-52);
        sense(&p, near);
    }
    ebpo_haptic_free(p.haptic);
    query_model_free(&m);
}
END_TEST

/* The probe is on faces, edges and corners of a cube, and moves through these along the planes of
 * the cube. */
START_TEST(test_haptic_probe_on_cube_faces)
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
        ebpo_haptic_probe_result r = sense(&p, at);
        for (int n = 0; n < 20000 && !(r.flags & EBPO_HAPTIC_ACCURATE); n++) {
            pause_a_little();
            r = sense(&p, at);
        }
        ck_assert_msg((r.flags & EBPO_HAPTIC_ACCURATE) != 0, "the bounds do not become accurate");
    }
    ck_assert_uint_eq(forbidden, 0);
    ebpo_haptic_free(p.haptic);
    query_model_free(&m);
}
END_TEST

START_TEST(test_haptic_probe_refuses_other_steps)
{
    static const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    const double place[3] = { 0.5, 0.5, 0.5 };
    query_model m;
    probe p;
    ebpo_haptic *none;
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_haptic_ball_result moved;
    ebpo_haptic_options options = EBPO_HAPTIC_OPTIONS_INIT;
    query_model_make(&m, "box", ebpo_test_box(low, high, 4), &query_variants[0]);
    begin(&p, &m);
    ebpo_haptic_step_ball(p.haptic, place, &moved);
    ck_assert_uint_eq(moved.flags, EBPO_HAPTIC_WRONG_KIND);
    options.kind = EBPO_HAPTIC_PROBE;
    options.radius = 0.1;
    ck_assert_int_eq(ebpo_haptic_new(m.model, &options, place, &none, &why), EBPO_E_ARGUMENT);
    options.radius = 0;
    options.kind = 3;
    ck_assert_int_eq(ebpo_haptic_new(m.model, &options, place, &none, &why), EBPO_E_ARGUMENT);
    ebpo_haptic_free(p.haptic);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(haptic_probe)
{
    Suite *suite = suite_create("haptic_probe");
    TCase *probes = tcase_create("probe");
    watch_gmp();
    tcase_set_timeout(probes, 600);
    tcase_add_loop_test(probes, test_haptic_probe_bounds_exact_distance, 0, WILD);
    tcase_add_test(probes, test_haptic_probe_bounds_after_long_jump);
    tcase_add_test(probes, test_haptic_probe_on_cube_faces);
    tcase_add_test(probes, test_haptic_probe_refuses_other_steps);
    suite_add_tcase(suite, probes);
    return suite;
}
