/* Tests the penetration depth of models against dense points on faces, by distances to every face
 * and by winding numbers as sums of solid angles; and against known depths of boxes. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <ebpo/collide.h>

#include "check_main.h"
#include "geometry/distance.h"
#include "models_reference.h"
#include "solids.h"

static const char *const names[] = { "cube", "torus", "sphere", "nested_windings" };
enum { NAMES = sizeof names / sizeof *names };
/* Samples per edge of a face. */
enum { STEPS = 4 };
/* Greatest product of the numbers of faces. Larger pairs of models are tested only at a few kinds
 * of poses. */
enum { MAX_PAIRS = 100000 };

typedef struct two_models {
    query_model model[2];
    ebpo_collider *collider, *swapped;
} two_models;

static void make_two(two_models *t, const char *name_a, const char *name_b)
{
    const char *name[2] = { name_a, name_b };
    for (int i = 0; i < 2; i++)
        query_model_make(&t->model[i], name[i], query_solid_by_name(name[i]), &query_variants[0]);
    ASSERT_OK(ebpo_collider_new(t->model[0].model, t->model[1].model, NULL, &t->collider, error));
    ASSERT_OK(ebpo_collider_new(t->model[1].model, t->model[0].model, NULL, &t->swapped, error));
}

static void free_two(two_models *t)
{
    ebpo_collider_free(t->collider);
    ebpo_collider_free(t->swapped);
    query_model_free(&t->model[0]);
    query_model_free(&t->model[1]);
}

static void run_query(ebpo_collider *c, const ebpo_pose *a, const ebpo_pose *b, double tolerance,
                      uint64_t deadline, ebpo_value_bounds out[2])
{
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    options.pose_a = *a;
    options.pose_b = *b;
    options.deadline_ns = deadline;
    ASSERT_OK(ebpo_collide_depth(c, &options, tolerance, &out[0], &out[1], error));
}

/* --- the reference implementation --- */

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Returns the solid angle of a face, seen from the origin of r, by the formula of Van Oosterom and
 * Strackee. */
static double solid_angle(const double r[3][3])
{
    double n[3],
        c[3] = { r[1][1] * r[2][2] - r[1][2] * r[2][1], r[1][2] * r[2][0] - r[1][0] * r[2][2],
                 r[1][0] * r[2][1] - r[1][1] * r[2][0] };
    for (int i = 0; i < 3; i++)
        n[i] = sqrt(dot(r[i], r[i]));
    return 2 * atan2(dot(r[0], c), n[0] * n[1] * n[2] + dot(r[0], r[1]) * n[2] +
                                       dot(r[0], r[2]) * n[1] + dot(r[1], r[2]) * n[0]);
}

/* Returns the depth of w inside the faces; 0 outside. */
static double depth_at(const reference_faces *f, const double w[3])
{
    double nearest = INFINITY, angle = 0;
    for (uint64_t i = 0; i < f->count; i++) {
        double r[3][3];
        ebpo_distance_bounds d;
        ebpo_triangle_distance_bounds(w, (const double(*)[3])f->corner[i], &d);
        nearest = fmin(nearest, d.hi);
        for (int k = 0; k < 9; k++)
            r[k / 3][k % 3] = f->corner[i][k / 3][k % 3] - w[k % 3];
        angle += solid_angle((const double(*)[3])r);
    }
    return fabs(angle) > 6 ? nearest : 0;
}

/* Computes bounds of the depth from points on all faces: at least *lo and at most *hi. */
static void depth_of_points(const reference_faces *a, const reference_faces *b, double *lo,
                            double *hi)
{
    double longest = 0;
    *lo = 0;
    for (uint64_t f = 0; f < a->count; f++) {
        const double(*t)[3] = (const double(*)[3])a->corner[f];
        for (int i = 0; i < 3; i++) {
            const double *p = t[i], *q = t[(i + 1) % 3];
            longest = fmax(longest, hypot(hypot(p[0] - q[0], p[1] - q[1]), p[2] - q[2]));
        }
        for (int i = 0; i <= STEPS; i++)
            for (int j = 0; i + j <= STEPS; j++) {
                double w[3];
                for (int k = 0; k < 3; k++)
                    w[k] =
                        t[0][k] + (t[1][k] - t[0][k]) * i / STEPS + (t[2][k] - t[0][k]) * j / STEPS;
                *lo = fmax(*lo, depth_at(b, w));
            }
    }
    *hi = *lo + longest / STEPS;
}

/* --- tests --- */

static void check_one(const ebpo_value_bounds *got, double lo, double hi, double tolerance,
                      double size, const char *what)
{
    ck_assert_msg(got->lo <= hi + 1e-12 * size && lo <= got->hi + 1e-12 * size,
                  "%s: %.17g .. %.17g, by points %.17g .. %.17g", what, got->lo, got->hi, lo, hi);
    ck_assert_msg(got->lo >= 0 && got->hi - got->lo <= tolerance + 1e-11 * size,
                  "%s: %.17g .. %.17g is too wide", what, got->lo, got->hi);
    ck_assert_int_eq(got->kind == EBPO_VALUE_EXACT, got->lo == got->hi);
}

static void check_case(two_models *t, int kind, uint64_t *state)
{
    ebpo_pose a, b;
    reference_faces f[2];
    ebpo_value_bounds got[2], other[2], late[2];
    char what[128];
    double lo, hi, size = t->model[0].size, tolerance = 0.003 * size;
    snprintf(what, sizeof what, "%s, %s, %s", t->model[0].name, t->model[1].name,
             reference_pose_name(kind));
    reference_pose(kind, size, state, &a, &b);
    run_query(t->collider, &a, &b, tolerance, 0, got);
    run_query(t->swapped, &b, &a, tolerance, 0, other);
    run_query(t->collider, &a, &b, tolerance, 1, late);
    for (int i = 0; i < 2; i++) {
        ck_assert_msg(memcmp(&got[i], &other[!i], sizeof *got) == 0, "%s: swapped", what);
        ck_assert_msg(late[i].lo <= got[i].hi && got[i].lo <= late[i].hi, "%s: late", what);
    }
    reference_faces_make(&f[0], &t->model[0], &a);
    reference_faces_make(&f[1], &t->model[1], &b);
    for (int i = 0; i < 2; i++) {
        depth_of_points(&f[i], &f[!i], &lo, &hi);
        check_one(&got[i], lo, hi, tolerance, size, what);
    }
    reference_faces_free(&f[0]);
    reference_faces_free(&f[1]);
}

START_TEST(test_depth_bounds_match_points)
{
    two_models t;
    uint64_t state = (uint64_t)_i + 5;
    if (!ebpo_test_wanted(_i))
        return;
    make_two(&t, names[_i / NAMES], names[_i % NAMES]);
    bool few = t.model[0].mesh.face_count * t.model[1].mesh.face_count > MAX_PAIRS;
    for (int kind = _i % 2; kind < REFERENCE_POSES; kind += 2)
        if (!few || kind % 8 == _i % 8)
            check_case(&t, kind, &state);
    free_two(&t);
}
END_TEST

/* All points of the inner box's surface are equally deep. A finer tolerance hardly increases the
 * cost. */
START_TEST(test_depth_of_boxes_matches_formula)
{
    two_models t;
    ebpo_pose a = EBPO_POSE_INIT, b = EBPO_POSE_INIT;
    ebpo_value_bounds got[2];
    double low[3], high[3], middle;
    make_two(&t, "cube", "cube");
    ebpo_test_point(&t.model[0].mesh, 0, low);
    memcpy(high, low, sizeof high);
    for (uint64_t i = 0; i < t.model[0].mesh.vertex_count; i++) {
        double x[3];
        ebpo_test_point(&t.model[0].mesh, i, x);
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], x[k]);
            high[k] = fmax(high[k], x[k]);
        }
    }
    a.scale = 0.25;
    for (int k = 0; k < 3; k++) {
        middle = (low[k] + high[k]) / 2;
        a.translation[k] = middle - 0.25 * middle;
    }
    double depth = 0.375 * (high[0] - low[0]);
    run_query(t.collider, &a, &b, 1e-9, 0, got);
    ck_assert_msg(got[0].lo <= depth && depth <= got[0].hi && got[0].hi - got[0].lo <= 2e-9,
                  "%.17g is not in %.17g .. %.17g", depth, got[0].lo, got[0].hi);
    ck_assert(got[1].lo == 0 && got[1].hi == 0 && got[1].kind == EBPO_VALUE_EXACT);
    free_two(&t);
}
END_TEST

START_TEST(test_depth_of_non_solid_is_refused)
{
    two_models t;
    ebpo_value_bounds out;
    ebpo_error refusal = EBPO_ERROR_INIT;
    make_two(&t, "cube", "sheet");
    ck_assert_int_eq(ebpo_collide_depth(t.collider, NULL, 0.1, &out, NULL, &refusal),
                     EBPO_E_NOT_SOLID);
    ASSERT_OK(ebpo_collide_depth(t.collider, NULL, 0.1, NULL, &out, error));
    const double wrong[] = { 0, -1, INFINITY, NAN };
    for (int i = 0; i < 4; i++)
        ck_assert_int_eq(ebpo_collide_depth(t.collider, NULL, wrong[i], NULL, &out, &refusal),
                         EBPO_E_ARGUMENT);
    free_two(&t);
}
END_TEST

TEST_SUITE(collide_depth)
{
    TCase *tests = tcase_create("collide_depth");
    tcase_set_timeout(tests, 900);
    tcase_add_loop_test(tests, test_depth_bounds_match_points, 0, NAMES * NAMES);
    tcase_add_test(tests, test_depth_of_boxes_matches_formula);
    tcase_add_test(tests, test_depth_of_non_solid_is_refused);
    Suite *suite = suite_create("collide_depth");
    suite_add_tcase(suite, tests);
    return suite;
}
