/* Tests data of OBJ, STL and OFF files besides positions and corners, which become attributes of
 * the mesh. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/mesh.h>

#include "mesh/attributes.h"
#include "core/endian.h"
#include "check_main.h"
#include "mesh/import.h"

static ebpo_mesh mesh;

static void import(const ebpo_import_format *format, const void *data, size_t size)
{
    ebpo_error error = EBPO_ERROR_INIT;
    uint8_t *exact = malloc(size);
    memcpy(exact, data, size);
    const ebpo_import_job job = {
        .data = exact, .size = size, .name = "model", .attributes = true
    };
    ebpo_status status = ebpo_import_memory(&mesh, format, &job, &error);
    free(exact);
    ck_assert_msg(status == EBPO_OK, "%s", error.message);
}

static void import_text(const ebpo_import_format *format, const char *text)
{
    import(format, text, strlen(text));
}

/* Finds the array with these names, whose rows belong to the element. */
static const ebpo_attribute *find(const char *element, const char *names)
{
    for (uint64_t i = 0; mesh.attributes && i < mesh.attributes->count; i++) {
        const ebpo_attribute *a = &mesh.attributes->array[i];
        bool face = strcmp(element, "face") == 0;
        if (strcmp(a->names, names) != 0 || !ebpo_attribute_is_of(a, element))
            continue;
        ck_assert_uint_eq(a->rows, face ? mesh.face_count : mesh.vertex_count);
        return a;
    }
    return NULL;
}

static void expect_floats(const ebpo_attribute *a, bool list, const float *values, uint64_t count)
{
    ck_assert_ptr_nonnull(a);
    ck_assert(a->type == EBPO_ATTRIBUTE_FLOAT32 && (a->list != EBPO_ATTRIBUTE_NO_LIST) == list);
    ck_assert_uint_eq(ebpo_attribute_value_count(a), count);
    ck_assert_mem_eq(a->values, values, count * sizeof *values);
}

/* Vertices are numbered by first use: 1, 3, 2, 4. */
#define POSITIONS "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
#define FACES     "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"

START_TEST(test_import_vertex_values_when_unique)
{
    static const float colours[] = { 1, 0, 0, 0, 0, 1, 0, 1, 0, 0.5f, 0.25f, 0 };
    static const float normals[] = { 0, 0, -1, 0, 1, 0, 1, 0, 0, 0, 0, 1 };
    static const float texture[] = { 0, 0, 0, 0.5f, 0.5f, 0, 1, 1 };
    import_text(&ebpo_import_obj,
                "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nv 0 0 1 0.5 0.25 0\n"
                "vn 0 0 -1\nvn 1 0 0\nvn 0 1 0\nvn 0 0 1\nvt 0 0\nvt 0.5 0\nvt 0 0.5\nvt 1 1\n"
                "f 1/1/1 3/3/3 2/2/2\nf 1/1/1 2/2/2 4/4/4\nf 1/1/1 4/4/4 3/3/3\n"
                "f 2/2/2 3/3/3 4/4/4\n");
    ck_assert_uint_eq(mesh.attributes->count, 3);
    expect_floats(find("vertex", "red green blue"), false, colours, 12);
    expect_floats(find("vertex", "nx ny nz"), false, normals, 12);
    expect_floats(find("vertex", "s t"), false, texture, 8);
    ck_assert(!mesh.attributes->header && !mesh.attributes->lost[0]);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_import_face_values_and_corner_lists)
{
    static const float normals[] = { 0, 0, -1, 0, -1, 0, -1, 0, 0, 1, 1, 1 };
    static const float texture[] = { 0, 0, 0, 0.5f, 0.5f, 0,    0.5f, 0, 0,    0, 0, 0.5f,
                                     0, 0, 0, 0.5f, 0.5f, 0.5f, 0,    0, 0.5f, 0, 0, 0.5f };
    import_text(&ebpo_import_obj,
                POSITIONS "vn 0 0 -1\nvn 0 -1 0\nvn -1 0 0\nvn 1 1 1\nvt 0 0\nvt 0.5 0\nvt 0 "
                          "0.5\nvt 0.5 0.5\n"
                          "f 1/1/1 3/3/1 2/2/1\nf 1/2/2 2/1/2 4/3/2\nf 1/1/3 4/3/3 3/4/3\n"
                          "f 2/1/4 3/2/4 4/3/4\n");
    ck_assert_uint_eq(mesh.attributes->count, 2);
    expect_floats(find("face", "nx ny nz"), false, normals, 12);
    expect_floats(find("face", "texcoord"), true, texture, 24);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* A quadrilateral is cut into triangles: each corner keeps its values. */
START_TEST(test_import_polygon_corners_keep_values)
{
    import_text(&ebpo_import_obj,
                "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
                "f 1/1 2/2 3/3 4/4\nf 1/2 2/3 5/4\n");
    const ebpo_attribute *a = find("face", "texcoord");
    ck_assert(a && mesh.face_count == 3);
    for (uint64_t i = 0; i < 6; i++) {
        const float *position = mesh.xyz32 + 3 * (uint64_t)mesh.faces[i];
        ck_assert_mem_eq(a->values + i * 2 * sizeof(float), position, 2 * sizeof(float));
    }
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_import_materials_are_indexed)
{
    static const uint32_t numbers[] = { 1, 1, 1, 2 };
    import_text(&ebpo_import_obj, "mtllib a.mtl\ns 1\nusemtl red paint\n" POSITIONS
                                  "f 1 3 2\nf 1 2 4\no here\nf 1 4 3\nusemtl b\nf 2 3 4\n");
    const ebpo_attribute *a = find("face", "material");
    ck_assert(a && a->type == EBPO_ATTRIBUTE_UINT32 && mesh.attributes->count == 1);
    ck_assert_mem_eq(a->values, numbers, sizeof numbers);
    const char *header = mesh.attributes->header;
    ck_assert_ptr_nonnull(header);
    ck_assert_ptr_nonnull(strstr(header, "comment material 1 red paint\ncomment material 2 b\n"));
    ck_assert_str_eq(
        mesh.attributes->lost,
        "smoothing groups; material properties in the library (colours and the like); names "
        "of groups and objects");
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_import_faces_before_first_material)
{
    static const uint32_t numbers[] = { 0, 1 };
    import_text(&ebpo_import_obj, POSITIONS "f 1 3 2\nusemtl a\nf 1 2 4\n");
    const ebpo_attribute *a = find("face", "material");
    ck_assert(a != NULL);
    ck_assert_mem_eq(a->values, numbers, sizeof numbers);
    ck_assert_str_eq(mesh.attributes->lost, "");
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_import_without_attributes_adds_none)
{
    import_text(&ebpo_import_obj, "# only a mesh\ns off\n" POSITIONS FACES);
    ck_assert(!mesh.attributes && !ebpo_mesh_has_attributes(&mesh));
    ebpo_mesh_free(&mesh);
    import_text(&ebpo_import_obj, "o name\ns 0\n" POSITIONS FACES);
    ck_assert(mesh.attributes && !ebpo_mesh_has_attributes(&mesh));
    ck_assert_str_eq(ebpo_mesh_attributes_lost(&mesh), "names of groups and objects");
    ebpo_mesh_free(&mesh);
}
END_TEST

static void import_off(const char *head, const char *vertex, const char *last)
{
    char text[300];
    sprintf(text,
            "%sOFF\n4 4 6\n0 0 0 %s\n1 0 0 %s\n0 1 0 %s\n0 0 1 %s\n"
            "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2 %s\n",
            head, vertex, vertex, vertex, vertex, last);
    import_text(&ebpo_import_off, text);
}

static void expect_bytes(const ebpo_attribute *a, const uint8_t *values, uint64_t count)
{
    ck_assert_ptr_nonnull(a);
    ck_assert(a->type == EBPO_ATTRIBUTE_UINT8 && ebpo_attribute_value_count(a) == count);
    ck_assert_mem_eq(a->values, values, count);
}

START_TEST(test_import_off_vertex_values)
{
    static const uint8_t bytes[] = { 255, 0, 7, 255, 0, 7, 255, 0, 7, 255, 0, 7 };
    static const float normal[] = { 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1 };
    static const float st[] = { 0.25f, 4, 0.25f, 4, 0.25f, 4, 0.25f, 4 };
    static const float part[] = { 0.5f, 0, 1, 0.5f, 0, 1, 0.5f, 0, 1, 0.5f, 0, 1 };
    import_off("", "# a comment", "");
    ck_assert_ptr_null(mesh.attributes);
    ebpo_mesh_free(&mesh);
    import_off("C", "255 0 7", "");
    expect_bytes(find("vertex", "red green blue"), bytes, 12);
    ck_assert(!mesh.attributes->lost[0] && !mesh.attributes->unread[0]);
    ebpo_mesh_free(&mesh);
    import_off("STCN", "0 0 1 0.5 0 1 0.75 0.25 4", "");
    expect_floats(find("vertex", "red green blue"), false, part, 12);
    expect_floats(find("vertex", "nx ny nz"), false, normal, 12);
    expect_floats(find("vertex", "s t"), false, st, 8);
    ck_assert_str_eq(mesh.attributes->lost, "opacity of colours");
    ebpo_mesh_free(&mesh);
    import_off("N", "0 0 1 5", "");
    expect_floats(find("vertex", "nx ny nz"), false, normal, 12);
    ck_assert_str_eq(ebpo_mesh_ignored(&mesh),
                     "vertex values that the file's first word does not declare: 4");
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_import_off_face_colours)
{
    static const uint8_t bytes[] = { 0, 0, 0, 0, 0, 0, 0, 0, 0, 255, 0, 9 };
    import_off("", "", "255 0 9");
    expect_bytes(find("face", "red green blue"), bytes, 12);
    ck_assert_str_eq(mesh.attributes->lost, "missing colours of faces (stored as black): 3");
    ebpo_mesh_free(&mesh);
    import_off("", "", "7");
    ck_assert_str_eq(mesh.attributes->lost, "colours of faces that are indices into a table");
    ck_assert_uint_eq(mesh.attributes->count, 0);
    ebpo_mesh_free(&mesh);
    import_off("C", "1 0 0", "255 0 9");
    ck_assert_str_eq(mesh.attributes->lost, "colours of faces (vertices also have colours)");
    ebpo_mesh_free(&mesh);
}
END_TEST

/* Faces without references have zeros. Values that faces refer to but the file lacks are reported.
 */
START_TEST(test_import_reports_missing_references)
{
    static const float texture[] = { 0.5f, 0.25f, 0, 0, 0, 0, 0, 0, 0, 0, 0.5f, 0.25f };
    import_text(&ebpo_import_obj, POSITIONS "vt 0.5 0.25\nf 1/1 3/2 2/7\nf 1//1 2 4/1\n");
    expect_floats(find("face", "texcoord"), true, texture, 12);
    ck_assert_str_eq(ebpo_mesh_ignored(&mesh),
                     "texture coordinates that faces refer to but the file lacks: 2; "
                     "normals that faces refer to but the file lacks: 1");
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_import_reports_third_texture_coordinate)
{
    import_text(&ebpo_import_obj, POSITIONS "vt 0 0 0.5\nf 1/1 3/1 2/1\nf 1/1 2/1 4/1\n");
    ck_assert_str_eq(mesh.attributes->lost, "the third texture coordinate");
    ebpo_mesh_free(&mesh);
}
END_TEST

/* --- STL --- */

enum { STL_FACES = 4, STL_BYTES = 84 + 50 * STL_FACES };

static void import_stl(const char *head, const uint16_t words[STL_FACES])
{
    static const float position[4][3] = { { 0, 0, 0 }, { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } };
    static const int face[4][3] = { { 0, 2, 1 }, { 0, 1, 3 }, { 0, 3, 2 }, { 1, 2, 3 } };
    uint8_t data[STL_BYTES] = { 0 };
    memcpy(data, head, strlen(head));
    ebpo_store32(data + 80, STL_FACES);
    for (int i = 0; i < STL_FACES; i++) {
        for (int k = 0; k < 3; k++)
            memcpy(data + 84 + 50 * i + 12 + 12 * k, position[face[i][k]], 12);
        data[84 + 50 * i + 48] = (uint8_t)words[i];
        data[84 + 50 * i + 49] = (uint8_t)(words[i] >> 8);
    }
    import(&ebpo_import_stl, data, sizeof data);
}

static void expect_stl(const uint16_t words[STL_FACES], const uint8_t rgb[3 * STL_FACES])
{
    const ebpo_attribute *a = find("face", "attribute"), *c = find("face", "red green blue");
    ck_assert(a && a->type == EBPO_ATTRIBUTE_UINT16);
    ck_assert_mem_eq(a->values, words, STL_FACES * sizeof *words);
    ck_assert(rgb ? c && c->type == EBPO_ATTRIBUTE_UINT8 : !c);
    if (rgb)
        ck_assert_mem_eq(c->values, rgb, 3 * STL_FACES);
    ebpo_mesh_free(&mesh);
}

START_TEST(test_import_stl_colours_follow_header)
{
    static const uint16_t words[STL_FACES] = { 0x801f, 0xfc00, 0x03e0, 0x8210 };
    static const uint8_t viscam[] = { 0, 0, 255, 255, 0, 0, 255, 255, 255, 0, 132, 132 };
    static const uint8_t magics[] = { 7, 8, 9, 7, 8, 9, 0, 255, 0, 7, 8, 9 };
    import_stl("", words);
    expect_stl(words, viscam);
    import_stl("COLOR=\7\10\11\377", words);
    expect_stl(words, magics);
}
END_TEST

START_TEST(test_import_stl_attribute_words_are_kept)
{
    static const uint16_t words[STL_FACES] = { 0, 0x7fff, 3, 0 }, zeros[STL_FACES] = { 0 };
    import_stl("by a scanner", words);
    expect_stl(words, NULL);
    import_stl("by a scanner", zeros);
    ck_assert_ptr_null(mesh.attributes);
    ebpo_mesh_free(&mesh);
}
END_TEST

TEST_SUITE(import_attributes)
{
    TCase *tests = tcase_create("import attributes");
    tcase_add_test(tests, test_import_vertex_values_when_unique);
    tcase_add_test(tests, test_import_face_values_and_corner_lists);
    tcase_add_test(tests, test_import_polygon_corners_keep_values);
    tcase_add_test(tests, test_import_materials_are_indexed);
    tcase_add_test(tests, test_import_faces_before_first_material);
    tcase_add_test(tests, test_import_without_attributes_adds_none);
    tcase_add_test(tests, test_import_off_vertex_values);
    tcase_add_test(tests, test_import_off_face_colours);
    tcase_add_test(tests, test_import_reports_missing_references);
    tcase_add_test(tests, test_import_reports_third_texture_coordinate);
    tcase_add_test(tests, test_import_stl_colours_follow_header);
    tcase_add_test(tests, test_import_stl_attribute_words_are_kept);
    Suite *suite = suite_create("import attributes");
    suite_add_tcase(suite, tests);
    return suite;
}
