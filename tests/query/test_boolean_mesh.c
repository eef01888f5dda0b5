/* Meshes of Boolean results: closed, by an own count of edges; and equal to the expression, by
 * winding numbers in rational arithmetic at points that are farther from all surfaces than rounding
 * moved vertices. Operands share planes, edges and vertices, repeat, nest, intersect themselves, or
 * differ by one unit in the last place. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/boolean.h>

#include "check_main.h"
#include "geometry/predicates.h"
#include "mesh/attributes.h"
#include "query_support.h"

enum { OPERANDS = 3, NODES = 9, SCENES = 200 };

typedef struct scene {
    query_model model[OPERANDS];
    ebpo_pose pose[OPERANDS];
    oracle *posed[OPERANDS]; /* of the operands at their poses */
    ebpo_boolean_node node[NODES];
    uint32_t operands, nodes;
    double low[3], high[3]; /* box of all operands */
} scene;

static uint32_t random_below(uint64_t *state, uint32_t n)
{
    return (uint32_t)(ebpo_test_random_unit(state) * n);
}

/* --- scenes --- */

static void scale_mesh(ebpo_mesh *mesh, double factor)
{
    for (uint64_t i = 0; i < 3 * mesh->vertex_count; i++)
        mesh->xyz64[i] *= factor;
}

/* Moves some coordinates by one unit in the last place. */
static void disturb_mesh(ebpo_mesh *mesh, uint64_t *state)
{
    for (uint64_t i = 0; i < 3 * mesh->vertex_count; i++)
        if (random_below(state, 4) == 0)
            mesh->xyz64[i] = nextafter(mesh->xyz64[i], random_below(state, 2) ? 9 : -9);
}

/* Joins two meshes to one, in which vertices repeat positions. Frees both. */
static ebpo_mesh join_meshes(ebpo_mesh a, ebpo_mesh b)
{
    ebpo_mesh out = { .vertex_count = a.vertex_count + b.vertex_count,
                      .face_count = a.face_count + b.face_count };
    out.xyz64 = query_alloc(3 * out.vertex_count, sizeof *out.xyz64);
    out.faces = query_alloc(3 * out.face_count, sizeof *out.faces);
    memcpy(out.xyz64, a.xyz64, 24 * a.vertex_count);
    memcpy(out.xyz64 + 3 * a.vertex_count, b.xyz64, 24 * b.vertex_count);
    memcpy(out.faces, a.faces, 12 * a.face_count);
    for (uint64_t i = 0; i < 3 * b.face_count; i++)
        out.faces[3 * a.face_count + i] = b.faces[i] + (uint32_t)a.vertex_count;
    ebpo_mesh_free(&a);
    ebpo_mesh_free(&b);
    return out;
}

static ebpo_pose turned_pose(uint64_t *state)
{
    double c, s, d, t;
    ebpo_test_circle(random_below(state, 1000), 1000, &c, &s);
    ebpo_test_circle(random_below(state, 1000), 1000, &d, &t);
    return (ebpo_pose){ { { c, -s, 0 }, { s * d, c * d, -t }, { s * t, c * t, d } },
                        { ebpo_test_random_unit(state), ebpo_test_random_unit(state), 0.25 },
                        1 };
}

static ebpo_pose moved_pose(double x, double y, double z)
{
    return (ebpo_pose){ { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } }, { x, y, z }, 1 };
}

/* Makes an oracle of the posed operand, and extends the box. */
static oracle *pose_operand(scene *s, const ebpo_mesh *mesh, const ebpo_pose *pose)
{
    ebpo_mesh posed = { .vertex_count = mesh->vertex_count, .face_count = mesh->face_count };
    posed.faces = mesh->faces;
    posed.xyz64 = query_alloc(3 * mesh->vertex_count, sizeof(double));
    for (uint64_t v = 0; v < mesh->vertex_count; v++) {
        double x[3];
        ebpo_test_point(mesh, v, x);
        for (int i = 0; i < 3; i++) {
            double m[3];
            for (int k = 0; k < 3; k++)
                m[k] = pose->rotation[i][k] * pose->scale;
            double y = ((m[0] * x[0] + m[1] * x[1]) + m[2] * x[2]) + pose->translation[i];
            posed.xyz64[3 * v + (unsigned)i] = y;
            s->low[i] = fmin(s->low[i], y);
            s->high[i] = fmax(s->high[i], y);
        }
    }
    oracle *made = oracle_make(&posed);
    free(posed.xyz64);
    return made;
}

static void add_operand(scene *s, ebpo_mesh mesh, ebpo_pose pose, uint64_t variant)
{
    query_model *m = &s->model[s->operands];
    static const ebpo_rule rules[] = { EBPO_RULE_NONZERO, EBPO_RULE_EVENODD, EBPO_RULE_POSITIVE };
    query_variant how = query_variants[variant % (uint64_t)query_variant_count];
    how.rule = rules[variant % 3];
    how.parts = 0;
    query_model_make(m, "operand", mesh, &how);
    s->pose[s->operands] = pose;
    s->posed[s->operands] = pose_operand(s, &m->mesh, &pose);
    s->operands++;
}

/* Makes A op B, or (A op B) op C. */
static void make_expression(scene *s, uint64_t *state)
{
    for (uint32_t i = 0; i < s->operands; i++)
        s->node[s->nodes++] = (ebpo_boolean_node){ EBPO_BOOLEAN_OPERAND, i, 0, 0 };
    for (uint32_t i = 1; i < s->operands; i++) {
        uint32_t left = i == 1 ? 0 : s->nodes - 1;
        s->node[s->nodes++] =
            (ebpo_boolean_node){ (int32_t)(1 + random_below(state, 4)), left, i, 0 };
    }
}

enum { KINDS = 11 };

static void make_scene(scene *s, uint64_t seed)
{
    static const double scales[] = { 1e150, 1e-150 };
    const double centre[3] = { 1.5, 1.5, 1.5 };
    uint64_t state = seed, kind = seed % KINDS;
    ebpo_pose still = moved_pose(0, 0, 0);
    bool on_grid = kind != 1;
    *s = (scene){ .low = { INFINITY, INFINITY, INFINITY },
                  .high = { -INFINITY, -INFINITY, -INFINITY } };
    ebpo_mesh a = query_random_solid(seed, on_grid);
    ebpo_mesh b = query_random_solid(kind == 2 ? seed : seed + 1000, on_grid);
    if (kind == 10)
        a = join_meshes(a, query_random_solid(seed + 3000, true));
    if (kind == 2 || kind == 3)
        disturb_mesh(&b, &state);
    if (kind == 4 || kind == 5) {
        scale_mesh(&a, scales[kind - 4]);
        scale_mesh(&b, scales[kind - 4]);
    }
    if (kind == 6) {
        ebpo_mesh_free(&b);
        b = ebpo_test_sphere(centre, 1.25, 1);
    }
    add_operand(s, a, still, seed);
    add_operand(s, b,
                kind == 7   ? turned_pose(&state)
                : kind == 8 ? moved_pose(0.5, 0, random_below(&state, 2))
                            : still,
                seed / 3);
    if (kind == 9)
        add_operand(s, query_random_solid(seed + 2000, true), moved_pose(0.5, 0.5, 0), seed / 9);
    make_expression(s, &state);
}

static void free_scene(scene *s)
{
    for (uint32_t i = 0; i < s->operands; i++) {
        oracle_free(s->posed[i]);
        query_model_free(&s->model[i]);
    }
}

static ebpo_boolean *make_boolean(const scene *s, unsigned threads)
{
    ebpo_boolean_operand operands[OPERANDS];
    ebpo_boolean_options options = EBPO_BOOLEAN_OPTIONS_INIT;
    ebpo_boolean *boolean;
    options.threads = threads;
    for (uint32_t i = 0; i < s->operands; i++)
        operands[i] = (ebpo_boolean_operand){ s->model[i].model, s->pose[i] };
    ASSERT_OK(
        ebpo_boolean_new(operands, s->operands, s->node, s->nodes, &options, &boolean, error));
    return boolean;
}

static ebpo_boolean_mesh_report make_mesh(const scene *s, unsigned threads, ebpo_mesh *mesh)
{
    ebpo_boolean_mesh_report report = EBPO_BOOLEAN_MESH_REPORT_INIT;
    ebpo_boolean_mesh_options options = EBPO_BOOLEAN_MESH_OPTIONS_INIT;
    ebpo_exact_volume exact = EBPO_EXACT_VOLUME_INIT;
    ebpo_boolean *boolean = make_boolean(s, threads);
    options.volume = true;
    ASSERT_OK(ebpo_boolean_mesh(boolean, &options, mesh, &report, error));
    ASSERT_OK(ebpo_boolean_exact_volume(boolean, NULL, &exact, error));
    if (exact.doubt == EBPO_VOLUME_CERTAIN) {
        ck_assert_double_eq(report.volume.lo, exact.volume.lo);
        ck_assert_double_eq(report.volume.hi, exact.volume.hi);
    }
    ebpo_boolean_free(boolean);
    return report;
}

/* --- closed --- */

typedef struct edge {
    uint32_t low, high;
    int direction;
} edge;

static int order_edges(const void *a, const void *b)
{
    const edge *x = a, *y = b;
    if (x->low != y->low)
        return x->low < y->low ? -1 : 1;
    return (x->high > y->high) - (x->high < y->high);
}

static uint64_t count_open_edges(const ebpo_mesh *mesh)
{
    uint64_t count = 3 * mesh->face_count, open = 0;
    edge *list = query_alloc(count, sizeof *list);
    for (uint64_t i = 0; i < count; i++) {
        uint32_t a = mesh->faces[i], b = mesh->faces[i % 3 == 2 ? i - 2 : i + 1];
        ck_assert_uint_ne(a, b);
        ck_assert_uint_lt(a, mesh->vertex_count);
        list[i] = (edge){ a < b ? a : b, a < b ? b : a, a < b ? 1 : -1 };
    }
    if (count)
        qsort(list, count, sizeof *list, order_edges);
    for (uint64_t i = 0, next; i < count; i = next) {
        int balance = 0;
        for (next = i; next < count && order_edges(&list[next], &list[i]) == 0; next++)
            balance += list[next].direction;
        open += balance != 0;
    }
    free(list);
    return open;
}

/* --- inside --- */

static bool rule_inside(ebpo_rule rule, int32_t winding)
{
    return rule == EBPO_RULE_EVENODD    ? winding % 2 != 0
           : rule == EBPO_RULE_POSITIVE ? winding > 0
                                        : winding != 0;
}

static bool evaluate(const scene *s, const bool in[OPERANDS])
{
    bool value[NODES] = { false };
    for (uint32_t i = 0; i < s->nodes; i++) {
        const ebpo_boolean_node *n = &s->node[i];
        bool left = value[n->left], right = value[n->right];
        value[i] = n->operation == EBPO_BOOLEAN_OPERAND        ? in[n->left]
                   : n->operation == EBPO_BOOLEAN_UNION        ? left || right
                   : n->operation == EBPO_BOOLEAN_INTERSECTION ? left && right
                   : n->operation == EBPO_BOOLEAN_DIFFERENCE   ? left && !right
                                                               : left != right;
    }
    return value[s->nodes - 1];
}

static bool is_clear(oracle *o, const double p[3], double margin)
{
    oracle_nearest nearest;
    oracle_find_nearest(o, p, &nearest);
    return !nearest.on && nearest.distance > margin;
}

/* Makes a point anywhere, or close to a face of the result. */
static void make_point(const scene *s, const ebpo_mesh *mesh, uint64_t *state, double out[3])
{
    bool near_face = mesh->face_count && random_below(state, 2);
    uint64_t face = near_face ? random_below(state, (uint32_t)mesh->face_count) : 0;
    for (int k = 0; k < 3; k++) {
        double size = s->high[k] - s->low[k], share = ebpo_test_random_unit(state);
        out[k] = s->low[k] + size * (1.2 * share - 0.1);
        if (!near_face)
            continue;
        out[k] = size * 1e-3 * (share - 0.5);
        for (int i = 0; i < 3; i++) {
            double corner[3];
            ebpo_test_point(mesh, mesh->faces[3 * face + (unsigned)i], corner);
            out[k] += corner[k] / 3;
        }
    }
}

/* Returns the number of tested points. */
static uint64_t check_points(scene *s, const ebpo_mesh *mesh, double displacement, uint64_t seed)
{
    uint64_t state = seed, tested = 0;
    oracle *result = mesh->face_count ? oracle_make(mesh) : NULL;
    for (int i = 0; i < 60; i++) {
        double p[3];
        bool in[OPERANDS] = { false }, clear = true;
        make_point(s, mesh, &state, p);
        for (uint32_t k = 0; k < s->operands && clear; k++) {
            clear = is_clear(s->posed[k], p, 4 * displacement);
            if (clear)
                in[k] = rule_inside(s->model[k].info.rule, oracle_winding(s->posed[k], p));
        }
        if (!clear || (result && !is_clear(result, p, 4 * displacement)))
            continue;
        int32_t winding = result ? oracle_winding(result, p) : 0;
        ck_assert_msg(winding == (evaluate(s, in) ? 1 : 0),
                      "seed %llu: winding number %d at %.17g %.17g %.17g; operands %d %d %d",
                      (unsigned long long)seed, winding, p[0], p[1], p[2], in[0], in[1], in[2]);
        tested++;
    }
    if (result)
        oracle_free(result);
    return tested;
}

START_TEST(random_scenes)
{
    uint64_t tested = 0, results = 0, cut = 0;
    for (uint64_t seed = 0; seed < ebpo_test_scaled(SCENES); seed++) {
        scene s;
        ebpo_mesh mesh;
        make_scene(&s, seed);
        ebpo_boolean_mesh_report report = make_mesh(&s, 2, &mesh);
        double size = 0;
        for (int k = 0; k < 3; k++)
            size = fmax(size, fmax(fabs(s.low[k]), fabs(s.high[k])));
        ck_assert_msg(count_open_edges(&mesh) == 0, "seed %llu: open edges",
                      (unsigned long long)seed);
        ck_assert_double_le(report.displacement, size * 0x1p-52);
        tested += check_points(&s, &mesh, report.displacement, seed);
        results += mesh.face_count > 0;
        cut += report.faces_cut > 0;
        ebpo_mesh_free(&mesh);
        free_scene(&s);
    }
    ck_assert_uint_ge(2 * results, ebpo_test_scaled(SCENES));
    ck_assert_uint_ge(2 * cut, ebpo_test_scaled(SCENES));
    ck_assert_uint_ge(tested, 20 * ebpo_test_scaled(SCENES));
}
END_TEST

/* A cube minus its moved copy: each face of the mesh is in the plane of the face from which it
 * comes. */
START_TEST(origins)
{
    const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    ebpo_boolean_mesh_options options = EBPO_BOOLEAN_MESH_OPTIONS_INIT;
    ebpo_mesh mesh;
    scene s = { .nodes = 0 };
    add_operand(&s, ebpo_test_box(low, high, 2), moved_pose(0, 0, 0), 0);
    add_operand(&s, ebpo_test_box(low, high, 3), moved_pose(0.5, 0.25, 0.125), 0);
    s.node[s.nodes++] = (ebpo_boolean_node){ EBPO_BOOLEAN_OPERAND, 0, 0, 0 };
    s.node[s.nodes++] = (ebpo_boolean_node){ EBPO_BOOLEAN_OPERAND, 1, 0, 0 };
    s.node[s.nodes++] = (ebpo_boolean_node){ EBPO_BOOLEAN_DIFFERENCE, 0, 1, 0 };
    ebpo_boolean *boolean = make_boolean(&s, 1);
    options.origins = true;
    ASSERT_OK(ebpo_boolean_mesh(boolean, &options, &mesh, NULL, error));
    ck_assert_uint_eq(mesh.attributes->count, 2);
    const uint8_t *operand = mesh.attributes->array[0].values;
    const uint32_t *face = (const void *)mesh.attributes->array[1].values;
    uint64_t of_second = 0;
    for (uint64_t i = 0; i < mesh.face_count; i++) {
        const query_model *m = &s.model[operand[i]];
        double plane[3][3], x[3];
        uint64_t file_face = 0;
        while (query_reported(m, (uint32_t)file_face) != face[i])
            file_face++;
        for (int k = 0; k < 3; k++) {
            ebpo_test_point(&m->mesh, m->mesh.faces[3 * file_face + (unsigned)k], plane[k]);
            for (int c = 0; c < 3; c++)
                plane[k][c] += s.pose[operand[i]].translation[c];
        }
        for (int k = 0; k < 3; k++) {
            ebpo_test_point(&mesh, mesh.faces[3 * i + (unsigned)k], x);
            ck_assert_int_eq(ebpo_orient3d(plane[0], plane[1], plane[2], x), 0);
        }
        of_second += operand[i];
    }
    ck_assert_uint_gt(of_second, 0);
    ck_assert_uint_lt(of_second, mesh.face_count);
    ebpo_mesh_free(&mesh);
    ebpo_boolean_free(boolean);
    free_scene(&s);
}
END_TEST

/* Returns true if the mesh has a vertex with exactly these bits. */
static bool has_vertex(const ebpo_mesh *mesh, const double at[3])
{
    for (uint64_t v = 0; v < mesh->vertex_count; v++)
        if (memcmp(mesh->xyz64 + 3 * v, at, 3 * sizeof *at) == 0)
            return true;
    return false;
}

/* A cube whose zeros are negative, minus a cube that cuts off a corner, or beside it: the vertices
 * that remain have their signs of zero, on cut and on other faces. */
START_TEST(signs_of_zero)
{
    const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    for (int beside = 0; beside < 2; beside++) {
        scene s = { .nodes = 0 };
        ebpo_mesh mesh, cube = ebpo_test_box(low, high, 3);
        for (uint64_t i = 0; i < 3 * cube.vertex_count; i++)
            cube.xyz64[i] = cube.xyz64[i] == 0 ? -0.0 : cube.xyz64[i];
        add_operand(&s, cube, moved_pose(0, 0, 0), 0);
        add_operand(&s, ebpo_test_box(low, high, 1),
                    moved_pose(beside ? 5 : 0.75, beside ? 0 : -0.5, beside ? 0 : -0.5), 0);
        s.node[s.nodes++] = (ebpo_boolean_node){ EBPO_BOOLEAN_OPERAND, 0, 0, 0 };
        s.node[s.nodes++] = (ebpo_boolean_node){ EBPO_BOOLEAN_OPERAND, 1, 0, 0 };
        s.node[s.nodes++] = (ebpo_boolean_node){ EBPO_BOOLEAN_DIFFERENCE, 0, 1, 0 };
        make_mesh(&s, 1, &mesh);
        const ebpo_mesh *a = &s.model[0].mesh;
        uint64_t negative = 0;
        for (uint64_t v = 0; v < a->vertex_count; v++) {
            double at[3];
            ebpo_test_point(a, v, at);
            negative += signbit(at[0]) != 0;
            if (beside || at[0] < 0.7)
                ck_assert(has_vertex(&mesh, at));
        }
        ck_assert_uint_eq(negative, 16);
        ebpo_mesh_free(&mesh);
        free_scene(&s);
    }
}
END_TEST

/* An empty result has arrays of the same types as another one. */
START_TEST(empty_result)
{
    const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    ebpo_boolean_mesh_options options = EBPO_BOOLEAN_MESH_OPTIONS_INIT;
    ebpo_mesh mesh;
    scene s = { .nodes = 0 };
    add_operand(&s, ebpo_test_box(low, high, 2), moved_pose(0, 0, 0), 0);
    s.node[s.nodes++] = (ebpo_boolean_node){ EBPO_BOOLEAN_OPERAND, 0, 0, 0 };
    s.node[s.nodes++] = (ebpo_boolean_node){ EBPO_BOOLEAN_DIFFERENCE, 0, 0, 0 };
    ebpo_boolean *boolean = make_boolean(&s, 1);
    options.origins = true;
    ASSERT_OK(ebpo_boolean_mesh(boolean, &options, &mesh, NULL, error));
    ck_assert_uint_eq(mesh.face_count, 0);
    ck_assert_uint_eq(mesh.vertex_count, 0);
    ck_assert_ptr_nonnull(mesh.xyz64);
    ck_assert_ptr_null(mesh.xyz32);
    ck_assert_uint_eq(mesh.attributes->count, 2);
    ebpo_mesh_free(&mesh);
    ebpo_boolean_free(boolean);
    free_scene(&s);
}
END_TEST

/* The volumes of A | B and A & B add up to those of A and of B, apart from four roundings. */
START_TEST(volumes)
{
    static const int32_t operations[] = { EBPO_BOOLEAN_UNION, EBPO_BOOLEAN_INTERSECTION };
    uint64_t state = 1;
    for (uint64_t seed = 0; seed < ebpo_test_scaled(40); seed++) {
        scene s = { .nodes = 0 };
        double sum = 0, size = 0;
        add_operand(&s, query_random_solid(seed, true), moved_pose(0, 0, 0), 0);
        add_operand(&s, query_random_solid(seed + 1000, true), turned_pose(&state), 0);
        s.node[0] = (ebpo_boolean_node){ EBPO_BOOLEAN_OPERAND, 0, 0, 0 };
        s.node[1] = (ebpo_boolean_node){ EBPO_BOOLEAN_OPERAND, 1, 0, 0 };
        for (uint32_t i = 0; i < 4; i++) {
            ebpo_mesh mesh;
            s.nodes = i < 2 ? i + 1 : 3;
            if (i >= 2)
                s.node[2] = (ebpo_boolean_node){ operations[i - 2], 0, 1, 0 };
            ebpo_boolean_mesh_report report = make_mesh(&s, 2, &mesh);
            ck_assert_double_ge(report.volume.hi, report.volume.lo);
            ck_assert_double_le(report.volume.hi - report.volume.lo, report.volume.hi * 0x1p-51);
            sum += (i < 2 ? 1 : -1) * report.volume.lo;
            size += report.volume.hi;
            ebpo_mesh_free(&mesh);
        }
        ck_assert_double_le(fabs(sum), size * 0x1p-50);
        free_scene(&s);
    }
}
END_TEST

START_TEST(equal_for_any_threads)
{
    for (uint64_t seed = 1; seed < 1 + KINDS; seed++) {
        scene s;
        ebpo_mesh mesh[2];
        make_scene(&s, seed);
        for (unsigned i = 0; i < 2; i++)
            make_mesh(&s, 1 + 3 * i, &mesh[i]);
        ck_assert_uint_eq(mesh[0].face_count, mesh[1].face_count);
        ck_assert_uint_eq(mesh[0].vertex_count, mesh[1].vertex_count);
        if (mesh[0].face_count) {
            ck_assert_mem_eq(mesh[0].faces, mesh[1].faces, 12 * mesh[0].face_count);
            ck_assert_mem_eq(mesh[0].xyz64, mesh[1].xyz64, 24 * mesh[0].vertex_count);
        }
        for (int i = 0; i < 2; i++)
            ebpo_mesh_free(&mesh[i]);
        free_scene(&s);
    }
}
END_TEST

TEST_SUITE(boolean_mesh)
{
    Suite *suite = suite_create("boolean_mesh");
    TCase *tests = tcase_create("boolean_mesh");
    tcase_set_timeout(tests, 0);
    tcase_add_test(tests, random_scenes);
    tcase_add_test(tests, origins);
    tcase_add_test(tests, signs_of_zero);
    tcase_add_test(tests, empty_result);
    tcase_add_test(tests, volumes);
    tcase_add_test(tests, equal_for_any_threads);
    suite_add_tcase(suite, tests);
    return suite;
}
