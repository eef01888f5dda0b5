/* Compares repairs of arranged meshes, in little memory and on all cores, with repairs in source
 * order. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "construct/arrange.h"
#include "check_main.h"
#include "core/hash.h"
#include "core/workspace.h"
#include "mesh/mesh_parts.h"
#include "solids.h"

static const ebpo_progress silent = { NULL, NULL };

enum { WELD = 1, ORIENT = 2, FILL = 4, DROP = 8, ALL = 15 };

static void repair_record(ebpo_mesh *m, int steps, ebpo_repair_record *record)
{
    ebpo_error error = EBPO_ERROR_INIT;
    memset(record, 0, sizeof *record);
    if (steps & WELD)
        ck_assert_msg(ebpo_mesh_weld(m, record, &error) == EBPO_OK, "%s", error.message);
    if (steps & DROP)
        ck_assert_msg(ebpo_mesh_drop_duplicates(m, record, &error) == EBPO_OK, "%s", error.message);
    if (steps & ORIENT)
        ck_assert_msg(ebpo_mesh_orient(m, record, &error) == EBPO_OK, "%s", error.message);
    if (steps & FILL)
        ck_assert_msg(ebpo_mesh_fill_holes(m, record, &error) == EBPO_OK, "%s", error.message);
    if (steps & ORIENT && record->filled_holes)
        ck_assert_msg(ebpo_mesh_orient(m, record, &error) == EBPO_OK, "%s", error.message);
}

static ebpo_mesh copy_of(const ebpo_mesh *m)
{
    ebpo_mesh c = *m;
    size_t bytes = (size_t)m->vertex_count * 3 * (m->xyz32 ? sizeof(float) : sizeof(double)),
           faces = (size_t)m->face_count * 12;
    void *xyz = malloc(bytes + 1);
    memcpy(xyz, m->xyz32 ? (const void *)m->xyz32 : (const void *)m->xyz64, bytes);
    c.xyz32 = m->xyz32 ? xyz : NULL;
    c.xyz64 = m->xyz32 ? NULL : xyz;
    c.faces = malloc(faces + 1);
    memcpy(c.faces, m->faces, faces);
    return c;
}

/* Checks that the arranged mesh, in source indices, equals the plain mesh. */
static void expect_same(const ebpo_mesh *arranged, const ebpo_mesh *plain)
{
    const struct ebpo_arrangement *a = arranged->arrangement;
    size_t width = 3 * (plain->xyz32 ? sizeof(float) : sizeof(double));
    ck_assert_uint_eq(arranged->vertex_count, plain->vertex_count);
    ck_assert_uint_eq(arranged->face_count, plain->face_count);
    uint64_t numbers = plain->face_count;
    for (uint64_t f = 0; f < plain->face_count; f++) /* dropped faces have left gaps */
        if (ebpo_mesh_source_face(plain, f) >= numbers)
            numbers = ebpo_mesh_source_face(plain, f) + 1;
    uint8_t *seen = calloc(1, plain->vertex_count + numbers + 1);
    uint64_t *place = malloc((numbers + 1) * sizeof *place);
    memset(place, 0xff, (numbers + 1) * sizeof *place);
    for (uint64_t f = 0; f < plain->face_count; f++)
        place[ebpo_mesh_source_face(plain, f)] = f;
    const char *here =
                   arranged->xyz32 ? (const char *)arranged->xyz32 : (const char *)arranged->xyz64,
               *there = plain->xyz32 ? (const char *)plain->xyz32 : (const char *)plain->xyz64;
    for (uint64_t v = 0; v < plain->vertex_count; v++) {
        uint64_t from = a->vertex_source[v];
        if (from >= plain->vertex_count || seen[from]++ ||
            memcmp(here + v * width, there + from * width, width) != 0)
            ck_abort_msg("vertex %llu", (unsigned long long)v);
    }
    for (uint64_t f = 0; f < plain->face_count; f++) {
        uint64_t from = a->face_source[f];
        if (from >= numbers || place[from] == UINT64_MAX || seen[plain->vertex_count + from]++)
            ck_abort_msg("face %llu", (unsigned long long)f);
        for (uint64_t k = 0; k < 3; k++)
            if (a->vertex_source[arranged->faces[3 * f + k]] != plain->faces[3 * place[from] + k])
                ck_abort_msg("face %llu, corner %llu", (unsigned long long)f,
                             (unsigned long long)k);
    }
    free(seen);
    free(place);
}

static void expect_equal_reports(ebpo_mesh_report a, ebpo_mesh_report b)
{
    for (int k = 0; k < 3; k++) { /* removes differences between the two zeros */
        a.min[k] += 0.0, a.max[k] += 0.0;
        b.min[k] += 0.0, b.max[k] += 0.0;
    }
    ck_assert(memcmp(&a, &b, sizeof a) == 0);
}

static void expect_same_report(const ebpo_mesh *plain, const ebpo_mesh *m)
{
    ebpo_mesh_report a, b;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert(ebpo_mesh_check(plain, 1, silent, &a, &error) == EBPO_OK);
    ck_assert(ebpo_mesh_check(m, 2, silent, &b, &error) == EBPO_OK);
    expect_equal_reports(a, b);
}

/* Repairs `plain` in source order, and an arranged copy in the workspace; then arranges both, and
 * checks that they are equal. Frees `plain`. */
static void repair_both(ebpo_mesh plain, int steps, ebpo_workspace *workspace)
{
    ebpo_mesh m = copy_of(&plain);
    ebpo_repair_record record, other;
    ebpo_error error = EBPO_ERROR_INIT;
    m.workspace = workspace;
    ck_assert_msg(ebpo_arrange_to_repair(&m, 3, &silent, &error) == EBPO_OK, "%s", error.message);
    expect_same_report(&plain, &m);
    repair_record(&plain, steps, &record);
    repair_record(&m, steps, &other);
    ck_assert(memcmp(&record, &other, sizeof record) == 0);
    expect_same(&m, &plain);
    ck_assert_msg(ebpo_mesh_arrange(&m, 3, silent, &error) == EBPO_OK, "%s", error.message);
    expect_same_report(&plain, &m);
    ck_assert_msg(ebpo_mesh_arrange(&plain, 1, silent, &error) == EBPO_OK, "%s", error.message);
    ck_assert(m.arrangement->key && m.arrangement->referenced == plain.arrangement->referenced);
    ck_assert(memcmp(m.arrangement->key, plain.arrangement->key,
                     (size_t)m.arrangement->referenced * 8) == 0);
    ck_assert(memcmp(m.faces, plain.faces, (size_t)m.face_count * 12) == 0);
    ck_assert(memcmp(m.arrangement->vertex_source, plain.arrangement->vertex_source,
                     (size_t)m.vertex_count * 4) == 0);
    ck_assert(memcmp(m.arrangement->face_source, plain.arrangement->face_source,
                     (size_t)m.face_count * 4) == 0);
    ebpo_mesh_free(&m);
    ebpo_mesh_free(&plain);
}

/* Makes a mesh with few positions, some with positive and negative zeros, so that every kind of
 * defect occurs many times. */
static ebpo_mesh random_mesh(uint64_t *state)
{
    static const double line[] = { -0.0, 0, 1, 2, 5 };
    ebpo_mesh m;
    memset(&m, 0, sizeof m);
    uint32_t vertices = 3 + (uint32_t)(ebpo_test_random(state) % 40),
             faces = 1 + (uint32_t)(ebpo_test_random(state) % 60);
    uint64_t kinds = 2 + ebpo_test_random(state) % 4;
    for (uint32_t v = 0; v < vertices; v++) {
        double p[3];
        for (int k = 0; k < 3; k++)
            p[k] = line[ebpo_test_random(state) % kinds];
        ebpo_test_append_vertex(&m, p[0], p[1], p[2]);
    }
    for (uint32_t f = 0; f < faces; f++)
        ebpo_test_append_face(&m, (uint32_t)(ebpo_test_random(state) % vertices),
                              (uint32_t)(ebpo_test_random(state) % vertices),
                              (uint32_t)(ebpo_test_random(state) % vertices));
    return m;
}

START_TEST(test_repair_random_meshes_in_any_order)
{
    uint64_t state = 77, rounds = ebpo_test_scaled(3000);
    for (uint64_t i = 0; i < rounds; i++) {
        ebpo_mesh m = random_mesh(&state);
        if (i % 3 == 1)
            ebpo_test_to_float(&m);
        repair_both(m, 1 + (int)(i % ALL), NULL);
    }
}
END_TEST

/* Returns 1 for the same three distinct vertices in the same orientation, -1 in the opposite one,
 * else 0. */
static int repeats(const uint32_t *a, const uint32_t *b)
{
    for (int turn = 0; turn < 3 && a[0] != a[1] && a[1] != a[2] && a[2] != a[0]; turn++) {
        const uint32_t t[3] = { b[turn], b[(turn + 1) % 3], b[(turn + 2) % 3] };
        if (a[0] == t[0] && a[1] == t[1] && a[2] == t[2])
            return 1;
        if (a[0] == t[0] && a[1] == t[2] && a[2] == t[1])
            return -1;
    }
    return 0;
}

/* Checks the dropped faces against a reference implementation, which compares each face with all
 * earlier faces that are kept. */
static void expect_dropped(ebpo_mesh *m)
{
    ebpo_mesh reference = copy_of(m);
    uint64_t kept = 0, opposite = 0, all = m->face_count;
    uint32_t *number = malloc((size_t)all * sizeof *number);
    for (uint64_t f = 0; f < all; f++) {
        int same = 0;
        for (uint64_t g = 0; g < kept && !same; g++)
            same = repeats(reference.faces + 3 * f, reference.faces + 3 * g);
        opposite += same < 0;
        if (same)
            continue;
        memmove(reference.faces + 3 * kept, reference.faces + 3 * f, 12);
        number[kept++] = (uint32_t)f;
    }
    ebpo_repair_record record;
    repair_record(m, DROP, &record);
    ck_assert_uint_eq(m->face_count, kept);
    ck_assert(record.drop_duplicates && record.dropped_faces == all - kept);
    ck_assert_uint_eq(record.dropped_opposite, opposite);
    ck_assert(memcmp(m->faces, reference.faces, (size_t)kept * 12) == 0);
    for (uint64_t f = 0; f < kept; f++)
        ck_assert_uint_eq(ebpo_mesh_source_face(m, f), number[f]);
    ebpo_mesh_report report;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert(ebpo_mesh_check(m, 1, silent, &report, &error) == EBPO_OK);
    ck_assert_uint_eq(report.repeated_faces.count, 0);
    repair_record(m, FILL, &record); /* added faces are numbered after all others */
    for (uint64_t f = kept; f < m->face_count; f++)
        ck_assert_uint_eq(ebpo_mesh_source_face(m, f), f - kept + all);
    free(number);
    ebpo_mesh_free(&reference);
}

START_TEST(test_repair_drops_repeated_faces)
{
    uint64_t state = 31, rounds = ebpo_test_scaled(2000);
    for (uint64_t i = 0; i < rounds; i++) {
        ebpo_mesh m = random_mesh(&state);
        expect_dropped(&m);
        ebpo_mesh_free(&m);
    }
}
END_TEST

/* Makes a mesh with reversed and omitted faces, and separate, shared and unused vertices. */
static ebpo_mesh damaged(int i)
{
    ebpo_mesh m = i < ebpo_test_solid_count ? ebpo_test_solids[i].make()
                  : i % 2                   ? ebpo_test_torus(2, 0.7, 300, 200)
                                            : ebpo_test_tetrahedra(8000);
    uint64_t state = 5 + (uint64_t)i, kept = 0;
    for (uint64_t f = 0; f < m.face_count; f++) {
        uint64_t r = ebpo_test_random(&state) % 100;
        if (r < 3 && f)
            continue;
        memmove(m.faces + 3 * kept, m.faces + 3 * f, 12);
        if (r < 30)
            ebpo_test_turn_face(&m, kept);
        kept++;
    }
    m.face_count = kept;
    if (i % 2 == 0)
        ebpo_test_split_vertices(&m);
    for (int k = 0; k < 5 && m.xyz64; k++) {
        double p[3];
        ebpo_test_point(&m, ebpo_test_random(&state) % m.vertex_count, p);
        ebpo_test_append_vertex(&m, p[0], p[1] + (k == 4), p[2]);
    }
    if (i % 3)
        ebpo_test_shuffle(&m, state);
    return m;
}

START_TEST(test_repair_damaged_solids_in_any_order)
{
    repair_both(damaged(_i), ALL, NULL);
    repair_both(damaged(_i), WELD | FILL, NULL);
    repair_both(damaged(_i), ORIENT, NULL);
}
END_TEST

START_TEST(test_repair_result_ignores_memory_budget)
{
    ebpo_workspace *w;
    ebpo_workspace_stats f = EBPO_WORKSPACE_STATS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert(ebpo_workspace_make_any(&w, 2 << 20, NULL, &error) == EBPO_OK);
    repair_both(damaged(ebpo_test_solid_count + _i), ALL, w);
    ebpo_workspace_get_stats(w, &f);
    ck_assert_uint_gt(f.filed_peak, 8 << 20);
    ck_assert(f.held == 0 && f.filed == 0);
    ebpo_workspace_free(w);
}
END_TEST

START_TEST(test_weld_of_arranged_mesh_matches)
{
    uint64_t state = 99, rounds = ebpo_test_scaled(500);
    for (uint64_t i = 0; i < rounds; i++) {
        ebpo_mesh plain = random_mesh(&state), m = copy_of(&plain);
        ebpo_repair_record record;
        ebpo_error error = EBPO_ERROR_INIT;
        ck_assert_msg(ebpo_mesh_arrange(&m, 1, silent, &error) == EBPO_OK, "%s", error.message);
        repair_record(&plain, ALL, &record);
        repair_record(&m, ALL, &record);
        expect_same(&m, &plain);
        ebpo_mesh_free(&m);
        ebpo_mesh_free(&plain);
    }
}
END_TEST

/* Compares ebpo_mesh_prepare with the separate calls in the documented order. Frees `plain`. */
static void prepare_and_compare(ebpo_mesh plain, const ebpo_prepare_options *options)
{
    ebpo_mesh m = copy_of(&plain);
    ebpo_prepared p = EBPO_PREPARED_INIT;
    ebpo_repair_record record;
    ebpo_mesh_report before, after;
    ebpo_error error = EBPO_ERROR_INIT;
    bool stl = strncmp(plain.source_format, "stl", 3) == 0;
    int steps = (options->weld || stl ? WELD : 0) | (options->orient ? ORIENT : 0) |
                (options->fill_holes ? FILL : 0);
    ck_assert_msg(ebpo_mesh_prepare(&m, options, &p, &error) == EBPO_OK, "%s", error.message);
    ck_assert(ebpo_mesh_check(&plain, 1, silent, &before, &error) == EBPO_OK);
    repair_record(&plain, steps, &record);
    ck_assert(ebpo_mesh_check(&plain, 1, silent, &after, &error) == EBPO_OK);
    ck_assert(p.was_repaired == (steps != 0) && memcmp(&p.record, &record, sizeof record) == 0);
    expect_equal_reports(p.before, before);
    expect_equal_reports(p.report, after);
    expect_same(&m, &plain);
    ebpo_mesh_free(&m);
    ebpo_mesh_free(&plain);
}

START_TEST(test_prepare_repairs_in_order_and_reports)
{
    for (int steps = 0; steps <= ALL; steps++) {
        ebpo_prepare_options o = EBPO_PREPARE_OPTIONS_INIT;
        if (ebpo_test_scale() < 1 && (steps + steps / 4 + _i) % 4)
            continue; /* a quarter of the sequences, others for the next solid */
        o.weld = steps & WELD;
        o.orient = steps & ORIENT;
        o.fill_holes = steps & FILL;
        prepare_and_compare(damaged(_i), &o);
        ebpo_mesh stl = damaged(_i);
        snprintf(stl.source_format, sizeof stl.source_format, "stl");
        prepare_and_compare(stl, &o);
    }
}
END_TEST

/* Refuses the stage named by `user`. */
static bool stop_at(void *user, const char *stage, uint64_t done, uint64_t total)
{
    (void)done;
    (void)total;
    return strcmp(stage, user) != 0;
}

START_TEST(test_prepare_cancel_and_size_limit)
{
    ebpo_mesh m = damaged(0);
    ebpo_prepared p = EBPO_PREPARED_INIT;
    ebpo_prepare_options o = EBPO_PREPARE_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    char repairing[] = "repairing";
    o.weld = true;
    o.progress = (ebpo_progress){ stop_at, repairing };
    ck_assert_int_eq(ebpo_mesh_prepare(&m, &o, &p, &error), EBPO_E_CANCELLED);
    ck_assert(!p.was_repaired && p.before.edges == 0);
    m.faces[0] = (uint32_t)m.vertex_count;
    ck_assert_int_eq(ebpo_mesh_prepare(&m, NULL, &p, &error), EBPO_E_FORMAT);
    m.faces[0] = 0;
    m.xyz64[3ul * m.faces[1]] = 1e302;
    ck_assert_int_eq(ebpo_mesh_arrange(&m, 1, silent, &error), EBPO_E_LIMIT);
    error = (ebpo_error)EBPO_ERROR_INIT;
    ck_assert_msg(ebpo_mesh_prepare(&m, NULL, &p, &error) == EBPO_OK, "%s", error.message);
    ck_assert(error.status == EBPO_OK &&
              !error.message[0]); /* an ignored failure is not reported */
    ck_assert(p.report.max[0] == 1e302);
    ebpo_mesh_free(&m);
}
END_TEST

START_TEST(test_build_rearranges_repaired_mesh)
{
    ebpo_mesh m = damaged(ebpo_test_solid_count + 1);
    ebpo_repair_record record;
    ebpo_mesh_report report;
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert(ebpo_arrange_to_repair(&m, 0, &silent, &error) == EBPO_OK);
    repair_record(&m, ALL, &record);
    ck_assert(ebpo_mesh_check(&m, 0, silent, &report, &error) == EBPO_OK && report.balanced);
    ck_assert_msg(ebpo_build(&m, &report, &record, NULL, &tree, &error) == EBPO_OK, "%s",
                  error.message);
    ebpo_tree_free(&tree);
}
END_TEST

/* Finds the first vertex at each position of a grid in which later vertices repeat some positions,
 * with memory for everything (_i = 0) and with little memory. There are so many positions that
 * several different ones have equal hashes. */
START_TEST(test_positions_find_first_vertices)
{
    enum { GRID = 1 << 18, REPEATED = 4000, ALL_VERTICES = GRID + REPEATED };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh mesh = { .vertex_count = ALL_VERTICES };
    ebpo_positions found;
    if (_i)
        ck_assert(ebpo_workspace_make_any(&mesh.workspace, 1 << 20, NULL, &error) == EBPO_OK);
    mesh.xyz64 = ebpo_array_alloc(mesh.workspace, ALL_VERTICES, 3 * sizeof *mesh.xyz64);
    for (uint64_t v = 0; v < ALL_VERTICES; v++) {
        uint64_t at =
            v < GRID ? v : v % 1000 * 97; /* each of these positions is repeated 4 times */
        for (unsigned k = 0; k < 3; k++)
            mesh.xyz64[3 * v + k] = 0.1 * (double)(at >> 6 * k & 63);
        if (v >= GRID && at % 64 == 0)
            mesh.xyz64[3 * v] = -0.0;
    }
    ck_assert(ebpo_positions_build(&found, &mesh, 2, &silent, &error) == EBPO_OK);
    ck_assert_uint_eq(found.repeated, REPEATED);
    for (uint64_t v = 0; v < ALL_VERTICES; v++)
        ck_assert_uint_eq(ebpo_positions_first(&found, (uint32_t)v), v < GRID ? v : v % 1000 * 97);
    ebpo_positions_free(&found);
    ebpo_array_free(mesh.workspace, mesh.xyz64);
    ebpo_workspace_free(mesh.workspace);
}
END_TEST

/* Many different positions may have equal hashes, because somebody has chosen them so. */
START_TEST(test_positions_with_equal_hashes)
{
    enum { DIFFERENT = 100000 };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh mesh = { .vertex_count = 2 * DIFFERENT };
    ebpo_positions found;
    mesh.xyz64 = malloc(2 * DIFFERENT * 3 * sizeof *mesh.xyz64);
    for (uint64_t v = 0; v < 2 * DIFFERENT; v++) {
        double x = 0.1 * (double)(1 + v % DIFFERENT), y = 0.5;
        uint64_t bits[2];
        memcpy(&bits[0], &x, sizeof x);
        memcpy(&bits[1], &y, sizeof y);
        uint64_t z = 1 - ebpo_hash_number(ebpo_hash_number(bits[0]) + bits[1]);
        mesh.xyz64[3 * v] = x;
        mesh.xyz64[3 * v + 1] = y;
        memcpy(&mesh.xyz64[3 * v + 2], &z, sizeof z);
    }
    ck_assert(ebpo_positions_build(&found, &mesh, 2, &silent, &error) == EBPO_OK);
    ck_assert_uint_eq(found.repeated, DIFFERENT);
    for (uint64_t v = 0; v < 2 * DIFFERENT; v++)
        ck_assert_uint_eq(ebpo_positions_first(&found, (uint32_t)v), v % DIFFERENT);
    ebpo_positions_free(&found);
    free(mesh.xyz64);
}
END_TEST

TEST_SUITE(mesh_repair)
{
    Suite *suite = suite_create("mesh_repair");
    TCase *tests = tcase_create("all");
    tcase_set_timeout(tests, 600);
    tcase_add_test(tests, test_repair_random_meshes_in_any_order);
    tcase_add_test(tests, test_repair_drops_repeated_faces);
    tcase_add_loop_test(tests, test_repair_damaged_solids_in_any_order, 0,
                        ebpo_test_solid_count + 2);
    tcase_add_loop_test(tests, test_repair_result_ignores_memory_budget, 0, 2);
    tcase_add_test(tests, test_weld_of_arranged_mesh_matches);
    tcase_add_loop_test(tests, test_positions_find_first_vertices, 0, 2);
    tcase_add_test(tests, test_positions_with_equal_hashes);
    tcase_add_loop_test(tests, test_prepare_repairs_in_order_and_reports, 0, ebpo_test_solid_count);
    tcase_add_test(tests, test_prepare_cancel_and_size_limit);
    tcase_add_test(tests, test_build_rearranges_repaired_mesh);
    suite_add_tcase(suite, tests);
    return suite;
}
