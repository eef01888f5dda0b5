/* Tests intersecting faces of one mesh, except neighbours, against an independent reference
 * implementation: under budgets, with threads, with and without shared vertices. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/collide.h>

#include "core/workspace.h"
#include "check_main.h"
#include "crossing_faces.h"
#include "query_support.h"
#include "solids.h"

typedef struct found {
    ebpo_self_intersection *at;
    uint64_t count;
    ebpo_self_intersections_summary sum;
} found;

static bool take(void *user, const ebpo_self_intersection *crossings, uint64_t count)
{
    found *f = user;
    f->at = realloc(f->at, (f->count + count) * sizeof *f->at);
    ck_assert_ptr_nonnull(f->at);
    memcpy(f->at + f->count, crossings, count * sizeof *f->at);
    f->count += count;
    return true;
}

static int by_faces(const void *x, const void *y)
{
    const ebpo_self_intersection *p = x, *q = y;
    int first = (p->face[0] > q->face[0]) - (p->face[0] < q->face[0]);
    return first ? first : (p->face[1] > q->face[1]) - (p->face[1] < q->face[1]);
}

static ebpo_mesh copy_of(const ebpo_mesh *mesh)
{
    ebpo_mesh out = *mesh;
    out.xyz32 = malloc(mesh->vertex_count * 3 * sizeof *out.xyz32);
    out.faces = malloc(mesh->face_count * 3 * sizeof *out.faces);
    ck_assert(out.xyz32 && out.faces);
    memcpy(out.xyz32, mesh->xyz32, mesh->vertex_count * 3 * sizeof *out.xyz32);
    memcpy(out.faces, mesh->faces, mesh->face_count * 3 * sizeof *out.faces);
    return out;
}

/* Finds all pairs. memory: 0 for no workspace. */
static found look(const ebpo_mesh *mesh, unsigned threads, uint64_t memory)
{
    found out = { .sum = EBPO_SELF_INTERSECTIONS_SUMMARY_INIT };
    ebpo_mesh own = copy_of(mesh);
    ebpo_mesh_report report;
    ebpo_self_intersections_options how = EBPO_SELF_INTERSECTIONS_OPTIONS_INIT;
    ebpo_workspace *workspace = NULL;
    how.threads = threads;
    if (memory)
        ASSERT_OK(ebpo_workspace_make_any(&workspace, memory, NULL, error));
    own.workspace = workspace;
    ASSERT_OK(ebpo_mesh_check(&own, 1, (ebpo_progress){ NULL, NULL }, &report, error));
    ASSERT_OK(ebpo_mesh_self_intersections(&own, &report, &how, take, &out, &out.sum, error));
    ck_assert_ptr_null(own.faces);
    ebpo_workspace_free(workspace);
    if (out.count)
        qsort(out.at, out.count, sizeof *out.at, by_faces);
    return out;
}

/* Checks that each reported position is in the boxes of both faces. */
static void check_places(const ebpo_mesh *mesh, const found *f)
{
    for (uint64_t i = 0; i < f->count; i++)
        for (int s = 0; s < 2; s++)
            for (unsigned k = 0; k < 3; k++) {
                double low = INFINITY, high = -INFINITY, size = 0;
                for (unsigned c = 0; c < 3; c++) {
                    uint32_t v = mesh->faces[3 * f->at[i].face[s] + c];
                    double x = (double)mesh->xyz32[3 * (uint64_t)v + k];
                    low = fmin(low, x);
                    high = fmax(high, x);
                    size = fmax(size, fabs(x));
                }
                ck_assert_double_ge(f->at[i].point[k], low - 0x1p-40 * size);
                ck_assert_double_le(f->at[i].point[k], high + 0x1p-40 * size);
            }
}

static void check_sum(const found *f, uint64_t faces)
{
    uint64_t of_kind[4] = { 0 }, in_pairs = 0;
    bool *intersected = calloc(faces, 1);
    for (uint64_t i = 0; i < f->count; i++) {
        of_kind[f->at[i].kind]++;
        ck_assert_uint_lt(f->at[i].face[0], f->at[i].face[1]);
        ck_assert_uint_lt(f->at[i].face[1], faces);
        intersected[f->at[i].face[0]] = intersected[f->at[i].face[1]] = true;
    }
    for (uint64_t i = 0; i < faces; i++)
        in_pairs += intersected[i];
    ck_assert_uint_eq(f->sum.faces, in_pairs);
    for (int k = 0; k < 4; k++)
        ck_assert_uint_eq(f->sum.pairs[k], of_kind[k]);
    ck_assert_uint_eq(of_kind[0], 0);
    free(intersected);
}

static void check_equal(const found *f, const found *g)
{
    ck_assert_uint_eq(f->count, g->count);
    for (uint64_t i = 0; i < f->count; i++)
        ck_assert_msg(memcmp(&f->at[i], &g->at[i], sizeof *f->at) == 0, "pair %llu differs",
                      (unsigned long long)i);
}

/* Returns the number of pairs. The mesh has floats, and no repeated vertex. */
static uint64_t check_mesh(ebpo_mesh *mesh)
{
    face_model m = { (const float(*)[3])mesh->xyz32, (const uint32_t(*)[3])mesh->faces,
                     mesh->vertex_count, mesh->face_count };
    uint64_t first[2];
    ck_assert_int_eq(crossing_flat_faces(&m), 0);
    found f = look(mesh, 1, 0), small = look(mesh, 3, 8 << 20);
    ck_assert_uint_eq(f.count, crossing_faces(&m, first));
    check_sum(&f, mesh->face_count);
    check_places(mesh, &f);
    check_equal(&f, &small);
    ebpo_test_split_vertices(mesh);
    found split = look(mesh, 2, 16 << 20);
    ck_assert_uint_eq(split.count, f.count);
    for (uint64_t i = 0; i < f.count; i++)
        ck_assert(by_faces(&f.at[i], &split.at[i]) == 0 && f.at[i].kind == split.at[i].kind);
    ebpo_mesh_free(mesh);
    free(f.at);
    free(small.at);
    free(split.at);
    return f.count;
}

/* --- soups --- */

static bool on_a_line(const float *a, const float *b, const float *c)
{
    float u[3], v[3];
    for (int k = 0; k < 3; k++) {
        u[k] = b[k] - a[k];
        v[k] = c[k] - a[k];
    }
    return u[1] * v[2] == u[2] * v[1] && u[2] * v[0] == u[0] * v[2] && u[0] * v[1] == u[1] * v[0];
}

/* Faces between points of a small integer grid: many are coplanar, many share vertices. */
static ebpo_mesh make_soup(uint32_t n, uint32_t faces, uint64_t seed)
{
    ebpo_mesh mesh = { 0 };
    mesh.vertex_count = (uint64_t)n * n * n;
    mesh.xyz32 = malloc(mesh.vertex_count * 3 * sizeof *mesh.xyz32);
    mesh.faces = malloc((uint64_t)faces * 3 * sizeof *mesh.faces);
    ck_assert(mesh.xyz32 && mesh.faces);
    for (uint32_t v = 0; v < mesh.vertex_count; v++) {
        mesh.xyz32[3 * v] = (float)(v % n);
        mesh.xyz32[3 * v + 1] = (float)(v / n % n);
        mesh.xyz32[3 * v + 2] = (float)(v / n / n);
    }
    while (mesh.face_count < faces) {
        uint32_t *f = mesh.faces + 3 * mesh.face_count;
        for (int i = 0; i < 3; i++)
            f[i] = (uint32_t)(ebpo_test_random(&seed) % mesh.vertex_count);
        mesh.face_count +=
            !on_a_line(&mesh.xyz32[3 * f[0]], &mesh.xyz32[3 * f[1]], &mesh.xyz32[3 * f[2]]);
    }
    return mesh;
}

START_TEST(test_crossings_of_grid_soups)
{
    for (uint64_t i = 0; i < ebpo_test_scaled(60); i++) {
        ebpo_mesh mesh = make_soup(2 + (uint32_t)(i % 4), 6 + 3 * (uint32_t)i, 77 + i);
        check_mesh(&mesh);
    }
}
END_TEST

/* --- solids --- */

/* Makes two copies that are `apart` from each other, or overlap. */
static ebpo_mesh make_two(uint32_t cut, double apart)
{
    const double here[3] = { 0, 0, 0 }, there[3] = { apart, 0.1, 0.2 };
    ebpo_mesh mesh = ebpo_test_sphere(here, 1, cut), other = ebpo_test_sphere(there, 1, cut);
    ebpo_test_append(&mesh, &other);
    ebpo_mesh_free(&other);
    ebpo_test_shuffle(&mesh, 5);
    ebpo_test_to_float(&mesh);
    return mesh;
}

START_TEST(test_crossings_of_nested_spheres)
{
    ebpo_mesh apart = make_two(2, 3), near = make_two(2, 1.1),
              many = make_two(ebpo_test_scale() < 1 ? 3 : 4, 1.2);
    ck_assert_uint_eq(check_mesh(&apart), 0);
    ck_assert_uint_gt(check_mesh(&near), 20);
    ck_assert_uint_gt(check_mesh(&many), 60);
}
END_TEST

/* Tests a face that occurs twice in opposite orientations, and a fold. */
START_TEST(test_crossings_of_coincident_faces)
{
    ebpo_mesh mesh = make_soup(2, 1, 3);
    uint32_t faces[4][3] = { { 0, 1, 2 }, { 2, 1, 0 }, { 1, 2, 3 }, { 0, 1, 3 } };
    mesh.faces = realloc(mesh.faces, sizeof faces);
    memcpy(mesh.faces, faces, sizeof faces);
    mesh.face_count = 4;
    found f = look(&mesh, 1, 0);
    /* faces 0 and 1 coincide; face 3 overlaps both of them, and face 2 overlaps them partly */
    ck_assert_uint_eq(f.count, 4);
    ck_assert_uint_eq(f.sum.pairs[EBPO_PAIR_COPLANAR], 4);
    ck_assert_uint_eq(f.sum.faces, 4);
    ebpo_mesh_free(&mesh);
    free(f.at);
}
END_TEST

static bool take_one(void *user, const ebpo_self_intersection *crossings, uint64_t count)
{
    (void)crossings;
    *(uint64_t *)user += count;
    return false;
}

START_TEST(test_crossings_stop_on_request)
{
    ebpo_mesh mesh = make_two(3, 1.1);
    ebpo_mesh_report report;
    uint64_t count = 0;
    ASSERT_OK(ebpo_mesh_check(&mesh, 1, (ebpo_progress){ NULL, NULL }, &report, error));
    ASSERT_OK(ebpo_mesh_self_intersections(&mesh, &report, NULL, take_one, &count, NULL, error));
    ck_assert_uint_gt(count, 0);
}
END_TEST

TEST_SUITE(crossings)
{
    Suite *suite = suite_create("crossings");
    TCase *tests = tcase_create("meshes");
    tcase_set_timeout(tests, 600);
    tcase_add_test(tests, test_crossings_of_grid_soups);
    tcase_add_test(tests, test_crossings_of_nested_spheres);
    tcase_add_test(tests, test_crossings_of_coincident_faces);
    tcase_add_test(tests, test_crossings_stop_on_request);
    suite_add_tcase(suite, tests);
    return suite;
}
