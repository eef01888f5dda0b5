/* Reading OBJ, STL and OFF. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <ebpo/mesh.h>

#include "core/endian.h"
#include "check_main.h"
#include "core/workspace.h"
#include "mesh/import.h"
#include "mesh/import_build.h"

static ebpo_status import(ebpo_mesh *mesh, const char *name, const void *data, size_t size,
                          ebpo_error *error)
{
    uint8_t *exact = malloc(size ? size : 1);
    memcpy(exact, data, size);
    ebpo_status status = EBPO_E_ARGUMENT;
    const ebpo_import_job job = { .data = exact, .size = size, .name = name, .attributes = true };
    const ebpo_import_format *format = ebpo_import_recognise(exact, size, name);
    if (format)
        status = ebpo_import_memory(mesh, format, &job, error);
    free(exact);
    return status;
}

static const ebpo_import_format *recognise_text(const char *text, const char *name)
{
    return ebpo_import_recognise((const uint8_t *)text, strlen(text), name);
}

START_TEST(test_import_format_by_content_then_name)
{
    uint8_t stl[134] = { 0 };
    stl[80] = 1;
    ck_assert_ptr_eq(ebpo_import_recognise(stl, sizeof stl, "x"), &ebpo_import_stl);
    ck_assert_ptr_null(ebpo_import_recognise(stl, sizeof stl - 1, "x"));
    ck_assert_ptr_eq(recognise_text("OFF\n", "x.obj"), &ebpo_import_off);
    ck_assert_ptr_null(recognise_text("OFFER", "x"));
    ck_assert_ptr_eq(recognise_text("solid a\n", "x"), &ebpo_import_stl);
    ck_assert_ptr_eq(recognise_text("v 0 0 0\n", "a.OBJ"), &ebpo_import_obj);
    ck_assert_ptr_eq(recognise_text("ply\n", "a.off"), &ebpo_import_ply);
    ck_assert_ptr_eq(recognise_text("v 0 0 0\n", "a.ply"), &ebpo_import_obj);
    ck_assert_ptr_eq(recognise_text("version\n", "a.PLY"), &ebpo_import_ply);
    ck_assert_ptr_null(recognise_text("", "obj"));
}
END_TEST

START_TEST(test_import_weld_keeps_first_position)
{
    float xyz[] = { 0, 1, 2, -0.0f, 1, 2, 3, 4, 5, 0, 1, 2, 6, 7, 8 };
    uint32_t map[5];
    uint64_t left;
    ck_assert(ebpo_import_weld(xyz, false, 5, map, &left, NULL) == EBPO_OK);
    ck_assert(left == 3 && map[0] == 0 && map[1] == 0 && map[2] == 1 && map[3] == 0 && map[4] == 2);
    ck_assert(xyz[3] == 3 && xyz[6] == 6 && xyz[8] == 8);
}
END_TEST

/* Binary fractions, which any reader of decimals reads exactly. */
static const float corner[4][3] = {
    { 0.5f, 0.25f, 0.125f }, { 2, 0.25f, 0.125f }, { 0.5f, 3, 0.125f }, { 0.5f, 0.25f, -4 }
};
static const uint32_t face[4][3] = { { 0, 1, 2 }, { 0, 3, 1 }, { 1, 3, 2 }, { 2, 3, 0 } };

/* Checks the four faces in their order, each with its corners in their order. */
static void check_tetrahedron(const ebpo_mesh *mesh, const char *format)
{
    ck_assert(mesh->vertex_count == 4 && mesh->face_count == 4 && mesh->xyz32 && !mesh->xyz64);
    ck_assert_str_eq(mesh->source_format, format);
    for (int i = 0; i < 12; i++)
        ck_assert(memcmp(mesh->xyz32 + 3 * mesh->faces[i], corner[face[i / 3][i % 3]],
                         sizeof corner[0]) == 0);
}

START_TEST(test_import_obj_keeps_faces_and_welds)
{
    static const char obj[] = "mtllib /etc/passwd\no a\nv 0.5 0.25 0.125\nv 2 0.25 0.125\nv 0.5 3 "
                              "0.125\nv 0.5 0.25 -4\nvn 0 0 1\n"
                              "f 1//1 2//1 3//1\nf 1 4 2\nf -3 -1 -2\nf 3 4 1\n";
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(import(&mesh, "t.obj", obj, sizeof obj - 1, &error) == EBPO_OK, "%s",
                  error.message);
    check_tetrahedron(&mesh, "obj");
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_import_off_keeps_face_order)
{
    static const char off[] = "OFF\n# made here\n4 4 6\n0.5 0.25 0.125\n2 0.25 0.125\n0.5 3 "
                              "0.125\n0.5 0.25 -4\n3 0 1 2\n3 0 3 1\n3 1 3 2\n3 2 3 0\n";
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(import(&mesh, "t.off", off, sizeof off - 1, &error) == EBPO_OK, "%s",
                  error.message);
    check_tetrahedron(&mesh, "off");
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_import_stl_is_welded)
{
    uint8_t binary[84 + 4 * 50] = "solid, although binary";
    char ascii[4096] = "solid t\n";
    ebpo_store32(binary + 80, 4);
    for (int i = 0; i < 4; i++) {
        strcat(ascii, "facet normal 0 0 1\nouter loop\n");
        for (int k = 0; k < 3; k++) {
            const float *p = corner[face[i][k]];
            for (int a = 0; a < 3; a++) {
                uint32_t bits;
                memcpy(&bits, p + a, sizeof bits);
                ebpo_store32(binary + 84 + 50 * i + 12 + 12 * k + 4 * a, bits);
            }
            sprintf(ascii + strlen(ascii), "vertex %g %g %g\n", (double)p[0], (double)p[1],
                    (double)p[2]);
        }
        strcat(ascii, "endloop\nendfacet\n");
    }
    strcat(ascii, "endsolid t\n");
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(import(&mesh, "b", binary, sizeof binary, &error) == EBPO_OK, "%s",
                  error.message);
    check_tetrahedron(&mesh, "stl");
    ebpo_mesh_free(&mesh);
    ck_assert_msg(import(&mesh, "a.stl", ascii, strlen(ascii), &error) == EBPO_OK, "%s",
                  error.message);
    check_tetrahedron(&mesh, "stl");
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_import_obj_polygons_are_triangulated)
{
    static const char obj[] = "v 0 0 0\nv 1 0 0\nv 0.25 0.25 0\nv 0 1 0\nf 1 2 3 4\n";
    ebpo_mesh mesh;
    ck_assert(import(&mesh, "t.obj", obj, sizeof obj - 1, NULL) == EBPO_OK);
    ck_assert(mesh.face_count == 2 && mesh.polygons_triangulated == 1 &&
              mesh.polygons_concave == 1);
    ebpo_mesh_free(&mesh);
}
END_TEST

static const struct {
    const char *name, *content, *message;
} bad[] = {
    { "t.obj", "", "t.obj: " },
    { "t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "t.obj: " },
    { "t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "t.obj: " },
    { "t.off", "OFF\n", "counts of vertices" },
    { "t.off", "OFF\n#x", "counts of vertices" },
    { "t.off", "OFF\n4000000000 1 0\n0 0 0\n",
      "4000000000 vertices and 1 faces do not fit into a file of 25 bytes" },
    { "t.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n",
      "line 6: face 0 names vertex 3, but there are 3 vertices" },
    { "t.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n",
      "line 6: face 0 names fewer than its 3" },
    { "t.off", "OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n3 0 1 2\n",
      "line 4: vertex 1 has fewer than three coordinates" },
    { "t.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "the file ends before face 1" },
    { "t.off", "OFF\n3 1 0 2.5\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "line 2: counts of vertices" },
    { "t.stl", "not an stl file at all", "t.stl: " },
    { "t.stl", "solid x\nendsolid x\n", "t.stl: " },
};

/* Makes a strip of squares whose vertices have colours; a coordinate of the last vertex ends with
 * `digits`. */
static char *long_strip(unsigned squares, const char *digits)
{
    char *text = malloc(squares * 120 + 100), *at = text;
    for (unsigned i = 0; i <= squares; i++)
        at += sprintf(at, "v %u 0 0.%u%s 1 0 0\nv %u 1 0 0 1 0\n", i, i % 7 + 1,
                      i == squares ? digits : "", i);
    for (unsigned i = 0; i < squares; i++)
        at += sprintf(at, "f %u %u %u %u\n", 2 * i + 1, 2 * i + 3, 2 * i + 4, 2 * i + 2);
    return text;
}

/* Arrays that exceed the budget are stored in files, and the mesh is the same: with floats, and
 * with doubles, which the file needs only at its last vertex. */
START_TEST(test_import_result_ignores_memory_budget)
{
    ebpo_mesh mesh, within;
    ebpo_workspace *w;
    ebpo_error error = EBPO_ERROR_INIT;
    char *text = long_strip(20000, _i ? "00000000001" : "");
    ck_assert(ebpo_workspace_make_any(&w, 1 << 20, NULL, &error) == EBPO_OK);
    ebpo_import_job job = {
        .data = (const uint8_t *)text, .size = strlen(text), .name = "a.obj", .attributes = true
    };
    ck_assert(ebpo_import_memory(&mesh, &ebpo_import_obj, &job, &error) == EBPO_OK);
    job.workspace = w;
    ck_assert_msg(ebpo_import_memory(&within, &ebpo_import_obj, &job, &error) == EBPO_OK, "%s",
                  error.message);
    ck_assert(mesh.face_count == 40000 && mesh.vertex_count == 40002);
    ck_assert(within.face_count == 40000 && within.vertex_count == 40002);
    ck_assert_mem_eq(mesh.faces, within.faces, mesh.face_count * 12);
    ck_assert(!mesh.xyz64 == !_i && !within.xyz64 == !_i);
    if (_i)
        ck_assert_mem_eq(mesh.xyz64, within.xyz64, mesh.vertex_count * 24);
    else
        ck_assert_mem_eq(mesh.xyz32, within.xyz32, mesh.vertex_count * 12);
    free(text);
    ebpo_mesh_free(&mesh);
    ebpo_mesh_free(&within);
    ebpo_workspace_free(w);
}
END_TEST

/* Decimal numbers become the nearest floats. For these numbers, other readers return neighbouring
 * floats. */
START_TEST(test_import_numbers_are_rounded_correctly)
{
    static const char obj[] = "v 2.96501994e-01 5.3e-31 16777216.0000000000\n"
                              "v 0.296502 1e-45 3.4028235e38\nv .5 -5. +1E2\nf 1 2 3\n";
    static const float right[] = { 0.296502f,      5.3e-31f, 16777216, 0.296502f, 1e-45f,
                                   3.4028235e+38f, 0.5f,     -5,       100 };
    ebpo_mesh mesh;
    ck_assert(import(&mesh, "t.obj", obj, sizeof obj - 1, NULL) == EBPO_OK);
    ck_assert_mem_eq(mesh.xyz32, right, sizeof right);
    ebpo_mesh_free(&mesh);
}
END_TEST

#define UTM_FACET(a, b, c) "facet\nouter loop\nvertex " a "\nvertex " b "\nvertex " c "\nendloop\n"
#define UTM_A              "691234.567 5334567.891 0.1"
#define UTM_B              "691246.912 5334567.891 519.25"
#define UTM_C              "691246.912 5334567.892 519.25"
#define UTM_D              "1.1 -0.000 1e39"

/* When floats cannot represent a coordinate, all coordinates become the nearest doubles, and
 * vertices with equal doubles are merged. B and C are equal as floats. */
START_TEST(test_import_doubles_when_floats_lose_digits)
{
    static const struct {
        const char *name, *text;
    } files[] = {
        { "t.obj", "v 0 0 0\nv " UTM_A "\nv " UTM_B "\nv " UTM_C "\nv " UTM_D "\nv " UTM_A
                   "\ng a\nf 2 3 4\nf 6 4 5\n" },
        { "t.off",
          "OFF 5 2 0\n" UTM_A "\n" UTM_B "\n" UTM_C "\n" UTM_D "\n" UTM_A "\n3 0 1 2\n3 4 2 3\n" },
        { "t.stl", "solid\n" UTM_FACET(UTM_A, UTM_B, UTM_C) "endfacet\n" UTM_FACET(
                       UTM_A, UTM_C, UTM_D) "endfacet\nendsolid\n" },
    };
    static const double right[] = { 691234.567,  5334567.891, 0.1,        691246.912,
                                    5334567.891, 519.25,      691246.912, 5334567.892,
                                    519.25,      1.1,         -0.0,       1e39 };
    static const uint32_t corners[] = { 0, 1, 2, 0, 2, 3 };
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(import(&mesh, files[_i].name, files[_i].text, strlen(files[_i].text), &error) ==
                      EBPO_OK,
                  "%s", error.message);
    ck_assert(mesh.vertex_count == 4 && mesh.face_count == 2 && !mesh.xyz32);
    ck_assert_mem_eq(mesh.xyz64, right, sizeof right);
    ck_assert_mem_eq(mesh.faces, corners, sizeof corners);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* Coordinates divided by a weight have no decimal text. Floats are used when they are exact. */
START_TEST(test_import_floats_for_exact_quotients)
{
    static const char exact[] = "v 0 0 0 1\nv 2 0 0 2.0\nv 0 0.1 0 1\nf 1 2 3\n",
                      inexact[] = "v 0 0 0 1\nv 2 0 0 3\nv 0 0.1 0 1\nf 1 2 3\n",
                      off[] = "4OFF 3 1 0\n0 0 0 1\n2 0 0 3\n0 0.1 0 1\n3 0 1 2\n";
    ebpo_mesh mesh;
    ck_assert(import(&mesh, "t.obj", exact, sizeof exact - 1, NULL) == EBPO_OK);
    ck_assert(mesh.xyz32 && mesh.xyz32[3] == 1 && mesh.xyz32[7] == 0.1f);
    ebpo_mesh_free(&mesh);
    ck_assert(import(&mesh, "t.obj", inexact, sizeof inexact - 1, NULL) == EBPO_OK);
    ck_assert(mesh.xyz64 && mesh.xyz64[3] == 2.0 / 3 && mesh.xyz64[7] == 0.1);
    ebpo_mesh_free(&mesh);
    ck_assert(import(&mesh, "t.off", off, sizeof off - 1, NULL) == EBPO_OK);
    ck_assert(mesh.xyz64 && mesh.xyz64[3] == 2.0 / 3 && mesh.xyz64[7] == 0.1);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_import_damaged_files_are_refused)
{
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_int_eq(import(&mesh, bad[_i].name, bad[_i].content, strlen(bad[_i].content), &error),
                     EBPO_E_FORMAT);
    ck_assert_msg(strstr(error.message, bad[_i].message) != NULL, "%s", error.message);
    ck_assert(!mesh.faces && !mesh.xyz32);
}
END_TEST

START_TEST(test_import_glmark2_bunny_is_closed)
{
    static const char path[] = "/usr/share/glmark2/models/bunny.obj";
    static const ebpo_progress silent = { NULL, NULL };
    ebpo_mesh mesh;
    ebpo_mesh_report report;
    ebpo_error error = EBPO_ERROR_INIT;
    if (access(path, R_OK) != 0)
        return;
    ck_assert_msg(ebpo_mesh_read(path, NULL, &mesh, &error) == EBPO_OK, "%s", error.message);
    ck_assert(mesh.vertex_count == 34835 && mesh.face_count == 69666);
    ck_assert(ebpo_mesh_check(&mesh, 1, silent, &report, &error) == EBPO_OK);
    ck_assert(report.manifold && report.balanced && report.boundary_edges.count == 0);
    ebpo_mesh_free(&mesh);
}
END_TEST

TEST_SUITE(import)
{
    TCase *tests = tcase_create("import");
    tcase_set_timeout(tests, 60);
    tcase_add_test(tests, test_import_format_by_content_then_name);
    tcase_add_test(tests, test_import_weld_keeps_first_position);
    tcase_add_test(tests, test_import_obj_keeps_faces_and_welds);
    tcase_add_test(tests, test_import_off_keeps_face_order);
    tcase_add_test(tests, test_import_stl_is_welded);
    tcase_add_test(tests, test_import_obj_polygons_are_triangulated);
    tcase_add_loop_test(tests, test_import_result_ignores_memory_budget, 0, 2);
    tcase_add_test(tests, test_import_numbers_are_rounded_correctly);
    tcase_add_loop_test(tests, test_import_doubles_when_floats_lose_digits, 0, 3);
    tcase_add_test(tests, test_import_floats_for_exact_quotients);
    tcase_add_loop_test(tests, test_import_damaged_files_are_refused, 0,
                        (int)(sizeof bad / sizeof *bad));
    tcase_add_test(tests, test_import_glmark2_bunny_is_closed);
    Suite *suite = suite_create("import");
    suite_add_tcase(suite, tests);
    return suite;
}
