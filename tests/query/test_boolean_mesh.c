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
#include "extras/boolean/base_faces.h"
#include "geometry/predicates.h"
#include "mesh/attributes.h"
#include "query_support.h"

enum { OPERANDS = 3, NODES = 9, PLANES = 2, SCENES = 200 };

typedef struct scene {
    query_model model[OPERANDS];
    ebpo_pose pose[OPERANDS];
    oracle *posed[OPERANDS]; /* of the operands at their poses */
    ebpo_boolean_node node[NODES];
    uint32_t operands, nodes;
    double low[3], high[3]; /* box of all operands */
    double box[6];          /* if `boxed`: the result is cut to it */
    bool boxed;
    double plane[PLANES][4]; /* the result is cut to these half-spaces */
    uint32_t planes;
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

/* Cuts the scene: to a box whose sides may be in planes of faces, with a complement, and to
 * half-spaces. */
static void add_regions(scene *s, uint64_t *state)
{
    s->boxed = random_below(state, 3) > 0;
    for (int k = 0; k < 3; k++) {
        double step = (s->high[k] - s->low[k]) / 8;
        s->box[k] = s->low[k] + step * (random_below(state, 5) - 1.0);
        s->box[3 + k] = s->box[k] + step * (1 + random_below(state, 8));
    }
    if (s->boxed) {
        s->node[s->nodes] = (ebpo_boolean_node){ EBPO_BOOLEAN_COMPLEMENT, s->nodes - 1, 7, 0 };
        s->nodes += random_below(state, 2);
    }
    s->planes = random_below(state, PLANES + 1);
    for (uint32_t i = 0; i < s->planes; i++) {
        double *plane = s->plane[i];
        bool axis_parallel = random_below(state, 2);
        for (int k = 0; k < 3; k++)
            plane[k] = axis_parallel ? 0 : ebpo_test_random_unit(state) - 0.5;
        if (axis_parallel)
            plane[random_below(state, 3)] = random_below(state, 2) ? 2 : -1;
        for (int k = 0; k < 3; k++)
            plane[3] += plane[k] * (s->low[k] +
                                    (s->high[k] - s->low[k]) / 8 * (random_below(state, 11) - 1.0));
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
    if (seed / KINDS % 2)
        add_regions(s, &state);
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
    options.box = s->boxed ? s->box : NULL;
    options.planes = s->plane[0];
    options.plane_count = s->planes;
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

/* Returns false if the point is near the border of a region; *in: the point is in all of them. */
static bool test_regions(const scene *s, const double p[3], double margin, bool *in)
{
    bool clear = true;
    *in = true;
    for (int k = 0; k < 3 && s->boxed; k++) {
        clear = clear && fabs(p[k] - s->box[k]) > margin && fabs(p[k] - s->box[3 + k]) > margin;
        *in = *in && p[k] > s->box[k] && p[k] < s->box[3 + k];
    }
    for (uint32_t i = 0; i < s->planes; i++) {
        const double *n = s->plane[i];
        double value = n[0] * p[0] + n[1] * p[1] + n[2] * p[2] - n[3];
        double length = fabs(n[0]) + fabs(n[1]) + fabs(n[2]);
        clear = clear && fabs(value) > margin * length;
        *in = *in && value < 0;
    }
    return clear;
}

static bool evaluate(const scene *s, const bool in[OPERANDS])
{
    bool value[NODES] = { false };
    for (uint32_t i = 0; i < s->nodes; i++) {
        const ebpo_boolean_node *n = &s->node[i];
        bool left = value[n->left], right = n->right < NODES && value[n->right];
        value[i] = n->operation == EBPO_BOOLEAN_OPERAND        ? in[n->left]
                   : n->operation == EBPO_BOOLEAN_UNION        ? left || right
                   : n->operation == EBPO_BOOLEAN_INTERSECTION ? left && right
                   : n->operation == EBPO_BOOLEAN_DIFFERENCE   ? left && !right
                   : n->operation == EBPO_BOOLEAN_COMPLEMENT   ? !left
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
    double size = 0;
    for (int k = 0; k < 3; k++)
        size = fmax(size, fmax(fabs(s->low[k]), fabs(s->high[k])));
    oracle *result = mesh->face_count ? oracle_make(mesh) : NULL;
    for (int i = 0; i < 60; i++) {
        double p[3];
        bool in[OPERANDS] = { false }, clear, in_regions;
        make_point(s, mesh, &state, p);
        clear = test_regions(s, p, fmax(4 * displacement, 0x1p-45 * size), &in_regions);
        for (uint32_t k = 0; k < s->operands && clear; k++) {
            clear = is_clear(s->posed[k], p, 4 * displacement);
            if (clear)
                in[k] = rule_inside(s->model[k].info.rule, oracle_winding(s->posed[k], p));
        }
        if (!clear || (result && !is_clear(result, p, 4 * displacement)))
            continue;
        int32_t winding = result ? oracle_winding(result, p) : 0;
        ck_assert_msg(winding == (evaluate(s, in) && in_regions ? 1 : 0),
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

/* The exact volume of a cube that a plane cuts, on each side, and of a box minus the cube. */
START_TEST(regions)
{
    const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    static const struct {
        bool boxed;
        double box[6];
        uint32_t planes;
        double plane[4];
        int32_t operation; /* EBPO_BOOLEAN_COMPLEMENT, or EBPO_BOOLEAN_OPERAND */
        double volume;
    } rows[] = {
        { false, { 0 }, 1, { 0, 0, 1, 0.25 }, EBPO_BOOLEAN_OPERAND, 0.25 },
        { false, { 0 }, 1, { 0, 0, -3, -0.75 }, EBPO_BOOLEAN_OPERAND, 0.75 },
        { false, { 0 }, 1, { 1, 1, 0, 1 }, EBPO_BOOLEAN_OPERAND, 0.5 },
        { false, { 0 }, 1, { 1, 1, 1, 1 }, EBPO_BOOLEAN_OPERAND, 1 / 6.0 },
        { false, { 0 }, 1, { 1, 0, 0, 1 }, EBPO_BOOLEAN_OPERAND, 1 },
        { false, { 0 }, 1, { 1, 0, 0, 1e300 }, EBPO_BOOLEAN_OPERAND, 1 },
        { false, { 0 }, 1, { -1e-300, 0, 0, -1 }, EBPO_BOOLEAN_OPERAND, 0 },
        { true, { 0.5, -1, -1, 3, 3, 0.5 }, 0, { 0 }, EBPO_BOOLEAN_OPERAND, 0.25 },
        { true, { -1, -1, -1, 1, 1, 1 }, 0, { 0 }, EBPO_BOOLEAN_COMPLEMENT, 7 },
        { true, { -1, -1, -1, 1, 1, 1 }, 1, { 0, 1, 0, 0 }, EBPO_BOOLEAN_COMPLEMENT, 4 },
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        scene s = { .boxed = rows[i].boxed, .planes = rows[i].planes };
        ebpo_mesh mesh;
        memcpy(s.box, rows[i].box, sizeof s.box);
        memcpy(s.plane[0], rows[i].plane, sizeof s.plane[0]);
        add_operand(&s, ebpo_test_box(low, high, 2), moved_pose(0, 0, 0), 0);
        s.node[s.nodes++] = (ebpo_boolean_node){ EBPO_BOOLEAN_OPERAND, 0, 0, 0 };
        if (rows[i].operation == EBPO_BOOLEAN_COMPLEMENT)
            s.node[s.nodes++] = (ebpo_boolean_node){ EBPO_BOOLEAN_COMPLEMENT, 0, 0, 0 };
        ebpo_boolean_mesh_report report = make_mesh(&s, 1, &mesh);
        ck_assert_uint_eq(count_open_edges(&mesh), 0);
        ck_assert_double_eq(report.volume.lo, rows[i].volume);
        ck_assert_double_eq(report.volume.hi, rows[i].volume);
        ck_assert_double_eq(report.displacement, 0);
        ebpo_mesh_free(&mesh);
        free_scene(&s);
    }
}
END_TEST

START_TEST(refused_regions)
{
    const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 }, flat[6] = { 0, 0, 0, 1, 0, 1 };
    static const double planes[][4] = { { 0, 0, 0, 1 }, { 1, NAN, 0, 1 }, { 1, 0, 0, INFINITY } };
    ebpo_boolean_node node[2] = { { EBPO_BOOLEAN_OPERAND, 0, 0, 0 },
                                  { EBPO_BOOLEAN_COMPLEMENT, 0, 0, 0 } };
    ebpo_boolean *boolean;
    scene s = { .nodes = 0 };
    add_operand(&s, ebpo_test_box(low, high, 1), moved_pose(0, 0, 0), 0);
    ebpo_boolean_operand operand = { s.model[0].model, s.pose[0] };
    for (uint32_t i = 0; i < 6; i++) {
        ebpo_boolean_options options = EBPO_BOOLEAN_OPTIONS_INIT;
        ebpo_error got = EBPO_ERROR_INIT;
        options.box = i == 0 ? flat : NULL;
        options.planes = i < 3 ? planes[i] : planes[0];
        options.plane_count = i == 4 ? 64 : i < 3 && i > 0 ? 1 : i == 5 ? 1 : 0;
        ebpo_status status =
            ebpo_boolean_new(&operand, 1, node, i == 3 ? 2 : 1, &options, &boolean, &got);
        ck_assert_int_eq(status, i == 4 ? EBPO_E_LIMIT : EBPO_E_ARGUMENT);
        ck_assert_ptr_null(boolean);
    }
    free_scene(&s);
}
END_TEST

/* --- changes --- */

typedef struct corners {
    double at[3][3];
} corners;

static int order_corners(const void *a, const void *b) { return memcmp(a, b, sizeof(corners)); }

/* Gets the corners of a face of a mesh, the least one first. */
static corners corners_of(const ebpo_mesh *mesh, uint64_t face, const ebpo_pose *pose)
{
    corners c, out;
    int least = 0;
    for (int i = 0; i < 3; i++) {
        ebpo_test_point(mesh, mesh->faces[3 * face + (unsigned)i], c.at[i]);
        for (int k = 0; k < 3 && pose; k++)
            c.at[i][k] += pose->translation[k];
        for (int k = 0; k < 3; k++)
            c.at[i][k] += 0.0; /* no -0 */
        if (memcmp(c.at[i], c.at[least], sizeof c.at[i]) < 0)
            least = i;
    }
    for (int i = 0; i < 3; i++)
        memcpy(out.at[i], c.at[(least + i) % 3], sizeof out.at[i]);
    return out;
}

/* Lists the faces of the base that are not removed, and those of the changes. */
static uint64_t list_changed(const scene *s, const ebpo_mesh *changes, corners *out)
{
    const ebpo_mesh *base = &s->model[0].mesh;
    const ebpo_attribute *removed = &changes->attributes->array[0];
    uint64_t count = 0, range = 0;
    ck_assert_str_eq(removed->element, "removed");
    for (uint64_t f = 0; f < base->face_count; f++) {
        uint32_t row[2] = { UINT32_MAX, 0 };
        if (range < removed->rows)
            memcpy(row, removed->values + 8 * range, sizeof row);
        if (f < row[0])
            out[count++] = corners_of(base, f, &s->pose[0]);
        else if (f + 1 == (uint64_t)row[0] + row[1])
            range++;
    }
    ck_assert_uint_eq(range, removed->rows);
    for (uint64_t f = 0; f < changes->face_count; f++)
        out[count++] = corners_of(changes, f, NULL);
    return count;
}

/* Makes a sphere with many faces and a long diagonal drill through it. The drill's box contains all
 * faces of the sphere. */
static void make_drilled_sphere(scene *s, uint32_t level)
{
    const double centre[3] = { 0, 0, 0 }, low[3] = { -4, -0.02, -0.02 },
                 high[3] = { 4, 0.02, 0.02 };
    static const double turn[3][3] = { { 0.36, 0.48, -0.8 },
                                       { -0.8, 0.6, 0 },
                                       { 0.48, 0.64, 0.6 } };
    ebpo_pose pose = moved_pose(0, 0, 0);
    memcpy(pose.rotation, turn, sizeof turn);
    add_operand(s, ebpo_test_sphere(centre, 1, level), moved_pose(0.25, 0, 0), 3);
    add_operand(s, ebpo_test_box(low, high, 2), pose, 3);
}

/* The faces that stay and the changes are the faces of the result. */
START_TEST(changes)
{
    static const int32_t operations[] = { EBPO_BOOLEAN_UNION, EBPO_BOOLEAN_INTERSECTION,
                                          EBPO_BOOLEAN_DIFFERENCE,
                                          EBPO_BOOLEAN_SYMMETRIC_DIFFERENCE };
    const double centre[3] = { 0, 0, 0 };
    uint64_t kept = 0, compared = 0;
    for (uint32_t i = 0; i < 50; i++) {
        uint64_t state = i + 1;
        double small[3] = { 0.1, 0.2, 0.3 };
        ebpo_boolean_mesh_options options = EBPO_BOOLEAN_MESH_OPTIONS_INIT;
        ebpo_boolean_mesh_report report = EBPO_BOOLEAN_MESH_REPORT_INIT;
        ebpo_mesh whole, mesh;
        scene s = { .nodes = 0 };
        if (i < 40)
            add_operand(&s, ebpo_test_sphere(centre, 1, 3), moved_pose(0.25 * (i % 3), 0, 0),
                        3 * i);
        if (i >= 40)
            make_drilled_sphere(&s, i < 44 ? 5 : 4);
        else if (i % 5 == 0)
            add_operand(&s, ebpo_test_sphere(centre, 1, 3), moved_pose(0, 0, 0), 3);
        else
            add_operand(&s, ebpo_test_sphere(small, 0.3, 1), turned_pose(&state), 3);
        s.node[s.nodes++] = (ebpo_boolean_node){ EBPO_BOOLEAN_OPERAND, 0, 0, 0 };
        s.node[s.nodes++] = (ebpo_boolean_node){ EBPO_BOOLEAN_OPERAND, 1, 0, 0 };
        s.node[s.nodes++] = (ebpo_boolean_node){ operations[i % 4], 0, 1, 0 };
        if (i >= 44) { /* cut by planes and a box, of which the sphere sticks out */
            static const double plane[2][4] = { { 0, 0, 1, 0.3 }, { 3, 1, -2, 0.1 } },
                                box[6] = { -2, -2, -0.5, 2, 0.5, 2 };
            memcpy(s.plane, plane, sizeof plane);
            memcpy(s.box, box, sizeof box);
            s.planes = i % 3;
            s.boxed = i % 3 != 1;
        }
        ebpo_boolean *boolean = make_boolean(&s, 2);
        ASSERT_OK(ebpo_boolean_mesh(boolean, &options, &whole, NULL, error));
        options.changed_only = true;
        ASSERT_OK(ebpo_boolean_mesh(boolean, &options, &mesh, &report, error));
        uint64_t most = s.model[0].mesh.face_count + mesh.face_count;
        corners *expected = query_alloc(whole.face_count + 1, sizeof *expected),
                *got = query_alloc(most, sizeof *got);
        for (uint64_t f = 0; f < whole.face_count; f++)
            expected[f] = corners_of(&whole, f, NULL);
        ck_assert_uint_eq(list_changed(&s, &mesh, got), whole.face_count);
        ck_assert_uint_eq(whole.face_count + report.removed_faces, most);
        qsort(expected, whole.face_count, sizeof *expected, order_corners);
        qsort(got, whole.face_count, sizeof *got, order_corners);
        ck_assert_mem_eq(expected, got, whole.face_count * sizeof *got);
        kept += s.model[0].mesh.face_count - report.removed_faces;
        compared += whole.face_count;
        free(expected);
        free(got);
        ebpo_mesh_free(&whole);
        ebpo_mesh_free(&mesh);
        ebpo_boolean_free(boolean);
        free_scene(&s);
    }
    ck_assert_uint_gt(3 * kept, compared);
}
END_TEST

/* Few faces of the sphere are listed: near a drill; near a plane through the sphere; near a box
 * that contains half of the sphere. */
START_TEST(few_faces_near_cut)
{
    const double low[3] = { -2, -2, -2 }, high[3] = { 2, 0.01, 2 };
    for (int i = 0; i < 3; i++) {
        scene s = { .nodes = i == 1 ? 1 : 3,
                    .node = { { EBPO_BOOLEAN_OPERAND, 0, 0, 0 },
                              { EBPO_BOOLEAN_OPERAND, 1, 0, 0 },
                              { EBPO_BOOLEAN_DIFFERENCE, 0, 1, 0 } },
                    .plane = { { 0.1, 0.2, 1, 0.05 } },
                    .planes = i == 1 };
        ebpo_base_faces near;
        make_drilled_sphere(&s, 5);
        if (i == 2) {
            s.node[1].left = 2;
            add_operand(&s, ebpo_test_box(low, high, 1), moved_pose(0, 0, 0), 3);
        }
        uint64_t faces = s.model[0].mesh.face_count, differ = 0;
        ebpo_boolean *boolean = make_boolean(&s, 1);
        ASSERT_OK(ebpo_base_faces_find(boolean, 1, NULL, &near, error));
        ck_assert_uint_gt(near.count, 0);
        ck_assert_uint_lt(near.count, faces / 2);
        for (uint64_t f = 1; f < near.count; f++)
            ck_assert_uint_lt(near.face[f - 1].file_face, near.face[f].file_face);
        for (uint64_t f = 0; f < faces && near.differs; f++)
            differ += near.differs[f / 64] >> f % 64 & 1;
        if (i)
            ck_assert_uint_gt(differ, faces / 4);
        ebpo_base_faces_free(&near);
        ebpo_boolean_free(boolean);
        free_scene(&s);
    }
}
END_TEST

/* The search for changed faces reports progress up to its end, and stops on request. */
static bool note_progress(void *user, const char *stage, uint64_t done, uint64_t total)
{
    double *last = user; /* the last reported share; the search is stopped after last[1] */
    if (strcmp(stage, "find changed faces") == 0) {
        double share = (double)done / (double)total;
        ck_assert_double_ge(share, last[0]);
        last[0] = share;
    }
    return last[0] <= last[1];
}

START_TEST(progress_of_changes)
{
    for (int i = 0; i < 2; i++) {
        double last[2] = { 0, i ? 0.3 : 1 };
        ebpo_boolean_mesh_options options = EBPO_BOOLEAN_MESH_OPTIONS_INIT;
        ebpo_mesh mesh;
        ebpo_error got = EBPO_ERROR_INIT;
        scene s = { .nodes = 1,
                    .node = { { EBPO_BOOLEAN_OPERAND, 0, 0, 0 } },
                    .plane = { { 0.1, 0.2, 1, 0.05 } },
                    .planes = 1 };
        make_drilled_sphere(&s, 5);
        ebpo_boolean *boolean = make_boolean(&s, 1);
        options.changed_only = true;
        options.progress = (ebpo_progress){ note_progress, last };
        ebpo_status status = ebpo_boolean_mesh(boolean, &options, &mesh, NULL, &got);
        ck_assert_int_eq(status, i ? EBPO_E_CANCELLED : EBPO_OK);
        if (i)
            ck_assert_str_eq(got.message, "stopped on request during find changed faces");
        else
            ck_assert_double_gt(last[0], 0.8);
        ebpo_mesh_free(&mesh);
        ebpo_boolean_free(boolean);
        free_scene(&s);
    }
}
END_TEST

/* A sheet crosses a thin stack of plates everywhere. All faces of the plates are in all boxes that
 * are not much smaller than the thickness of the stack; there are millions of such boxes. */
START_TEST(long_faces_near_sheet)
{
    enum { PLATES = 600 };
    const double thickness = 0x1p-20, slope = PLATES * 0x1p-21;
    scene s = { .nodes = 3,
                .node = { { EBPO_BOOLEAN_OPERAND, 0, 0, 0 },
                          { EBPO_BOOLEAN_OPERAND, 1, 0, 0 },
                          { EBPO_BOOLEAN_DIFFERENCE, 0, 1, 0 } } };
    const double sheet_low[3] = { -1, -1, 0 }, sheet_high[3] = { 2, 2, thickness };
    ebpo_mesh sheet = ebpo_test_box(sheet_low, sheet_high, 1), plates = { 0 };
    for (uint32_t i = 0; i < PLATES; i++) {
        const double low[3] = { 0, 0, i * thickness }, high[3] = { 1, 1, (i + 0.5) * thickness };
        ebpo_mesh plate = ebpo_test_box(low, high, 1);
        plates = i ? join_meshes(plates, plate) : plate;
    }
    for (uint64_t v = 0; v < sheet.vertex_count; v++)
        sheet.xyz64[3 * v + 2] += slope * (sheet.xyz64[3 * v] + 1);
    ebpo_base_faces near;
    add_operand(&s, plates, moved_pose(0, 0, 0), 3);
    add_operand(&s, sheet, moved_pose(0, 0, 0), 3);
    ebpo_boolean *boolean = make_boolean(&s, 1);
    ASSERT_OK(ebpo_base_faces_find(boolean, 1, NULL, &near, error));
    ck_assert_uint_gt(near.count, s.model[0].mesh.face_count / 2);
    ck_assert_uint_le(near.count, s.model[0].mesh.face_count);
    ebpo_base_faces_free(&near);
    ebpo_boolean_free(boolean);
    free_scene(&s);
}
END_TEST

/* Refuses changes of two overlapping spheres: the other operand cuts both, or it is in both, or it
 * contains both, and the result has the reversed spheres. */
START_TEST(refused_changes)
{
    const double centre[3] = { 0, 0, 0 }, other[3] = { 0.9, 0, 0 }, far[3] = { 1.3, -1.2, 0 };
    static const double size[4] = { 0.5, 0.1, 8, 8 }, shift[4] = { -0.25, -0.45, 0, 0 };
    static const ebpo_boolean_node root[4] = { { EBPO_BOOLEAN_DIFFERENCE, 0, 1, 0 },
                                               { EBPO_BOOLEAN_DIFFERENCE, 0, 1, 0 },
                                               { EBPO_BOOLEAN_DIFFERENCE, 1, 0, 0 },
                                               { EBPO_BOOLEAN_SYMMETRIC_DIFFERENCE, 0, 1, 0 } };
    ebpo_error got = EBPO_ERROR_INIT;
    ebpo_mesh mesh;
    for (int i = 0; i < 4; i++) {
        ebpo_boolean_mesh_options options = EBPO_BOOLEAN_MESH_OPTIONS_INIT;
        scene s = { .nodes = 0 };
        ebpo_mesh second = ebpo_test_sphere(i < 2 ? other : far, 1, 2);
        add_operand(&s, join_meshes(ebpo_test_sphere(centre, 1, 2), second), moved_pose(0, 0, 0),
                    0);
        add_operand(&s, ebpo_test_sphere(other, size[i], 1), moved_pose(shift[i], 0, 0), 0);
        s.node[s.nodes++] = (ebpo_boolean_node){ EBPO_BOOLEAN_OPERAND, 0, 0, 0 };
        s.node[s.nodes++] = (ebpo_boolean_node){ EBPO_BOOLEAN_OPERAND, 1, 0, 0 };
        s.node[s.nodes++] = root[i];
        options.changed_only = true;
        ebpo_boolean *boolean = make_boolean(&s, 1);
        ck_assert_int_eq(ebpo_boolean_mesh(boolean, &options, &mesh, NULL, &got),
                         EBPO_E_UNSUPPORTED);
        options.volume = true;
        ck_assert_int_eq(ebpo_boolean_mesh(boolean, &options, &mesh, NULL, &got), EBPO_E_ARGUMENT);
        ebpo_boolean_free(boolean);
        s.nodes = 2; /* the expression does not use the spheres */
        options.volume = false;
        boolean = make_boolean(&s, 1);
        ck_assert_int_eq(ebpo_boolean_mesh(boolean, &options, &mesh, NULL, &got), EBPO_E_ARGUMENT);
        ebpo_boolean_free(boolean);
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
    tcase_add_test(tests, regions);
    tcase_add_test(tests, refused_regions);
    tcase_add_test(tests, changes);
    tcase_add_test(tests, few_faces_near_cut);
    tcase_add_test(tests, progress_of_changes);
    tcase_add_test(tests, long_faces_near_sheet);
    tcase_add_test(tests, refused_changes);
    tcase_add_test(tests, equal_for_any_threads);
    suite_add_tcase(suite, tests);
    return suite;
}
