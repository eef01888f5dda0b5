/* Compares tried repairs with all sequences of steps on copies of the mesh. */
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "check_main.h"
#include "mesh/mesh_parts.h"
#include "solids.h"

static const ebpo_progress silent = { NULL, NULL };

enum { WELD = 1, ORIENT = 2, FILL = 4, DROP = 32, ALL = 7 };

static ebpo_mesh_report check(const ebpo_mesh *mesh)
{
    ebpo_mesh_report report;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(ebpo_mesh_check(mesh, 1, silent, &report, &error) == EBPO_OK, "%s",
                  error.message);
    return report;
}

/* Returns the doubts after steps on a copy. */
static uint32_t left_after(const ebpo_mesh *mesh, int steps, ebpo_mesh_report *after)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_repair_record record;
    ebpo_mesh copy;
    double area = check(mesh).area;
    memset(&record, 0, sizeof record);
    ck_assert(ebpo_mesh_copy(mesh, &copy, &error) == EBPO_OK);
    if (steps & WELD)
        ck_assert(ebpo_mesh_weld(&copy, &record, &error) == EBPO_OK);
    if (steps & DROP)
        ck_assert(ebpo_mesh_drop_duplicates(&copy, &record, &error) == EBPO_OK);
    if (steps & ORIENT)
        ck_assert(ebpo_mesh_orient(&copy, &record, &error) == EBPO_OK);
    if (steps & FILL)
        ck_assert(ebpo_mesh_fill_holes(&copy, &record, &error) == EBPO_OK);
    if (steps & ORIENT && record.filled_holes)
        ck_assert(ebpo_mesh_orient(&copy, &record, &error) == EBPO_OK);
    *after = check(&copy);
    ebpo_mesh_free(&copy);
    return ebpo_mesh_doubts(area, after, &record);
}

/* Returns the minimum number of steps without doubts; -1: none. */
static int fewest(const ebpo_mesh *mesh)
{
    int best = -1;
    ebpo_mesh_report after;
    int sequences = mesh->face_count < 1000 ? 2 * (ALL + 1) : ALL + 1;
    for (int i = 0; i < sequences; i++) {
        int steps = i <= ALL ? i : DROP | (i & ALL), count = __builtin_popcount((unsigned)steps);
        if ((best < 0 || count < best) && left_after(mesh, steps, &after) == 0)
            best = count;
    }
    return best;
}

static ebpo_repairs tried(const ebpo_mesh *mesh)
{
    ebpo_repairs repairs = EBPO_REPAIRS_INIT;
    ebpo_mesh_report report = check(mesh);
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(ebpo_mesh_try_repairs(mesh, &report, 1, silent, &repairs, &error) == EBPO_OK,
                  "%s", error.message);
    return repairs;
}

/* Checks that no sequence is shorter than the chosen one, and that the reported results are
 * correct. */
static void expect_best(const ebpo_mesh *mesh)
{
    ebpo_repairs r = tried(mesh);
    int best = fewest(mesh);
    if (best == 0) /* nothing needs repair, and the result of dropping faces is reported */
        ck_assert(r.chosen < 0 && r.count == (check(mesh).repeated_faces.count > 0));
    else if (best < 0)
        ck_assert_int_eq(r.chosen, -1);
    else {
        ck_assert_int_eq(r.chosen, (int64_t)r.count - 1);
        ck_assert_int_eq(__builtin_popcount(r.tries[r.chosen].steps), best);
    }
    for (uint64_t i = 0; i < r.count; i++) {
        ebpo_mesh_report after;
        const ebpo_repair_try *t = &r.tries[i];
        ck_assert_uint_eq(t->doubts, left_after(mesh, (int)t->steps, &after));
        ck_assert(after.balanced == t->report.balanced && after.volume == t->report.volume &&
                  after.edges == t->report.edges);
        ck_assert(t->record.weld == !!(t->steps & WELD) &&
                  t->record.orient == !!(t->steps & ORIENT) &&
                  t->record.fill_holes == !!(t->steps & FILL) &&
                  t->record.drop_duplicates == !!(t->steps & DROP));
    }
}

static ebpo_mesh damaged(int solid, int damage)
{
    ebpo_mesh mesh = ebpo_test_solids[solid].make();
    uint64_t state = (uint64_t)damage;
    if (damage & 1)
        mesh.face_count -= mesh.face_count > 4;
    if (damage & 2)
        ebpo_test_turn_face(&mesh, ebpo_test_random(&state) % mesh.face_count);
    if (damage & 4)
        ebpo_test_split_vertices(&mesh);
    if (damage & 8)
        ebpo_test_reverse(&mesh);
    for (uint64_t f = 0, count = mesh.face_count; damage & 48 && f < count; f += 1 + f / 2) {
        const uint32_t c[3] = { mesh.faces[3 * f], mesh.faces[3 * f + 1], mesh.faces[3 * f + 2] };
        if (damage & 16)
            ebpo_test_append_face(&mesh, c[1], c[2], c[0]);
        if (damage & 32)
            ebpo_test_append_face(&mesh, c[1], c[0], c[2]);
    }
    return mesh;
}

START_TEST(test_repair_chooses_fewest_steps)
{
    for (int i = 0; i < 32; i++) {
        int damage = i < 16 ? i : (16 + 16 * (i % 3)) | ((i - 16) & 13);
        if (ebpo_test_scale() < 1 && (i + i / 4 + _i) % 4)
            continue; /* a quarter of the damages, others for the next solid */
        ebpo_mesh mesh = damaged(_i, damage);
        ebpo_error error = EBPO_ERROR_INIT;
        if (mesh.face_count < (i < 16 ? 20000 : 1000)) {
            expect_best(&mesh);
            if (ebpo_mesh_arrange(&mesh, 1, silent, &error) == EBPO_OK)
                expect_best(&mesh);
        }
        ebpo_mesh_free(&mesh);
    }
}
END_TEST

START_TEST(test_repair_trial_keeps_mesh_unchanged)
{
    ebpo_mesh mesh = damaged(1, 5);
    size_t size = (size_t)mesh.face_count * 3 * sizeof *mesh.faces;
    uint64_t vertices = mesh.vertex_count, faces = mesh.face_count;
    uint32_t *before = malloc(size);
    ck_assert_ptr_nonnull(before);
    memcpy(before, mesh.faces, size);
    ck_assert_uint_gt(tried(&mesh).count, 0);
    ck_assert(mesh.vertex_count == vertices && mesh.face_count == faces);
    ck_assert(memcmp(before, mesh.faces, size) == 0);
    free(before);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_repair_doubts_filling_before_welding)
{
    ebpo_mesh mesh = ebpo_test_make("cube");
    ebpo_mesh_report after;
    ebpo_test_split_vertices(&mesh);
    ck_assert_uint_eq(left_after(&mesh, WELD, &after), 0);
    ck_assert_uint_eq(left_after(&mesh, FILL, &after),
                      EBPO_DOUBT_UNWELDED | EBPO_DOUBT_MOSTLY_OPEN | EBPO_DOUBT_MOSTLY_FILLED |
                          EBPO_DOUBT_NO_VOLUME);
    ck_assert(after.balanced);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_repair_doubts_sheets_and_inverted_solids)
{
    ebpo_mesh sheet = ebpo_test_sheet(4, 4), cube = ebpo_test_make("cube");
    ebpo_mesh_report after;
    ck_assert_uint_eq(left_after(&cube, 0, &after), 0);
    ebpo_test_reverse(&cube);
    ck_assert_uint_eq(left_after(&cube, 0, &after), EBPO_DOUBT_INSIDE_OUT);
    ck_assert_uint_eq(left_after(&sheet, 0, &after), EBPO_DOUBT_OPEN);
    uint32_t left = left_after(&sheet, FILL, &after);
    ck_assert_uint_eq(left & EBPO_DOUBT_NO_VOLUME, EBPO_DOUBT_NO_VOLUME);
    ck_assert_int_eq(tried(&sheet).chosen, -1);
    ebpo_mesh_free(&sheet);
    ebpo_mesh_free(&cube);
}
END_TEST

TEST_SUITE(repairs)
{
    Suite *suite = suite_create("repairs");
    TCase *tests = tcase_create("all");
    tcase_set_timeout(tests, 600);
    tcase_add_loop_test(tests, test_repair_chooses_fewest_steps, 0, ebpo_test_solid_count);
    tcase_add_test(tests, test_repair_trial_keeps_mesh_unchanged);
    tcase_add_test(tests, test_repair_doubts_filling_before_welding);
    tcase_add_test(tests, test_repair_doubts_sheets_and_inverted_solids);
    suite_add_tcase(suite, tests);
    return suite;
}
