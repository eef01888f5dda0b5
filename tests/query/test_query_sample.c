/* Tests attributes at points on faces against long doubles and exact conditions. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <ebpo/build.h>
#include <ebpo/query.h>
#include <ebpo/subset.h>

#include "check_main.h"
#include "scratch.h"
#include "solids.h"

static ebpo_error error = EBPO_ERROR_INIT;

static void fine(ebpo_status status) { ck_assert_msg(status == EBPO_OK, "%s", error.message); }

/* --- a torus whose attributes are functions of the vertex position --- */

static double linear(const double p[3]) { return 3 * p[0] - 2 * p[1] + p[2] + 5; }

static void write_ply(const ebpo_mesh *mesh, const char *path)
{
    FILE *out = fopen(path, "w");
    fprintf(out,
            "ply\nformat ascii 1.0\nelement vertex %llu\nproperty double x\nproperty double y\n"
            "property double z\nproperty double linear\nproperty float same\nproperty uchar red\n"
            "element face %llu\nproperty list uchar int vertex_indices\nproperty int red\n"
            "property list uchar float corner\nproperty list uchar int different\nend_header\n",
            (unsigned long long)mesh->vertex_count, (unsigned long long)mesh->face_count);
    for (uint64_t v = 0; v < mesh->vertex_count; v++) {
        const double *p = mesh->xyz64 + 3 * v;
        fprintf(out, "%.17g %.17g %.17g %.17g 0.1 %llu\n", p[0], p[1], p[2], linear(p),
                (unsigned long long)(v % 256));
    }
    for (uint64_t f = 0; f < mesh->face_count; f++)
        fprintf(out, "3 %u %u %u %llu 3 0.5 1.5 2.5 %s\n", mesh->faces[3 * f],
                mesh->faces[3 * f + 1], mesh->faces[3 * f + 2], (unsigned long long)f,
                f % 2 ? "0" : "1 7");
    fclose(out);
}

static void convert(const char *ply, const char *path, uint32_t without)
{
    ebpo_mesh_read_options how = EBPO_MESH_READ_OPTIONS_INIT;
    ebpo_prepared prepared = EBPO_PREPARED_INIT;
    ebpo_build_options build = EBPO_BUILD_OPTIONS_INIT;
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    ebpo_mesh mesh;
    ebpo_tree tree;
    how.attributes = 1;
    build.parts &= ~without;
    write.subtree_faces = 40;
    fine(ebpo_mesh_read(ply, &how, &mesh, &error));
    fine(ebpo_mesh_prepare(&mesh, NULL, &prepared, &error));
    fine(ebpo_build(&mesh, &prepared.report, &prepared.record, &build, &tree, &error));
    fine(ebpo_tree_write(&tree, path, &write, &error));
    ebpo_tree_free(&tree);
}

typedef struct fixture {
    ebpo_file *file;
    ebpo_model *model;
    ebpo_context *context;
    ebpo_sampler *sampler;
} fixture;

static fixture run_query(const char *path, const char *names)
{
    fixture a = { .file = NULL };
    fine(ebpo_open(path, &a.file, &error));
    fine(ebpo_model_new(a.file, NULL, &a.model, &error));
    fine(ebpo_context_new(a.model, &a.context, &error));
    fine(ebpo_sampler_new(a.file, names, 2, &a.sampler, &error));
    return a;
}

static void answered(fixture *a)
{
    ebpo_sampler_free(a->sampler);
    ebpo_context_free(a->context);
    ebpo_model_free(a->model);
    ebpo_close(a->file);
}

static ebpo_mesh torus(const char *ply)
{
    ebpo_mesh mesh = ebpo_test_torus(1, 0.375, 24, 18);
    write_ply(&mesh, ply);
    return mesh;
}

static void random_point(uint64_t *state, double point[3])
{
    for (int k = 0; k < 3; k++)
        point[k] = (double)(ebpo_test_random(state) >> 11) * 0x1p-53 * 3 - 1.5;
}

/* In a file with maps `face` is the source index, which is the attribute `red` of faces. */
static void expect_values(const double values[3], uint64_t face, const double point[3], bool maps)
{
    ck_assert_double_eq_tol(values[0], linear(point), 1e-13);
    ck_assert_double_eq(values[1], (double)0.1f); /* all three values are equal */
    if (maps)
        ck_assert_double_eq(values[2], (double)face);
}

static void query_points(bool maps)
{
    uint64_t state = 7;
    fixture a = run_query(scratch("a.ebpo.h5"), "linear,same,face:red");
    ck_assert_uint_eq(ebpo_sampler_columns(a.sampler), 3);
    for (uint64_t i = 0; i < ebpo_test_scaled(400); i++) {
        double point[3], towards[3], values[3];
        ebpo_distance_result near;
        ebpo_ray_hit hit;
        bool intersected;
        random_point(&state, point);
        random_point(&state, towards);
        fine(ebpo_distance(a.context, point, NULL, &near, &error));
        fine(ebpo_sample(a.sampler, near.point, &near.face, 1, values, &error));
        expect_values(values, near.face, near.point, maps);
        fine(ebpo_ray_first(a.context, point, towards, INFINITY, &hit, &intersected, &error));
        for (int k = 0; k < 3; k++)
            point[k] += hit.t * towards[k];
        if (intersected) {
            fine(ebpo_sample(a.sampler, point, &hit.face, 1, values, &error));
            expect_values(values, hit.face, point, maps);
        }
    }
    answered(&a);
}

START_TEST(test_sample_of_linear_values_is_linear)
{
    ebpo_mesh mesh = torus(scratch("a.ply"));
    convert(scratch("a.ply"), scratch("a.ebpo.h5"), 0);
    query_points(true);
    convert(scratch("a.ply"), scratch("a.ebpo.h5"), EBPO_PART_MAPS);
    query_points(false);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_sample_at_vertex_is_vertex_value)
{
    ebpo_mesh mesh = torus(scratch("a.ply"));
    convert(scratch("a.ply"), scratch("a.ebpo.h5"), 0);
    fixture a = run_query(scratch("a.ebpo.h5"), "red,linear");
    for (uint64_t f = 0; f < mesh.face_count; f++)
        for (int i = 0; i < 3; i++) {
            uint32_t v = mesh.faces[3 * f + (uint64_t)i];
            double values[2];
            fine(ebpo_sample(a.sampler, mesh.xyz64 + 3 * (uint64_t)v, &f, 1, values, &error));
            ck_assert_double_eq(values[0], v % 256);
            ck_assert_double_eq(values[1], linear(mesh.xyz64 + 3 * (uint64_t)v));
        }
    answered(&a);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_sample_of_subset_matches_whole)
{
    ebpo_mesh mesh = torus(scratch("a.ply"));
    ebpo_subset_options cut = EBPO_SUBSET_OPTIONS_INIT;
    uint64_t state = 3, count = 0;
    convert(scratch("a.ply"), scratch("a.ebpo.h5"), 0);
    fixture whole = run_query(scratch("a.ebpo.h5"), "red,face:red");
    cut.boxed = true;
    for (int k = 0; k < 3; k++)
        cut.min[k] = 0, cut.max[k] = 1;
    fine(ebpo_subset(whole.file, scratch("b.ebpo.h5"), &cut, &error));
    fixture part = run_query(scratch("b.ebpo.h5"), "red,face:red");
    for (uint64_t f = 0; f < mesh.face_count; f++) {
        double point[3], one[2], other[2];
        random_point(&state, point);
        fine(ebpo_sample(whole.sampler, point, &f, 1, one, &error));
        if (ebpo_sample(part.sampler, point, &f, 1, other, &error) == EBPO_OK)
            count++, ck_assert(memcmp(one, other, sizeof one) == 0);
    }
    ck_assert(count > 50 && count < mesh.face_count);
    answered(&part);
    answered(&whole);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* --- degenerate faces --- */

/* Writes a tetrahedron of a given size, and two faces without area or nearly so. The vertices of
 * the tetrahedron have the values 1, 2, 4 and 8; the vertex far along an edge has NaN. */
static void write_hard(double size)
{
    FILE *out = fopen(scratch("h.ply"), "w");
    fprintf(out, "ply\nformat ascii 1.0\nelement vertex 5\nproperty double x\nproperty double y\n"
                 "property double z\nproperty double q\nelement face 6\n"
                 "property list uchar int vertex_indices\nend_header\n");
    fprintf(out, "0 0 0 1\n%.17g 0 0 2\n0 %.17g 0 4\n0 0 %.17g 8\n%.17g 0 0 nan\n", size, size,
            size, size * 0.75);
    fprintf(out, "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n3 0 4 1\n3 1 1 1\n");
    fclose(out);
}

static double at(const fixture *a, uint64_t face, double x, double y, double z)
{
    double value, point[3] = { x, y, z };
    fine(ebpo_sample(a->sampler, point, &face, 1, &value, &error));
    return value;
}

START_TEST(test_sample_of_slivers_at_any_scale)
{
    static const double sizes[] = { 1, 0x1p-1000, 0x1p1000 };
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        double s = sizes[i];
        write_hard(s);
        convert(scratch("h.ply"), scratch("h.ebpo.h5"), 0);
        fixture a = run_query(scratch("h.ebpo.h5"), "q");
        ck_assert_double_eq(at(&a, 0, s / 4, s / 2, 0), 0.25 * 1 + 0.5 * 4 + 0.25 * 2);
        ck_assert_double_eq(at(&a, 0, s / 2, 0, 0), 1.5); /* vertex 2 has weight 0 */
        /* beside the face: values of the nearest point */
        ck_assert_double_eq(at(&a, 0, -s, s / 2, 0), 2.5);
        /* a face without area: values along the edge from 0 to 1 */
        ck_assert_double_eq(at(&a, 4, s / 4, 0, 0), 1.25);
        ck_assert_double_eq(at(&a, 4, s / 2, s, s), 1.5);
        ck_assert_double_eq(at(&a, 5, s, 0, 0), 2);
        answered(&a);
    }
}
END_TEST

/* --- errors --- */

static void expect_refused(const ebpo_file *file, const char *names, ebpo_status expected)
{
    ebpo_sampler *sampler;
    ck_assert_msg(ebpo_sampler_new(file, names, 1, &sampler, &error) == expected, "%s", names);
    ck_assert(!sampler && strstr(error.message, expected == EBPO_E_ABSENT ? "'" : "at most 16"));
}

START_TEST(test_sample_of_missing_attribute_is_refused)
{
    ebpo_mesh mesh = torus(scratch("a.ply"));
    const uint64_t beyond = mesh.face_count, none = EBPO_NO_FACE, first = 0;
    double value, point[3] = { 1, 0, NAN };
    convert(scratch("a.ply"), scratch("a.ebpo.h5"), 0);
    fixture a = run_query(scratch("a.ebpo.h5"), "vertex:red");
    expect_refused(a.file, "blue", EBPO_E_ABSENT);
    expect_refused(a.file, "", EBPO_E_ABSENT);
    expect_refused(a.file, "red,", EBPO_E_ABSENT);
    expect_refused(a.file, "different", EBPO_E_ABSENT);
    expect_refused(a.file, "corner", EBPO_E_ABSENT);
    expect_refused(a.file, "vertex:different", EBPO_E_ABSENT);
    expect_refused(a.file, "vertices:red", EBPO_E_ABSENT);
    expect_refused(a.file, "red,red,red,red,red,red,red,red,red,red,red,red,red,red,red,red,red",
                   EBPO_E_ARGUMENT);
    ck_assert_int_eq(ebpo_sample(a.sampler, point, &beyond, 1, &value, &error), EBPO_E_ARGUMENT);
    ck_assert_int_eq(ebpo_sample(a.sampler, point, &first, 1, &value, &error), EBPO_E_ARGUMENT);
    fine(ebpo_sample(a.sampler, point, &none, 1, &value, &error));
    ck_assert(isnan(value));
    answered(&a);
    convert(scratch("a.ply"), scratch("a.ebpo.h5"), EBPO_PART_ATTRIBUTES);
    ebpo_file *bare;
    fine(ebpo_open(scratch("a.ebpo.h5"), &bare, &error));
    expect_refused(bare, "red", EBPO_E_ABSENT);
    ebpo_close(bare);
    ebpo_mesh_free(&mesh);
}
END_TEST

TEST_SUITE(query_sample)
{
    Suite *suite = suite_create("query_sample");
    TCase *tests = tcase_create("sample");
    tcase_add_checked_fixture(tests, scratch_enter, scratch_leave);
    tcase_set_timeout(tests, 300);
    tcase_add_test(tests, test_sample_of_linear_values_is_linear);
    tcase_add_test(tests, test_sample_at_vertex_is_vertex_value);
    tcase_add_test(tests, test_sample_of_subset_matches_whole);
    tcase_add_test(tests, test_sample_of_slivers_at_any_scale);
    tcase_add_test(tests, test_sample_of_missing_attribute_is_refused);
    suite_add_tcase(suite, tests);
    return suite;
}
