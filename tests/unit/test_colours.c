/* Tests colours in the attributes of a mesh: of every type, by their names, of vertices and of
 * faces. */
#include <stdio.h>
#include <string.h>

#include <ebpo/colours.h>

#include "check_main.h"
#include "scratch.h"

/* Reads a triangle with attributes of vertices and of the face; each text has lines of a PLY
 * header, a "|", and the values of the first row. */
static ebpo_colours colours_of(const char *vertex, const char *face, ebpo_error *error)
{
    ebpo_mesh mesh;
    ebpo_colours out;
    ebpo_mesh_read_options options = EBPO_MESH_READ_OPTIONS_INIT;
    options.attributes = 1;
    FILE *f = fopen(scratch("colours.ply"), "w");
    int head[2] = { (int)strcspn(vertex, "|"), (int)strcspn(face, "|") };
    ck_assert(f);
    fprintf(f,
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
            "property float z\n%.*selement face 1\nproperty list uchar int vertex_indices\n"
            "%.*send_header\n",
            head[0], vertex, head[1], face);
    for (int i = 0; i < 3; i++)
        fprintf(f, "%d %d 0 %s\n", i == 1, i == 2, vertex[head[0]] ? vertex + head[0] + 1 : "");
    fprintf(f, "3 0 1 2 %s\n", face[head[1]] ? face + head[1] + 1 : "");
    fclose(f);
    ck_assert_msg(ebpo_mesh_read(scratch("colours.ply"), &options, &mesh, error) == EBPO_OK, "%s",
                  error->message);
    ck_assert_int_eq(ebpo_mesh_colours(&mesh, &out, error), EBPO_OK);
    ebpo_mesh_free(&mesh);
    return out;
}

#define RGB(type, before)                                                                \
    "property " type " " before "red\nproperty " type " " before "green\nproperty " type \
    " " before "blue\n"

START_TEST(test_colours_convert_to_bytes)
{
    static const struct {
        const char *vertex;
        uint8_t rgba[4];
    } rows[] = {
        { RGB("uchar", "") "|1 128 255", { 1, 128, 255, 255 } },
        { RGB("uchar", "") "property uchar alpha\n|1 128 255 7", { 1, 128, 255, 7 } },
        { RGB("ushort", "") "|0 32896 65535", { 0, 128, 255, 255 } },
        { RGB("float", "") "|0 0.5 1", { 0, 128, 255, 255 } },
        { RGB("double", "") "|-1 nan 7", { 0, 0, 255, 255 } },
        { RGB("int", "") "|-5 9 300", { 0, 9, 255, 255 } },
        { RGB("uchar", "diffuse_") "|1 2 3", { 1, 2, 3, 255 } },
        { RGB("uchar", "diffuse_") RGB("uchar", "") "|1 2 3 4 5 6", { 4, 5, 6, 255 } },
        /* the columns are neither adjacent nor of one type */
        { "property float blue\nproperty float quality\nproperty uchar red\n"
          "property ushort green\n|1 0.25 3 65535",
          { 3, 255, 255, 255 } },
    };
    ebpo_error error = EBPO_ERROR_INIT;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        ebpo_colours c = colours_of(rows[i].vertex, "", &error);
        ck_assert(c.vertex && !c.face && !c.by_face);
        for (size_t v = 0; v < 3; v++)
            ck_assert_mem_eq(c.vertex + 4 * v, rows[i].rgba, 4);
        ebpo_colours_free(&c);
        ck_assert(!c.vertex);
    }
}
END_TEST

START_TEST(test_colours_invalid_values_are_ignored)
{
    static const char *const rows[] = {
        "",
        "property uchar red\nproperty uchar green\n|1 2",
        "property list uchar uchar red\nproperty uchar green\nproperty uchar blue\n|1 1 2 3",
        "property uchar reds\nproperty uchar green\nproperty uchar blue\n|1 2 3",
    };
    ebpo_error error = EBPO_ERROR_INIT;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        ebpo_colours c = colours_of(rows[i], rows[i], &error);
        ck_assert(!c.vertex && !c.face && !c.by_face);
        ebpo_colours_free(&c);
    }
}
END_TEST

/* Some programs write white for all vertices when only faces have colours. */
START_TEST(test_colours_prefer_faces_over_equal_vertices)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_colours c = colours_of(RGB("uchar", "") "|255 255 255", RGB("float", "") "|1 0 0", &error);
    ck_assert(c.vertex && c.face && c.by_face);
    ck_assert_mem_eq(c.face, ((uint8_t[]){ 255, 0, 0, 255 }), 4);
    ebpo_colours_free(&c);
    c = colours_of("", RGB("uchar", "") "|9 8 7", &error);
    ck_assert(!c.vertex && c.face && c.by_face);
    ebpo_colours_free(&c);
    ebpo_colours_free(NULL);
}
END_TEST

TEST_SUITE(colours)
{
    Suite *suite = suite_create("colours");
    TCase *tests = tcase_create("colours");
    tcase_add_checked_fixture(tests, scratch_enter, scratch_leave);
    tcase_add_test(tests, test_colours_convert_to_bytes);
    tcase_add_test(tests, test_colours_invalid_values_are_ignored);
    tcase_add_test(tests, test_colours_prefer_faces_over_equal_vertices);
    suite_add_tcase(suite, tests);
    return suite;
}
