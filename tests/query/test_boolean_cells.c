/* Cells of Booleans: known volumes are in the interval, outer cells contain the result and inner
 * cells are in it, and results do not depend on threads or loading. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/boolean.h>

#include "check_main.h"
#include "query_support.h"

enum { FINEST = 6 };

static const double pi = 3.14159265358979323846;

static ebpo_pose pose_of(double angle, double scale, double x, double y, double z)
{
    double c = cos(angle), s = sin(angle);
    return (ebpo_pose){ { { c, -s, 0 }, { s * c, c * c, -s }, { s * s, c * s, c } },
                        { x, y, z },
                        scale };
}

static query_model make_cube(void)
{
    const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    query_model m;
    query_model_make(&m, "cube", ebpo_test_box(low, high, 8), &query_variants[0]);
    return m;
}

static query_model make_sphere(void)
{
    const double centre[3] = { 0, 0, 0 };
    query_model m;
    query_model_make(&m, "sphere", ebpo_test_sphere(centre, 1, 4), &query_variants[0]);
    return m;
}

/* Makes the Boolean A op B. */
static ebpo_boolean *make_pair(ebpo_model *a, ebpo_pose pose_a, ebpo_model *b, ebpo_pose pose_b,
                               int operation, unsigned threads)
{
    const ebpo_boolean_operand operands[2] = { { a, pose_a }, { b, pose_b } };
    const ebpo_boolean_node nodes[3] = { { EBPO_BOOLEAN_OPERAND, 0, 0, 0 },
                                         { EBPO_BOOLEAN_OPERAND, 1, 0, 0 },
                                         { operation, 0, 1, 0 } };
    ebpo_boolean *boolean;
    ebpo_boolean_options options = EBPO_BOOLEAN_OPTIONS_INIT;
    options.threads = threads;
    ASSERT_OK(ebpo_boolean_new(operands, 2, nodes, 3, &options, &boolean, error));
    return boolean;
}

static ebpo_boolean_cells *make_cells(ebpo_boolean *boolean, int level)
{
    ebpo_boolean_cells *cells;
    ebpo_cells_options options = EBPO_CELLS_OPTIONS_INIT;
    options.level = level;
    ASSERT_OK(ebpo_boolean_cells_new(boolean, &options, &cells, error));
    return cells;
}

static ebpo_boolean_volume volume_of(ebpo_boolean *boolean, int level)
{
    ebpo_boolean_volume v = EBPO_BOOLEAN_VOLUME_INIT;
    ebpo_boolean_cells *cells = make_cells(boolean, level);
    ck_assert_int_eq(ebpo_boolean_cells_volume(cells, &v), EBPO_OK);
    ebpo_boolean_cells_free(cells);
    return v;
}

/* Checks that the interval contains the true volume, within `slack`, at every level, and that
 * deeper levels never widen the interval. */
static void check_volume(ebpo_boolean *boolean, double truth, double slack)
{
    double lo = 0, hi = INFINITY, first = 0;
    for (int level = 0; level <= FINEST; level++) {
        ebpo_boolean_volume v = volume_of(boolean, level);
        ck_assert_msg(v.lo <= truth + slack && v.hi >= truth - slack, "level %d: %.17g .. %.17g",
                      level, v.lo, v.hi);
        ck_assert(v.lo >= lo && v.hi <= hi);
        lo = v.lo;
        hi = v.hi;
        if (level == 2)
            first = hi - lo;
    }
    ck_assert_msg(hi - lo < 0.2 * first, "the interval is still %g of %g wide", hi - lo, first);
}

static double combined(int operation, double a, double b, double both)
{
    switch (operation) {
    case EBPO_BOOLEAN_UNION: return a + b - both;
    case EBPO_BOOLEAN_INTERSECTION: return both;
    case EBPO_BOOLEAN_DIFFERENCE: return a - both;
    default: return a + b - 2 * both;
    }
}

static void check_operations(query_model *a, ebpo_pose pose_a, query_model *b, ebpo_pose pose_b,
                             const double volumes[3], double slack)
{
    for (int op = EBPO_BOOLEAN_UNION; op <= EBPO_BOOLEAN_SYMMETRIC_DIFFERENCE; op++) {
        ebpo_boolean *boolean = make_pair(a->model, pose_a, b->model, pose_b, op, 0);
        check_volume(boolean, combined(op, volumes[0], volumes[1], volumes[2]), slack);
        ebpo_boolean_free(boolean);
    }
}

START_TEST(test_cell_volumes_of_cubes)
{
    query_model cube = make_cube();
    ebpo_pose turned = pose_of(0.4, 1, 3, 2, 1), small = turned;
    small.scale = 0.25;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            small.translation[i] += 0.375 * turned.rotation[i][k];
    const double shifted[3] = { 1, 1, 0.5 * 0.75 * 0.875 }, nested[3] = { 1, 0x1p-6, 0x1p-6 };
    ebpo_pose at = EBPO_POSE_INIT, moved = EBPO_POSE_INIT;
    moved.translation[0] = 0.5;
    moved.translation[1] = 0.25;
    moved.translation[2] = -0.125;
    check_operations(&cube, at, &cube, moved, shifted, 0);
    check_operations(&cube, turned, &cube, small, nested, 1e-14);
    query_model_free(&cube);
}
END_TEST

/* Two unit balls at a distance of 1 share a lens with a volume of 5/12 pi. For meshes of 5,120
 * faces, the volume is smaller by less than a hundredth. */
START_TEST(test_cell_volumes_of_spheres)
{
    query_model sphere = make_sphere();
    const double ball = 4 * pi / 3, volumes[3] = { ball, ball, 5 * pi / 12 };
    check_operations(&sphere, pose_of(0.3, 1, 0, 0, 0), &sphere, pose_of(1, 1, 0.6, 0, 0.8),
                     volumes, 0.02);
    query_model_free(&sphere);
}
END_TEST

/* --- the surfaces of cells --- */

static void check_closed(const ebpo_mesh *mesh)
{
    ebpo_mesh_report report;
    ebpo_progress none = { NULL, NULL };
    ASSERT_OK(ebpo_mesh_check(mesh, 1, none, &report, error));
    ck_assert_uint_eq(report.unbalanced_edges.count, 0);
    ck_assert_uint_eq(report.zero_area_faces.count + report.repeated_faces.count +
                          report.repeated_positions.count + report.unreferenced_vertices.count,
                      0);
}

/* Checks that points of the result are in the outer cells, and that points of the inner cells are
 * in the result. */
static void check_points(ebpo_boolean *boolean, oracle *outer, oracle *inner)
{
    uint64_t state = 5, in = 0, sure = 0;
    for (uint64_t i = 0; i < 1500; i++) {
        double p[3];
        ebpo_boolean_result got;
        for (int k = 0; k < 3; k++)
            p[k] = 2.4 * ebpo_test_random_unit(&state) - 0.8;
        ASSERT_OK(ebpo_boolean_inside(boolean, p, &got, error));
        int32_t around = oracle_winding(outer, p), within = oracle_winding(inner, p);
        ck_assert((around == 0 || around == 1) && (within == 0 || within == 1));
        ck_assert(around || got.where == EBPO_OUT);
        ck_assert(!within || got.where == EBPO_IN);
        in += got.where == EBPO_IN;
        sure += (uint64_t)within;
    }
    ck_assert(sure > 0 && in > sure);
}

START_TEST(test_inner_and_outer_surfaces_enclose_result)
{
    query_model sphere = make_sphere(), cube = make_cube();
    for (int op = EBPO_BOOLEAN_UNION; op <= EBPO_BOOLEAN_SYMMETRIC_DIFFERENCE; op++) {
        ebpo_boolean *boolean = make_pair(sphere.model, pose_of(0.3, 1, 0, 0, 0), cube.model,
                                          pose_of(0.7, 1.2, 0.1, 0.2, 0.3), op, 0);
        ebpo_boolean_cells *cells = make_cells(boolean, 5);
        ebpo_boolean_volume v = EBPO_BOOLEAN_VOLUME_INIT;
        ebpo_mesh outer, inner;
        ck_assert_int_eq(ebpo_boolean_cells_volume(cells, &v), EBPO_OK);
        ASSERT_OK(ebpo_boolean_cells_mesh(cells, EBPO_BOOLEAN_OUTER, &outer, error));
        ASSERT_OK(ebpo_boolean_cells_mesh(cells, EBPO_BOOLEAN_INNER, &inner, error));
        oracle *judge_outer = oracle_make(&outer), *judge_inner = oracle_make(&inner);
        check_closed(&outer);
        check_closed(&inner);
        ck_assert_double_eq(oracle_volume(judge_outer), v.hi);
        ck_assert_double_eq(oracle_volume(judge_inner), v.lo);
        check_points(boolean, judge_outer, judge_inner);
        oracle_free(judge_outer);
        oracle_free(judge_inner);
        ebpo_mesh_free(&outer);
        ebpo_mesh_free(&inner);
        ebpo_boolean_cells_free(cells);
        ebpo_boolean_free(boolean);
    }
    query_model_free(&sphere);
    query_model_free(&cube);
}
END_TEST

/* --- independence --- */

static void check_equal(ebpo_boolean *a, ebpo_boolean *b, bool same_work)
{
    ebpo_boolean_volume va = volume_of(a, 5), vb = volume_of(b, 5);
    ebpo_boolean_cells *ca = make_cells(a, 5), *cb = make_cells(b, 5);
    ebpo_mesh ma, mb;
    ck_assert(va.lo == vb.lo && va.hi == vb.hi && va.in_cells == vb.in_cells &&
              va.mixed_cells == vb.mixed_cells);
    if (same_work)
        ck_assert_mem_eq(&va, &vb, sizeof va);
    ASSERT_OK(ebpo_boolean_cells_mesh(ca, EBPO_BOOLEAN_OUTER, &ma, error));
    ASSERT_OK(ebpo_boolean_cells_mesh(cb, EBPO_BOOLEAN_OUTER, &mb, error));
    ck_assert_uint_eq(ma.face_count, mb.face_count);
    ck_assert_uint_eq(ma.vertex_count, mb.vertex_count);
    ck_assert_mem_eq(ma.faces, mb.faces, ma.face_count * sizeof(uint32_t[3]));
    ck_assert_mem_eq(ma.xyz64, mb.xyz64, ma.vertex_count * sizeof(double[3]));
    ebpo_mesh_free(&ma);
    ebpo_mesh_free(&mb);
    ebpo_boolean_cells_free(ca);
    ebpo_boolean_cells_free(cb);
    ebpo_boolean_free(a);
    ebpo_boolean_free(b);
}

START_TEST(test_cells_ignore_order_and_threads)
{
    query_model sphere = make_sphere(), cube = make_cube();
    const int same[] = { EBPO_BOOLEAN_UNION, EBPO_BOOLEAN_INTERSECTION,
                         EBPO_BOOLEAN_SYMMETRIC_DIFFERENCE };
    ebpo_pose a = pose_of(0.3, 1, 0, 0, 0), b = pose_of(0.7, 1.2, 0.1, 0.2, 0.3);
    for (int i = 0; i < 3; i++)
        check_equal(make_pair(sphere.model, a, cube.model, b, same[i], 1),
                    make_pair(cube.model, b, sphere.model, a, same[i], 1), false);
    check_equal(make_pair(sphere.model, a, cube.model, b, EBPO_BOOLEAN_DIFFERENCE, 1),
                make_pair(sphere.model, a, cube.model, b, EBPO_BOOLEAN_DIFFERENCE, 3), true);
    query_model_free(&sphere);
    query_model_free(&cube);
}
END_TEST

/* Loads the subtrees of a model on demand. */
START_TEST(test_cells_same_with_loading_on_demand)
{
    query_model sphere = make_sphere();
    ebpo_model *parts;
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    options.cut_level = 2;
    ASSERT_OK(ebpo_model_new(sphere.file, &options, &parts, error));
    ebpo_pose a = pose_of(0.3, 1, 0, 0, 0), b = pose_of(1, 1, 0.6, 0, 0.8);
    check_equal(make_pair(sphere.model, a, sphere.model, b, EBPO_BOOLEAN_DIFFERENCE, 2),
                make_pair(parts, a, parts, b, EBPO_BOOLEAN_DIFFERENCE, 2), false);
    ebpo_model_free(parts);
    query_model_free(&sphere);
}
END_TEST

START_TEST(test_nodes_classify_most_cells)
{
    query_model sphere = make_sphere();
    ebpo_boolean *boolean = make_pair(sphere.model, pose_of(0.3, 1, 0, 0, 0), sphere.model,
                                      pose_of(1, 1, 0.6, 0, 0.8), EBPO_BOOLEAN_UNION, 0);
    ebpo_boolean_volume v = volume_of(boolean, 6);
    ck_assert(v.by_nodes > 0 && v.by_box > 0);
    ebpo_boolean_free(boolean);
    query_model_free(&sphere);
}
END_TEST

/* --- distances --- */

/* The result for two boxes in a row: at most two boxes, which do not touch. */
typedef struct row_of_boxes {
    int operation, count;
    double low[2], high[2]; /* bounds on x; the boxes extend from 0 to 1 on y and z */
} row_of_boxes;

static double to_boundary(const row_of_boxes *row, const double p[3])
{
    double least = INFINITY;
    for (int i = 0; i < row->count; i++) {
        const double low[3] = { row->low[i], 0, 0 }, high[3] = { row->high[i], 1, 1 };
        double out = 0, in = INFINITY;
        for (int k = 0; k < 3; k++) {
            double beyond = fmax(fmax(low[k] - p[k], p[k] - high[k]), 0);
            out += beyond * beyond;
            in = fmin(in, fmin(p[k] - low[k], high[k] - p[k]));
        }
        least = fmin(least, in > 0 ? in : sqrt(out));
    }
    return least;
}

/* Returns the distance to the faces that both boxes have in the same plane. Rounding of the pose
 * decides what the result is beside them, so that they may be its boundary. */
static double to_common_faces(const double p[3])
{
    double along = fmax(fmax(0.5 - p[0], p[0] - 1), 0), least = INFINITY;
    for (int k = 1; k < 3; k++) {
        double across = fmax(fmax(-p[3 - k], p[3 - k] - 1), 0);
        for (int face = 0; face < 2; face++) {
            double off = p[k] - face;
            least = fmin(least, sqrt(along * along + across * across + off * off));
        }
    }
    return least;
}

static void check_distances(ebpo_boolean *boolean, const ebpo_pose *pose, const row_of_boxes *row)
{
    uint64_t state = 9;
    for (uint64_t i = 0; i < query_scaled(100); i++) {
        double p[3], w[3];
        ebpo_boundary_distance got;
        for (int k = 0; k < 3; k++)
            p[k] = 2 * ebpo_test_random_unit(&state) - 0.3;
        for (int k = 0; k < 3; k++)
            w[k] = pose->rotation[k][0] * p[0] + pose->rotation[k][1] * p[1] +
                   pose->rotation[k][2] * p[2] + pose->translation[k];
        ASSERT_OK(ebpo_boolean_distance(boolean, w, NULL, &got, error));
        double truth = to_boundary(row, p);
        ck_assert_msg(got.lo <= truth + 1e-13 && got.hi >= truth - 1e-13,
                      "operation %d, (%g, %g, %g): %.17g, not in %.17g .. %.17g", row->operation,
                      p[0], p[1], p[2], truth, got.lo, got.hi);
        double lo = to_common_faces(p) < truth ? truth : got.lo;
        ck_assert_msg(row->count == 0 || got.hi - lo <= 0.01 * got.hi,
                      "operation %d, (%g, %g, %g): %.17g .. %.17g", row->operation, p[0], p[1],
                      p[2], got.lo, got.hi);
    }
}

START_TEST(test_boundary_distance_to_box_row)
{
    static const row_of_boxes rows[] = {
        { EBPO_BOOLEAN_UNION, 1, { 0, 0 }, { 1.5, 0 } },
        { EBPO_BOOLEAN_INTERSECTION, 1, { 0.5, 0 }, { 1, 0 } },
        { EBPO_BOOLEAN_DIFFERENCE, 1, { 0, 0 }, { 0.5, 0 } },
        { EBPO_BOOLEAN_SYMMETRIC_DIFFERENCE, 2, { 0, 1 }, { 0.5, 1.5 } },
    };
    query_model cube = make_cube();
    ebpo_pose pose = pose_of(0.3, 1, 2, -1, 0.5), beside = pose;
    for (int k = 0; k < 3; k++)
        beside.translation[k] += 0.5 * pose.rotation[k][0];
    for (int i = 0; i < 4; i++) {
        ebpo_boolean *boolean =
            make_pair(cube.model, pose, cube.model, beside, rows[i].operation, 1);
        check_distances(boolean, &pose, &rows[i]);
        ebpo_boolean_free(boolean);
    }
    query_model_free(&cube);
}
END_TEST

/* The boundary of an empty result is empty: certainly beyond the boxes, possibly between them. */
START_TEST(test_boundary_distance_of_empty_result)
{
    query_model cube = make_cube();
    ebpo_pose at = pose_of(0.3, 1, 0, 0, 0), away = pose_of(0.3, 1, 9, 0, 0);
    const double p[3] = { 4, 4, 4 };
    ebpo_boundary_distance got;
    ebpo_boundary_options few = EBPO_BOUNDARY_OPTIONS_INIT;
    few.cells = 2000;
    ebpo_boolean *boolean =
        make_pair(cube.model, at, cube.model, away, EBPO_BOOLEAN_INTERSECTION, 1);
    ASSERT_OK(ebpo_boolean_distance(boolean, p, NULL, &got, error));
    ck_assert(got.lo == INFINITY && got.hi == INFINITY && got.inside.where == EBPO_OUT);
    ebpo_boolean_free(boolean);
    boolean = make_pair(cube.model, at, cube.model, at, EBPO_BOOLEAN_DIFFERENCE, 1);
    ASSERT_OK(ebpo_boolean_distance(boolean, p, &few, &got, error));
    ck_assert(got.lo > 3 && got.hi == INFINITY);
    ebpo_boolean_free(boolean);
    query_model_free(&cube);
}
END_TEST

/* --- empty results, and limits --- */

START_TEST(test_disjoint_boxes_have_empty_intersection)
{
    query_model cube = make_cube();
    ebpo_boolean *boolean = make_pair(cube.model, pose_of(0.3, 1, 0, 0, 0), cube.model,
                                      pose_of(0.3, 1, 9, 0, 0), EBPO_BOOLEAN_INTERSECTION, 1);
    ebpo_boolean_volume v = volume_of(boolean, 4);
    ebpo_boolean_cells *cells = make_cells(boolean, 4);
    ebpo_mesh mesh;
    ck_assert(v.lo == 0 && v.hi == 0 && v.edge == 0);
    ASSERT_OK(ebpo_boolean_cells_mesh(cells, EBPO_BOOLEAN_OUTER, &mesh, error));
    ck_assert_uint_eq(mesh.face_count, 0);
    ebpo_mesh_free(&mesh);
    ebpo_boolean_cells_free(cells);
    ebpo_boolean_free(boolean);
    query_model_free(&cube);
}
END_TEST

static ebpo_status try_cells(ebpo_boolean *boolean, int level, uint64_t most)
{
    ebpo_boolean_cells *cells;
    ebpo_cells_options options = EBPO_CELLS_OPTIONS_INIT;
    options.level = level;
    options.most = most;
    ebpo_status status = ebpo_boolean_cells_new(boolean, &options, &cells, NULL);
    ck_assert(status == EBPO_OK || !cells);
    ebpo_boolean_cells_free(cells);
    return status;
}

START_TEST(test_invalid_cell_levels_are_refused)
{
    query_model cube = make_cube();
    ebpo_pose far = pose_of(0.3, 1, 1e14, 0, 0);
    ebpo_boolean *boolean = make_pair(cube.model, far, cube.model, far, EBPO_BOOLEAN_UNION, 1);
    ck_assert_int_eq(try_cells(boolean, -1, 0), EBPO_E_ARGUMENT);
    ck_assert_int_eq(try_cells(boolean, EBPO_BOOLEAN_LEVEL_MAX + 1, 0), EBPO_E_ARGUMENT);
    ck_assert_int_eq(try_cells(boolean, 12, 0), EBPO_E_LIMIT);
    ebpo_boolean_free(boolean);
    boolean = make_pair(cube.model, pose_of(0.3, 1, 0, 0, 0), cube.model, pose_of(0.7, 1, 0, 0, 0),
                        EBPO_BOOLEAN_UNION, 1);
    ck_assert_int_eq(try_cells(boolean, 5, 100), EBPO_E_LIMIT);
    ck_assert_int_eq(try_cells(boolean, 3, 100000), EBPO_OK);
    ebpo_boolean_free(boolean);
    query_model_free(&cube);
}
END_TEST

TEST_SUITE(boolean_cells)
{
    Suite *s = suite_create("boolean_cells");
    TCase *c = tcase_create("boolean_cells"), *threads = tcase_create("threads");
    tcase_set_timeout(c, 1200);
    tcase_set_timeout(threads, 1200);
    tcase_add_test(threads, test_cells_ignore_order_and_threads);
    tcase_add_test(c, test_cell_volumes_of_cubes);
    tcase_add_test(c, test_cell_volumes_of_spheres);
    tcase_add_test(c, test_inner_and_outer_surfaces_enclose_result);
    tcase_add_test(c, test_cells_same_with_loading_on_demand);
    tcase_add_test(c, test_nodes_classify_most_cells);
    tcase_add_test(c, test_boundary_distance_to_box_row);
    tcase_add_test(c, test_boundary_distance_of_empty_result);
    tcase_add_test(c, test_disjoint_boxes_have_empty_intersection);
    tcase_add_test(c, test_invalid_cell_levels_are_refused);
    suite_add_tcase(s, c);
    suite_add_tcase(s, threads);
    return s;
}
