/* OBJ, STL and OFF through assimp. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <ebpo/mesh.h>

#include "base/endian.h"
#include "check_main.h"
#include "base/arrays.h"
#include "ebpo_config.h"
#include "import/import.h"
#include "import/corner_weld.h"

static ebpo_status import(ebpo_mesh *mesh, const char *name, const void *data, size_t size,
                          ebpo_error *error)
{
    ebpo_import_format format;
    uint8_t *exact = malloc(size ? size : 1);
    memcpy(exact, data, size);
    ebpo_status status = EBPO_E_ARGUMENT;
    if (ebpo_import_recognise(&format, exact, size, name))
        status = ebpo_import_memory(mesh, format, exact, size, name, NULL, true, error);
    free(exact);
    return status;
}

START_TEST(formats_are_told_by_bytes_then_by_name)
{
    ebpo_import_format format;
    uint8_t stl[134] = { 0 };
    stl[80] = 1;
    ck_assert(ebpo_import_recognise(&format, stl, sizeof stl, "x") && format == EBPO_IMPORT_STL);
    ck_assert(!ebpo_import_recognise(&format, stl, sizeof stl - 1, "x"));
    ck_assert(ebpo_import_recognise(&format, (const uint8_t *)"OFF\n", 4, "x.obj") &&
              format == EBPO_IMPORT_OFF);
    ck_assert(!ebpo_import_recognise(&format, (const uint8_t *)"OFFER", 5, "x"));
    ck_assert(ebpo_import_recognise(&format, (const uint8_t *)"solid a\n", 8, "x") &&
              format == EBPO_IMPORT_STL);
    ck_assert(ebpo_import_recognise(&format, (const uint8_t *)"v 0 0 0\n", 8, "a.OBJ") &&
              format == EBPO_IMPORT_OBJ);
    ck_assert(!ebpo_import_recognise(&format, (const uint8_t *)"", 0, "obj"));
}
END_TEST

START_TEST(weld_keeps_the_first_of_each_position)
{
    float xyz[] = { 0, 1, 2, -0.0f, 1, 2, 3, 4, 5, 0, 1, 2, 6, 7, 8 };
    uint32_t map[5];
    uint64_t left;
    ck_assert(ebpo_import_weld(xyz, 5, map, &left, NULL) == EBPO_OK);
    ck_assert(left == 3 && map[0] == 0 && map[1] == 0 && map[2] == 1 && map[3] == 0 && map[4] == 2);
    ck_assert(xyz[3] == 3 && xyz[6] == 6 && xyz[8] == 8);
}
END_TEST

#if EBPO_HAVE_ASSIMP

/* Binary fractions: exact in any decimal reader. */
static const float corner[4][3] = {
    { 0.5f, 0.25f, 0.125f }, { 2, 0.25f, 0.125f }, { 0.5f, 3, 0.125f }, { 0.5f, 0.25f, -4 }
};
static const uint32_t face[4][3] = { { 0, 1, 2 }, { 0, 3, 1 }, { 1, 3, 2 }, { 2, 3, 0 } };

/* The four faces in their order, each with its corners in their order. */
static void check_tetrahedron(const ebpo_mesh *mesh, const char *format)
{
    ck_assert(mesh->vertex_count == 4 && mesh->face_count == 4 && mesh->xyz32 && !mesh->xyz64);
    ck_assert_str_eq(mesh->source_format, format);
    for (int i = 0; i < 12; i++)
        ck_assert(memcmp(mesh->xyz32 + 3 * mesh->faces[i], corner[face[i / 3][i % 3]],
                         sizeof corner[0]) == 0);
}

START_TEST(obj_keeps_faces_in_order_and_welds_corners)
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

START_TEST(off_keeps_faces_in_order)
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

START_TEST(stl_of_both_kinds_is_welded)
{
    uint8_t binary[84 + 4 * 50] = "solid, although binary";
    char ascii[4096] = "solid t\n";
    ebpo_store32(binary + 80, 4);
    for (int i = 0; i < 4; i++) {
        strcat(ascii, "facet normal 0 0 1\nouter loop\n");
        for (int k = 0; k < 3; k++) {
            const float *p = corner[face[i][k]];
            memcpy(binary + 84 + 50 * i + 12 + 12 * k, p, 12);
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

START_TEST(polygons_of_obj_are_cut_by_ears)
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
    { "t.off", "OFF\n", "no counts" },
    { "t.off", "OFF\n#x", "no counts" },
    { "t.off", "OFF\n4000000000 1 0\n0 0 0\n",
      "4000000000 vertices and 1 faces do not fit into a file of 25 bytes" },
    { "t.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n",
      "line 6: face 0 names vertex 3, but there are 3 vertices" },
    { "t.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n",
      "line 6: face 0 names fewer than its 3" },
    { "t.off", "OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n3 0 1 2\n",
      "line 4: vertex 1 has no three coordinates" },
    { "t.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "the file ends before face 1" },
    { "t.off", "OFF\n3 1 0 2.5\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "line 2: no counts" },
    { "t.stl", "not an stl file at all", "t.stl: " },
    { "t.stl", "solid x\nendsolid x\n", "t.stl: " },
};

START_TEST(off_faces_that_assimp_would_leave_out_are_refused)
{
    static const char off[] = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n10 0 1 2 0 1 2 0 1 2 0\n";
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert(import(&mesh, "t.off", off, sizeof off - 1, &error) == EBPO_E_UNSUPPORTED);
    ck_assert(strstr(error.message, "line 6: face 0 has 10 corners") != NULL);
}
END_TEST

START_TEST(what_assimp_would_take_too_much_memory_for_is_refused)
{
    ebpo_mesh mesh;
    ebpo_workspace *w;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert(ebpo_workspace_make_any(&w, 1 << 20, NULL, &error) == EBPO_OK);
    static char text[300000] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    memset(text + strlen(text), '\n', sizeof text - strlen(text));
    ck_assert_int_eq(ebpo_import_memory(&mesh, EBPO_IMPORT_OBJ, (const uint8_t *)text, sizeof text,
                                        "a.obj", w, true, &error),
                     EBPO_E_LIMIT);
    ck_assert_msg(strstr(error.message, "a.obj: reading it takes some 3 MiB") &&
                      strstr(error.message, "1 MiB are allowed"),
                  "%s", error.message);
    ck_assert_msg(ebpo_import_memory(&mesh, EBPO_IMPORT_OBJ, (const uint8_t *)text, 100000, "a.obj",
                                     w, true, &error) == EBPO_OK,
                  "%s", error.message);
    ck_assert_uint_eq(mesh.face_count, 1);
    ebpo_mesh_free(&mesh);
    ebpo_workspace_free(w);
}
END_TEST

START_TEST(damaged_files_are_refused_by_name)
{
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_int_eq(import(&mesh, bad[_i].name, bad[_i].content, strlen(bad[_i].content), &error),
                     EBPO_E_FORMAT);
    ck_assert_msg(strstr(error.message, bad[_i].message) != NULL, "%s", error.message);
    ck_assert(!mesh.faces && !mesh.xyz32);
}
END_TEST

START_TEST(bunny_of_glmark2_is_closed_when_it_is_there)
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

#else

START_TEST(build_without_assimp_says_what_to_install)
{
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert(import(&mesh, "t.obj", "v 0 0 0\n", 8, &error) == EBPO_E_UNSUPPORTED);
    ck_assert(strstr(error.message, "libassimp-dev") != NULL);
}
END_TEST

#endif

Suite *test_suite(void)
{
    TCase *tests = tcase_create("import");
    tcase_set_timeout(tests, 60);
    tcase_add_test(tests, formats_are_told_by_bytes_then_by_name);
    tcase_add_test(tests, weld_keeps_the_first_of_each_position);
#if EBPO_HAVE_ASSIMP
    tcase_add_test(tests, obj_keeps_faces_in_order_and_welds_corners);
    tcase_add_test(tests, off_keeps_faces_in_order);
    tcase_add_test(tests, stl_of_both_kinds_is_welded);
    tcase_add_test(tests, polygons_of_obj_are_cut_by_ears);
    tcase_add_test(tests, off_faces_that_assimp_would_leave_out_are_refused);
    tcase_add_test(tests, what_assimp_would_take_too_much_memory_for_is_refused);
    tcase_add_loop_test(tests, damaged_files_are_refused_by_name, 0,
                        (int)(sizeof bad / sizeof *bad));
    tcase_add_test(tests, bunny_of_glmark2_is_closed_when_it_is_there);
#else
    tcase_add_test(tests, build_without_assimp_says_what_to_install);
#endif
    Suite *suite = suite_create("import");
    suite_add_tcase(suite, tests);
    return suite;
}
