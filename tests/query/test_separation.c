/* Tests the separation distance along a direction. Pairs of faces and whole models are compared
 * with a reference implementation in integers (tests/support/sweep_reference.h), and with contacts
 * of the moved models. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/collide.h>

#include "check_main.h"
#include "models_reference.h"
#include "extras/collide/face_pairs.h"
#include "solids.h"
#include "sweep_reference.h"

/* --- two faces --- */

/* Uses small integers, so that many faces are parallel to the direction, are in one plane, or have
 * a common edge or corner. */
static void on_grid(double *x, int n, uint64_t *state, unsigned size)
{
    for (int i = 0; i < n; i++)
        x[i] = (double)(ebpo_test_random(state) % size);
}

static void anywhere(double *x, int n, uint64_t *state)
{
    for (int i = 0; i < n; i++)
        x[i] = 2 * ebpo_test_random_unit(state) - 1;
}

typedef struct two_faces {
    double a[3][3], b[3][3], d[3];
} two_faces;

/* Moves both faces into one plane that contains the direction; some faces become points. */
static void flatten(two_faces *f, uint64_t i)
{
    for (int c = 0; c < 3; c++)
        f->a[c][2] = f->b[c][2] = 0;
    f->d[2] = 0;
    if (f->d[0] == 0 && f->d[1] == 0)
        f->d[0] = 1;
    if (i % 4 == 0)
        memcpy(f->b[2], f->b[1], sizeof f->b[2]);
    for (int c = 1; c < 3 && i % 3 == 0; c++)
        memcpy(f->a[c], f->a[0], sizeof f->a[c]);
    for (int c = 1; c < 3 && i % 6 == 0; c++)
        memcpy(f->b[c], f->b[0], sizeof f->b[c]);
}

static two_faces make_faces(uint64_t i, uint64_t *state)
{
    two_faces f;
    if (i % 3 < 2) {
        on_grid(f.a[0], 9, state, 2 + (unsigned)(i % 4));
        on_grid(f.b[0], 9, state, 2 + (unsigned)(i % 4));
    } else {
        anywhere(f.a[0], 9, state);
        anywhere(f.b[0], 9, state);
    }
    do {
        if (i % 3)
            on_grid(f.d, 3, state, 3);
        else
            anywhere(f.d, 3, state);
    } while (f.d[0] == 0 && f.d[1] == 0 && f.d[2] == 0);
    if (i % 5 == 0)
        flatten(&f, i / 5);
    if (i % 7 == 0) /* sometimes all coordinates are very small or very large */
        for (int k = 0; k < 9; k++) {
            f.a[k / 3][k % 3] = ldexp(f.a[k / 3][k % 3], (int)(i % 5) * 200 - 400);
            f.b[k / 3][k % 3] = ldexp(f.b[k / 3][k % 3], (int)(i % 5) * 200 - 400);
        }
    return f;
}

static void same_time(const ebpo_sweep_time *got, mpq_t t, const char *what)
{
    mpz_t left, right;
    mpz_inits(left, right, NULL);
    mpz_mul(left, got->numerator, mpq_denref(t));
    mpz_mul(right, mpq_numref(t), got->denominator);
    if (got->unit >= 0)
        mpz_mul_2exp(left, left, (mp_bitcnt_t)got->unit);
    else
        mpz_mul_2exp(right, right, (mp_bitcnt_t)-got->unit);
    ck_assert_msg(mpz_cmp(left, right) == 0, "%s: %g", what, ebpo_sweep_time_round(got));
    mpz_clears(left, right, NULL);
}

START_TEST(test_face_separation_matches_reference)
{
    uint64_t state = 5, ever = 0, never = 0, bounded = 0;
    for (uint64_t i = 0; i < ebpo_test_scaled(20000); i++) {
        two_faces f = make_faces(i, &state);
        const double(*a)[3] = (const double(*)[3])f.a, (*b)[3] = (const double(*)[3])f.b;
        char what[32];
        ebpo_sweep_time got;
        mpq_t t;
        mpq_init(t);
        ebpo_sweep_time_init(&got);
        snprintf(what, sizeof what, "case %llu", (unsigned long long)i);
        ebpo_sweep_last(a, b, f.d, &got);
        bool any = sweep_reference(a, b, f.d, false, t);
        ck_assert_msg(got.ever == any, "%s: ever %d", what, got.ever);
        if (any)
            same_time(&got, t, what);
        double most = fmax(fabs(f.d[0]), fmax(fabs(f.d[1]), fabs(f.d[2])));
        if (most >= 0.5 && most <= 2) {
            double bound = ebpo_sweep_max(a, b, f.d, INFINITY), time = ebpo_sweep_time_round(&got);
            ck_assert_msg(!any || time < 0 || bound >= time, "%s: %g, bound %g", what, time, bound);
            bounded += bound < 0 ? 1 : any && bound <= time * (1 + 1e-9) + 1e-9;
        }
        ever += any;
        never += !any;
        ebpo_sweep_time_clear(&got);
        mpq_clear(t);
    }
    ck_assert_uint_gt(ever, ebpo_test_scaled(20000) / 20);
    ck_assert_uint_gt(never, ebpo_test_scaled(20000) / 20);
    ck_assert_uint_gt(bounded, ebpo_test_scaled(20000) / 8);
}
END_TEST

/* --- models --- */

static const char *const names[] = { "cube",  "sphere", "staircase", "tetrahedron",
                                     "sheet", "cavity", "blob",      "zero_area_face" };
enum { NAMES = sizeof names / sizeof *names, DIRECTIONS = 4 };
/* The reference implementation takes a fifth of a millisecond for each pair. */
enum { MAX_PAIRS = 8000 };

static void direction_of(int kind, uint64_t *state, double d[3])
{
    static const double plain[3][3] = { { 1, 0, 0 }, { 0, -3, 0 }, { 1, 1, -1 } };
    if (kind < 3)
        memcpy(d, plain[kind], sizeof plain[kind]);
    else
        anywhere(d, 3, state);
}

static ebpo_separation run_query(ebpo_collider *c, const ebpo_pose *a, const ebpo_pose *b,
                                 const double d[3], uint64_t deadline)
{
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_separation out;
    options.pose_a = *a;
    options.pose_b = *b;
    options.deadline_ns = deadline;
    ASSERT_OK(ebpo_collide_separation(c, &options, d, &out, error));
    return out;
}

/* Checks that t is the double nearest to the exact time. */
static void check_time(mpq_t exact, double t, const char *what)
{
    mpq_t low, high;
    mpq_inits(low, high, NULL);
    mpq_set_d(low, nextafter(t, -INFINITY));
    mpq_set_d(high, nextafter(t, INFINITY));
    ck_assert_msg(mpq_cmp(low, exact) < 0 && mpq_cmp(exact, high) < 0, "%s: %.17g, exactly %.17g",
                  what, t, mpq_get_d(exact));
    mpq_clears(low, high, NULL);
}

/* Tests all pairs. *t is the time of the last contact at 0 or later; returns false when there is
 * none. */
static bool brute_force(const reference_faces *a, const reference_faces *b, const double d[3],
                        mpq_t t)
{
    bool any = false;
    mpq_set_si(t, 0, 1);
    for (uint64_t i = 0; i < a->count; i++)
        for (uint64_t j = 0; j < b->count; j++) {
            mpq_t own;
            mpq_init(own);
            mpq_set(own, t);
            if (sweep_reference((const double(*)[3])a->corner[i], (const double(*)[3])b->corner[j],
                                d, any, own) &&
                mpq_sgn(own) >= 0) {
                mpq_set(t, own);
                any = true;
            }
            mpq_clear(own);
        }
    return any;
}

static bool parts_at(const reference_faces *a, uint64_t i, const reference_faces *b, uint64_t j,
                     const double d[3], mpq_t t)
{
    mpq_t own;
    mpq_init(own);
    mpq_set_d(own, 0x1p-20);
    mpq_sub(own, t, own); /* excludes most pairs early */
    bool parts = sweep_reference((const double(*)[3])a->corner[i], (const double(*)[3])b->corner[j],
                                 d, true, own) &&
                 mpq_cmp(own, t) == 0;
    mpq_clear(own);
    return parts;
}

/* Checks the reported pair. Among pairs that separate at the same time, it is the first pair by
 * the faces of a or by the faces of b. The order of the models depends on digests. */
static void check_pair(const reference_faces *a, const reference_faces *b, const double d[3],
                       mpq_t t, const ebpo_face_pair *pair, const char *what)
{
    uint64_t x = pair->file_face_a, y = pair->file_face_b;
    bool by_a = true, by_b = true;
    ck_assert_msg(x < a->count && y < b->count && parts_at(a, x, b, y, d, t),
                  "%s: another pair separates last", what);
    for (uint64_t i = 0; i <= x; i++)
        for (uint64_t j = 0; j < (i < x ? b->count : y); j++)
            by_a = by_a && !parts_at(a, i, b, j, d, t);
    for (uint64_t j = 0; j <= y && !by_a; j++)
        for (uint64_t i = 0; i < (j < y ? a->count : x); i++)
            by_b = by_b && !parts_at(a, i, b, j, d, t);
    ck_assert_msg(by_a || by_b, "%s: not the first pair that separates last", what);
}

static void check_case(ebpo_collider *c, ebpo_collider *swapped, const query_model m[2], int kind,
                       int along, uint64_t *state)
{
    ebpo_pose a, b;
    reference_faces f[2];
    char what[128];
    double d[3], back[3];
    mpq_t t;
    mpq_init(t);
    reference_pose(kind, m[0].size > 0 ? m[0].size : 1, state, &a, &b);
    direction_of(along, state, d);
    for (int k = 0; k < 3; k++)
        back[k] = -d[k];
    snprintf(what, sizeof what, "%s, %s, %s, direction %d", m[0].name, m[1].name,
             reference_pose_name(kind), along);
    reference_faces_make(&f[0], &m[0], &a);
    reference_faces_make(&f[1], &m[1], &b);
    ebpo_separation got = run_query(c, &a, &b, d, 0), other = run_query(swapped, &b, &a, back, 0),
                    late = run_query(c, &a, &b, d, 1);
    bool any = brute_force(&f[0], &f[1], d, t);
    ck_assert_msg(any == (got.pair.face_a != EBPO_NO_FACE), "%s: any %d", what, any);
    ck_assert_int_eq(got.t.kind, EBPO_VALUE_EXACT);
    check_time(t, got.t.lo, what);
    if (any)
        check_pair(&f[0], &f[1], d, t, &got.pair, what);
    ck_assert_msg(memcmp(&got.t, &other.t, sizeof got.t) == 0 &&
                      got.pair.file_face_a == other.pair.file_face_b &&
                      got.pair.file_face_b == other.pair.file_face_a,
                  "%s: swapped", what);
    ck_assert_msg(late.t.lo <= got.t.lo && got.t.lo <= late.t.hi, "%s: late", what);
    reference_faces_free(&f[0]);
    reference_faces_free(&f[1]);
    mpq_clear(t);
}

START_TEST(test_separation_matches_brute_force)
{
    query_model m[2];
    ebpo_collider *c, *swapped;
    uint64_t state = (uint64_t)_i + 1;
    if (!ebpo_test_wanted(_i))
        return;
    const char *name[2] = { names[_i / NAMES], names[_i % NAMES] };
    for (int i = 0; i < 2; i++)
        query_model_make(&m[i], name[i], query_solid_by_name(name[i]),
                         &query_variants[(_i + i) % query_variant_count]);
    ASSERT_OK(ebpo_collider_new(m[0].model, m[1].model, NULL, &c, error));
    ASSERT_OK(ebpo_collider_new(m[1].model, m[0].model, NULL, &swapped, error));
    uint64_t pairs = m[0].mesh.face_count * m[1].mesh.face_count;
    for (int kind = _i % 2; kind < REFERENCE_POSES && pairs <= MAX_PAIRS; kind += 2)
        check_case(c, swapped, m, kind, (kind / 2 + _i) % DIRECTIONS, &state);
    ebpo_collider_free(c);
    ebpo_collider_free(swapped);
    query_model_free(&m[0]);
    query_model_free(&m[1]);
}
END_TEST

/* --- moved models --- */

static int32_t meets(ebpo_collider *c, const ebpo_pose *a, const ebpo_pose *b)
{
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_face_pair pair;
    int32_t found;
    options.pose_a = *a;
    options.pose_b = *b;
    ASSERT_OK(ebpo_collide_first(c, &options, &pair, &found, error));
    return found;
}

/* On a grid, little is rounded. Models moved by t are in contact. Models moved farther are never
 * in contact again. */
START_TEST(test_separation_of_grid_solids)
{
    query_model m[2];
    ebpo_collider *c;
    ebpo_pose a = EBPO_POSE_INIT, b = EBPO_POSE_INIT;
    uint64_t state = 99 + (uint64_t)_i;
    if (!ebpo_test_wanted(_i))
        return;
    for (int i = 0; i < 2; i++)
        query_model_make(&m[i], "grid", query_random_solid(state + 7 * (unsigned)i, true),
                         &query_variants[0]);
    ASSERT_OK(ebpo_collider_new(m[0].model, m[1].model, NULL, &c, error));
    for (int axis = 0; axis < 6; axis++) {
        double d[3] = { 0, 0, 0 };
        d[axis % 3] = axis < 3 ? 1 : -2;
        for (int k = 0; k < 3; k++)
            b.translation[k] = (double)(ebpo_test_random(&state) % 3) / 2;
        ebpo_separation w = run_query(c, &a, &b, d, 0);
        /* models with slanted faces may separate at a t that doubles do not represent */
        for (int step = w.t.lo * 64 == floor(w.t.lo * 64) ? 0 : 1; step < 12; step++) {
            ebpo_pose moved = a;
            double t = w.t.lo + step / 4.0;
            moved.translation[axis % 3] = t * d[axis % 3];
            int32_t expected = step == 0 && w.pair.face_a != EBPO_NO_FACE;
            ck_assert_msg(meets(c, &moved, &b) == expected, "%d: axis %d, t %g of %g", _i, axis, t,
                          w.t.lo);
        }
    }
    ebpo_collider_free(c);
    query_model_free(&m[0]);
    query_model_free(&m[1]);
}
END_TEST

/* For boxes the distance is the overlap along the axis. A solid within another one is moved out of
 * it. */
START_TEST(test_separation_of_boxes_is_axis_overlap)
{
    query_model m;
    ebpo_collider *c;
    ebpo_pose a = EBPO_POSE_INIT, b = EBPO_POSE_INIT;
    const double x[3] = { 1, 0, 0 }, up[3] = { 0, 0, 0.5 };
    query_model_make(&m, "cube", query_solid_by_name("cube"), &query_variants[0]);
    ASSERT_OK(ebpo_collider_new(m.model, m.model, NULL, &c, error));
    double size = m.size;
    ck_assert_double_eq(run_query(c, &a, &b, x, 0).t.lo, size);
    b.translation[0] = size / 4;
    b.translation[1] = size / 8;
    ck_assert_double_eq(run_query(c, &a, &b, x, 0).t.lo, size * 5 / 4);
    ck_assert_double_eq(run_query(c, &a, &b, up, 0).t.lo, size * 2);
    b.translation[1] = 2 * size; /* beside the box: never in contact */
    ck_assert(run_query(c, &a, &b, x, 0).pair.face_a == EBPO_NO_FACE);
    ck_assert_double_eq(run_query(c, &a, &b, x, 0).t.hi, 0);
    b.translation[1] = 0;
    b.translation[0] = -4 * size; /* behind the box: already separated */
    ck_assert(run_query(c, &a, &b, x, 0).pair.face_a == EBPO_NO_FACE);
    ebpo_collider_free(c);
    query_model_free(&m);
}
END_TEST

START_TEST(test_separation_invalid_direction_is_refused)
{
    query_model m;
    ebpo_collider *c;
    ebpo_separation out;
    ebpo_error why = EBPO_ERROR_INIT;
    const double bad[][3] = { { 0, 0, 0 }, { NAN, 0, 1 }, { 1, INFINITY, 0 } };
    query_model_make(&m, "cube", query_solid_by_name("cube"), &query_variants[0]);
    ASSERT_OK(ebpo_collider_new(m.model, m.model, NULL, &c, error));
    for (int i = 0; i < 3; i++)
        ck_assert_int_eq(ebpo_collide_separation(c, NULL, bad[i], &out, &why), EBPO_E_ARGUMENT);
    ebpo_collider_free(c);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(separation)
{
    TCase *tests = tcase_create("separation");
    tcase_set_timeout(tests, 900);
    tcase_add_test(tests, test_face_separation_matches_reference);
    tcase_add_loop_test(tests, test_separation_matches_brute_force, 0, NAMES * NAMES);
    tcase_add_loop_test(tests, test_separation_of_grid_solids, 0, 20);
    tcase_add_test(tests, test_separation_of_boxes_is_axis_overlap);
    tcase_add_test(tests, test_separation_invalid_direction_is_refused);
    Suite *suite = suite_create("way_out");
    suite_add_tcase(suite, tests);
    return suite;
}
