/* Exact volumes of Booleans. Boxes on a grid are counted cell by cell, with sums of winding numbers
 * of boxes; other meshes are measured in rational arithmetic. */
#include "core/strict_fp.h"

#include <gmp.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/boolean.h>

#include "check_main.h"
#include "query_support.h"

enum { OPERANDS = 3, BOXES = 40, WORLD = 24, NODES = 9 };

static uint32_t below(uint64_t *state, uint32_t n)
{
    return (uint32_t)(ebpo_test_random_unit(state) * n);
}

static void measure(ebpo_boolean *boolean, ebpo_exact_volume *out)
{
    *out = (ebpo_exact_volume)EBPO_EXACT_VOLUME_INIT;
    ASSERT_OK(ebpo_boolean_exact_volume(boolean, NULL, out, error));
}

static ebpo_boolean *make_boolean(const ebpo_boolean_operand *operands, uint32_t count,
                                  const ebpo_boolean_node *nodes, uint32_t node_count,
                                  unsigned threads)
{
    ebpo_boolean *boolean;
    ebpo_boolean_options options = EBPO_BOOLEAN_OPTIONS_INIT;
    options.threads = threads;
    ASSERT_OK(ebpo_boolean_new(operands, count, nodes, node_count, &options, &boolean, error));
    return boolean;
}

/* Measures A op B. */
static ebpo_exact_volume measure_pair(ebpo_model *a, ebpo_pose pose_a, ebpo_model *b,
                                      ebpo_pose pose_b, int operation, unsigned threads)
{
    const ebpo_boolean_operand operands[2] = { { a, pose_a }, { b, pose_b } };
    const ebpo_boolean_node nodes[3] = { { EBPO_BOOLEAN_OPERAND, 0, 0, 0 },
                                         { EBPO_BOOLEAN_OPERAND, 1, 0, 0 },
                                         { operation, 0, 1, 0 } };
    ebpo_exact_volume v;
    ebpo_boolean *boolean = make_boolean(operands, 2, nodes, 3, threads);
    measure(boolean, &v);
    ebpo_boolean_free(boolean);
    return v;
}

static void check_exact(const ebpo_exact_volume *v, double truth)
{
    ck_assert_int_eq(v->doubt, EBPO_VOLUME_CERTAIN);
    ck_assert_int_eq(v->volume.kind, EBPO_VALUE_EXACT);
    ck_assert_msg(v->volume.lo == truth && v->volume.hi == truth, "%.17g .. %.17g, not %.17g",
                  v->volume.lo, v->volume.hi, truth);
}

/* --- boxes on a grid --- */

/* A box; its faces are oriented inwards when the sign is -1. */
typedef struct box {
    int low[3], high[3], operand, sign;
} box;

typedef struct scene {
    box of[BOXES]; /* boxes in world coordinates */
    int count;
    ebpo_boolean_node node[NODES];
    ebpo_rule rule[OPERANDS];
    ebpo_pose pose[OPERANDS];
    query_model model[OPERANDS];
} scene;

static void add_box(scene *s, uint64_t *state, const int low[3], const int high[3])
{
    box *b = &s->of[s->count];
    memcpy(b->low, low, sizeof b->low);
    memcpy(b->high, high, sizeof b->high);
    b->operand = s->count < OPERANDS ? s->count : (int)below(state, OPERANDS);
    b->sign = below(state, 3) ? 1 : -1;
    s->count++;
}

/* Fills the inner part of a region with boxes: side by side and nested, never in contact. */
static void fill_region(scene *s, uint64_t *state, const int low[3], const int high[3])
{
    int a[3], b[3], axis = (int)below(state, 3);
    for (int k = 0; k < 3; k++)
        if (high[k] - low[k] < 3 || s->count == BOXES - 1)
            return;
    memcpy(a, low, sizeof a);
    memcpy(b, high, sizeof b);
    if (high[axis] - low[axis] >= 6 && below(state, 2)) {
        int middle = low[axis] + 3 + (int)below(state, (uint32_t)(high[axis] - low[axis] - 5));
        a[axis] = b[axis] = middle;
        fill_region(s, state, low, b);
        fill_region(s, state, a, high);
        return;
    }
    for (int k = 0; k < 3; k++) {
        a[k] += 1 + (int)below(state, (uint32_t)((high[k] - low[k]) / 6 + 1));
        b[k] -= 1 + (int)below(state, (uint32_t)((high[k] - low[k]) / 6 + 1));
    }
    add_box(s, state, a, b);
    fill_region(s, state, a, b);
}

static void add_any_box(scene *s, uint64_t *state)
{
    int low[3], high[3];
    for (int k = 0; k < 3; k++) {
        low[k] = (int)below(state, WORLD - 1);
        high[k] = low[k] + 1 + (int)below(state, (uint32_t)(WORLD - low[k]));
    }
    add_box(s, state, low, high);
}

static bool surfaces_intersect(const box *a, const box *b)
{
    bool apart = false, in_a = true, in_b = true;
    for (int k = 0; k < 3; k++) {
        apart |= a->low[k] > b->high[k] || b->low[k] > a->high[k];
        in_a &= a->low[k] < b->low[k] && b->high[k] < a->high[k];
        in_b &= b->low[k] < a->low[k] && a->high[k] < b->high[k];
    }
    return !apart && !in_a && !in_b;
}

/* --- poses that keep the grid: quarter turns, a scale of 2, translations --- */

static ebpo_pose random_pose(uint64_t *state)
{
    ebpo_pose pose = EBPO_POSE_INIT;
    int first = (int)below(state, 3);
    memset(pose.rotation, 0, sizeof pose.rotation);
    for (int i = 0; i < 3; i++) /* a cyclic exchange of axes, and a half turn about one axis */
        pose.rotation[i][(i + first) % 3] = 1;
    int kept = (int)below(state, 4);
    for (int i = 0; i < 3 && kept < 3; i++)
        pose.rotation[i][(i + first) % 3] *= i == kept ? 1 : -1;
    if (below(state, 2)) { /* a quarter turn */
        double row[3];
        memcpy(row, pose.rotation[0], sizeof row);
        memcpy(pose.rotation[0], pose.rotation[1], sizeof row);
        for (int k = 0; k < 3; k++)
            pose.rotation[1][k] = row[k] != 0 ? -row[k] : 0;
    }
    for (int i = 0; i < 3; i++)
        pose.translation[i] = (double)below(state, 16) - 8;
    pose.scale = below(state, 2) ? 2 : 1;
    return pose;
}

/* Converts world to model coordinates. The conversion is exact for these poses. */
static void to_model(const ebpo_pose *pose, const int w[3], double x[3])
{
    for (int k = 0; k < 3; k++) {
        x[k] = 0;
        for (int i = 0; i < 3; i++)
            x[k] += pose->rotation[i][k] * ((double)w[i] - pose->translation[i]) / pose->scale;
    }
}

static void append_box(ebpo_mesh *mesh, const ebpo_pose *pose, const box *b)
{
    double p[3], q[3], low[3], high[3];
    to_model(pose, b->low, p);
    to_model(pose, b->high, q);
    for (int k = 0; k < 3; k++) {
        low[k] = fmin(p[k], q[k]);
        high[k] = fmax(p[k], q[k]);
    }
    ebpo_mesh one = ebpo_test_box(low, high, 1 + (b->operand == 1));
    if (b->sign < 0)
        ebpo_test_reverse(&one);
    ebpo_test_append(mesh, &one);
    ebpo_mesh_free(&one);
}

static void make_models(scene *s)
{
    for (int i = 0; i < OPERANDS; i++) {
        ebpo_mesh mesh = { 0 };
        query_variant variant = { "boxes", 4, -1, s->rule[i], 0 };
        for (int k = 0; k < s->count; k++)
            if (s->of[k].operand == i)
                append_box(&mesh, &s->pose[i], &s->of[k]);
        query_model_make(&s->model[i], "boxes", mesh, &variant);
    }
}

/* --- reference --- */

static bool by_rule(ebpo_rule rule, int winding)
{
    return rule == EBPO_RULE_EVENODD   ? winding % 2 != 0
           : rule == EBPO_RULE_NONZERO ? winding != 0
                                       : winding > 0;
}

static bool combined(int operation, bool a, bool b)
{
    return operation == EBPO_BOOLEAN_UNION          ? a || b
           : operation == EBPO_BOOLEAN_INTERSECTION ? a && b
           : operation == EBPO_BOOLEAN_DIFFERENCE   ? a && !b
                                                    : a != b;
}

static bool cell_is_in(const scene *s, const int cell[3])
{
    int winding[OPERANDS] = { 0 };
    bool value[NODES] = { false };
    for (int i = 0; i < s->count; i++) {
        bool in = true;
        for (int k = 0; k < 3; k++)
            in &= s->of[i].low[k] <= cell[k] && cell[k] < s->of[i].high[k];
        winding[s->of[i].operand] += in ? s->of[i].sign : 0;
    }
    for (int i = 0; i < NODES; i++) {
        const ebpo_boolean_node *n = &s->node[i];
        value[i] = n->operation == EBPO_BOOLEAN_OPERAND
                       ? by_rule(s->rule[n->left], winding[n->left])
                       : combined(n->operation, value[n->left], value[n->right]);
    }
    return value[NODES - 1];
}

static double count_cells(const scene *s)
{
    int count = 0;
    for (int i = 0; i < WORLD * WORLD * WORLD; i++) {
        const int cell[3] = { i % WORLD, i / WORLD % WORLD, i / (WORLD * WORLD) };
        count += cell_is_in(s, cell);
    }
    return count;
}

static unsigned used_operands(const scene *s)
{
    bool used[NODES] = { false };
    unsigned operands = 0;
    used[NODES - 1] = true;
    for (int i = NODES - 1; i >= 0; i--) {
        const ebpo_boolean_node *n = &s->node[i];
        if (used[i] && n->operation == EBPO_BOOLEAN_OPERAND)
            operands |= 1u << n->left;
        else if (used[i])
            used[n->left] = used[n->right] = true;
    }
    return operands;
}

/* Returns true when the surfaces of used operands intersect. `two`: both operands are used. */
static bool some_intersect(const scene *s, bool two)
{
    unsigned used = used_operands(s);
    for (int i = 0; i < s->count; i++)
        for (int k = 0; k < i; k++) {
            const box *a = &s->of[i], *b = &s->of[k];
            if ((used >> a->operand & used >> b->operand & 1) &&
                (a->operand != b->operand) == two && surfaces_intersect(a, b))
                return true;
        }
    return false;
}

/* --- random scenes --- */

static void random_scene(scene *s, uint64_t seed, bool clash)
{
    uint64_t state = seed;
    const int low[3] = { 0, 0, 0 }, high[3] = { WORLD, WORLD, WORLD };
    memset(s, 0, sizeof *s);
    while (s->count < OPERANDS) {
        s->count = 0;
        fill_region(s, &state, low, high);
    }
    if (clash)
        add_any_box(s, &state);
    for (uint32_t i = 0; i < NODES; i++) {
        bool leaf = i < OPERANDS;
        s->node[i] = (ebpo_boolean_node){ leaf ? EBPO_BOOLEAN_OPERAND : 1 + (int)below(&state, 4),
                                          leaf ? i : below(&state, i), 0, 0 };
        s->node[i].right = leaf ? 0 : i - 1;
    }
    for (int i = 0; i < OPERANDS; i++) {
        s->rule[i] = (ebpo_rule)below(&state, 3);
        s->pose[i] = random_pose(&state);
    }
    make_models(s);
}

static ebpo_exact_volume measure_scene(const scene *s, unsigned threads)
{
    ebpo_boolean_operand operands[OPERANDS];
    ebpo_exact_volume v;
    for (int i = 0; i < OPERANDS; i++)
        operands[i] = (ebpo_boolean_operand){ s->model[i].model, s->pose[i] };
    ebpo_boolean *boolean = make_boolean(operands, OPERANDS, s->node, NODES, threads);
    measure(boolean, &v);
    ebpo_boolean_free(boolean);
    return v;
}

static void free_scene(scene *s)
{
    for (int i = 0; i < OPERANDS; i++)
        query_model_free(&s->model[i]);
}

/* Checks that results reported as exact are exact, and that exact results are reported when they
 * are possible. */
START_TEST(test_volume_of_boxes_matches_cell_count)
{
    int positive = 0;
    for (uint64_t seed = 1; seed <= query_scaled(50); seed++) {
        scene s;
        random_scene(&s, seed, false);
        ebpo_exact_volume v = measure_scene(&s, 1 + seed % 2);
        double truth = count_cells(&s);
        ck_assert(!some_intersect(&s, true) && !some_intersect(&s, false));
        check_exact(&v, truth);
        positive += truth > 0;
        free_scene(&s);
    }
    ck_assert(positive > 0);
}
END_TEST

START_TEST(test_volume_of_possibly_intersecting_boxes)
{
    for (uint64_t seed = 1; seed <= query_scaled(50); seed++) {
        scene s;
        random_scene(&s, seed, true);
        ebpo_exact_volume v = measure_scene(&s, 1);
        double truth = count_cells(&s);
        bool two = some_intersect(&s, true), one = some_intersect(&s, false);
        ck_assert(v.volume.lo <= truth && truth <= v.volume.hi);
        if (v.doubt == EBPO_VOLUME_CERTAIN || (!two && !one))
            check_exact(&v, truth);
        else
            ck_assert_int_eq(v.volume.kind, EBPO_VALUE_BOUND);
        ck_assert(v.doubt != EBPO_VOLUME_OPERANDS_INTERSECT || two);
        ck_assert(v.doubt != EBPO_VOLUME_FACES_INTERSECT || (one && !two));
        ck_assert(!two || truth == 0 || v.doubt == EBPO_VOLUME_OPERANDS_INTERSECT);
        free_scene(&s);
    }
}
END_TEST

/* --- any meshes at any poses, in rational arithmetic --- */

static ebpo_pose pose_of(double angle, double scale, double x, double y, double z)
{
    double c = cos(angle), s = sin(angle);
    return (ebpo_pose){ { { c, -s, 0 }, { s * c, c * c, -s }, { s * s, c * s, c } },
                        { x, y, z },
                        scale };
}

/* Implements the definition of docs/develop/collision.md without the library. */
static void pose_vertex(const ebpo_pose *p, const double x[3], mpq_t out[3])
{
    for (int i = 0; i < 3; i++) {
        volatile double m[3], a[3], sum;
        for (int k = 0; k < 3; k++) {
            m[k] = p->scale * p->rotation[i][k];
            a[k] = m[k] * x[k];
        }
        sum = a[0] + a[1];
        sum = sum + a[2];
        sum = sum + p->translation[i];
        mpq_set_d(out[i], sum);
    }
}

/* sum += times * x y z */
static void add_product(mpq_t sum, int times, const mpq_t x, const mpq_t y, const mpq_t z)
{
    mpq_t product, factor;
    mpq_inits(product, factor, NULL);
    mpq_set_si(factor, times, 1);
    mpq_mul(product, x, y);
    mpq_mul(product, product, z);
    mpq_mul(product, product, factor);
    mpq_add(sum, sum, product);
    mpq_clears(product, factor, NULL);
}

/* Adds `times` the volume of a closed posed mesh. */
static void add_volume(mpq_t sum, const ebpo_mesh *mesh, const ebpo_pose *pose, int times)
{
    mpq_t t[3][3], six, volume;
    mpq_inits(six, volume, NULL);
    for (int i = 0; i < 9; i++)
        mpq_init(t[i / 3][i % 3]);
    for (uint64_t f = 0; f < mesh->face_count; f++) {
        for (int i = 0; i < 3; i++) {
            double x[3];
            ebpo_test_point(mesh, mesh->faces[3 * f + (uint64_t)i], x);
            pose_vertex(pose, x, t[i]);
        }
        for (int k = 0; k < 3; k++) {
            add_product(volume, times, t[0][k], t[1][(k + 1) % 3], t[2][(k + 2) % 3]);
            add_product(volume, -times, t[0][k], t[1][(k + 2) % 3], t[2][(k + 1) % 3]);
        }
    }
    mpq_set_si(six, 6, 1);
    mpq_div(volume, volume, six);
    mpq_add(sum, sum, volume);
    for (int i = 0; i < 9; i++)
        mpq_clear(t[i / 3][i % 3]);
    mpq_clears(six, volume, NULL);
}

static void distance_to(mpq_t out, const mpq_t truth, double x)
{
    mpq_set_d(out, x);
    mpq_sub(out, out, truth);
    mpq_abs(out, out);
}

/* Checks that no other double is nearer to the truth, in units of 2^exponent. */
static void check_nearest_double(double x, const mpq_t truth, int64_t exponent)
{
    mpq_t units, here, other;
    mpq_inits(units, here, other, NULL);
    if (exponent >= 0)
        mpq_div_2exp(units, truth, (mp_bitcnt_t)exponent);
    else
        mpq_mul_2exp(units, truth, (mp_bitcnt_t)-exponent);
    distance_to(here, units, x);
    distance_to(other, units, nextafter(x, INFINITY));
    ck_assert_msg(mpq_cmp(here, other) <= 0, "%.17g is too small", x);
    distance_to(other, units, nextafter(x, -INFINITY));
    ck_assert_msg(mpq_cmp(here, other) <= 0, "%.17g is too large", x);
    mpq_clears(units, here, other, NULL);
}

static void check_nearest(const ebpo_exact_volume *v, const mpq_t truth)
{
    ck_assert_int_eq(v->doubt, EBPO_VOLUME_CERTAIN);
    ck_assert(v->volume.kind == EBPO_VALUE_EXACT && v->volume.lo == v->volume.hi);
    ck_assert(v->scaled == 0 || (fabs(v->scaled) > 0x1p-5 && fabs(v->scaled) < 0x1p5));
    check_nearest_double(v->scaled, truth, v->exponent);
    if (isfinite(v->volume.lo))
        check_nearest_double(v->volume.lo, truth, 0);
    else
        ck_assert(v->exponent > 1000);
}

/* Checks the volumes of a ball and a smaller ball in it. */
static void check_nested(const query_model *outer, ebpo_pose pose, const query_model *inner,
                         ebpo_pose within)
{
    static const int times[][2] = { { 1, 0 }, { 0, 1 }, { 1, -1 }, { 1, -1 } };
    mpq_t truth;
    mpq_init(truth);
    for (int op = EBPO_BOOLEAN_UNION; op <= EBPO_BOOLEAN_SYMMETRIC_DIFFERENCE; op++) {
        const int *n = times[op - EBPO_BOOLEAN_UNION];
        ebpo_exact_volume v =
            measure_pair(outer->model, pose, inner->model, within, op, (unsigned)op);
        mpq_set_si(truth, 0, 1);
        add_volume(truth, &outer->mesh, &pose, n[0]);
        add_volume(truth, &inner->mesh, &within, n[1]);
        check_nearest(&v, truth);
        ck_assert_uint_eq(v.patches, 2);
    }
    mpq_clear(truth);
}

static query_model make_ball(double radius)
{
    const double centre[3] = { 0, 0, 0 };
    query_model m;
    query_model_make(&m, "ball", ebpo_test_sphere(centre, radius, 2), &query_variants[0]);
    return m;
}

START_TEST(test_volume_of_nested_balls)
{
    query_model ball = make_ball(1), small = make_ball(0.3);
    uint64_t state = 5;
    for (uint64_t i = 0; i < query_scaled(20); i++) {
        double angle = 7 * ebpo_test_random_unit(&state), s = 1 + ebpo_test_random_unit(&state);
        double x = 100 * ebpo_test_random_unit(&state), y = ebpo_test_random_unit(&state);
        check_nested(&ball, pose_of(angle, s, x, y, -y), &small,
                     pose_of(3 * angle, s, x + 0.2, y, 0.1 - y));
    }
    query_model_free(&small);
    query_model_free(&ball);
}
END_TEST

/* Products of coordinates beyond doubles, and volumes at the limit of doubles. */
START_TEST(test_volume_of_huge_and_tiny_models)
{
    query_model ball = make_ball(1), small = make_ball(0.3);
    const double scales[] = { 0x1p-290, 0x1p-251, 0x1p-249, 0x1p249, 0x1p251, 0x1p290 };
    for (int i = 0; i < 6; i++)
        check_nested(&ball, pose_of(0.5, scales[i], 0, 0, 0), &small,
                     pose_of(1.5, scales[i], 0, 0.1 * scales[i], 0));
    query_model_free(&small);
    query_model_free(&ball);
}
END_TEST

/* Volumes beyond doubles. */
START_TEST(test_volume_beyond_double_range)
{
    const double sizes[] = { 1e-150, 1e-110, 1e110, 1e150, 1e290 };
    for (int i = 0; i < 5; i++) {
        query_model ball = make_ball(sizes[i]), small = make_ball(0.3 * sizes[i]);
        check_nested(&ball, pose_of(0, 1, 0, 0, 0), &small, pose_of(0, 1, 0, 0.1 * sizes[i], 0));
        query_model_free(&small);
        query_model_free(&ball);
    }
}
END_TEST

/* Products of numbers with fewer than 53 bits. */
START_TEST(test_volume_with_subnormal_coordinates)
{
    const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 }, least[] = { 0x1p-1074, 0x1.8p-1030 };
    query_model cube;
    query_model_make(&cube, "cube", ebpo_test_box(low, high, 2), &query_variants[0]);
    for (int i = 0; i < 4; i++) {
        const double scale = i < 2 ? 1 : 0x1p-290;
        ebpo_pose outer = pose_of(0, scale, least[i % 2], -least[i % 2], 0);
        check_nested(&cube, outer, &cube,
                     pose_of(0, 0.5 * scale, 0.25 * scale, 0.25 * scale, 0.25 * scale));
    }
    query_model_free(&cube);
}
END_TEST

/* The boxes are nearly in contact, and then in contact. The difference is one unit in the last
 * place. */
START_TEST(test_volume_contact_is_not_exact)
{
    const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    query_model cube;
    query_model_make(&cube, "cube", ebpo_test_box(low, high, 2), &query_variants[0]);
    ebpo_pose at = EBPO_POSE_INIT, beside = at;
    mpq_t truth;
    mpq_init(truth);
    beside.translation[0] = 1 + 0x1p-52;
    add_volume(truth, &cube.mesh, &at, 1);
    add_volume(truth, &cube.mesh, &beside, 1);
    ebpo_exact_volume v = measure_pair(cube.model, at, cube.model, beside, EBPO_BOOLEAN_UNION, 1);
    check_nearest(&v, truth);
    beside.translation[0] = 1;
    v = measure_pair(cube.model, at, cube.model, beside, EBPO_BOOLEAN_UNION, 1);
    ck_assert_int_eq(v.doubt, EBPO_VOLUME_OPERANDS_INTERSECT);
    ck_assert_int_eq(v.volume.kind, EBPO_VALUE_BOUND);
    ck_assert(v.operand[0] == 0 && v.operand[1] == 1 && v.volume.lo == 0 && v.volume.hi >= 2);
    ck_assert(v.file_face[0] < cube.mesh.face_count && v.file_face[1] < cube.mesh.face_count);
    mpq_clear(truth);
    query_model_free(&cube);
}
END_TEST

/* --- operands that are equal, unused, or incomplete --- */

START_TEST(test_volume_of_equal_operands)
{
    query_model ball = make_ball(1), again = make_ball(1);
    ebpo_pose at = pose_of(0.5, 1, 1, 2, 3);
    mpq_t truth;
    mpq_init(truth);
    add_volume(truth, &ball.mesh, &at, 1);
    query_model *const others[] = { &ball, &again };
    for (int i = 0; i < 2; i++)
        for (int op = EBPO_BOOLEAN_UNION; op <= EBPO_BOOLEAN_SYMMETRIC_DIFFERENCE; op++) {
            ebpo_exact_volume v = measure_pair(ball.model, at, others[i]->model, at, op, 1);
            if (op <= EBPO_BOOLEAN_INTERSECTION)
                check_nearest(&v, truth);
            else
                check_exact(&v, 0);
        }
    mpq_clear(truth);
    query_model_free(&again);
    query_model_free(&ball);
}
END_TEST

/* Tests (A & A) - B with B in A. Around B, points are in both operands A. */
START_TEST(test_volume_of_equal_operands_inside_third)
{
    query_model ball = make_ball(1), small = make_ball(0.3);
    ebpo_pose at = pose_of(0.5, 1, 1, 2, 3);
    const ebpo_boolean_operand operands[3] = { { ball.model, at },
                                               { ball.model, at },
                                               { small.model, at } };
    const ebpo_boolean_node nodes[5] = { { EBPO_BOOLEAN_OPERAND, 0, 0, 0 },
                                         { EBPO_BOOLEAN_OPERAND, 1, 0, 0 },
                                         { EBPO_BOOLEAN_OPERAND, 2, 0, 0 },
                                         { EBPO_BOOLEAN_INTERSECTION, 0, 1, 0 },
                                         { EBPO_BOOLEAN_DIFFERENCE, 3, 2, 0 } };
    ebpo_exact_volume v;
    mpq_t truth;
    mpq_init(truth);
    add_volume(truth, &ball.mesh, &at, 1);
    add_volume(truth, &small.mesh, &at, -1);
    ebpo_boolean *boolean = make_boolean(operands, 3, nodes, 5, 1);
    measure(boolean, &v);
    check_nearest(&v, truth);
    ebpo_boolean_free(boolean);
    mpq_clear(truth);
    query_model_free(&small);
    query_model_free(&ball);
}
END_TEST

START_TEST(test_volume_ignores_unused_operands)
{
    query_model ball = make_ball(1);
    ebpo_pose at = EBPO_POSE_INIT, through = pose_of(0.5, 1, 1, 0, 0);
    const ebpo_boolean_operand operands[2] = { { ball.model, at }, { ball.model, through } };
    const ebpo_boolean_node node = { EBPO_BOOLEAN_OPERAND, 0, 0, 0 };
    ebpo_exact_volume v;
    mpq_t truth;
    mpq_init(truth);
    add_volume(truth, &ball.mesh, &at, 1);
    ebpo_boolean *boolean = make_boolean(operands, 2, &node, 1, 1);
    measure(boolean, &v);
    check_nearest(&v, truth);
    ebpo_boolean_free(boolean);
    mpq_clear(truth);
    query_model_free(&ball);
}
END_TEST

static ebpo_mesh tetrahedron_on_edge(int size)
{
    ebpo_mesh m = { 0 };
    const int c[4][3] = { { 0, 0, 0 }, { 0, 0, 8 }, { size, 2 - size / 4, 4 }, { 2, size, 4 } };
    uint32_t v[4];
    for (int i = 0; i < 4; i++)
        v[i] = ebpo_test_append_vertex(&m, c[i][0], c[i][1], c[i][2]);
    ebpo_test_append_face(&m, v[0], v[3], v[2]);
    ebpo_test_append_face(&m, v[0], v[1], v[3]);
    ebpo_test_append_face(&m, v[0], v[2], v[1]);
    ebpo_test_append_face(&m, v[1], v[2], v[3]);
    return m;
}

/* One solid is in the other, and they share an edge with four faces: the faces belong to two
 * patches. */
START_TEST(test_volume_patches_at_four_face_edges)
{
    static const ebpo_rule rules[] = { EBPO_RULE_NONZERO, EBPO_RULE_EVENODD, EBPO_RULE_POSITIVE };
    const ebpo_pose at = EBPO_POSE_INIT, away = pose_of(0, 1, 99, 0, 0);
    mpq_t truth;
    mpq_init(truth);
    for (int i = 0; i < 6; i++) {
        query_variant variant = { "tetrahedra", 4, -1, rules[i / 2], 0 };
        query_model m;
        ebpo_mesh mesh = tetrahedron_on_edge(8), outer = tetrahedron_on_edge(8),
                  inner = tetrahedron_on_edge(4);
        mpq_set_si(truth, 0, 1);
        add_volume(truth, &outer, &at, 2);
        if (i % 2 || rules[i / 2] == EBPO_RULE_EVENODD)
            add_volume(truth, &inner, &at, -2);
        if (i % 2)
            ebpo_test_reverse(&inner);
        ebpo_test_append(&mesh, &inner);
        query_model_make(&m, "tetrahedra", mesh, &variant);
        ebpo_exact_volume v = measure_pair(m.model, at, m.model, away, EBPO_BOOLEAN_UNION, 1);
        check_nearest(&v, truth);
        ebpo_mesh_free(&inner);
        ebpo_mesh_free(&outer);
        query_model_free(&m);
    }
    mpq_clear(truth);
}
END_TEST

/* Two overlapping cubes in one model: winding numbers vary along a face. */
START_TEST(test_volume_self_intersection_is_not_exact)
{
    const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 }, above[3] = { 0.5, 0.5, 0.5 },
                 top[3] = { 2, 2, 2 };
    ebpo_mesh mesh = ebpo_test_box(low, high, 1), other = ebpo_test_box(above, top, 1);
    query_model m;
    ebpo_test_append(&mesh, &other);
    ebpo_mesh_free(&other);
    query_model_make(&m, "overlapping", mesh, &query_variants[0]);
    ebpo_pose at = EBPO_POSE_INIT, away = pose_of(0, 1, 9, 0, 0);
    ebpo_exact_volume v = measure_pair(m.model, at, m.model, away, EBPO_BOOLEAN_UNION, 1);
    ck_assert_int_eq(v.doubt, EBPO_VOLUME_FACES_INTERSECT);
    ck_assert(v.operand[0] == 0 && v.operand[1] == 0 && v.file_face[0] != v.file_face[1]);
    v = measure_pair(m.model, at, m.model, away, EBPO_BOOLEAN_INTERSECTION, 1);
    check_exact(&v, 0); /* the boxes are apart */
    query_model_free(&m);
}
END_TEST

START_TEST(test_volume_of_partly_loaded_is_refused)
{
    query_model ball = make_ball(1);
    ebpo_model *parts;
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    options.cut_level = 1;
    ASSERT_OK(ebpo_model_new(ball.file, &options, &parts, error));
    ebpo_pose at = EBPO_POSE_INIT, away = pose_of(0, 1, 9, 0, 0);
    ebpo_exact_volume v = measure_pair(ball.model, at, parts, away, EBPO_BOOLEAN_UNION, 1);
    ck_assert_int_eq(v.doubt, EBPO_VOLUME_IN_PARTS);
    ck_assert(v.operand[0] == 1 && v.volume.kind == EBPO_VALUE_BOUND);
    ebpo_model_free(parts);
    query_model_free(&ball);
}
END_TEST

/* --- errors --- */

static bool stop(void *user, const char *stage, uint64_t done, uint64_t total)
{
    (void)user, (void)stage, (void)done, (void)total;
    return false;
}

START_TEST(test_volume_can_be_cancelled)
{
    query_model ball = make_ball(1);
    const ebpo_boolean_operand operand = { ball.model, EBPO_POSE_INIT };
    const ebpo_boolean_node node = { EBPO_BOOLEAN_OPERAND, 0, 0, 0 };
    ebpo_boolean *boolean = make_boolean(&operand, 1, &node, 1, 1);
    ebpo_volume_options options = EBPO_VOLUME_OPTIONS_INIT;
    ebpo_exact_volume v = EBPO_EXACT_VOLUME_INIT;
    options.progress.report = stop;
    ck_assert_int_eq(ebpo_boolean_exact_volume(boolean, &options, &v, NULL), EBPO_E_CANCELLED);
    v.struct_size = 0;
    ck_assert_int_eq(ebpo_boolean_exact_volume(boolean, NULL, &v, NULL), EBPO_E_ARGUMENT);
    ebpo_boolean_free(boolean);
    query_model_free(&ball);
}
END_TEST

TEST_SUITE(boolean_volume)
{
    Suite *s = suite_create("boolean_volume");
    TCase *c = tcase_create("boolean_volume");
    tcase_set_timeout(c, 1200);
    tcase_add_test(c, test_volume_of_boxes_matches_cell_count);
    tcase_add_test(c, test_volume_of_possibly_intersecting_boxes);
    tcase_add_test(c, test_volume_of_nested_balls);
    tcase_add_test(c, test_volume_of_huge_and_tiny_models);
    tcase_add_test(c, test_volume_with_subnormal_coordinates);
    tcase_add_test(c, test_volume_contact_is_not_exact);
    tcase_add_test(c, test_volume_of_equal_operands);
    tcase_add_test(c, test_volume_of_equal_operands_inside_third);
    tcase_add_test(c, test_volume_patches_at_four_face_edges);
    tcase_add_test(c, test_volume_ignores_unused_operands);
    tcase_add_test(c, test_volume_self_intersection_is_not_exact);
    tcase_add_test(c, test_volume_of_partly_loaded_is_refused);
    tcase_add_test(c, test_volume_can_be_cancelled);
    tcase_add_test(c, test_volume_beyond_double_range);
    suite_add_tcase(s, c);
    return s;
}
