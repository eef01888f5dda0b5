/* Borders of meshes: with the caps of its loops, every mesh uses every edge equally often in both
 * directions. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "check_main.h"
#include "geometry/cap_triangles.h"
#include "mesh/border.h"
#include "mesh/mesh_parts.h"
#include "solids.h"

/* ---- the judge: a sorted list of all edge uses ---- */

typedef struct edge_use {
    uint64_t edge; /* lower vertex << 32 | higher vertex */
    int64_t times; /* negative: from the higher to the lower vertex */
} edge_use;

typedef struct use_list {
    edge_use *use;
    uint64_t count;
} use_list;

static void add_use(use_list *l, uint32_t a, uint32_t b, int64_t times)
{
    if (a != b)
        l->use[l->count++] = a < b ? (edge_use){ (uint64_t)a << 32 | b, times }
                                   : (edge_use){ (uint64_t)b << 32 | a, -times };
}

static int compare_uses(const void *a, const void *b)
{
    const edge_use *x = a, *y = b;
    return (x->edge > y->edge) - (x->edge < y->edge);
}

/* Returns the number of edges whose uses do not cancel out. */
static uint64_t unbalanced(use_list *l)
{
    uint64_t bad = 0;
    qsort(l->use, l->count, sizeof *l->use, compare_uses);
    for (uint64_t i = 0, next; i < l->count; i = next) {
        int64_t sum = 0;
        for (next = i; next < l->count && l->use[next].edge == l->use[i].edge; next++)
            sum += l->use[next].times;
        bad += sum != 0;
    }
    return bad;
}

static use_list uses_of(const ebpo_mesh *mesh, uint64_t more)
{
    use_list l = { .use = malloc((3 * mesh->face_count + more + 1) * sizeof *l.use) };
    ck_assert_ptr_nonnull(l.use);
    for (uint64_t i = 0; i < 3 * mesh->face_count; i++)
        add_use(&l, mesh->faces[i], mesh->faces[i % 3 == 2 ? i - 2 : i + 1], 1);
    return l;
}

/* ---- borders ---- */

static ebpo_border border_of(const ebpo_mesh *mesh, unsigned threads)
{
    ebpo_border b;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status = ebpo_border_find(&b, mesh, threads, &error);
    ck_assert_msg(status == EBPO_OK, "%s", error.message);
    return b;
}

static void check_simple(const uint32_t *vertex, uint64_t n)
{
    uint32_t *sorted = malloc(n * sizeof *sorted);
    ck_assert_uint_ge(n, 3);
    memcpy(sorted, vertex, n * sizeof *sorted);
    for (uint64_t i = 1; i < n; i++)
        for (uint64_t k = i; n < 200 && k > 0 && sorted[k] < sorted[k - 1]; k--) {
            uint32_t t = sorted[k];
            sorted[k] = sorted[k - 1];
            sorted[k - 1] = t;
        }
    for (uint64_t i = 1; i < n && n < 200; i++)
        ck_assert_uint_ne(sorted[i], sorted[i - 1]);
    free(sorted);
}

/* Checks that faces and caps balance on every edge. Returns the border. */
static ebpo_border check_border(const ebpo_mesh *mesh, const char *name)
{
    ebpo_border b = border_of(mesh, 1), other = border_of(mesh, 3);
    use_list alone = uses_of(mesh, 0), all = uses_of(mesh, 3 * ebpo_border_cap_count(&b));
    ck_assert_uint_eq(b.edge_count, unbalanced(&alone));
    for (uint64_t i = 0; i < b.loop_count; i++) {
        const uint32_t *loop = b.vertex + b.first[i];
        uint64_t n = b.first[i + 1] - b.first[i], t[3];
        check_simple(loop, n);
        ck_assert_uint_ge(b.weight[i], 1);
        for (uint64_t k = 0; k < ebpo_cap_count(0, n - 1); k++) {
            ebpo_cap_triangle(0, n - 1, k, t);
            for (int c = 0; c < 3; c++)
                add_use(&all, loop[t[c]], loop[t[(c + 1) % 3]], -(int64_t)b.weight[i]);
        }
    }
    ck_assert_msg(unbalanced(&all) == 0, "%s: does not balance with caps", name);
    ck_assert_uint_eq(b.loop_count, other.loop_count);
    if (b.loop_count) {
        ck_assert_mem_eq(b.first, other.first, (b.loop_count + 1) * sizeof *b.first);
        ck_assert_mem_eq(b.vertex, other.vertex, b.first[b.loop_count] * sizeof *b.vertex);
        ck_assert_mem_eq(b.weight, other.weight, b.loop_count * sizeof *b.weight);
    }
    ebpo_border_free(&other);
    free(alone.use);
    free(all.use);
    return b;
}

START_TEST(test_solids_with_caps_balance)
{
    const ebpo_test_solid *solid = &ebpo_test_solids[_i];
    ebpo_mesh mesh = solid->make();
    ebpo_border b = check_border(&mesh, solid->name);
    ck_assert_msg((b.loop_count == 0) == solid->balanced, "%s: %llu loops", solid->name,
                  (unsigned long long)b.loop_count);
    ebpo_border_free(&b);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_border_of_sheet_is_one_loop)
{
    ebpo_mesh mesh = ebpo_test_sheet(1, 5);
    ebpo_border b = check_border(&mesh, "sheet");
    ck_assert_uint_eq(b.loop_count, 1);
    ck_assert_uint_eq(b.first[1], 20);
    ck_assert_uint_eq(b.weight[0], 1);
    ebpo_border_free(&b);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* A strip that is oriented except at one edge: both faces use that edge in the same direction. */
START_TEST(test_moebius_strip_has_weight_two)
{
    ebpo_mesh mesh = ebpo_test_band(9, true);
    ebpo_border b = check_border(&mesh, "strip");
    uint64_t heavy = 0, sum = 0;
    for (uint64_t i = 0; i < b.loop_count; i++) {
        sum += b.weight[i] * (b.first[i + 1] - b.first[i]);
        heavy += b.weight[i] > 1;
    }
    ck_assert_uint_eq(b.edge_count, 19);
    ck_assert_uint_eq(sum, 18 + 2); /* the edge that two loops share, or one loop uses twice */
    ck_assert_uint_eq(heavy, 0);
    ebpo_border_free(&b);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* The same triangle three times, and the reverse once: weight two. */
START_TEST(test_repeated_triangle_has_its_weight)
{
    ebpo_mesh mesh = ebpo_test_sheet(1, 1);
    for (int i = 0; i < 2; i++)
        for (uint64_t f = 0; f < 2; f++)
            ebpo_test_append_face(&mesh, mesh.faces[3 * f], mesh.faces[3 * f + 1],
                                  mesh.faces[3 * f + 2]);
    ebpo_test_append_face(&mesh, mesh.faces[0], mesh.faces[2], mesh.faces[1]);
    ebpo_border b = check_border(&mesh, "triangles");
    uint64_t sum = 0;
    for (uint64_t i = 0; i < b.loop_count; i++)
        sum += b.weight[i] * (b.first[i + 1] - b.first[i]);
    ck_assert_uint_eq(sum, 2 * 2 + 2 * 3 + 1);
    ebpo_border_free(&b);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* Makes triangles over few vertices: edges of many faces, faces of repeated vertices, loops that
 * touch at vertices and along edges. */
static ebpo_mesh random_soup(uint64_t *state, uint32_t vertices, uint32_t faces)
{
    ebpo_mesh m = { 0 };
    for (uint32_t v = 0; v < vertices; v++)
        ebpo_test_append_vertex(&m, ebpo_test_random_unit(state), ebpo_test_random_unit(state),
                                ebpo_test_random_unit(state));
    for (uint32_t f = 0; f < faces; f++) {
        uint32_t v[3];
        for (int k = 0; k < 3; k++)
            v[k] = (uint32_t)(ebpo_test_random(state) % vertices);
        ebpo_test_append_face(&m, v[0], v[1], v[2]);
    }
    return m;
}

START_TEST(test_soups_with_caps_balance)
{
    uint64_t state = 7;
    for (uint64_t i = 0; i < ebpo_test_scaled(2000); i++) {
        uint32_t vertices = 3 + (uint32_t)(ebpo_test_random(&state) % 12);
        ebpo_mesh mesh =
            random_soup(&state, vertices, 1 + (uint32_t)(ebpo_test_random(&state) % 40));
        ebpo_border b = check_border(&mesh, "soup");
        ebpo_border_free(&b);
        ebpo_mesh_free(&mesh);
    }
}
END_TEST

/* Makes a sphere and drops faces at random. */
static ebpo_mesh holed_sphere(uint64_t *state, unsigned percent)
{
    const double centre[3] = { 0.25, -1, 3 };
    ebpo_mesh m = ebpo_test_sphere(centre, 1, 3);
    uint64_t kept = 0;
    for (uint64_t f = 0; f < m.face_count; f++)
        if (ebpo_test_random(state) % 100 >= percent)
            memmove(m.faces + 3 * kept++, m.faces + 3 * f, 3 * sizeof *m.faces);
    m.face_count = kept;
    return m;
}

START_TEST(test_border_is_independent_of_order)
{
    uint64_t state = 3;
    ebpo_mesh mesh = holed_sphere(&state, 20);
    ebpo_border before = check_border(&mesh, "sphere");
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_int_eq(ebpo_mesh_arrange(&mesh, 1, (ebpo_progress){ NULL, NULL }, &error), EBPO_OK);
    ebpo_border after = check_border(&mesh, "sphere");
    ck_assert_uint_gt(before.loop_count, 10);
    ck_assert_uint_eq(before.loop_count, after.loop_count);
    ck_assert_mem_eq(before.first, after.first, (before.loop_count + 1) * sizeof *before.first);
    for (uint64_t i = 0; i < before.first[before.loop_count]; i++)
        ck_assert_uint_eq(before.vertex[i], ebpo_mesh_source_vertex(&mesh, after.vertex[i]));
    ebpo_border_free(&before);
    ebpo_border_free(&after);
    ebpo_mesh_free(&mesh);
}
END_TEST

static const struct {
    const char *name;
    uint64_t loops, edges;
} scans[] = { { "bunny", 5, 223 },  { "dragon_vrip", 0, 4270 }, { "motorbike", 0, 0 },
              { "blade", 0, 240 },  { "office_chair", 0, 0 },   { "conrod", 0, 0 },
              { "buildings", 0, 0 } };

START_TEST(test_models_with_caps_balance)
{
    char path[1024];
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    snprintf(path, sizeof path, "%s/%s.ply", getenv("EBPO_MODELS"), scans[_i].name);
    ck_assert_msg(ebpo_mesh_read(path, NULL, &mesh, &error) == EBPO_OK, "%s", error.message);
    ebpo_border b = check_border(&mesh, scans[_i].name);
    uint64_t longest = 0;
    for (uint64_t i = 0; i < b.loop_count; i++)
        if (b.first[i + 1] - b.first[i] > longest)
            longest = b.first[i + 1] - b.first[i];
    printf("%s: %llu edges, %llu loops, the longest of %llu\n", scans[_i].name,
           (unsigned long long)b.edge_count, (unsigned long long)b.loop_count,
           (unsigned long long)longest);
    if (scans[_i].loops)
        ck_assert_uint_eq(b.loop_count, scans[_i].loops);
    if (scans[_i].edges)
        ck_assert_uint_eq(b.edge_count, scans[_i].edges);
    ebpo_border_free(&b);
    ebpo_mesh_free(&mesh);
}
END_TEST

TEST_SUITE(border)
{
    Suite *suite = suite_create("border");
    TCase *shapes = tcase_create("shapes");
    tcase_set_timeout(shapes, 120);
    tcase_add_loop_test(shapes, test_solids_with_caps_balance, 0, ebpo_test_solid_count);
    tcase_add_test(shapes, test_border_of_sheet_is_one_loop);
    tcase_add_test(shapes, test_moebius_strip_has_weight_two);
    tcase_add_test(shapes, test_repeated_triangle_has_its_weight);
    tcase_add_test(shapes, test_soups_with_caps_balance);
    tcase_add_test(shapes, test_border_is_independent_of_order);
    suite_add_tcase(suite, shapes);
    if (getenv("EBPO_MODELS")) {
        TCase *real = tcase_create("real models");
        tcase_set_timeout(real, 300);
        tcase_add_loop_test(real, test_models_with_caps_balance, 0,
                            (int)(sizeof scans / sizeof *scans));
        suite_add_tcase(suite, real);
    }
    return suite;
}
