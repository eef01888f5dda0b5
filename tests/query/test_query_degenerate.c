/* Tests queries with lengths of very different size: faces far larger than a subtree, edges far
 * shorter than a cell. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "query_support.h"

static const query_variant deep = { "N=8, all levels", 8, 20, EBPO_RULE_NONZERO, 0 },
                           one_leaf = { "one leaf", 1000, 0, EBPO_RULE_NONZERO, 0 };

static void add(ebpo_mesh *m, ebpo_mesh other)
{
    ebpo_test_append(m, &other);
    ebpo_mesh_free(&other);
}

/* --- a small ball before a large face, and points at equal distances from both --- */

enum { TIES = 60, STEPS = 40 };
static const double radius = 0x1p-14;

/* Computes the unit normal of the large face, and its middle. */
static void large_face(const ebpo_mesh *m, double normal[3], double middle[3])
{
    const double *a = m->xyz64 + 3 * 1, *b = m->xyz64 + 3 * 2, *c = m->xyz64 + 3 * 3;
    double e[3], f[3], length = 0;
    for (int k = 0; k < 3; k++) {
        e[k] = b[k] - a[k];
        f[k] = c[k] - a[k];
        middle[k] = a[k] * 0.35 + b[k] * 0.33 + c[k] * 0.32;
    }
    for (int k = 0; k < 3; k++) {
        normal[k] = e[(k + 1) % 3] * f[(k + 2) % 3] - e[(k + 2) % 3] * f[(k + 1) % 3];
        length += normal[k] * normal[k];
    }
    length = copysign(sqrt(length),
                      normal[0] * middle[0] + normal[1] * middle[1] + normal[2] * middle[2]);
    for (int k = 0; k < 3; k++)
        normal[k] /= length;
}

static ebpo_mesh make_ball_before_face(uint64_t *state, double normal[3], double middle[3])
{
    double centre[3];
    ebpo_mesh m = ebpo_test_tetrahedron(1);
    for (int i = 0; i < 12; i++)
        m.xyz64[i] = i < 3 ? 0 : (i % 3 == i / 3 - 1) + 0.4 * ebpo_test_random_unit(state);
    large_face(&m, normal, middle);
    for (int k = 0; k < 3; k++)
        centre[k] = middle[k] + 1.6 * radius * normal[k];
    add(&m, ebpo_test_sphere(centre, radius, 3));
    return m;
}

/* Finds points over the face at equal distances from face and ball, by bisection. */
static void make_ties(query_model *m, const double normal[3], const double middle[3],
                      double points[TIES][3])
{
    double base[TIES][3], low[TIES], high[TIES];
    uint64_t state = 5;
    for (int i = 0; i < TIES; i++) {
        low[i] = 0.01 * radius;
        high[i] = 1.5 * radius;
        double aside[3], along = 0;
        for (int k = 0; k < 3; k++) {
            aside[k] = ebpo_test_random_unit(&state) - 0.5;
            along += aside[k] * normal[k];
        }
        for (int k = 0; k < 3; k++)
            base[i][k] = middle[k] + 0.6 * radius * (aside[k] - along * normal[k]);
    }
    for (int step = 0; step < STEPS; step++)
        for (int i = 0; i < TIES; i++) {
            ebpo_distance_options cold = EBPO_DISTANCE_OPTIONS_INIT;
            ebpo_distance_result d;
            double at = (low[i] + high[i]) / 2;
            for (int k = 0; k < 3; k++)
                points[i][k] = base[i][k] + at * normal[k];
            cold.warm = false;
            ck_assert_int_eq(ebpo_distance(m->context, points[i], &cold, &d, NULL), EBPO_OK);
            *(d.face < 4 ? &low[i] : &high[i]) =
                at; /* the tetrahedron's faces come first in the source */
        }
}

START_TEST(test_faces_larger_than_subtree_are_exact)
{
    query_model m;
    double normal[3], middle[3], points[TIES][3];
    query_truth truth[TIES];
    ebpo_distance_result got[TIES];
    uint64_t state = (uint64_t)_i;
    query_model_make(&m, "ball before a face", make_ball_before_face(&state, normal, middle),
                     &deep);
    ck_assert_int_gt(m.info.level_count, 14);
    make_ties(&m, normal, middle, points);
    query_find_truths(&m, points[0], TIES, truth);
    int large = 0;
    for (int i = 0; i < TIES; i++)
        large += truth[i].face < 4;
    ck_assert(large > 5 && large < TIES - 5);
    for (int cut = 6; cut < m.info.level_count; cut++)
        for (int warm = 0; warm < 2; warm++) {
            ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
            ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
            ebpo_model *model;
            ebpo_context *context;
            how.cut_level = cut;
            options.warm = warm;
            ck_assert_int_eq(ebpo_model_new(m.file, &how, &model, NULL), EBPO_OK);
            ck_assert_int_eq(ebpo_context_new(model, &context, NULL), EBPO_OK);
            ck_assert_int_eq(ebpo_distance_many(context, points[0], TIES, &options, got, NULL),
                             EBPO_OK);
            ck_assert_msg(query_wrong_distance(&m, points[0], truth, TIES, false, got) == 0,
                          "cut level %d, warm %d", cut, warm);
            ebpo_context_free(context);
            ebpo_model_free(model);
        }
    query_model_free(&m);
}
END_TEST

/* --- an octahedron with one vertex replaced by two very close ones, on a common plane --- */

static ebpo_mesh make_doubled_vertex(double apart, const double axis[3], uint64_t *state)
{
    static const uint32_t faces[][3] = { { 0, 1, 3 }, { 1, 2, 3 }, { 1, 0, 6 }, { 1, 6, 2 },
                                         { 2, 4, 3 }, { 2, 6, 4 }, { 3, 4, 5 }, { 4, 6, 5 },
                                         { 3, 5, 0 }, { 0, 5, 6 } };
    double xyz[7][3] = { { axis[0], 0, 0 },
                         { axis[0] - axis[0] * apart, axis[1] * apart, 0 },
                         { 0, axis[1], 0 },
                         { 0, 0, axis[2] } };
    for (int k = 0; k < 3; k++)
        xyz[4 + k][k] = -0.2 - 5 * ebpo_test_random_unit(state);
    ebpo_mesh m = { .vertex_count = 7,
                    .face_count = 10,
                    .xyz64 = malloc(sizeof xyz),
                    .faces = malloc(sizeof faces) };
    memcpy(m.xyz64, xyz, sizeof xyz);
    memcpy(m.faces, faces, sizeof faces);
    return m;
}

START_TEST(test_convex_leaf_planes_with_short_edges)
{
    enum { POINTS = 700 };
    static const double off[] = { 0, 0x1p-50, 0x1p-30, 0x1p-24, 0x1p-22, -0x1p-50, -0x1p-24 };
    double points[POINTS][3];
    query_truth truth[POINTS];
    ebpo_inside_result got[POINTS];
    query_model m;
    uint64_t state = (uint64_t)_i + 1;
    double axis[3];
    for (int k = 0; k < 3; k++)
        axis[k] = (double)(3 + 2 * (ebpo_test_random(&state) % 6));
    double apart = ldexp(1 + (double)(ebpo_test_random(&state) % 32) / 32, -32 - _i % 10);
    query_model_make(&m, "doubled vertex", make_doubled_vertex(apart, axis, &state), &one_leaf);
    for (int i = 0; i < POINTS; i++) { /* about the plane of the first faces */
        double a = 0.2 * ebpo_test_random_unit(&state), c = 0.2 * ebpo_test_random_unit(&state),
               far = 1 + off[i % 7];
        points[i][0] = a * axis[0] * far;
        points[i][1] = (1 - a - c) * axis[1] * far;
        points[i][2] = c * axis[2] * far;
    }
    query_find_truths(&m, points[0], POINTS, truth);
    ck_assert_int_eq(ebpo_inside_many(m.context, points[0], POINTS, NULL, got, NULL), EBPO_OK);
    ck_assert_uint_eq(query_wrong_inside(&m, points[0], truth, POINTS, got), 0);
    query_model_free(&m);
}
END_TEST

/* --- tiny faces in a model of size 1: squares of distances underflow in floats --- */

START_TEST(test_nearest_tiny_face_with_underflow)
{
    if (!ebpo_test_wanted(_i))
        return;
    const double m = 0x1p-77 * (1 + _i * 0.025), origin[3] = { 0, 0, 0 };
    /* the size of the model */
    const double xyz[9][3] = { { -1, -1, -1 },    { 1, -1, 1 },       { 1, -1, -1 },
                               { m, m, m },       { 1.02 * m, m, m }, { m, 1.02 * m, m },
                               { 1.3 * m, 0, 0 }, { 1.32 * m, 0, 0 }, { 1.3 * m, 0.01 * m, 0 } };
    ebpo_mesh mesh = { .vertex_count = 9,
                       .face_count = 3,
                       .xyz32 = malloc(27 * sizeof(float)),
                       .faces = malloc(9 * sizeof(uint32_t)) };
    for (uint32_t i = 0; i < 27; i++)
        mesh.xyz32[i] = (float)xyz[i / 3][i % 3];
    for (uint32_t i = 0; i < 9; i++)
        mesh.faces[i] = i;
    double wanted = (double)mesh.xyz32[18];
    query_model model;
    ebpo_distance_result got;
    query_model_make(&model, "tiny faces", mesh, &one_leaf);
    ck_assert_int_eq(ebpo_distance(model.context, origin, NULL, &got, NULL), EBPO_OK);
    ck_assert(got.distance == wanted);
    query_model_free(&model);
}
END_TEST

TEST_SUITE(query_degenerate)
{
    Suite *suite = suite_create("query_degenerate");
    TCase *tests = tcase_create("degenerate");
    tcase_set_timeout(tests, 600);
    tcase_add_loop_test(tests, test_faces_larger_than_subtree_are_exact, 0, 12);
    tcase_add_loop_test(tests, test_convex_leaf_planes_with_short_edges, 0, 60);
    tcase_add_loop_test(tests, test_nearest_tiny_face_with_underflow, 0, 320);
    suite_add_tcase(suite, tests);
    return suite;
}
