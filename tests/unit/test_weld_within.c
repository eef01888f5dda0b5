/* Compares welding within a distance with a comparison of all pairs in integers. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "construct/arrange.h"
#include "check_main.h"
#include "mesh/mesh_parts.h"
#include "solids.h"

enum { LIMIT = 400, FACES = 300 };

static const ebpo_progress silent = { NULL, NULL };

typedef struct point {
    int64_t at[3];
} point;

typedef struct soup {
    uint32_t vertices;
    point vertex[LIMIT];
    uint32_t face[FACES][3];
    int64_t offset; /* offset of coordinates, in units of 1/8 */
} soup;

static uint64_t state;

static uint32_t below(uint32_t n) { return (uint32_t)(ebpo_test_random(&state) % n); }

static void make_soup(soup *s, uint32_t side, int64_t offset)
{
    s->vertices = 3 + below(LIMIT - 3);
    s->offset = offset;
    for (uint32_t i = 0; i < s->vertices; i++)
        for (int k = 0; k < 3; k++)
            s->vertex[i].at[k] = below(side);
    for (int f = 0; f < FACES; f++)
        for (int k = 0; k < 3; k++)
            s->face[f][k] = below(s->vertices);
    s->vertex[0] = (point){ { 0, 0, 0 } };
    s->vertex[1] = (point){ { side, side, side } };
}

static ebpo_mesh mesh_of(const soup *s, bool single)
{
    ebpo_mesh m;
    memset(&m, 0, sizeof m);
    for (uint32_t i = 0; i < s->vertices; i++)
        ebpo_test_append_vertex(&m, (double)(s->vertex[i].at[0] + s->offset) / 8,
                                (double)(s->vertex[i].at[1] - s->offset) / 8,
                                (double)s->vertex[i].at[2] / 8);
    for (int f = 0; f < FACES; f++)
        ebpo_test_append_face(&m, s->face[f][0], s->face[f][1], s->face[f][2]);
    if (single)
        ebpo_test_to_float(&m);
    return m;
}

/* ---- all pairs ---- */

static int compare_points(const void *x, const void *y)
{
    const point *a = x, *b = y;
    for (int k = 0; k < 3; k++)
        if (a->at[k] != b->at[k])
            return a->at[k] < b->at[k] ? -1 : 1;
    return 0;
}

static int64_t squared(const point *a, const point *b)
{
    int64_t sum = 0;
    for (int k = 0; k < 3; k++)
        sum += (a->at[k] - b->at[k]) * (a->at[k] - b->at[k]);
    return sum;
}

typedef struct expected {
    uint32_t count;
    point stays[LIMIT], becomes[LIMIT];
    int64_t moved;
} expected;

static void weld_reference(const soup *s, int64_t distance, expected *e)
{
    point sorted[LIMIT];
    e->count = 0;
    e->moved = 0;
    memcpy(sorted, s->vertex, sizeof sorted);
    qsort(sorted, s->vertices, sizeof *sorted, compare_points);
    for (uint32_t i = 0; i < s->vertices; i++) {
        bool near = false;
        for (uint32_t j = 0; j < e->count; j++)
            near |= squared(&sorted[i], &e->stays[j]) <= distance * distance;
        if (!near)
            e->stays[e->count++] = sorted[i];
    }
    for (uint32_t i = 0; i < s->vertices; i++) {
        const point *best = &e->stays[0];
        for (uint32_t j = 1; j < e->count; j++)
            if (squared(&s->vertex[i], &e->stays[j]) < squared(&s->vertex[i], best))
                best = &e->stays[j];
        e->becomes[i] = *best;
        if (squared(&s->vertex[i], best) > e->moved)
            e->moved = squared(&s->vertex[i], best);
    }
}

static void compare(const soup *s, const expected *e, ebpo_mesh *m, double distance)
{
    ebpo_repair_record record;
    ebpo_error error = EBPO_ERROR_INIT;
    uint64_t collapsed = 0, repeated = 0;
    memset(&record, 0, sizeof record);
    ck_assert_msg(ebpo_mesh_weld_within(m, distance, &record, &error) == EBPO_OK, "%s",
                  error.message);
    ck_assert_uint_eq(m->vertex_count, e->count);
    ck_assert_uint_eq(record.welded_vertices, s->vertices - e->count);
    ck_assert(record.weld && record.weld_distance == distance);
    ck_assert_double_eq(record.weld_moved, sqrt((double)e->moved / 64));
    for (uint64_t i = 0; i < FACES; i++) {
        uint64_t f = ebpo_mesh_source_face(m, i);
        const uint32_t *v = m->faces + 3 * i, *was = s->face[f];
        for (int k = 0; k < 3; k++) {
            double p[3];
            const int64_t *to = e->becomes[was[k]].at;
            ebpo_mesh_position(m, v[k], p);
            ck_assert(p[0] == (double)(to[0] + s->offset) / 8);
            ck_assert(p[1] == (double)(to[1] - s->offset) / 8);
            ck_assert(p[2] == (double)to[2] / 8);
        }
        /* vertices at one position were merged before, so that those faces have not lost their
         * area */
        bool before = compare_points(&s->vertex[was[0]], &s->vertex[was[1]]) == 0 ||
                      compare_points(&s->vertex[was[1]], &s->vertex[was[2]]) == 0 ||
                      compare_points(&s->vertex[was[2]], &s->vertex[was[0]]) == 0;
        repeated += v[0] == v[1] || v[1] == v[2] || v[2] == v[0];
        collapsed += !before && (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]);
    }
    ck_assert_uint_eq(record.collapsed_faces, collapsed);
    ck_assert_uint_ge(repeated, collapsed);
    ebpo_mesh_free(m);
}

START_TEST(test_weld_within_matches_all_pairs)
{
    static soup s;
    static expected e;
    state = 77 + (uint64_t)_i;
    for (int round = 0; round < 40; round++) {
        uint32_t side = 6 + below(30);
        int64_t distance = 1 + below(5);
        bool far = below(2), single = below(2);
        make_soup(&s, side, far ? (single ? 1 << 20 : INT64_C(1) << 45) : 0);
        weld_reference(&s, distance, &e);
        ebpo_mesh m = mesh_of(&s, single), arranged = mesh_of(&s, single);
        ebpo_error error = EBPO_ERROR_INIT;
        compare(&s, &e, &m, (double)distance / 8);
        ck_assert(ebpo_arrange_to_repair(&arranged, 0, &silent, &error) == EBPO_OK);
        compare(&s, &e, &arranged, (double)distance / 8);
    }
}
END_TEST

/* Welds separate triangles of a torus, whose corners have an error of up to a tenth of the weld
 * distance. Squares of the moves of the small and the large torus underflow and overflow. */
START_TEST(test_weld_within_noisy_soup)
{
    static const int exponents[] = { 0, -660, 660 };
    double first_moved = 0;
    for (int i = 0; i < 3; i++) {
        ebpo_mesh mesh = ebpo_test_make("torus");
        ebpo_error error = EBPO_ERROR_INIT;
        ebpo_repair_record record;
        ebpo_mesh_report report;
        uint64_t vertices = mesh.vertex_count;
        double distance = 0.001;
        state = 5;
        memset(&record, 0, sizeof record);
        ebpo_test_split_vertices(&mesh);
        for (uint64_t k = 0; k < 3 * mesh.vertex_count; k++) {
            mesh.xyz64[k] += distance / 10 * ((double)below(2001) / 1000 - 1);
            mesh.xyz64[k] = ldexp(mesh.xyz64[k], exponents[i]);
        }
        distance = ldexp(distance, exponents[i]);
        ck_assert(ebpo_mesh_weld_within(&mesh, distance, &record, &error) == EBPO_OK);
        ck_assert(record.weld_moved > 0 && record.weld_moved <= 0.4 * distance);
        first_moved = i == 0 ? record.weld_moved : first_moved;
        ck_assert_double_eq_tol(ldexp(record.weld_moved, -exponents[i]), first_moved,
                                1e-15 * first_moved);
        ck_assert_uint_eq(mesh.vertex_count, vertices);
        ck_assert(ebpo_mesh_check(&mesh, 0, silent, &report, &error) == EBPO_OK);
        ck_assert(report.manifold && report.genus == 1);
        ebpo_mesh_free(&mesh);
    }
}
END_TEST

START_TEST(test_weld_within_bad_distance_is_refused)
{
    static const double bad[] = { 0, -1, NAN, INFINITY, 1, 2, 1e-17, 1e-310 };
    ebpo_mesh mesh = ebpo_test_make("cube");
    uint64_t vertices = mesh.vertex_count;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        ebpo_error error = EBPO_ERROR_INIT;
        ck_assert_int_eq(ebpo_mesh_weld_within(&mesh, bad[i], NULL, &error), EBPO_E_ARGUMENT);
        ck_assert_ptr_nonnull(strstr(error.message, "weld distance"));
        ck_assert_uint_eq(mesh.vertex_count, vertices);
    }
    ebpo_mesh_free(&mesh);
}
END_TEST

TEST_SUITE(weld_within)
{
    Suite *suite = suite_create("weld_within");
    TCase *tests = tcase_create("all");
    tcase_set_timeout(tests, 120);
    tcase_add_loop_test(tests, test_weld_within_matches_all_pairs, 0, 10);
    tcase_add_test(tests, test_weld_within_noisy_soup);
    tcase_add_test(tests, test_weld_within_bad_distance_is_refused);
    suite_add_tcase(suite, tests);
    return suite;
}
