/* Tests data of a PLY file besides positions and corners: it is read in each encoding; kept by
 * building, writing and reading; split and merged with the mesh; and written unchanged. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/build.h>
#include <ebpo/subset.h>
#include <ebpo/verify.h>

#include "mesh/attributes.h"
#include "check_main.h"
#include "core/text.h"
#include "format/read_attributes.h"
#include "format/chunks.h"
#include "format/pick_rows.h"
#include "mesh/ply.h"
#include "scratch.h"
#include "solids.h"

static ebpo_error error = EBPO_ERROR_INIT;

static void fine(ebpo_status status) { ck_assert_msg(status == EBPO_OK, "%s", error.message); }

/* --- PLY files with random properties: the same seed gives the same data in each encoding --- */

enum { ASCII, LITTLE, BIG, ENCODINGS };
enum { MAX_PROPERTIES = 12 };

typedef struct random_property {
    char name[24];
    /* count: -1 for a property that is not a list, otherwise the type of the list's length */
    int type, count;
    bool equal; /* all lists have the same length */
    char axis;  /* x, y or z; v for corners; 0 for other properties */
} random_property;

typedef struct random_element {
    const char *name;
    random_property property[MAX_PROPERTIES];
    int properties;
    uint64_t rows;
} random_element;

static const char *const types[] = { "char", "uint8", "short", "uint16",
                                     "int",  "uint",  "float", "double" };
static const unsigned widths[] = { 1, 1, 2, 2, 4, 4, 4, 8 };

typedef struct ply_text {
    FILE *out;
    int encoding;
    uint64_t state;
    const ebpo_mesh *mesh;
} ply_text;

static unsigned draw(ply_text *p, unsigned below)
{
    return (unsigned)(ebpo_test_random(&p->state) >> 33) % below;
}

static void put_bits(ply_text *p, int type, uint64_t bits)
{
    for (unsigned i = 0; i < widths[type]; i++) {
        unsigned byte = p->encoding == BIG ? widths[type] - 1 - i : i;
        fputc((int)(bits >> 8 * byte & 255), p->out);
    }
}

/* Writes a value of the type; `bits` has the bits of the value in its low bytes. */
static void put_value(ply_text *p, int type, uint64_t bits)
{
    float narrow;
    double wide;
    uint32_t low = (uint32_t)bits;
    if (p->encoding != ASCII) {
        put_bits(p, type, bits);
        return;
    }
    memcpy(&narrow, &low, sizeof narrow);
    memcpy(&wide, &bits, sizeof wide);
    switch (type) {
    case 0: fprintf(p->out, "%d ", (int8_t)bits); break;
    case 1: fprintf(p->out, "%u ", (uint8_t)bits); break;
    case 2: fprintf(p->out, "%d ", (int16_t)bits); break;
    case 3: fprintf(p->out, "%u ", (uint16_t)bits); break;
    case 4: fprintf(p->out, "%d ", (int32_t)bits); break;
    case 5: fprintf(p->out, "%u ", (uint32_t)bits); break;
    case 6: fprintf(p->out, "%.9g ", (double)narrow); break;
    default: fprintf(p->out, "%.17g ", wide);
    }
}

/* Returns random bits. Floats are finite, as text has only one NaN. */
static uint64_t random_bits(ply_text *p, int type)
{
    float narrow = (float)draw(p, 1000000) / 1000 - 500;
    double wide = (double)draw(p, 1000000) / 7 - 70000;
    uint64_t bits = ebpo_test_random(&p->state);
    uint32_t low;
    memcpy(&low, &narrow, sizeof low);
    if (type == 7)
        memcpy(&bits, &wide, sizeof bits);
    return type == 6 ? low : type == 7 ? bits : bits >> 8;
}

static void put_property(ply_text *p, const random_property *property, uint64_t row)
{
    uint64_t count = property->equal ? 3 : draw(p, 4);
    uint32_t low;
    if (property->axis == 'v') {
        put_value(p, property->count, 3);
        for (uint64_t k = 0; k < 3; k++)
            put_value(p, property->type, p->mesh->faces[3 * row + k]);
        return;
    }
    if (property->axis) {
        memcpy(&low, &p->mesh->xyz32[3 * row + (uint64_t)(property->axis - 'x')], sizeof low);
        put_value(p, property->type, low);
        return;
    }
    if (property->count >= 0)
        put_value(p, property->count, count);
    for (uint64_t i = 0; i < (property->count < 0 ? 1 : count); i++)
        put_value(p, property->type, random_bits(p, property->type));
}

static void put_element(ply_text *p, const random_element *e)
{
    for (uint64_t row = 0; row < e->rows; row++) {
        for (int i = 0; i < e->properties; i++)
            put_property(p, &e->property[i], row);
        if (p->encoding == ASCII)
            fputc('\n', p->out);
    }
}

static void put_header(ply_text *p, const random_element *e)
{
    fprintf(p->out, "element %s %llu\n", e->name, (unsigned long long)e->rows);
    for (int i = 0; i < e->properties; i++) {
        const random_property *property = &e->property[i];
        if (property->count >= 0)
            fprintf(p->out, "property list %s %s %s\n", types[property->count],
                    types[property->type], property->name);
        else
            fprintf(p->out, "property %s %s\n", types[property->type], property->name);
    }
}

static void add(random_element *e, const char *name, int type, int count, char axis)
{
    random_property *property = &e->property[e->properties++];
    *property = (random_property){ .type = type, .count = count, .axis = axis };
    snprintf(property->name, sizeof property->name, "%s", name);
}

static void add_random(ply_text *p, random_element *e, unsigned most)
{
    static const char *const names[] = { "red", "green", "blue", "alpha", "nx",
                                         "ny",  "nz",    "s",    "t",     "label" };
    unsigned count = draw(p, most), first = draw(p, 10);
    int type = (int)draw(p, 8);
    for (unsigned i = 0; i < count; i++) {
        if (draw(p, 3) == 0)
            type = (int)draw(p, 8);
        add(e, names[(first + i) % 10], type, draw(p, 4) ? -1 : (int)draw(p, 6), 0);
        e->property[e->properties - 1].equal = draw(p, 2);
    }
}

static uint8_t *make_ply(const ebpo_mesh *mesh, uint64_t seed, int encoding, size_t *size)
{
    static const char *const words[] = { "ascii", "binary_little_endian", "binary_big_endian" };
    char *data = NULL;
    ply_text p = { open_memstream(&data, size), encoding, seed, mesh };
    random_element vertex = { .name = "vertex", .rows = mesh->vertex_count },
                   face = { .name = "face", .rows = mesh->face_count },
                   other = { .name = "edge", .rows = draw(&p, 40) };
    add_random(&p, &vertex, 4);
    for (char axis = 'x'; axis <= 'z'; axis++)
        add(&vertex, (char[]){ axis, 0 }, 6, -1, axis);
    add_random(&p, &vertex, 4);
    add_random(&p, &face, 3);
    add(&face, draw(&p, 2) ? "vertex_indices" : "vertex_index", 4 + (int)draw(&p, 2), 1, 'v');
    add_random(&p, &face, 3);
    add(&other, "vertex1", 4, -1, 0);
    add_random(&p, &other, 3);
    fprintf(p.out, "ply\nformat %s 1.0\ncomment seed %llu\n", words[encoding],
            (unsigned long long)seed);
    put_header(&p, &vertex);
    fprintf(p.out, "obj_info in the midst\n");
    put_header(&p, &face);
    put_header(&p, &other);
    fprintf(p.out, "end_header\n");
    put_element(&p, &vertex);
    put_element(&p, &face);
    put_element(&p, &other);
    fclose(p.out);
    return (uint8_t *)data;
}

static ebpo_mesh parse(const uint8_t *data, size_t size)
{
    ebpo_mesh mesh;
    fine(ebpo_ply_parse_all(&mesh, data, size, "made.ply", NULL, true, 2, NULL, &error));
    return mesh;
}

static ebpo_mesh parse_seed(const ebpo_mesh *mesh, uint64_t seed, int encoding)
{
    size_t size;
    uint8_t *data = make_ply(mesh, seed, encoding, &size);
    ebpo_mesh made = parse(data, size);
    free(data);
    return made;
}

/* --- comparing --- */

static uint64_t begin_of(const ebpo_attribute *a, uint64_t row)
{
    return !a->ends ? row * a->columns : row ? a->ends[row - 1] : 0;
}

static bool same_row(const ebpo_attribute *a, uint64_t i, const ebpo_attribute *b, uint64_t k)
{
    size_t bytes = ebpo_attribute_bytes(a->type);
    uint64_t x = begin_of(a, i), y = begin_of(b, k),
             count = (a->ends ? a->ends[i] : x + a->columns) - x;
    return (b->ends ? b->ends[k] : y + b->columns) - y == count &&
           (!count || memcmp(a->values + x * bytes, b->values + y * bytes, count * bytes) == 0);
}

static void same_head(const ebpo_attribute *a, const ebpo_attribute *b)
{
    ck_assert_str_eq(a->element, b->element);
    ck_assert_str_eq(a->names, b->names);
    ck_assert(a->type == b->type && a->list == b->list);
}

static void same(const ebpo_attributes *a, const ebpo_attributes *b)
{
    ck_assert(!a == !b);
    ck_assert(!a || a->count == b->count);
    for (uint64_t i = 0; a && i < a->count; i++) {
        same_head(&a->array[i], &b->array[i]);
        ck_assert_uint_eq(a->array[i].rows, b->array[i].rows);
        for (uint64_t row = 0; row < a->array[i].rows; row++)
            ck_assert_msg(same_row(&a->array[i], row, &b->array[i], row),
                          "row %llu of %s of %s differs", (unsigned long long)row,
                          a->array[i].names, a->array[i].element);
    }
}

static void same_files(const char *one, const char *other)
{
    char command[512];
    snprintf(command, sizeof command, "cmp '%s' '%s'", one, other);
    ck_assert_int_eq(system(command), 0);
}

static ebpo_mesh small_mesh(void)
{
    ebpo_mesh mesh = ebpo_test_torus(1, 0.375, 24, 18);
    ebpo_test_to_float(&mesh);
    return mesh;
}

START_TEST(test_attributes_same_in_all_encodings)
{
    ebpo_mesh solid = small_mesh();
    for (uint64_t seed = 1; seed <= 12; seed++) {
        ebpo_mesh text = parse_seed(&solid, seed, ASCII);
        for (int encoding = LITTLE; encoding < ENCODINGS; encoding++) {
            ebpo_mesh other = parse_seed(&solid, seed, encoding);
            same(text.attributes, other.attributes);
            ebpo_mesh_free(&other);
        }
        ebpo_mesh_free(&text);
    }
    ebpo_mesh_free(&solid);
}
END_TEST

/* --- through a file --- */

static void write_file(ebpo_mesh *mesh, const char *path, uint64_t subtree_faces)
{
    ebpo_prepare_options prepare = EBPO_PREPARE_OPTIONS_INIT;
    ebpo_prepared prepared = EBPO_PREPARED_INIT;
    ebpo_build_options build = EBPO_BUILD_OPTIONS_INIT;
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    ebpo_tree tree;
    write.subtree_faces = subtree_faces;
    fine(ebpo_mesh_prepare(mesh, &prepare, &prepared, &error));
    fine(ebpo_build(mesh, &prepared.report, &prepared.record, &build, &tree, &error));
    fine(ebpo_tree_write(&tree, path, &write, &error));
    ebpo_tree_free(&tree);
}

static ebpo_mesh read_back(const char *path)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_file *file;
    ebpo_mesh mesh;
    bool ordered;
    read.attributes = 1;
    fine(ebpo_open(path, &file, &error));
    fine(ebpo_file_check_content(file, NULL, &error));
    fine(ebpo_file_read_source_mesh(file, &read, &mesh, &ordered, &error));
    ck_assert(ordered);
    ebpo_close(file);
    return mesh;
}

START_TEST(test_attributes_file_round_trip)
{
    ebpo_mesh solid = small_mesh();
    for (uint64_t seed = 1; seed <= 8; seed++) {
        ebpo_mesh source = parse_seed(&solid, seed, LITTLE), given = parse_seed(&solid, seed, BIG);
        fine(ebpo_mesh_write_ply(&source, scratch("source.ply"), &error));
        write_file(&given, scratch("a.ebpo.h5"), seed % 2 ? EBPO_NO_SUBTREES : 40);
        ebpo_mesh back = read_back(scratch("a.ebpo.h5"));
        same(source.attributes, back.attributes);
        fine(ebpo_mesh_write_ply(&back, scratch("back.ply"), &error));
        same_files(scratch("source.ply"), scratch("back.ply"));
        ebpo_mesh_free(&source);
        ebpo_mesh_free(&back);
    }
    ebpo_mesh_free(&solid);
}
END_TEST

START_TEST(test_attributes_ply_round_trip)
{
    ebpo_mesh solid = small_mesh(), again;
    ebpo_mesh_read_options how = EBPO_MESH_READ_OPTIONS_INIT;
    how.attributes = 1;
    for (uint64_t seed = 20; seed < 26; seed++) {
        ebpo_mesh source = parse_seed(&solid, seed, LITTLE);
        size_t size;
        uint8_t *data = make_ply(&solid, seed, LITTLE, &size);
        FILE *out = fopen(scratch("made.ply"), "wb");
        ck_assert(fwrite(data, 1, size, out) == size && fclose(out) == 0);
        free(data);
        fine(ebpo_mesh_write_ply(&source, scratch("again.ply"), &error));
        fine(ebpo_mesh_read(scratch("again.ply"), &how, &again, &error));
        same(source.attributes, again.attributes);
        /* types have several names, but the values and therefore the bytes are the same */
        same_files(scratch("made.ply"), scratch("again.ply"));
        ebpo_mesh_free(&source);
        ebpo_mesh_free(&again);
    }
    ebpo_mesh_free(&solid);
}
END_TEST

/* --- subsets --- */

static void same_rows(const ebpo_attributes *whole, const ebpo_attributes *part,
                      const char *element, const uint32_t *source, uint64_t count)
{
    for (uint64_t i = 0, k = 0; i < whole->count; i++) {
        if (!ebpo_attribute_is_of_mesh(&whole->array[i]))
            continue;
        ck_assert_uint_lt(k, part->count);
        const ebpo_attribute *a = &whole->array[i], *b = &part->array[k++];
        same_head(a, b);
        if (!ebpo_attribute_is_of(a, element))
            continue;
        ck_assert_uint_eq(b->rows, count);
        for (uint64_t row = 0; row < count; row++)
            ck_assert(same_row(a, source[row], b, row));
    }
}

START_TEST(test_attributes_of_subset_follow_mesh)
{
    ebpo_mesh solid = small_mesh(), mesh;
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    read.attributes = 1;
    for (uint64_t seed = 40; seed < 46; seed++) {
        ebpo_mesh source = parse_seed(&solid, seed, LITTLE), given = parse_seed(&solid, seed, BIG);
        ebpo_subset_options cut = EBPO_SUBSET_OPTIONS_INIT;
        ebpo_file *file, *part;
        ebpo_maps maps;
        write_file(&given, scratch("a.ebpo.h5"), 40);
        fine(ebpo_open(scratch("a.ebpo.h5"), &file, &error));
        cut.boxed = true;
        for (int k = 0; k < 3; k++)
            cut.min[k] = 0, cut.max[k] = 1;
        fine(ebpo_subset(file, scratch("b.ebpo.h5"), &cut, &error));
        fine(ebpo_open(scratch("b.ebpo.h5"), &part, &error));
        fine(ebpo_file_check_content(part, NULL, &error));
        fine(ebpo_file_read_mesh(part, &read, &mesh, &error));
        fine(ebpo_file_read_maps(part, NULL, &maps, &error));
        ck_assert_uint_lt(mesh.face_count, source.face_count);
        same_rows(source.attributes, mesh.attributes, "vertex", maps.vertex_source,
                  mesh.vertex_count);
        same_rows(source.attributes, mesh.attributes, "face", maps.face_source, mesh.face_count);
        ebpo_maps_free(&maps);
        ebpo_mesh_free(&mesh);
        ebpo_mesh_free(&source);
        ebpo_close(part);
        ebpo_close(file);
    }
    ebpo_mesh_free(&solid);
}
END_TEST

/* Returns the number of lists with different lengths. */
static uint64_t pick_none(const ebpo_mesh *solid, uint64_t seed)
{
    static const char *const elements[] = { "vertex", "face" };
    ebpo_mesh mesh = parse_seed(solid, seed, LITTLE);
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_attributes *to;
    ebpo_chunks *chunks;
    ebpo_file *file;
    uint64_t lists = 0;
    write_file(&mesh, scratch("a.ebpo.h5"), 40);
    fine(ebpo_open(scratch("a.ebpo.h5"), &file, &error));
    fine(ebpo_chunks_make(&chunks, file, 0, &error));
    fine(ebpo_attributes_read_head(file, &read, &to, &error));
    for (int e = 0; e < 2; e++) {
        fine(ebpo_pick_attributes(chunks, to, elements[e], NULL, 0, 1, &error));
        for (uint64_t i = 0; i < to->count; i++)
            if (ebpo_attribute_is_of(&to->array[i], elements[e])) {
                ck_assert_uint_eq(to->array[i].rows, 0);
                lists += file->attributes.head[i].different;
            }
    }
    ebpo_attributes_free(to);
    ebpo_chunks_free(chunks);
    ebpo_close(file);
    ebpo_mesh_free(&mesh);
    return lists;
}

START_TEST(test_attributes_pick_of_no_rows)
{
    ebpo_mesh solid = small_mesh();
    uint64_t lists = 0;
    for (uint64_t seed = 40; seed < 46; seed++)
        lists += pick_none(&solid, seed);
    ck_assert_uint_gt(lists, 0);
    ebpo_mesh_free(&solid);
}
END_TEST

/* --- changes on the way --- */

static ebpo_mesh parse_text(const char *text) { return parse((const uint8_t *)text, strlen(text)); }

static const char two_triangles[] =
    "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\n"
    "property float z\nproperty uchar red\nelement face 2\n"
    "property list uchar int vertex_indices\nproperty int label\nend_header\n"
    "0 0 0 1\n1 0 0 2\n0 1 0 3\n1 0 0 2\n1 1 0 5\n0 1 0 6\n3 0 1 2 70\n3 3 4 5 71\n";

static void weld_two(bool arranged)
{
    ebpo_mesh mesh = parse_text(two_triangles);
    ebpo_progress nobody = { NULL, NULL };
    if (arranged)
        fine(ebpo_mesh_arrange(&mesh, 1, nobody, &error));
    fine(ebpo_mesh_weld(&mesh, NULL, &error));
    const ebpo_attribute *red = &mesh.attributes->array[0];
    ck_assert_uint_eq(mesh.vertex_count, 4);
    ck_assert_uint_eq(red->rows, 4);
    ck_assert(memcmp(red->values, (uint8_t[]){ 1, 2, 3, 5 }, 4) == 0);
    ck_assert_str_eq(
        ebpo_mesh_attributes_lost(&mesh),
        "attribute values of joined vertices that differ from the remaining vertex: 1");
    ebpo_mesh_free(&mesh);
}

START_TEST(test_attributes_of_joined_vertices_keep_first)
{
    weld_two(false);
    weld_two(true);
}
END_TEST

START_TEST(test_attributes_of_triangles_follow_polygon)
{
    ebpo_mesh mesh = parse_text(
        "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
        "property float z\nelement face 4\nproperty short label\n"
        "property list uchar int vertex_indices\nproperty list uchar uchar words\nend_header\n"
        "0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n"
        "7 4 0 1 2 3 2 8 9\n1 2 0 1 1 4\n-2 3 0 1 4 0\n300 5 0 1 2 3 4 1 5\n");
    const ebpo_attribute *label = &mesh.attributes->array[0], *words = &mesh.attributes->array[1];
    ck_assert_uint_eq(mesh.face_count, 6); /* an item with two corners is not a face */
    ck_assert(memcmp(label->values, (int16_t[]){ 7, 7, -2, 300, 300, 300 }, 12) == 0);
    ck_assert(memcmp(words->ends, (uint64_t[]){ 2, 4, 4, 5, 6, 7 }, 48) == 0);
    ck_assert(memcmp(words->values, (uint8_t[]){ 8, 9, 8, 9, 5, 5, 5 }, 7) == 0);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* A list of as many items as its polygon has corners would be copied to each of the polygon's
 * triangles. The other attributes stay. */
START_TEST(test_attributes_copies_of_lists_are_limited)
{
    enum { CORNERS = 36000 };
    ebpo_text_stream text;
    ck_assert(ebpo_text_stream_begin(&text));
    fprintf(text.file,
            "ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float y\n"
            "property float z\nelement face 2\nproperty list int int vertex_indices\n"
            "property list int uchar words\nproperty uchar label\nend_header\n",
            CORNERS);
    for (int i = 0; i < CORNERS; i++)
        fprintf(text.file, "%.9g %.9g 0\n", cos(2 * M_PI * i / CORNERS),
                sin(2 * M_PI * i / CORNERS));
    fprintf(text.file, "%d", CORNERS);
    for (int i = 0; i < CORNERS; i++)
        fprintf(text.file, " %d", i);
    fprintf(text.file, " %d", CORNERS);
    for (int i = 0; i < CORNERS; i++)
        fputs(" 1", text.file);
    fputs(" 7\n4 0 2 1 9 1 5 8\n", text.file);
    ck_assert(ebpo_text_stream_end(&text));
    ebpo_mesh mesh = parse((const uint8_t *)text.text, text.bytes);
    free(text.text);
    ck_assert_uint_eq(mesh.face_count, CORNERS);
    const char *lost = ebpo_mesh_attributes_lost(&mesh);
    ck_assert(lost && strstr(lost, "property 'words' of 'face' (copies"));
    ck_assert_uint_eq(mesh.attributes->count, 1);
    const ebpo_attribute *label = &mesh.attributes->array[0];
    ck_assert(label->values[CORNERS - 3] == 7 && label->values[CORNERS - 2] == 8);
    ebpo_mesh_free(&mesh);
}
END_TEST

static const char strip_vertices[] =
    "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
    "property float z\n";
static const char strip_faces[] =
    "element face 2\nproperty list uchar int vertex_indices\nproperty short label\n"
    "property list uchar uchar words\n";
static const char strip_strips[] = "element tristrips 1\nproperty list int int vertex_indices\n";
static const char strip_points[] = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n";
static const char strip_rows[] = "3 0 1 2 7 2 8 9\n3 0 2 3 -2 1 4\n";

static ebpo_mesh parse_strips(bool first)
{
    char text[1024];
    snprintf(text, sizeof text, "%s%s%send_header\n%s%s%s", strip_vertices,
             first ? strip_strips : strip_faces, first ? strip_faces : strip_strips, strip_points,
             first ? "4 0 1 4 3\n" : strip_rows, first ? strip_rows : "4 0 1 4 3\n");
    return parse_text(text);
}

START_TEST(test_attributes_of_strips_are_empty)
{
    ebpo_mesh mesh = parse_strips(false);
    const ebpo_attribute *label = &mesh.attributes->array[0], *words = &mesh.attributes->array[1];
    ck_assert(mesh.face_count == 4 && label->rows == 4 && words->rows == 4);
    ck_assert(memcmp(label->values, (int16_t[]){ 7, -2, 0, 0 }, 8) == 0);
    ck_assert(memcmp(words->ends, (uint64_t[]){ 2, 3, 3, 3 }, 32) == 0);
    ebpo_mesh_free(&mesh);
    mesh = parse_strips(true);
    label = &mesh.attributes->array[0];
    words = &mesh.attributes->array[1];
    ck_assert(memcmp(label->values, (int16_t[]){ 0, 0, 7, -2 }, 8) == 0);
    ck_assert(memcmp(words->ends, (uint64_t[]){ 0, 0, 2, 3 }, 32) == 0);
    ck_assert(memcmp(words->values, (uint8_t[]){ 8, 9, 4 }, 3) == 0);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* A face element without rows states its properties. The triangles belong to strips. */
START_TEST(test_attributes_ply_writes_every_property)
{
    ebpo_mesh back,
        mesh = parse_text(
            "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
            "property float z\nelement face 0\nproperty list uchar int vertex_indices\n"
            "property uchar flag\nelement tristrips 1\nproperty list int int vertex_indices\n"
            "end_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n4 0 1 2 3\n");
    fine(ebpo_mesh_write_ply(&mesh, scratch("a.ply"), &error));
    fine(ebpo_mesh_read(scratch("a.ply"), NULL, &back, &error));
    ck_assert_uint_eq(back.face_count, 2);
    ck_assert(memcmp(back.faces, mesh.faces, 6 * sizeof *back.faces) == 0);
    ebpo_mesh_free(&mesh);
    ebpo_mesh_free(&back);
}
END_TEST

/* Types have two names. A mesh without other data is also written with the names of its source, and
 * with elements that have no properties. */
START_TEST(test_attributes_ply_keeps_source_header)
{
    static const char head[] = "ply\nformat binary_little_endian 1.0\nelement vertex 3\n"
                               "property float32 x\nproperty float32 y\nproperty float32 z\n"
                               "element face 1\nproperty list uint8 int32 vertex_indices\n"
                               "element mark 2\nend_header\n";
    enum { HEAD = sizeof head - 1, BODY = 36 + 13 };
    uint8_t data[HEAD + BODY] = { 0 }, written[HEAD + BODY + 1];
    memcpy(data, head, HEAD);
    data[HEAD + 15] = 0x3f; /* the second vertex has x = 0.5, the third has y = 0.5 */
    data[HEAD + 31] = 0x3f;
    data[HEAD + 36] = 3;
    data[HEAD + 41] = 1;
    data[HEAD + 45] = 2;
    ebpo_mesh mesh = parse(data, sizeof data);
    fine(ebpo_mesh_write_ply(&mesh, scratch("a.ply"), &error));
    FILE *f = fopen(scratch("a.ply"), "rb");
    ck_assert_uint_eq(fread(written, 1, sizeof written, f), sizeof data);
    fclose(f);
    ck_assert_mem_eq(written, data, sizeof data);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_attributes_report_lost_properties)
{
    ebpo_mesh mesh =
        parse_text("ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                   "property float z\nproperty uchar red\nproperty float q\nelement face 1\n"
                   "property list uchar int vertex_indices\nend_header\n"
                   "0 0 0 255 nan\n1 0 0 256 inf\n0 1 0 7 1e999\n3 0 1 2\n");
    ck_assert_uint_eq(mesh.attributes->count, 1);
    ck_assert_str_eq(mesh.attributes->array[0].names, "q");
    ck_assert_str_eq(ebpo_mesh_attributes_lost(&mesh),
                     "property 'red' of 'vertex' (row 1 has '256', which does not fit its type)");
    ebpo_mesh_free(&mesh);
    mesh = parse_text("ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
                      "property float y\nproperty float z\nelement face 1\n"
                      "property list uchar int vertex_indices\nend_header\n"
                      "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    ck_assert(!mesh.attributes && !ebpo_mesh_attributes_lost(&mesh));
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_attributes_of_elements_with_equal_name)
{
    ebpo_mesh mesh =
        parse_text("ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                   "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
                   "element note 2\nproperty int a\nelement note 3\nproperty int b\n"
                   "element note 2\nproperty int c\nend_header\n"
                   "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n1\n2\n3\n4\n5\n6\n7\n");
    ck_assert_uint_eq(mesh.attributes->count, 2);
    ck_assert_str_eq(mesh.attributes->array[1].names, "c");
    ck_assert_str_eq(
        ebpo_mesh_attributes_lost(&mesh),
        "property 'b' of 'note' (another element has the same name and a different row count)");
    write_file(&mesh, scratch("a.ebpo.h5"), 0);
}
END_TEST

/* Lists colours of vertices with one byte for each component, also with other names, and other
 * values. */
START_TEST(test_attributes_are_listed_by_file)
{
    ebpo_mesh mesh = parse_text(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
        "property float z\nproperty uchar diffuse_red\nproperty uchar diffuse_green\n"
        "property uchar diffuse_blue\nproperty float quality\nelement face 4\n"
        "property list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n"
        "0 0 0 9 8 7 nan\n0 1 0 6 5 4 -2\n1 0 0 3 2 1 3\n0 0 1 0 0 200 nan\n"
        "3 0 1 2 2 0 1\n3 0 3 1 2 2 3\n3 0 2 3 2 4 5\n3 1 3 2 2 6 7\n");
    ebpo_attribute_facts facts = EBPO_ATTRIBUTE_FACTS_INIT;
    ebpo_attribute_values values;
    ebpo_file *file;
    write_file(&mesh, scratch("a.ebpo.h5"), 0);
    fine(ebpo_open(scratch("a.ebpo.h5"), &file, &error));
    ck_assert(ebpo_file_attribute(file, 0, &facts));
    ck_assert_str_eq(facts.names, "diffuse_red diffuse_green diffuse_blue");
    ck_assert(facts.columns == 3 && facts.rows == 4 && facts.has_range && facts.range[1] == 200);
    ck_assert(ebpo_file_attribute(file, 1, &facts));
    ck_assert(facts.range[0] == -2 && facts.range[1] == 3);
    ck_assert_str_eq(ebpo_attribute_type_text(facts.type), "float32");
    ck_assert(ebpo_file_attribute(file, 2, &facts));
    ck_assert(facts.list && facts.columns == 2);
    ck_assert(!ebpo_file_attribute(file, 3, &facts) && !ebpo_attribute_type_text(8));
    fine(ebpo_file_read_attribute(file, 0, NULL, &values, &error));
    ck_assert_uint_eq(values.count, 12);
    ebpo_attribute_values_free(&values);
    ck_assert_int_eq(ebpo_file_read_attribute(file, 3, NULL, &values, &error), EBPO_E_ABSENT);
    ebpo_close(file);
}
END_TEST

TEST_SUITE(mesh_attributes)
{
    Suite *suite = suite_create("attributes");
    TCase *tests = tcase_create("attributes");
    tcase_add_checked_fixture(tests, scratch_enter, scratch_leave);
    tcase_set_timeout(tests, 300);
    tcase_add_test(tests, test_attributes_same_in_all_encodings);
    tcase_add_test(tests, test_attributes_file_round_trip);
    tcase_add_test(tests, test_attributes_ply_round_trip);
    tcase_add_test(tests, test_attributes_of_subset_follow_mesh);
    tcase_add_test(tests, test_attributes_pick_of_no_rows);
    tcase_add_test(tests, test_attributes_of_joined_vertices_keep_first);
    tcase_add_test(tests, test_attributes_of_triangles_follow_polygon);
    tcase_add_test(tests, test_attributes_copies_of_lists_are_limited);
    tcase_add_test(tests, test_attributes_of_strips_are_empty);
    tcase_add_test(tests, test_attributes_ply_writes_every_property);
    tcase_add_test(tests, test_attributes_ply_keeps_source_header);
    tcase_add_test(tests, test_attributes_report_lost_properties);
    tcase_add_test(tests, test_attributes_of_elements_with_equal_name);
    tcase_add_test(tests, test_attributes_are_listed_by_file);
    suite_add_tcase(suite, tests);
    return suite;
}
