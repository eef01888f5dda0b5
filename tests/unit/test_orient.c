/* Tests the orientation of cubes that share edges, vertices and faces against winding numbers in
 * every cell. */
#include <string.h>

#include <ebpo/ebpo.h>

#include "check_main.h"
#include "geometry/predicates.h"
#include "mesh/mesh_parts.h"
#include "solids.h"

enum { SIDE = 3, LATTICE = SIDE + 1, CELLS = SIDE * SIDE * SIDE };

static const ebpo_progress silent = { NULL, NULL };
static uint64_t state;

static uint32_t below(uint32_t n) { return (uint32_t)(ebpo_test_random(&state) % n); }

/* Makes twelve faces for each filled cell, over the vertices of a lattice. Adjacent cells share
 * vertices and edges, and have coincident faces. */
static ebpo_mesh mesh_of(const bool filled[CELLS])
{
    static const uint32_t quad[6][4] = { { 0, 2, 3, 1 }, { 4, 5, 7, 6 }, { 0, 1, 5, 4 },
                                         { 2, 6, 7, 3 }, { 0, 4, 6, 2 }, { 1, 3, 7, 5 } };
    ebpo_mesh m;
    memset(&m, 0, sizeof m);
    for (int v = 0; v < LATTICE * LATTICE * LATTICE; v++)
        ebpo_test_append_vertex(&m, v % LATTICE, v / LATTICE % LATTICE, v / LATTICE / LATTICE);
    for (uint32_t c = 0; c < CELLS; c++) {
        uint32_t x = c % SIDE, y = c / SIDE % SIDE, z = c / SIDE / SIDE, v[8];
        if (!filled[c])
            continue;
        for (uint32_t i = 0; i < 8; i++)
            v[i] = x + (i & 1) + LATTICE * (y + (i >> 1 & 1) + LATTICE * (z + (i >> 2)));
        for (int q = 0; q < 6; q++) {
            ebpo_test_append_face(&m, v[quad[q][0]], v[quad[q][1]], v[quad[q][2]]);
            ebpo_test_append_face(&m, v[quad[q][0]], v[quad[q][2]], v[quad[q][3]]);
        }
    }
    return m;
}

static void turn_some(ebpo_mesh *m, uint32_t of_eight)
{
    for (uint64_t f = 0; f < m->face_count; f++)
        if (below(8) < of_eight)
            ebpo_test_turn_face(m, f);
}

static int64_t winding_at(const ebpo_mesh *m, const double p[3])
{
    int64_t winding = 0;
    for (uint64_t f = 0; f < m->face_count; f++) {
        double t[3][3];
        for (uint64_t k = 0; k < 3; k++)
            ebpo_mesh_position(m, m->faces[3 * f + k], t[k]);
        winding -= ebpo_axis_crossing(p, 2 * LATTICE, 0, t[0], t[1], t[2]);
    }
    return winding;
}

static void expect_cells(const ebpo_mesh *m, const bool filled[CELLS])
{
    ebpo_mesh_report report;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert(ebpo_mesh_check(m, 1, silent, &report, &error) == EBPO_OK);
    ck_assert(report.balanced);
    for (int c = 0; c < CELLS; c++) {
        const double middle[3] = { c % SIDE + 0.5, c / SIDE % SIDE + 0.5, c / SIDE / SIDE + 0.5 };
        ck_assert_int_eq(winding_at(m, middle), filled[c]);
    }
}

static ebpo_repair_record orient(ebpo_mesh *m)
{
    ebpo_repair_record record;
    ebpo_error error = EBPO_ERROR_INIT;
    memset(&record, 0, sizeof record);
    ck_assert_msg(ebpo_mesh_orient(m, &record, &error) == EBPO_OK, "%s", error.message);
    return record;
}

static void check_cells(const bool filled[CELLS], uint32_t of_eight)
{
    ebpo_mesh m = mesh_of(filled), right = mesh_of(filled);
    ebpo_prepare_options o = EBPO_PREPARE_OPTIONS_INIT;
    ebpo_prepared p = EBPO_PREPARED_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    if (!m.face_count) {
        ebpo_mesh_free(&right);
        ebpo_mesh_free(&m);
        return;
    }
    ck_assert_uint_eq(orient(&right).flipped_faces, 0); /* correct faces are not changed */
    ebpo_mesh_free(&right);
    turn_some(&m, of_eight);
    ebpo_mesh copy;
    ck_assert(ebpo_mesh_copy(&m, &copy, &error) == EBPO_OK);
    ebpo_repair_record record = orient(&m);
    ck_assert_uint_eq(record.unorientable_components, 0);
    expect_cells(&m, filled);
    ck_assert_uint_eq(orient(&m).flipped_faces, 0);
    o.orient = true;
    ck_assert_msg(ebpo_mesh_prepare(&copy, &o, &p, &error) == EBPO_OK, "%s", error.message);
    ck_assert_uint_eq(p.record.flipped_faces, record.flipped_faces);
    expect_cells(&copy, filled);
    ebpo_mesh_free(&copy);
    ebpo_mesh_free(&m);
}

/* Tests two cubes that share an edge, a vertex or a face, and the greatest number of cubes around
 * an edge. */
START_TEST(test_orient_neighbours_point_outwards)
{
    static const int with_first[][3] = {
        { 4, -1, -1 }, { 13, -1, -1 }, { 1, -1, -1 }, { 1, 3, 4 }
    };
    state = 2 + (uint64_t)_i;
    for (int round = 0; round < 40; round++) {
        bool filled[CELLS] = { true };
        for (int k = 0; k < 3 && with_first[_i][k] >= 0; k++)
            filled[with_first[_i][k]] = true;
        check_cells(filled, below(9));
    }
}
END_TEST

START_TEST(test_orient_random_cells_point_outwards)
{
    state = 100 + (uint64_t)_i;
    for (int round = 0; round < 60; round++) {
        bool filled[CELLS];
        uint32_t dense = 1 + below(8);
        for (int c = 0; c < CELLS; c++)
            filled[c] = below(8) < dense;
        check_cells(filled, below(9));
    }
}
END_TEST

/* Each cube is oriented, although the volumes of such cubes cancel. */
START_TEST(test_orient_shells_sharing_vertex_or_edge)
{
    for (int other = 4; other <= 13; other += 9) {
        bool filled[CELLS] = { true };
        ebpo_shells s = EBPO_SHELLS_INIT;
        ebpo_error error = EBPO_ERROR_INIT;
        filled[other] = true;
        ebpo_mesh m = mesh_of(filled);
        for (uint64_t f = 12; f < 24; f++)
            ebpo_test_turn_face(&m, f);
        ck_assert(ebpo_mesh_count_shells(&m, 1, silent, &s, &error) == EBPO_OK);
        ck_assert(s.closed == 2 && s.inside_out == 1 && s.cavities == 0 && s.nested == 0);
        ebpo_mesh_free(&m);
    }
}
END_TEST

TEST_SUITE(orient)
{
    Suite *suite = suite_create("orient");
    TCase *tests = tcase_create("all");
    tcase_set_timeout(tests, 300);
    tcase_add_loop_test(tests, test_orient_neighbours_point_outwards, 0, 4);
    tcase_add_loop_test(tests, test_orient_random_cells_point_outwards, 0, 4);
    tcase_add_test(tests, test_orient_shells_sharing_vertex_or_edge);
    suite_add_tcase(suite, tests);
    return suite;
}
