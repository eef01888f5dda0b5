/* Components of a mesh against reference implementations: neighbours step by step, cavities by all
 * faces. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "check_main.h"
#include "geometry/predicates.h"
#include "mesh/mesh_parts.h"
#include "solids.h"

static const ebpo_progress silent = { NULL, NULL };

/* ---- meshes ---- */

enum { KINDS = 8 };

static void add_box(ebpo_mesh *m, double x, double half, bool reversed)
{
    double low[3] = { x - half, -half, -half }, high[3] = { x + half, half, half };
    ebpo_mesh box = ebpo_test_box(low, high, 1 + (uint32_t)half % 3);
    if (reversed)
        ebpo_test_reverse(&box);
    ebpo_test_append(m, &box);
    ebpo_mesh_free(&box);
}

/* Makes boxes in boxes: solids, cavities, islands in cavities, cavities in these, and two separate
 * boxes. */
static ebpo_mesh nested(uint64_t *state)
{
    double low[3] = { -40, -40, -40 }, high[3] = { 40, 40, 40 };
    ebpo_mesh m = ebpo_test_box(low, high, 4);
    for (int i = 0; i < 12; i++) {
        double x = 10.0 * (double)(ebpo_test_random(state) % 8) - 35;
        add_box(&m, x, 0.5 + (double)(ebpo_test_random(state) % 12),
                ebpo_test_random(state) % 2 == 0);
    }
    add_box(&m, 100, 4, true);  /* a box in no other box */
    add_box(&m, 80, 40, false); /* shares a side with the first box */
    add_box(&m, 44, 3, true);   /* the common face of the two boxes passes through its middle */
    return m;
}

/* Makes an open component, a component in it, one that is not oriented, faces with a repeated
 * vertex, and unused vertices. */
static ebpo_mesh awkward(uint64_t *state)
{
    ebpo_mesh m = nested(state), sheet = ebpo_test_sheet(30, 3), band = ebpo_test_band(9, true);
    ebpo_test_append(&m, &sheet);
    ebpo_test_append(&m, &band);
    ebpo_test_turn_face(&m, 3);
    uint32_t v = ebpo_test_append_vertex(&m, 1, 2, 3);
    ebpo_test_append_vertex(&m, 1, 2, 4);
    ebpo_test_append_face(&m, v, v, 5);
    ebpo_mesh_free(&sheet);
    ebpo_mesh_free(&band);
    return m;
}

static ebpo_mesh some_mesh(int kind, uint64_t seed)
{
    uint64_t state = seed;
    ebpo_mesh m = kind % 4 == 0   ? nested(&state)
                  : kind % 4 == 1 ? awkward(&state)
                  : kind % 4 == 2 ? ebpo_test_tetrahedra(60)
                                  : ebpo_test_blob(7, 30, seed);
    ebpo_test_shuffle(&m, seed + 1);
    if (kind >= 4)
        ebpo_test_to_float(&m);
    return m;
}

/* ---- the reference implementation: for a mesh in source order ---- */

typedef struct reference {
    uint64_t count;
    uint32_t *of; /* [face_count] */
    bool *open;
    double *volume;
    uint32_t *host, *first;
} reference;

static bool share(const ebpo_mesh *m, uint64_t f, uint64_t g)
{
    for (int i = 0; i < 9; i++)
        if (m->faces[3 * f + (uint64_t)i / 3] == m->faces[3 * g + (uint64_t)i % 3])
            return true;
    return false;
}

static void flood(const ebpo_mesh *m, reference *t, uint64_t first)
{
    uint64_t *queue = malloc(m->face_count * sizeof *queue), begin = 0, end = 1;
    queue[0] = first;
    t->of[first] = (uint32_t)t->count;
    while (begin < end) {
        uint64_t f = queue[begin++];
        for (uint64_t g = 0; g < m->face_count; g++)
            if (t->of[g] == UINT32_MAX && share(m, f, g)) {
                t->of[g] = (uint32_t)t->count;
                queue[end++] = g;
            }
    }
    free(queue);
}

/* Returns how often faces of the component run from a to b, minus how often from b to a. */
static int balance(const ebpo_mesh *m, const reference *t, uint32_t c, uint32_t a, uint32_t b)
{
    int sum = 0;
    for (uint64_t f = 0; f < m->face_count; f++)
        for (uint64_t k = 0; k < 3 && t->of[f] == c; k++) {
            uint32_t x = m->faces[3 * f + k], y = m->faces[3 * f + (k + 1) % 3];
            sum += (x == a && y == b) - (x == b && y == a);
        }
    return sum;
}

static void measure(const ebpo_mesh *m, reference *t)
{
    for (uint64_t f = 0; f < m->face_count; f++) {
        double p[3][3], cross[3];
        for (uint64_t k = 0; k < 3; k++) {
            uint32_t a = m->faces[3 * f + k], b = m->faces[3 * f + (k + 1) % 3];
            ebpo_mesh_position(m, a, p[k]);
            t->open[t->of[f]] |= a != b && balance(m, t, t->of[f], a, b) != 0;
        }
        ebpo_face_cross(p[0], p[1], p[2], cross);
        for (int k = 0; k < 3; k++)
            t->volume[t->of[f]] += p[0][k] * cross[k];
    }
}

static int winding(const ebpo_mesh *m, const reference *t, uint32_t c, const double at[3])
{
    int sum = 0;
    for (uint64_t f = 0; f < m->face_count; f++) {
        double p[3][3];
        for (uint64_t k = 0; k < 3; k++)
            ebpo_mesh_position(m, m->faces[3 * f + k], p[k]);
        /* uses another method than the library, with the same shift of the point */
        if (t->of[f] == c)
            sum += ebpo_axis_crossing(at, 1e6, 2, p[0], p[1], p[2]);
    }
    return sum;
}

static void place(const ebpo_mesh *m, reference *t)
{
    for (uint32_t c = 0; c < t->count; c++) {
        double at[3];
        t->host[c] = c;
        ebpo_mesh_position(m, m->faces[3 * (uint64_t)t->first[c]], at);
        for (uint32_t h = 0; h < t->count && !t->open[c] && t->volume[c] < -1e-9; h++)
            if (!t->open[h] && t->volume[h] > 1e-9 && winding(m, t, h, at) != 0 &&
                (t->host[c] == c || t->volume[h] < t->volume[t->host[c]] * (1 - 1e-12)))
                t->host[c] = h;
    }
}

static reference make_reference(const ebpo_mesh *m)
{
    uint64_t n = m->face_count;
    reference t = { 0,
                    malloc(n * sizeof(uint32_t)),
                    calloc(n, sizeof(bool)),
                    calloc(n, sizeof(double)),
                    calloc(n, sizeof(uint32_t)),
                    calloc(n, sizeof(uint32_t)) };
    memset(t.of, 0xff, n * sizeof *t.of);
    for (uint64_t f = 0; f < n; f++)
        if (t.of[f] == UINT32_MAX) {
            flood(m, &t, f);
            t.first[t.count++] = (uint32_t)f;
        }
    measure(m, &t);
    place(m, &t);
    return t;
}

static void free_reference(reference *t)
{
    free(t->of);
    free(t->open);
    free(t->volume);
    free(t->host);
    free(t->first);
}

/* ---- what is expected ---- */

static uint64_t cavities_of(const reference *t, uint32_t host)
{
    uint64_t count = 0;
    for (uint32_t c = 0; c < t->count; c++)
        count += t->host[c] == host && c != host;
    return count;
}

/* Checks that faces and vertices equal the source, bit by bit, at the indices stated by the part.
 */
static void expect_faces(const ebpo_mesh *part, const ebpo_mesh *source, const reference *t,
                         uint32_t host, uint8_t *seen)
{
    for (uint64_t f = 0; f < part->face_count; f++) {
        uint64_t from = ebpo_mesh_source_face(part, f);
        ck_assert(from < source->face_count && !seen[from]++);
        ck_assert_uint_eq(t->host[t->of[from]], host);
        for (uint64_t k = 0; k < 3; k++) {
            uint32_t v = part->faces[3 * f + k];
            double p[3], q[3];
            ck_assert_uint_lt(v, part->vertex_count);
            ck_assert_uint_eq(ebpo_mesh_source_vertex(part, v), source->faces[3 * from + k]);
            ebpo_mesh_position(part, v, p);
            ebpo_mesh_position(source, source->faces[3 * from + k], q);
            ck_assert(memcmp(p, q, sizeof p) == 0);
        }
    }
}

static void expect_part(const ebpo_components *c, uint64_t i, const ebpo_mesh *source,
                        const reference *t, uint8_t *seen)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_component facts = EBPO_COMPONENT_INIT;
    ebpo_mesh_report report;
    ebpo_mesh part;
    ck_assert(ebpo_components_get(c, i, &facts, &error) == EBPO_OK);
    uint32_t host = t->host[t->of[facts.first_face]];
    ck_assert(facts.closed == !t->open[host]);
    ck_assert_uint_eq(facts.cavities, cavities_of(t, host));
    ck_assert_msg(ebpo_components_mesh(c, i, &part, &error) == EBPO_OK, "%s", error.message);
    ck_assert(part.face_count == facts.face_count && part.vertex_count == facts.vertex_count);
    expect_faces(&part, source, t, host, seen);
    uint64_t least = UINT64_MAX;
    for (uint64_t f = 0; f < part.face_count; f++)
        if (ebpo_mesh_source_face(&part, f) < least)
            least = ebpo_mesh_source_face(&part, f);
    ck_assert_uint_eq(least, facts.first_face);
    ck_assert(ebpo_mesh_arrange(&part, 1, silent, &error) == EBPO_OK);
    ck_assert(ebpo_mesh_check(&part, 1, silent, &report, &error) == EBPO_OK);
    ck_assert_uint_eq(report.unreferenced_vertices.count, 0);
    ck_assert_uint_eq(report.components, 1 + facts.cavities);
    ck_assert(report.balanced == facts.closed);
    ebpo_mesh_free(&part);
}

static void expect_all(const ebpo_mesh *m, const ebpo_mesh *source, const reference *t,
                       unsigned threads)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_components *c = NULL;
    uint64_t count = 0, before = 0;
    uint8_t *seen = calloc(1, source->face_count);
    for (uint32_t i = 0; i < t->count; i++)
        count += t->host[i] == i;
    ck_assert_msg(ebpo_components_new(m, threads, silent, &c, &error) == EBPO_OK, "%s",
                  error.message);
    ck_assert_uint_eq(ebpo_components_count(c), count);
    for (uint64_t i = 0; i < count; i++) {
        ebpo_component facts = EBPO_COMPONENT_INIT;
        ck_assert(ebpo_components_get(c, i, &facts, &error) == EBPO_OK);
        ck_assert(i == 0 || facts.first_face > before);
        before = facts.first_face;
        expect_part(c, i, source, t, seen);
    }
    for (uint64_t f = 0; f < source->face_count; f++)
        ck_assert_uint_eq(seen[f], 1);
    ebpo_component facts = EBPO_COMPONENT_INIT;
    ebpo_mesh none;
    ck_assert(ebpo_components_get(c, count, &facts, &error) == EBPO_E_ARGUMENT);
    ck_assert(ebpo_components_mesh(c, count, &none, &error) == EBPO_E_ARGUMENT && !none.faces);
    ebpo_components_free(c);
    free(seen);
}

START_TEST(test_components_match_reference)
{
    for (uint64_t round = 0; round < ebpo_test_scaled(3); round++) {
        uint64_t seed = 100 * (uint64_t)_i + round;
        ebpo_mesh source = some_mesh(_i, seed), m = some_mesh(_i, seed);
        ebpo_error error = EBPO_ERROR_INIT;
        reference t = make_reference(&source);
        expect_all(&m, &source, &t, 1);
        ck_assert(ebpo_mesh_arrange(&m, 2, silent, &error) == EBPO_OK);
        expect_all(&m, &source, &t, 2);
        free_reference(&t);
        ebpo_mesh_free(&source);
        ebpo_mesh_free(&m);
    }
}
END_TEST

/* ---- results ---- */

/* The file states the face count of the whole mesh, and uses its indices. */
START_TEST(test_component_file_keeps_source_indices)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_build_options build = EBPO_BUILD_OPTIONS_INIT;
    ebpo_components *c = NULL;
    ebpo_mesh m = ebpo_test_tetrahedra(20), part;
    ebpo_mesh_report report;
    ebpo_tree tree;
    ck_assert(ebpo_components_new(&m, 1, silent, &c, &error) == EBPO_OK);
    ck_assert_uint_eq(ebpo_components_count(c), 20);
    ck_assert(ebpo_components_mesh(c, 7, &part, &error) == EBPO_OK);
    ck_assert(ebpo_mesh_check(&part, 1, silent, &report, &error) == EBPO_OK);
    ck_assert_msg(ebpo_build(&part, &report, NULL, &build, &tree, &error) == EBPO_OK, "%s",
                  error.message);
    ck_assert_uint_eq(tree.info.source_face_count, 80);
    ck_assert_uint_eq(tree.info.source_vertex_count, 80);
    ck_assert_uint_eq(tree.info.face_count, 4);
    for (int i = 0; i < 4; i++)
        ck_assert(tree.face_source[i] >= 28 && tree.face_source[i] < 32 &&
                  tree.vertex_source[i] >= 28 && tree.vertex_source[i] < 32);
    ebpo_tree_free(&tree);
    ebpo_components_free(c);
    ebpo_mesh_free(&m);
}
END_TEST

/* Source indices refer to the whole mesh. Faces added by repairs would have no source index. */
START_TEST(test_component_repair_is_refused)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_components *c = NULL;
    ebpo_mesh m = ebpo_test_sheet(1, 2), other = ebpo_test_make("cube"), part;
    ebpo_test_split_vertices(&other);
    ebpo_test_append(&m, &other);
    ck_assert(ebpo_components_new(&m, 1, silent, &c, &error) == EBPO_OK);
    ck_assert_uint_eq(ebpo_components_count(c), 1 + other.face_count);
    ck_assert(ebpo_components_mesh(c, 0, &part, &error) == EBPO_OK);
    ck_assert(ebpo_mesh_weld(&part, NULL, &error) == EBPO_OK); /* nothing to weld */
    ck_assert(ebpo_mesh_fill_holes(&part, NULL, &error) == EBPO_E_ARGUMENT);
    ebpo_mesh_free(&part);
    ebpo_components_free(c);
    ebpo_mesh_free(&other);
    ebpo_mesh_free(&m);
}
END_TEST

START_TEST(test_components_of_bad_meshes_are_refused)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_components *c = NULL;
    ebpo_mesh m = ebpo_test_tetrahedron(1);
    m.faces[5] = 4;
    ck_assert(ebpo_components_new(&m, 1, silent, &c, &error) == EBPO_E_FORMAT && !c);
    ck_assert(strstr(error.message, "face 1") != NULL);
    m.face_count = 0;
    ck_assert(ebpo_components_new(&m, 1, silent, &c, &error) == EBPO_E_FORMAT && !c);
    ck_assert_uint_eq(ebpo_components_count(NULL), 0);
    ebpo_mesh_free(&m);
}
END_TEST

TEST_SUITE(components)
{
    Suite *suite = suite_create("components");
    TCase *tests = tcase_create("components");
    tcase_set_timeout(tests, 600);
    tcase_add_loop_test(tests, test_components_match_reference, 0, KINDS);
    tcase_add_test(tests, test_component_file_keeps_source_indices);
    tcase_add_test(tests, test_component_repair_is_refused);
    tcase_add_test(tests, test_components_of_bad_meshes_are_refused);
    suite_add_tcase(suite, tests);
    return suite;
}
