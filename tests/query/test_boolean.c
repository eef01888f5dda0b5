/* Boolean queries against rational arithmetic: meshes are posed by the definition, and winding
 * numbers are computed by brute force. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/boolean.h>

#include "check_main.h"
#include "query_support.h"

enum { OPERANDS = 3, NEAR = 24 };

/* --- operands: a model, its pose, and the reference of the posed mesh --- */

typedef struct operand {
    query_model model;
    ebpo_pose pose;
    ebpo_mesh posed;
    oracle *judge;
} operand;

/* Implements the definition of docs/develop/collision.md without the library. */
static void pose_vertex(const ebpo_pose *p, const double x[3], double out[3])
{
    for (int i = 0; i < 3; i++) {
        volatile double m[3], a[3], sum;
        for (int k = 0; k < 3; k++) {
            m[k] = p->scale * p->rotation[i][k];
            a[k] = m[k] * x[k];
        }
        sum = a[0] + a[1];
        sum = sum + a[2];
        out[i] = sum + p->translation[i];
    }
}

static void operand_make(operand *o, const char *solid, int variant, const ebpo_pose *pose)
{
    query_model_make(&o->model, solid, query_solid_by_name(solid), &query_variants[variant]);
    o->pose = *pose;
    const ebpo_mesh *from = &o->model.mesh;
    o->posed = (ebpo_mesh){ .vertex_count = from->vertex_count, .face_count = from->face_count };
    o->posed.xyz64 = query_alloc(from->vertex_count, sizeof(double[3]));
    o->posed.faces = query_alloc(from->face_count, sizeof(uint32_t[3]));
    memcpy(o->posed.faces, from->faces, from->face_count * sizeof(uint32_t[3]));
    for (uint64_t v = 0; v < from->vertex_count; v++) {
        double x[3];
        ebpo_test_point(from, v, x);
        pose_vertex(pose, x, o->posed.xyz64 + 3 * v);
    }
    o->judge = oracle_make(&o->posed);
}

static void operand_free(operand *o)
{
    oracle_free(o->judge);
    ebpo_mesh_free(&o->posed);
    query_model_free(&o->model);
}

static ebpo_pose pose_of(double angle, double scale, double x, double y, double z)
{
    double c = cos(angle), s = sin(angle);
    return (ebpo_pose){ { { c, -s, 0 }, { s * c, c * c, -s }, { s * s, c * s, c } },
                        { x, y, z },
                        scale };
}

static ebpo_pose shifted(double x, double y, double z)
{
    ebpo_pose pose = EBPO_POSE_INIT;
    pose.translation[0] = x;
    pose.translation[1] = y;
    pose.translation[2] = z;
    return pose;
}

/* Returns a quarter turn about z with a translation. */
static ebpo_pose quarter_turn(double x, double y, double z)
{
    ebpo_pose pose = shifted(x, y, z);
    static const double turn[3][3] = { { 0, -1, 0 }, { 1, 0, 0 }, { 0, 0, 1 } };
    memcpy(pose.rotation, turn, sizeof turn);
    return pose;
}

/* --- expressions and their meaning --- */

#define LEAF(i)                         \
    {                                   \
        EBPO_BOOLEAN_OPERAND, (i), 0, 0 \
    }
#define NODE(operation, a, b)                 \
    {                                         \
        EBPO_BOOLEAN_##operation, (a), (b), 0 \
    }

typedef struct formula {
    const char *name;
    ebpo_boolean_node node[8];
    uint32_t count;
} formula;

static const formula formulas[] = {
    { "A", { LEAF(0) }, 1 },
    { "A | B", { LEAF(0), LEAF(1), NODE(UNION, 0, 1) }, 3 },
    { "A & B", { LEAF(0), LEAF(1), NODE(INTERSECTION, 0, 1) }, 3 },
    { "A - B", { LEAF(0), LEAF(1), NODE(DIFFERENCE, 0, 1) }, 3 },
    { "B - A", { LEAF(0), LEAF(1), NODE(DIFFERENCE, 1, 0) }, 3 },
    { "A ^ B", { LEAF(0), LEAF(1), NODE(SYMMETRIC_DIFFERENCE, 0, 1) }, 3 },
    { "A - A", { LEAF(0), NODE(DIFFERENCE, 0, 0) }, 2 },
    { "(A | B) - C", { LEAF(0), LEAF(1), NODE(UNION, 0, 1), LEAF(2), NODE(DIFFERENCE, 2, 3) }, 5 },
    { "A ^ B ^ C",
      { LEAF(0), LEAF(1), NODE(SYMMETRIC_DIFFERENCE, 0, 1), LEAF(2),
        NODE(SYMMETRIC_DIFFERENCE, 2, 3) },
      5 },
};
enum { FORMULAS = sizeof formulas / sizeof *formulas };

static bool means(const formula *f, uint32_t node, const bool *in)
{
    const ebpo_boolean_node *n = &f->node[node];
    if (n->operation == EBPO_BOOLEAN_OPERAND)
        return in[n->left];
    bool a = means(f, n->left, in), b = means(f, n->right, in);
    switch (n->operation) {
    case EBPO_BOOLEAN_UNION: return a || b;
    case EBPO_BOOLEAN_INTERSECTION: return a && b;
    case EBPO_BOOLEAN_DIFFERENCE: return a && !b;
    default: return a != b;
    }
}

static bool rule_in(ebpo_rule rule, int32_t winding)
{
    return rule == EBPO_RULE_EVENODD    ? winding % 2 != 0
           : rule == EBPO_RULE_POSITIVE ? winding > 0
                                        : winding != 0;
}

/* Classifies p as IN, OUT or ON each operand. */
static bool find_truths(operand *o, const double p[3], int32_t where[OPERANDS])
{
    bool on = false;
    for (int i = 0; i < OPERANDS; i++) {
        oracle_nearest near;
        oracle_find_nearest(o[i].judge, p, &near);
        where[i] = near.on                                                        ? EBPO_ON
                   : rule_in(o[i].model.info.rule, oracle_winding(o[i].judge, p)) ? EBPO_IN
                                                                                  : EBPO_OUT;
        on |= near.on;
    }
    return on;
}

/* Returns true when p is farther than `distance` from every face that does not contain p. */
static bool nothing_else_near(operand *o, const double p[3], double distance)
{
    uint32_t count;
    oracle_near *near = oracle_order(o->judge, p, distance, &count);
    bool none = count == 0 || near[count - 1].distance == 0;
    free(near);
    return none;
}

/* Returns the kinds of the points very close to p as bits. The point p is on at least one operand.
 * Returns 0 when other faces are close to p. */
static unsigned kinds_near(const formula *f, operand *o, const double p[3],
                           const int32_t where[OPERANDS], uint64_t *state)
{
    double distance = ldexp(fmax(fabs(p[0]), fmax(fabs(p[1]), fabs(p[2]))), -40);
    unsigned kinds = 0;
    for (int i = 0; i < OPERANDS; i++)
        if (where[i] == EBPO_ON && !nothing_else_near(&o[i], p, 2 * distance))
            return 0;
    for (int turn = 0; turn < NEAR; turn++) {
        double q[3];
        int32_t there[OPERANDS];
        bool in[OPERANDS], again = false;
        for (int k = 0; k < 3; k++)
            q[k] = p[k] + distance * (2 * ebpo_test_random_unit(state) - 1);
        find_truths(o, q, there);
        for (int i = 0; i < OPERANDS; i++) {
            in[i] = (where[i] == EBPO_ON ? there[i] : where[i]) == EBPO_IN;
            again |= where[i] == EBPO_ON && there[i] == EBPO_ON;
        }
        kinds |= again ? 0u : 1u << (means(f, f->count - 1, in) ? EBPO_IN : EBPO_OUT);
    }
    return kinds;
}

static void judge(const formula *f, operand *o, const double p[3], const ebpo_boolean_result *got,
                  uint64_t *state, uint64_t seen[4])
{
    int32_t where[OPERANDS];
    bool in[OPERANDS];
    seen[got->where == EBPO_ON && !got->certain ? 3 : got->where]++;
    if (!find_truths(o, p, where)) {
        for (int i = 0; i < OPERANDS; i++)
            in[i] = where[i] == EBPO_IN;
        int32_t expected = means(f, f->count - 1, in) ? EBPO_IN : EBPO_OUT;
        ck_assert_msg(got->where == expected && got->certain, "%s: (%a, %a, %a) is %d, not %d",
                      f->name, p[0], p[1], p[2], expected, got->where);
        return;
    }
    unsigned kinds = kinds_near(f, o, p, where, state);
    if (!kinds)
        return;
    if (got->where != EBPO_ON)
        ck_assert_msg(kinds == 1u << got->where, "%s: (%a, %a, %a) is %d, but near it %u", f->name,
                      p[0], p[1], p[2], got->where, kinds);
    else if (got->certain)
        ck_assert_msg(kinds == (1u << EBPO_IN | 1u << EBPO_OUT),
                      "%s: (%a, %a, %a) is on the boundary, but near it %u", f->name, p[0], p[1],
                      p[2], kinds);
}

/* --- points --- */

/* Makes a point on a vertex, an edge or a face of an operand, exactly or within rounding; or
 * anywhere. */
static void make_point(const operand *o, uint64_t *state, double p[3])
{
    const operand *of = &o[ebpo_test_random(state) % OPERANDS];
    const uint32_t *face = of->posed.faces + 3 * (ebpo_test_random(state) % of->posed.face_count);
    const double *a = of->posed.xyz64 + 3 * face[0], *b = of->posed.xyz64 + 3 * face[1],
                 *c = of->posed.xyz64 + 3 * face[2];
    unsigned kind = (unsigned)(ebpo_test_random(state) % 6);
    for (int k = 0; k < 3; k++)
        p[k] = kind == 0   ? a[k]
               : kind == 1 ? a[k] / 2 + b[k] / 2
               : kind <= 4 ? a[k] / 2 + (b[k] / 4 + c[k] / 4)
                           : a[k] + 2 * of->model.size * of->pose.scale *
                                        (2 * ebpo_test_random_unit(state) - 1);
    if (kind == 4)
        p[ebpo_test_random(state) % 3] *= 1 + 0x1p-52;
}

static void run_query(operand *o, const formula *f, uint64_t count, uint64_t seed, uint64_t seen[4])
{
    ebpo_boolean_operand operands[OPERANDS];
    ebpo_boolean *boolean;
    double *points = query_alloc(count, sizeof(double[3]));
    ebpo_boolean_result *got = query_alloc(count, sizeof *got);
    uint64_t state = seed;
    for (int i = 0; i < OPERANDS; i++)
        operands[i] = (ebpo_boolean_operand){ o[i].model.model, o[i].pose };
    for (uint64_t i = 0; i < count; i++)
        make_point(o, &state, points + 3 * i);
    ASSERT_OK(ebpo_boolean_new(operands, OPERANDS, f->node, f->count, NULL, &boolean, error));
    ASSERT_OK(ebpo_boolean_inside_many(boolean, points, count, got, error));
    for (uint64_t i = 0; i < count; i++)
        judge(f, o, points + 3 * i, &got[i], &state, seen);
    ebpo_boolean_free(boolean);
    free(got);
    free(points);
}

/* reported: counts of results: OUT, IN, certain ON (in the order of ebpo_where), then other ON. */
static void query_all(const char *const solids[OPERANDS], const ebpo_pose poses[OPERANDS],
                      uint64_t reported[4])
{
    operand o[OPERANDS];
    uint64_t seen[4] = { 0 };
    for (int i = 0; i < OPERANDS; i++)
        operand_make(&o[i], solids[i], i, &poses[i]);
    for (int f = 0; f < FORMULAS; f++)
        run_query(o, &formulas[f], 100 + query_scaled(300), 77 + (uint64_t)f, seen);
    for (int i = 0; i < OPERANDS; i++)
        operand_free(&o[i]);
    ck_assert(seen[EBPO_IN] && seen[EBPO_OUT]);
    memcpy(reported, seen, sizeof seen);
}

START_TEST(test_boolean_with_any_pose)
{
    static const char *const solids[OPERANDS] = { "sphere", "touching_shells", "nested_windings" };
    ebpo_pose poses[OPERANDS] = { pose_of(0.3, 1, 0.1, 0.2, 0.3), pose_of(1.1, 0.7, 0.3, 0, -0.2),
                                  pose_of(-2, 0.2, -0.5, -0.5, -0.5) };
    uint64_t reported[4];
    query_all(solids, poses, reported);
}
END_TEST

START_TEST(test_boolean_of_boxes_sharing_sides)
{
    static const char *const solids[OPERANDS] = { "touching_shells", "touching_shells",
                                                  "boxes_in_walls" };
    ebpo_pose poses[OPERANDS] = { shifted(0, 0, 0), quarter_turn(1, 0, 0), shifted(1, 0, 0.5) };
    uint64_t reported[4];
    query_all(solids, poses, reported);
    ck_assert(reported[EBPO_ON] && reported[3]); /* points on sides, and points on edges */
}
END_TEST

START_TEST(test_boolean_of_equal_and_nearly_equal)
{
    static const char *const solids[OPERANDS] = { "torus", "torus", "torus" };
    ebpo_pose poses[OPERANDS] = { pose_of(0.5, 1, 0, 0, 0), pose_of(0.5, 1, 0, 0, 0),
                                  pose_of(0.5, 1, 1e-9, 0, 0) };
    uint64_t reported[4];
    query_all(solids, poses, reported);
}
END_TEST

/* Rounding moves faces by 2^-26 of their size, so that the position in the model is uncertain for
 * many points. */
START_TEST(test_boolean_far_from_origin)
{
    static const char *const solids[OPERANDS] = { "sphere", "tetrahedron", "touching_shells" };
    ebpo_pose poses[OPERANDS] = { pose_of(0.3, 1, 1e8, 2e8, -3e7), pose_of(0.7, 1, 1e8, 2e8, -3e7),
                                  pose_of(0.9, 1, 1e8, 2e8, -3e7) };
    uint64_t reported[4];
    query_all(solids, poses, reported);
}
END_TEST

/* --- errors --- */

static ebpo_status try_nodes(const operand *o, const ebpo_boolean_node *nodes, uint32_t count,
                             ebpo_error *error)
{
    ebpo_boolean_operand posed = { o->model.model, o->pose };
    ebpo_boolean *boolean;
    ebpo_status status = ebpo_boolean_new(&posed, 1, nodes, count, NULL, &boolean, error);
    ck_assert(status == EBPO_OK || !boolean);
    ebpo_boolean_free(boolean);
    return status;
}

START_TEST(test_boolean_invalid_expression_is_refused)
{
    operand o;
    ebpo_error error = EBPO_ERROR_INIT;
    const ebpo_boolean_node later[] = { NODE(UNION, 1, 1), LEAF(0) }, missing[] = { LEAF(1) },
                            itself[] = { LEAF(0), NODE(UNION, 0, 1) },
                            unknown[] = { { 9, 0, 0, 0 } };
    ebpo_pose pose = shifted(0, 0, 0);
    operand_make(&o, "tetrahedron", 0, &pose);
    ck_assert_int_eq(try_nodes(&o, later, 2, &error), EBPO_E_ARGUMENT);
    ck_assert_int_eq(try_nodes(&o, missing, 1, &error), EBPO_E_ARGUMENT);
    ck_assert_int_eq(try_nodes(&o, itself, 2, &error), EBPO_E_ARGUMENT);
    ck_assert_int_eq(try_nodes(&o, unknown, 1, &error), EBPO_E_ARGUMENT);
    ck_assert_int_eq(try_nodes(&o, later, 0, &error), EBPO_E_LIMIT);
    ck_assert_int_eq(try_nodes(&o, later, EBPO_BOOLEAN_NODES_MAX + 1, &error), EBPO_E_LIMIT);
    o.pose.rotation[0][0] = 2;
    ck_assert_int_eq(try_nodes(&o, formulas[0].node, 1, &error), EBPO_E_ARGUMENT);
    ck_assert_msg(strstr(error.message, "operand 1: pose: ") != NULL, "%s", error.message);
    operand_free(&o);
}
END_TEST

/* Reads a scene with two instances of the model: the first one is at rest, and the second one moves
 * by 4 along x within a second. */
static ebpo_scene *make_scene(const operand *o)
{
    static const char text[] =
        "{\"ebpo_scene\": \"1.0\", \"models\": {\"m\": {\"file\": \"model.ebpo.h5\"}}, \"routes\": "
        "{\"r\": {\"poses\": [{}, {\"translation\": [4, 0, 0]}], \"step\": 1}}, \"instances\": "
        "[{\"name\": \"a\", \"model\": \"m\"}, {\"name\": \"b\", \"model\": \"m\", \"route\": "
        "\"r\"}]}";
    ebpo_scene *scene = NULL;
    ASSERT_OK(
        ebpo_scene_parse(text, sizeof text - 1, "scene", o->model.folder, NULL, &scene, error));
    return scene;
}

START_TEST(test_boolean_of_instances_of_scene)
{
    operand o;
    uint32_t count = 0;
    ebpo_boolean_operand got[2];
    ebpo_boolean *boolean = NULL;
    ebpo_exact_volume volume = EBPO_EXACT_VOLUME_INIT;
    ebpo_load_options cut = EBPO_LOAD_OPTIONS_INIT;
    ebpo_error error_of_call = EBPO_ERROR_INIT;
    ebpo_pose pose = shifted(0, 0, 0);
    operand_make(&o, "sphere", 0, &pose);
    ebpo_scene *scene = make_scene(&o), *in_parts = make_scene(&o);
    ck_assert_int_eq(ebpo_boolean_get_operands(scene, 0.75, got, 2, &count, &error_of_call),
                     EBPO_E_ARGUMENT);
    ASSERT_OK(ebpo_scene_load(scene, NULL, error));
    ck_assert_int_eq(ebpo_boolean_get_operands(scene, 0.75, got, 1, &count, &error_of_call),
                     EBPO_E_LIMIT);
    ck_assert_uint_eq(count, 2);
    ck_assert_int_eq(ebpo_boolean_get_operands(scene, NAN, got, 2, &count, &error_of_call),
                     EBPO_E_ARGUMENT);
    ASSERT_OK(ebpo_boolean_get_operands(scene, 0.75, got, 2, &count, error));
    ck_assert_ptr_eq(got[0].model, got[1].model);
    ck_assert_double_eq(got[0].pose.translation[0], 0);
    ck_assert_double_eq(got[1].pose.translation[0], 3);
    ASSERT_OK(ebpo_boolean_new(got, 2, formulas[1].node, formulas[1].count, NULL, &boolean, error));
    ASSERT_OK(ebpo_boolean_exact_volume(boolean, NULL, &volume, error));
    ck_assert_int_eq(volume.doubt, EBPO_VOLUME_CERTAIN);
    ck_assert_double_eq_tol(volume.volume.lo, 2 * o.model.info.report.volume, 1e-9);
    ebpo_boolean_free(boolean);
    ebpo_scene_free(scene);
    /* With a cut level, the scene's models are only partly in memory. */
    cut.cut_level = 1;
    ASSERT_OK(ebpo_scene_load(in_parts, &cut, error));
    ASSERT_OK(ebpo_boolean_get_operands(in_parts, 0.75, got, 2, &count, error));
    ASSERT_OK(ebpo_boolean_new(got, 2, formulas[1].node, formulas[1].count, NULL, &boolean, error));
    ASSERT_OK(ebpo_boolean_exact_volume(boolean, NULL, &volume, error));
    ck_assert_int_eq(volume.doubt, EBPO_VOLUME_IN_PARTS);
    ebpo_boolean_free(boolean);
    ebpo_scene_free(in_parts);
    operand_free(&o);
}
END_TEST

TEST_SUITE(boolean)
{
    Suite *s = suite_create("boolean");
    TCase *c = tcase_create("boolean");
    tcase_set_timeout(c, 1200);
    tcase_add_test(c, test_boolean_with_any_pose);
    tcase_add_test(c, test_boolean_of_boxes_sharing_sides);
    tcase_add_test(c, test_boolean_of_equal_and_nearly_equal);
    tcase_add_test(c, test_boolean_far_from_origin);
    tcase_add_test(c, test_boolean_invalid_expression_is_refused);
    tcase_add_test(c, test_boolean_of_instances_of_scene);
    suite_add_tcase(s, c);
    return s;
}
