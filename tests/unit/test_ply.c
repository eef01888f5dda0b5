/* Tests reading and writing of PLY: dialects, messages, damaged files. */
#include <fcntl.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <ebpo/mesh.h>

#include "core/checksum.h"
#include "check_main.h"
#include "mesh/ply.h"
#include "scratch.h"
#include "solids.h"

/* --- files made here --- */

typedef struct bytes {
    uint8_t data[1 << 16];
    size_t size;
} bytes;

static void put(bytes *b, const void *data, size_t size)
{
    ck_assert(b->size + size <= sizeof b->data);
    memcpy(b->data + b->size, data, size);
    b->size += size;
}

static void text(bytes *b, const char *format, ...) EBPO_PRINTF(2, 3);
static void text(bytes *b, const char *format, ...)
{
    char line[512];
    va_list args;
    va_start(args, format);
    int n = vsnprintf(line, sizeof line, format, args);
    va_end(args);
    put(b, line, (size_t)n);
}

enum encoding { ASCII, LITTLE, BIG };
static const char *const encoding_names[] = { "ascii", "binary_little_endian",
                                              "binary_big_endian" };
static const char *const format_names[] = { "ply-ascii", "ply-le", "ply-be" };

static void put_ordered(bytes *b, enum encoding e, uint64_t raw, int width)
{
    for (int i = 0; i < width; i++) {
        uint8_t byte = (uint8_t)(raw >> 8 * (e == LITTLE ? i : width - 1 - i));
        put(b, &byte, 1);
    }
}

static void integer(bytes *b, enum encoding e, int64_t value, int width)
{
    if (e == ASCII)
        text(b, "%" PRId64 " ", value);
    else
        put_ordered(b, e, (uint64_t)value, width);
}

static void real(bytes *b, enum encoding e, double value, int width)
{
    float narrow = (float)value;
    uint64_t raw = 0;
    uint32_t raw32;
    if (e == ASCII) {
        text(b, width == 4 ? "%.9g " : "%.17g ", value);
        return;
    }
    memcpy(&raw, &value, 8);
    memcpy(&raw32, &narrow, 4);
    put_ordered(b, e, width == 4 ? raw32 : raw, width);
}

static void end_row(bytes *b, enum encoding e)
{
    if (e == ASCII)
        text(b, "\n");
}

static const double corner[8][3] = { { 0.1, 0.2, 0.3 }, { 1.1, 0.2, 0.3 }, { 1.1, 1.2, 0.3 },
                                     { 0.1, 1.2, 0.3 }, { 0.1, 0.2, 1.3 }, { 1.1, 0.2, 1.3 },
                                     { 1.1, 1.2, 1.3 }, { 0.1, 1.2, 1.3 } };
static const int side[6][4] = { { 0, 3, 2, 1 }, { 4, 5, 6, 7 }, { 0, 1, 5, 4 },
                                { 1, 2, 6, 5 }, { 2, 3, 7, 6 }, { 3, 0, 4, 7 } };

static void cube_vertices(bytes *b, enum encoding e, int width)
{
    for (int i = 0; i < 8; i++) {
        integer(b, e, 200 + i, 1);
        for (int k = 0; k < 3; k++)
            real(b, e, corner[i][k], width);
        integer(b, e, i % 3, 2); /* a list among the vertex's properties */
        for (int k = 0; k < i % 3; k++)
            real(b, e, 7.5, 8);
        end_row(b, e);
    }
}

static void cube_faces(bytes *b, enum encoding e)
{
    for (int i = 0; i < 6; i++) {
        integer(b, e, -i, 4);
        integer(b, e, 4, 1);
        for (int k = 0; k < 4; k++)
            integer(b, e, side[i][k], 2);
        end_row(b, e);
    }
}

static void cube_edges(bytes *b, enum encoding e)
{
    for (int i = 0; i < 2; i++) {
        integer(b, e, 1, 1);
        integer(b, e, 5, 4);
        real(b, e, 0.5, 4);
        end_row(b, e);
    }
}

/* Makes a cube of six quads, with other properties, lists and elements around. */
static void make_cube(bytes *b, enum encoding e, bool faces_first, int width, const char *line_end)
{
    const char *real_name = width == 4 ? "float32" : "float64";
    char vertex[300], face[200];
    b->size = 0;
    snprintf(vertex, sizeof vertex,
             "element vertex 8%sproperty uint8 red%sproperty %s x%sproperty %s y%sproperty %s "
             "z%sproperty list ushort double w%s",
             line_end, line_end, real_name, line_end, real_name, line_end, real_name, line_end,
             line_end);
    snprintf(face, sizeof face,
             "element face 6%sproperty int32 flag%sproperty list uchar int16 vertex_index%s",
             line_end, line_end, line_end);
    text(b, "ply%sformat %s 1.0%scomment element vertex 99%sobj_info made here%s", line_end,
         encoding_names[e], line_end, line_end, line_end);
    text(b, "%selement edge 2%sproperty list char int ends%sproperty float weight%s%s",
         faces_first ? face : "", line_end, line_end, line_end, vertex);
    text(b, "%send_header%s", faces_first ? "" : face, line_end);
    if (faces_first)
        cube_faces(b, e);
    cube_edges(b, e);
    cube_vertices(b, e, width);
    if (!faces_first)
        cube_faces(b, e);
}

static ebpo_status parse(ebpo_mesh *mesh, const bytes *b, ebpo_error *error)
{
    /* the block has exactly this size, so that the sanitizer detects a read after its end */
    uint8_t *copy = malloc(b->size ? b->size : 1);
    memcpy(copy, b->data, b->size);
    ebpo_status status =
        ebpo_ply_parse_memory(mesh, copy, b->size, "folder/made.ply", NULL, 0, NULL, error);
    free(copy);
    return status;
}

static ebpo_status parse_text(ebpo_mesh *mesh, const char *source, ebpo_error *error)
{
    static bytes b;
    b.size = 0;
    put(&b, source, strlen(source));
    return parse(mesh, &b, error);
}

static void check_cube(const ebpo_mesh *mesh, int width)
{
    ck_assert(mesh->vertex_count == 8 && mesh->face_count == 12 &&
              mesh->polygons_triangulated == 6);
    ck_assert(mesh->polygons_concave == 0 && mesh->polygons_dropped == 0 && mesh->strips == 0);
    ck_assert(!mesh->xyz32 == (width == 8) && !mesh->xyz64 == (width == 4));
    for (int i = 0; i < 24; i++)
        if (width == 4)
            ck_assert(mesh->xyz32[i] == (float)corner[i / 3][i % 3]);
        else
            ck_assert(mesh->xyz64[i] == corner[i / 3][i % 3]);
    for (int i = 0; i < 6; i++) {
        const uint32_t expected[6] = { (uint32_t)side[i][0], (uint32_t)side[i][1],
                                       (uint32_t)side[i][2], (uint32_t)side[i][0],
                                       (uint32_t)side[i][2], (uint32_t)side[i][3] };
        ck_assert(memcmp(mesh->faces + 6 * i, expected, sizeof expected) == 0);
    }
}

/* --- dialects --- */

START_TEST(test_ply_variants_give_same_cube)
{
    static bytes b;
    static const char *const line_ends[] = { "\n", "\r\n", "\r" };
    enum encoding e = (enum encoding)(_i % 3);
    int width = _i / 3 % 2 ? 8 : 4;
    make_cube(&b, e, _i / 6 % 2, width, line_ends[_i / 12]);
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(parse(&mesh, &b, &error) == EBPO_OK, "%s", error.message);
    check_cube(&mesh, width);
    ck_assert_str_eq(mesh.source_name, "made.ply");
    ck_assert_str_eq(mesh.source_format, format_names[e]);
    ck_assert(mesh.source_size == b.size);
    ebpo_mesh_free(&mesh);
    ck_assert(!mesh.faces && !mesh.xyz32);
}
END_TEST

START_TEST(test_ply_trailing_bytes_are_accepted)
{
    static bytes b;
    for (int e = 0; e < 3; e++) {
        ebpo_mesh mesh;
        make_cube(&b, (enum encoding)e, false, 4, "\n");
        text(&b, "what follows is not ours");
        ck_assert(parse(&mesh, &b, NULL) == EBPO_OK);
        check_cube(&mesh, 4);
        ebpo_mesh_free(&mesh);
    }
}
END_TEST

START_TEST(test_ply_integer_coordinates_become_doubles)
{
    static const char *const types[] = { "char", "uchar", "short", "ushort", "int", "uint" };
    static const int widths[] = { 1, 1, 2, 2, 4, 4 };
    static bytes b;
    int64_t most = (int64_t)(UINT64_C(0xffffffff) >> (32 - 8 * widths[_i]));
    int64_t value = _i % 2 ? most : -most / 2 - 1;
    for (int e = 0; e < 3; e++) {
        ebpo_mesh mesh;
        b.size = 0;
        text(&b,
             "ply\nformat %s 1.0\nelement vertex 3\nproperty %s x\nproperty %s y\nproperty float "
             "z\n",
             encoding_names[e], types[_i], types[_i]);
        text(&b, "element face 1\nproperty list uint uint vertex_indices\nend_header\n");
        for (int i = 0; i < 3; i++) {
            integer(&b, (enum encoding)e, value, widths[_i]);
            integer(&b, (enum encoding)e, i, widths[_i]);
            real(&b, (enum encoding)e, 0.1f, 4);
            end_row(&b, (enum encoding)e);
        }
        for (int i = 0; i < 4; i++)
            integer(&b, (enum encoding)e, i ? i - 1 : 3, 4);
        ck_assert(parse(&mesh, &b, NULL) == EBPO_OK);
        ck_assert(mesh.xyz64 && mesh.xyz64[0] == (double)value && mesh.xyz64[4] == 1 &&
                  mesh.xyz64[5] == (double)0.1f);
        ebpo_mesh_free(&mesh);
    }
}
END_TEST

#define POINTS(n)                               \
    "ply\nformat ascii 1.0\nelement vertex " #n \
    "\nproperty float x\nproperty float y\nproperty float z\n"
#define FACES(n) "element face " #n "\nproperty list uchar int vertex_indices\nend_header\n"
#define TRIANGLE POINTS(3) FACES(1) "0 0 0\n1 0 0\n0 1 0\n"

START_TEST(test_ply_nan_and_infinity_are_kept)
{
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert(parse_text(&mesh, POINTS(3) FACES(1) "nan -inf 0\n1 Infinity 0\n0 1 0\n3 0 1 2\n",
                         &error) == EBPO_OK);
    ck_assert(mesh.xyz32[0] != mesh.xyz32[0] && mesh.xyz32[1] < -3e38f && mesh.xyz32[4] > 3e38f);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_ply_broken_rows_and_short_faces)
{
    ebpo_mesh mesh;
    ck_assert(parse_text(&mesh,
                         POINTS(3) FACES(4) "0 0\n 0\n1 0 0\n\n0 1 0\n3 0\n1\n2\n2 0 1\n0\n1 2",
                         NULL) == EBPO_OK);
    ck_assert(mesh.face_count == 1 && mesh.polygons_dropped == 3);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_ply_comment_without_keyword_is_accepted)
{
    ebpo_mesh mesh;
    ck_assert(
        parse_text(&mesh,
                   "ply\nformat ascii 1.0\nCreated by hand\n"
                   "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n" FACES(
                       1) "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
                   NULL) == EBPO_OK);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* --- polygons and strips --- */

START_TEST(test_ply_concave_faces_are_triangulated)
{
    ebpo_mesh mesh;
    ck_assert(parse_text(&mesh, POINTS(4) FACES(1) "0 0 0\n1 0 0\n0.2 0.2 0\n0 1 0\n4 0 1 2 3\n",
                         NULL) == EBPO_OK);
    ck_assert(mesh.face_count == 2 && mesh.polygons_triangulated == 1 &&
              mesh.polygons_concave == 1);
    for (int i = 0; i < 2; i++) { /* only the diagonal 0-2 is inside */
        const uint32_t *f = mesh.faces + 3 * i;
        ck_assert((f[0] == 0 || f[1] == 0 || f[2] == 0) && (f[0] == 2 || f[1] == 2 || f[2] == 2));
    }
    ebpo_mesh_free(&mesh);
}
END_TEST

#define STRIPS(n)   "element tristrips " #n "\nproperty list int int vertex_indices\nend_header\n"
#define FIVE_POINTS "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n"

START_TEST(test_ply_strips_restart_and_drop_degenerates)
{
    ebpo_mesh mesh;
    const uint32_t expected[] = { 0, 1, 2, 2, 1, 3, 2, 3, 4, 1, 4, 3, 0, 3, 1 };
    ebpo_error error = EBPO_ERROR_INIT;
    /* In the second strip a repeated vertex changes the parity: 1 4 3 3, then (3 3 0) and (3 0 1)
     * follow. */
    ck_assert_msg(parse_text(&mesh,
                             POINTS(5) STRIPS(2) FIVE_POINTS
                             "6 0 1 2 3 4 -1\n10 -1 -1 1 4 3 3 0 1 -1 2\n",
                             &error) == EBPO_OK,
                  "%s", error.message);
    ck_assert(mesh.strips == 2 && mesh.face_count == 5);
    ck_assert(memcmp(mesh.faces, expected, sizeof expected) == 0);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* --- messages --- */

static const struct {
    const char *source;
    ebpo_status status;
    const char *message;
} bad[] = {
    { "", EBPO_E_FORMAT, "line 1: not a PLY file" },
    { "plyx\n", EBPO_E_FORMAT, "line 1: not a PLY file" },
    { "ply\nformat ascii 1.0\n", EBPO_E_FORMAT, "line 3: the file ends before 'end_header'" },
    { "ply\nformat ascii 2.0\n", EBPO_E_FORMAT, "line 2: unknown format version '2.0'" },
    { "ply\nformat text 1.0\n", EBPO_E_FORMAT, "line 2: unknown format 'text'" },
    { "ply\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
      EBPO_E_FORMAT, "no format statement" },
    { "ply\nformat ascii 1.0\nelement vertex three\n", EBPO_E_FORMAT,
      "line 3: not a count: 'three'" },
    { "ply\nformat ascii 1.0\nelement vertex 99999999999999999999\n", EBPO_E_FORMAT,
      "line 3: not a count" },
    { "ply\nformat ascii 1.0\nelement vertex -3\n", EBPO_E_FORMAT, "line 3: not a count: '-3'" },
    { "ply\nformat ascii 1.0\nproperty float x\n", EBPO_E_FORMAT, "line 3: no element before" },
    { "ply\nformat ascii 1.0\nelement vertex 3\nproperty real x\n", EBPO_E_FORMAT,
      "line 4: unknown type 'real'" },
    { "ply\nformat ascii 1.0\nelement vertex 3\nproperty list float int x\n", EBPO_E_FORMAT,
      "line 4: invalid type for a list length: 'float'" },
    { "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float x\n",
      EBPO_E_FORMAT, "line 5: duplicate property 'x'" },
    { "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nelement vertex 3\n",
      EBPO_E_FORMAT, "line 5: duplicate element 'vertex'" },
    { "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nend_header\n",
      EBPO_E_FORMAT, "line 3: this element has no property 'z'" },
    { "ply\nformat ascii 1.0\nelement vertex 3\npropertie float x\n", EBPO_E_FORMAT,
      "line 4: unknown statement 'propertie'" },
    { POINTS(3) "element face 1\nproperty list uchar float vertex_indices\n", EBPO_E_FORMAT,
      "line 8: invalid type for vertex indices: 'float'" },
    { POINTS(3) "element face 1\nproperty list uchar int corners\nend_header\n", EBPO_E_FORMAT,
      "line 7: this element has no list 'vertex_indices'" },
    { "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n",
      EBPO_E_FORMAT, "no element 'vertex'" },
    { POINTS(3) "end_header\n0 0 0\n1 0 0\n0 1 0\n", EBPO_E_FORMAT,
      "3 vertices but no faces (a point cloud" },
    { POINTS(3) FACES(0) "0 0 0\n1 0 0\n0 1 0\n", EBPO_E_FORMAT,
      "3 vertices but no faces (a point cloud" },
    { POINTS(0) FACES(0), EBPO_E_FORMAT, "the mesh is empty, with neither vertices nor faces" },
    { POINTS(1000000000000) FACES(1) "0 0 0\n", EBPO_E_FORMAT,
      "line 3: 1000000000000 rows of element 'vertex' do not fit into the rest of the file" },
    { POINTS(10000000000000000000) FACES(1) "0 0 0\n", EBPO_E_FORMAT,
      "do not fit into the rest of the file" },
    { POINTS(3) FACES(1000000000) "0 0 0\n0 0 0\n0 0 0\n", EBPO_E_FORMAT,
      "line 7: 1000000000 rows of element 'face'" },
    { TRIANGLE "3 0 1 3\n", EBPO_E_FORMAT,
      "made.ply: line 13: face 0 names vertex 3, but there are 3 vertices; repair the file or drop "
      "the face" },
    { TRIANGLE "3 0 -1 2\n", EBPO_E_FORMAT, "line 13: face 0 names vertex -1" },
    { TRIANGLE "3 0 1 9999999999999999999\n", EBPO_E_FORMAT,
      "line 13: invalid integer '9999999999999999999' in face 0" },
    { TRIANGLE "3 0 1 2.0\n", EBPO_E_FORMAT, "line 13: invalid integer '2.0' in face 0" },
    { TRIANGLE "3 0 1", EBPO_E_FORMAT,
      "line 13: face 0 has a list of 3 items, more than the rest" },
    { TRIANGLE "-3 0 1 2\n", EBPO_E_FORMAT, "line 13: face 0 has a list of -3 items" },
    { TRIANGLE "200000000 0 1 2\n", EBPO_E_FORMAT,
      "line 13: face 0 has a list of 200000000 items, more than the rest" },
    { TRIANGLE "2 0 1 \n", EBPO_E_FORMAT, "no face has three corners" },
    { POINTS(3) FACES(1) "0 0 0\n1 zero 0\n0 1 0\n3 0 1 2\n", EBPO_E_FORMAT,
      "line 11: invalid number 'zero' in vertex 1" },
    { POINTS(3) FACES(1) "0 0 0\n1 0x1p3 0\n0 1 0\n3 0 1 2\n", EBPO_E_FORMAT,
      "line 11: invalid number '0x1p3' in vertex 1" },
    { POINTS(3) FACES(1) "0 0 0\n1 0,5 0\n0 1 0\n3 0 1 2\n", EBPO_E_FORMAT,
      "line 11: invalid number '0,5' in vertex 1" },
    { POINTS(3) FACES(1) "0 0 0\n1 0\n0 1 0\n3 0 1 2\n", EBPO_E_FORMAT,
      "line 12: vertex 1 began in line 11 and ends within this line" },
    { POINTS(3) FACES(1) "0.00000 0.0000 0.0000\n1.000000 0\n", EBPO_E_FORMAT,
      "line 12: the file ends after 187 bytes within row 1 of the 3 of element 'vertex'" },
    { POINTS(5) STRIPS(1) FIVE_POINTS "4 0 1 2 5\n", EBPO_E_FORMAT,
      "line 15: strip 0 names vertex 5" },
};

START_TEST(test_ply_errors_report_cause_and_position)
{
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    memset(&mesh, 1, sizeof mesh);
    ck_assert_int_eq(parse_text(&mesh, bad[_i].source, &error), bad[_i].status);
    ck_assert_msg(strstr(error.message, bad[_i].message) != NULL, "'%s' is not in '%s'",
                  bad[_i].message, error.message);
    ck_assert(error.status == bad[_i].status && !mesh.faces && !mesh.xyz32 && !mesh.vertex_count);
}
END_TEST

START_TEST(test_ply_bad_index_reports_position)
{
    static bytes b;
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    make_cube(&b, LITTLE, false, 4, "\n");
    size_t row = 4 + 1 + 4 * 2, begin = b.size - 6 * row; /* rows of the faces */
    b.data[begin + 2 * row + 4 + 1 + 2 * 3] = 8;          /* last corner of face 2 */
    char expected[100];
    snprintf(expected, sizeof expected,
             "made.ply: byte %zu: face 2 names vertex 8, but there are 8 vertices",
             begin + 2 * row + 11);
    ck_assert(parse(&mesh, &b, &error) == EBPO_E_FORMAT);
    ck_assert_msg(strstr(error.message, expected) != NULL, "'%s' is not in '%s'", expected,
                  error.message);
}
END_TEST

START_TEST(test_ply_header_size_limit)
{
    size_t size = (1u << 20) + 1000;
    uint8_t *data = malloc(size);
    memset(data, '\n', size);
    memcpy(data, "ply\nformat ascii 1.0\n", 21);
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert(ebpo_ply_parse_memory(&mesh, data, size, "x", NULL, 0, NULL, &error) ==
              EBPO_E_FORMAT);
    ck_assert(strstr(error.message, "the header exceeds 1 MiB") != NULL);
    free(data);
}
END_TEST

START_TEST(test_ply_truncation_is_refused)
{
    static bytes b;
    make_cube(&b, (enum encoding)(_i % 3), _i / 3 % 2, 4, "\n");
    size_t whole = b.size;
    for (size_t n = 0; n < whole; n++) {
        ebpo_mesh mesh;
        ebpo_error error = EBPO_ERROR_INIT;
        b.size = n;
        ebpo_status status = parse(&mesh, &b, &error);
        if (status ==
            EBPO_OK) /* in ascii, only blanks and digits of the last value may be missing */
            ck_assert(_i % 3 == ASCII && n + 2 + (_i == 3 ? 2 : 0) >= whole);
        else
            ck_assert(status == EBPO_E_FORMAT && error.message[0] && !mesh.faces);
        ebpo_mesh_free(&mesh);
    }
}
END_TEST

/* --- vertices only --- */

static ebpo_status parse_points(double **xyz, uint64_t *count, const bytes *b, ebpo_error *error)
{
    uint8_t *copy = malloc(b->size ? b->size : 1);
    memcpy(copy, b->data, b->size);
    ebpo_status status =
        ebpo_points_parse_ply(copy, b->size, "folder/points.ply", xyz, count, error);
    free(copy);
    return status;
}

START_TEST(test_points_of_any_dialect_are_vertices)
{
    static bytes b;
    int width = _i / 3 % 2 ? 8 : 4;
    double *xyz;
    uint64_t count;
    ebpo_error error = EBPO_ERROR_INIT;
    make_cube(&b, (enum encoding)(_i % 3), _i / 6, width, "\n");
    ck_assert_msg(parse_points(&xyz, &count, &b, &error) == EBPO_OK, "%s", error.message);
    ck_assert(count == 8);
    for (int i = 0; i < 24; i++)
        ck_assert(xyz[i] ==
                  (width == 4 ? (double)(float)corner[i / 3][i % 3] : corner[i / 3][i % 3]));
    free(xyz);
}
END_TEST

START_TEST(test_points_need_no_faces)
{
    static const char *const sources[] = { POINTS(2) "end_header\n0 0 0\n1 2.5 nan\n",
                                           POINTS(2) FACES(1) "0 0 0\n1 2.5 inf\n3 0 1 99\n" };
    static bytes b;
    for (int i = 0; i < 2; i++) {
        double *xyz;
        uint64_t count;
        b.size = 0;
        text(&b, "%s", sources[i]);
        ck_assert(parse_points(&xyz, &count, &b, NULL) == EBPO_OK);
        ck_assert(count == 2 && xyz[3] == 1 && xyz[4] == 2.5 && !(xyz[5] - xyz[5] == 0));
        free(xyz);
    }
}
END_TEST

START_TEST(test_damaged_points_report_position)
{
    static bytes b;
    double *xyz;
    uint64_t count;
    ebpo_error error = EBPO_ERROR_INIT;
    b.size = 0;
    text(&b, POINTS(2) "end_header\n0 0 0\n1 x 0\n");
    ck_assert(parse_points(&xyz, &count, &b, &error) == EBPO_E_FORMAT && !xyz && !count);
    ck_assert_msg(strstr(error.message, "points.ply: line 9: invalid number 'x' in vertex 1") !=
                      NULL,
                  "%s", error.message);
    make_cube(&b, LITTLE, true, 4, "\n");
    for (size_t whole = b.size, n = 0; n < whole; n++) {
        b.size = n;
        ck_assert(parse_points(&xyz, &count, &b, &error) == EBPO_E_FORMAT && !xyz);
    }
}
END_TEST

static bool refuse(void *user, const char *stage, uint64_t done, uint64_t total)
{
    (void)user;
    ck_assert(strcmp(stage, "reading") == 0 && done <= total);
    return false;
}

START_TEST(test_ply_reader_can_be_cancelled)
{
    static bytes b;
    ebpo_mesh mesh;
    const ebpo_progress progress = { refuse, NULL };
    make_cube(&b, BIG, true, 4, "\n");
    ck_assert(ebpo_ply_parse_memory(&mesh, b.data, b.size, "x", NULL, 0, &progress, NULL) ==
              EBPO_E_CANCELLED);
    ck_assert(!mesh.faces);
}
END_TEST

/* --- rows on all cores --- */

/* The kind of fault in one row of many. */
enum error_bound {
    TRIANGLES,
    QUAD,
    TWO_CORNERS,
    NO_CORNERS,
    BAD_INDEX,
    NEGATIVE_INDEX,
    LONG_LIST,
    CUT,
    FEW_VERTICES,
    ERROR_BOUNDS
};

enum { MANY_VERTICES = 40000, MANY_FACES = 90000 };

/* Writes a value without the overhead of Check, as there are a million values. */
static uint8_t *put_raw(uint8_t *to, enum encoding e, uint64_t raw, int width)
{
    for (int i = 0; i < width; i++)
        *to++ = (uint8_t)(raw >> 8 * (e == LITTLE ? i : width - 1 - i));
    return to;
}

/* `second_list`: faces have another, empty list, so that the reader processes single rows. */
static uint8_t *make_many(size_t *size, enum encoding e, enum error_bound what, uint64_t at,
                          bool second_list)
{
    static bytes b;
    uint8_t *file = malloc(MANY_VERTICES * 13 + MANY_FACES * 40);
    uint64_t state = 3;
    b.size = 0;
    text(&b,
         "ply\nformat %s 1.0\nelement vertex %d\nproperty float x\nproperty uchar shade\nproperty "
         "float y\nproperty float z\nelement face %d\nproperty ushort tag\n"
         "property list uchar int vertex_indices\n%s",
         encoding_names[e], what == FEW_VERTICES ? 0 : MANY_VERTICES, MANY_FACES,
         second_list ? "property list uchar float more\n" : "");
    text(&b, "property uchar last\nend_header\n");
    memcpy(file, b.data, b.size);
    *size = b.size;
    uint8_t *to = file + *size;
    for (uint64_t v = 0; v < MANY_VERTICES && what != FEW_VERTICES; v++) {
        to = put_raw(to, e, ebpo_test_random(&state) & 0xffffffff, 4); /* any bits */
        to = put_raw(to, e, v & 255, 1);
        to = put_raw(to, e, ebpo_test_random(&state) & 0xffffffff, 4);
        to = put_raw(to, e, ebpo_test_random(&state) & 0xffffffff, 4);
    }
    for (uint64_t f = 0; f < MANY_FACES; f++) {
        int count = f != at               ? 3
                    : what == QUAD        ? 4
                    : what == TWO_CORNERS ? 2
                    : what == NO_CORNERS  ? 0
                                          : 3;
        uint8_t *row = to;
        to = put_raw(to, e, f & 65535, 2);
        to = put_raw(to, e, f == at && what == LONG_LIST ? 255 : (uint64_t)count, 1);
        for (int k = 0; k < count; k++)
            to = put_raw(to, e,
                         f == at && k == 1 && what == BAD_INDEX ? MANY_VERTICES
                         : f == at && k == 1 && what == NEGATIVE_INDEX
                             ? UINT32_MAX
                             : ebpo_test_random(&state) % MANY_VERTICES,
                         4);
        if (second_list)
            to = put_raw(to, e, 0, 1);
        to = put_raw(to, e, 9, 1);
        if (f == at && what == CUT) {
            to = row + (to - row) / 2;
            break;
        }
    }
    *size = (size_t)(to - file);
    return file;
}

/* Compares the message before and after the byte offset. */
static void expect_message(const ebpo_error *error, const ebpo_error *reference)
{
    const char *a = strstr(error->message, ": "), *b = strstr(reference->message, ": ");
    ck_assert(a && b && (a = strstr(a + 2, ": ")) && (b = strstr(b + 2, ": ")));
    if (!strstr(a, "bytes")) /* the files differ in size */
        ck_assert_str_eq(a, b);
}

START_TEST(test_ply_parallel_rows_match_serial)
{
    static const uint64_t places[] = { 0, 16383, 16384, 50000, MANY_FACES - 1 };
    enum error_bound what = (enum error_bound)(_i / 5);
    for (enum encoding e = LITTLE; e <= BIG; e = (enum encoding)(e + 1)) {
        size_t size, reference_size;
        uint8_t *file = make_many(&size, e, what, places[_i % 5], false),
                *reference_file = make_many(&reference_size, e, what, places[_i % 5], true);
        ebpo_mesh m, reference;
        ebpo_error error = EBPO_ERROR_INIT, reference_error = EBPO_ERROR_INIT;
        ebpo_status status = ebpo_ply_parse_memory(&m, file, size, "x", NULL, 3, NULL, &error),
                    wanted = ebpo_ply_parse_memory(&reference, reference_file, reference_size, "x",
                                                   NULL, 1, NULL, &reference_error);
        ck_assert_int_eq(status, wanted);
        ck_assert_uint_eq(m.vertex_count, reference.vertex_count);
        ck_assert_uint_eq(m.face_count, reference.face_count);
        if (status == EBPO_OK) {
            ck_assert(m.polygons_dropped == reference.polygons_dropped &&
                      m.polygons_triangulated == reference.polygons_triangulated);
            ck_assert(memcmp(m.xyz32, reference.xyz32, (size_t)m.vertex_count * 12) == 0);
            ck_assert(memcmp(m.faces, reference.faces, (size_t)m.face_count * 12) == 0);
        } else {
            ck_assert(what >= BAD_INDEX);
            if (what != LONG_LIST) /* the items of the list are the following bytes */
                expect_message(&error, &reference_error);
        }
        ebpo_mesh_free(&m);
        ebpo_mesh_free(&reference);
        free(file);
        free(reference_file);
    }
}
END_TEST

/* --- writing, and files --- */

static void fill_bits(void *to, size_t size, uint64_t *state)
{
    for (size_t i = 0; i < size; i++) {
        *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
        ((uint8_t *)to)[i] = (uint8_t)(*state >> 56);
    }
}

START_TEST(test_ply_round_trip_is_bit_exact)
{
    scratch_enter();
    const char *name = scratch("out.ply");
    size_t width = _i ? 8 : 4;
    const uint64_t n = 20000; /* more than the writer's buffer */
    ebpo_mesh mesh = { .vertex_count = n, .face_count = n }, back;
    uint64_t state = 1;
    void *xyz = malloc(3 * n * width);
    fill_bits(xyz, 3 * n * width, &state); /* NaNs, infinities and denormals among them */
    mesh.xyz32 = _i ? NULL : xyz;
    mesh.xyz64 = _i ? xyz : NULL;
    mesh.faces = malloc(3 * n * sizeof *mesh.faces);
    for (uint64_t i = 0; i < 3 * n; i++)
        mesh.faces[i] = (uint32_t)(i * 7919 % n);
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(ebpo_mesh_write_ply(&mesh, name, &error) == EBPO_OK, "%s", error.message);
    ck_assert_msg(ebpo_mesh_read(name, NULL, &back, &error) == EBPO_OK, "%s", error.message);
    ck_assert(back.vertex_count == n && back.face_count == n && !back.xyz64 == !_i);
    ck_assert(memcmp(_i ? (void *)back.xyz64 : (void *)back.xyz32, xyz, 3 * n * width) == 0);
    ck_assert(memcmp(back.faces, mesh.faces, 3 * n * sizeof *mesh.faces) == 0);
    ck_assert_str_eq(back.source_name, "out.ply");
    ebpo_mesh_free(&mesh);
    ebpo_mesh_free(&back);
    unlink(name);
    ck_assert_int_eq(scratch_entries(), 0); /* no other files remain */
}
END_TEST

START_TEST(test_ply_writer_refuses_inconsistent_mesh)
{
    float xyz[3] = { 0, 0, 0 };
    uint32_t faces[3] = { 0, 0, 1 };
    ebpo_mesh mesh = { .vertex_count = 1, .face_count = 1, .xyz32 = xyz, .faces = faces };
    ck_assert(ebpo_mesh_write_ply(&mesh, "/tmp/never-written.ply", NULL) == EBPO_E_ARGUMENT);
    mesh.face_count = 0;
    mesh.xyz32 = NULL;
    ck_assert(ebpo_mesh_write_ply(&mesh, "/tmp/never-written.ply", NULL) == EBPO_E_ARGUMENT);
    ck_assert(access("/tmp/never-written.ply", F_OK) != 0);
}
END_TEST

START_TEST(test_read_file_records_digest)
{
    const char *path = scratch("triangle.ply");
    int fd = open(path, O_CREAT | O_WRONLY, 0600);
    ck_assert(write(fd, TRIANGLE "3 0 1 2\n", strlen(TRIANGLE "3 0 1 2\n")) > 0);
    close(fd);
    ebpo_mesh mesh;
    ebpo_sha256 state;
    uint8_t digest[32];
    ck_assert(ebpo_mesh_read(path, NULL, &mesh, NULL) == EBPO_OK);
    ebpo_sha256_begin(&state);
    ebpo_sha256_add(&state, TRIANGLE "3 0 1 2\n", strlen(TRIANGLE "3 0 1 2\n"));
    ebpo_sha256_end(&state, digest);
    ck_assert(memcmp(digest, mesh.source_sha256, 32) == 0);
    ebpo_mesh_free(&mesh);
    unlink(path);
}
END_TEST

START_TEST(test_unknown_file_format_is_reported)
{
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert(ebpo_mesh_read("/nowhere/at.ply", NULL, &mesh, &error) == EBPO_E_IO);
    ck_assert(strstr(error.message, "/nowhere/at.ply") != NULL);
    ck_assert(ebpo_mesh_read("/tmp", NULL, &mesh, &error) == EBPO_E_IO &&
              strstr(error.message, "is a folder") != NULL);
    ck_assert(ebpo_mesh_read("/dev/null", NULL, &mesh, &error) == EBPO_E_IO);
}
END_TEST

/* --- real models --- */

static const struct {
    const char *name;
    uint64_t vertices, faces;
} wild[] = {
    { "buddha_le_trailing_bytes.ply", 29609, 51414 },
    { "bunny_ascii.ply", 35947, 69451 },
    { "cycloidal_le_vertex_and_face_colours.ply", 21384, 43368 },
    { "dragon100k_le_normals_flags.ply", 50000, 100000 },
    { "dragon_res3_ascii.ply", 22998, 47794 },
    { "elephant_le_tristrips_restart.ply", 19753, 39290 },
    { "igea_le_tristrips.ply", 134345, 268686 },
    { "screwdriver_bigendian_confidence.ply", 6789, 13574 },
    { "sphere_ascii_double.ply", 162, 320 },
    { "suzanne_ascii_quads_normals_uv.ply", 1966, 968 },
    { "tetra_ascii_double_normals_colours_edges.ply", 4, 4 },
    { "wuson_ascii_split.ply", 11184, 3732 },
};

static bool read_model(ebpo_mesh *mesh, const char *name, ebpo_status expected, ebpo_error *error)
{
    const char *models = getenv("EBPO_MODELS");
    char path[4096];
    snprintf(path, sizeof path, "%s/%s", models ? models : "", name);
    if (!models || access(path, R_OK) != 0)
        return false;
    ck_assert_msg(ebpo_mesh_read(path, NULL, mesh, error) == expected, "%s: %s", path,
                  error->message);
    return true;
}

START_TEST(test_files_from_other_programs_are_read)
{
    char name[100];
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    snprintf(name, sizeof name, "wild/%s", wild[_i].name);
    if (!read_model(&mesh, name, EBPO_OK, &error))
        return;
    ck_assert_msg(mesh.vertex_count == wild[_i].vertices && mesh.face_count == wild[_i].faces,
                  "%s: %" PRIu64 " vertices, %" PRIu64 " faces", name, mesh.vertex_count,
                  mesh.face_count);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_truncated_point_cloud_reports_position)
{
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    if (read_model(&mesh, "wild/pond_truncated_points.ply", EBPO_E_FORMAT, &error))
        ck_assert(strstr(error.message, "byte 2171788") &&
                  strstr(error.message, "row 70048 of the 70051 of element 'vertex'"));
}
END_TEST

START_TEST(test_igea_strips_match_triangles)
{
    ebpo_mesh strips, triangles;
    ebpo_error error = EBPO_ERROR_INIT;
    if (!read_model(&strips, "wild/igea_le_tristrips.ply", EBPO_OK, &error))
        return;
    if (read_model(&triangles, "igea.ply", EBPO_OK, &error)) {
        ck_assert(memcmp(strips.xyz32, triangles.xyz32, strips.vertex_count * 12) == 0);
        ck_assert(strips.face_count == triangles.face_count && strips.strips == 35048);
        for (uint64_t i = 0; i < strips.face_count;
             i++) { /* the same faces in the same order, up to rotation */
            const uint32_t *a = strips.faces + 3 * i, *b = triangles.faces + 3 * i;
            int turn = b[0] == a[0] ? 0 : b[1] == a[0] ? 1 : 2;
            ck_assert(a[0] == b[turn] && a[1] == b[(turn + 1) % 3] && a[2] == b[(turn + 2) % 3]);
        }
        ebpo_mesh_free(&triangles);
    }
    ebpo_mesh_free(&strips);
}
END_TEST

TEST_SUITE(ply)
{
    TCase *tests = tcase_create("ply");
    tcase_set_timeout(tests, 120);
    tcase_add_loop_test(tests, test_ply_variants_give_same_cube, 0, 36);
    tcase_add_loop_test(tests, test_points_of_any_dialect_are_vertices, 0, 12);
    tcase_add_test(tests, test_points_need_no_faces);
    tcase_add_test(tests, test_damaged_points_report_position);
    tcase_add_test(tests, test_ply_trailing_bytes_are_accepted);
    tcase_add_loop_test(tests, test_ply_integer_coordinates_become_doubles, 0, 6);
    tcase_add_test(tests, test_ply_nan_and_infinity_are_kept);
    tcase_add_test(tests, test_ply_broken_rows_and_short_faces);
    tcase_add_test(tests, test_ply_comment_without_keyword_is_accepted);
    tcase_add_test(tests, test_ply_concave_faces_are_triangulated);
    tcase_add_test(tests, test_ply_strips_restart_and_drop_degenerates);
    tcase_add_loop_test(tests, test_ply_errors_report_cause_and_position, 0,
                        (int)(sizeof bad / sizeof *bad));
    tcase_add_test(tests, test_ply_bad_index_reports_position);
    tcase_add_test(tests, test_ply_header_size_limit);
    tcase_add_loop_test(tests, test_ply_truncation_is_refused, 0, 6);
    tcase_add_test(tests, test_ply_reader_can_be_cancelled);
    tcase_add_loop_test(tests, test_ply_round_trip_is_bit_exact, 0, 2);
    tcase_add_test(tests, test_ply_writer_refuses_inconsistent_mesh);
    tcase_add_test(tests, test_read_file_records_digest);
    tcase_add_loop_test(tests, test_ply_parallel_rows_match_serial, 0, 5 * ERROR_BOUNDS);
    tcase_add_test(tests, test_unknown_file_format_is_reported);
    tcase_add_loop_test(tests, test_files_from_other_programs_are_read, 0,
                        (int)(sizeof wild / sizeof *wild));
    tcase_add_test(tests, test_truncated_point_cloud_reports_position);
    tcase_add_test(tests, test_igea_strips_match_triangles);
    Suite *suite = suite_create("ply");
    suite_add_tcase(suite, tests);
    return suite;
}
