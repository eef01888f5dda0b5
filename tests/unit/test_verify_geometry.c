/* Tests the geometry of the verifier: floating-point results against rationals, rays against the
 * crossings of the library, and the certificates against clipping. */
#include <stdlib.h>
#include <string.h>

#include "core/workspace.h"
#include "check_main.h"
#include "geometry/polytope.h"
#include "geometry/predicates.h"
#include "solids.h"
#include "verify/verify_geometry.h"
#include "verify/verify_labels.h"

enum { ROUNDS = 6000 };

static const ebpo_box box = { { -1, -2, 0.5 }, { 3, 5, 7 }, 20 };

static ebpo_cell some_cell(uint64_t *state)
{
    ebpo_cell cell = { (int)(ebpo_test_random(state) % 6), { 0 } };
    for (int k = 0; k < 3; k++)
        cell.at[k] = (uint32_t)(ebpo_test_random(state) % (1u << cell.level));
    return cell;
}

/* Returns a coordinate near the cell, often exactly on its faces, corners and middle, so that
 * every kind of contact occurs. */
static double some_coordinate(const ebpo_frame *frame, int k, uint64_t *state)
{
    double size = frame->high[k] - frame->low[k];
    switch (ebpo_test_random(state) % 4) {
    case 0: return frame->low[k] + size * 0.5 * ((double)(ebpo_test_random(state) % 7) - 2);
    case 1:
        return frame->low[k] + size * (ebpo_test_random_unit(state) * 0.001 +
                                       (double)(ebpo_test_random(state) % 2));
    default: return frame->low[k] + size * (ebpo_test_random_unit(state) * 4 - 1.5);
    }
}

static ebpo_corners some_face(const ebpo_frame *frame, uint64_t *state)
{
    ebpo_corners face;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            face.at[i][k] = some_coordinate(frame, k, state);
    if (ebpo_test_random(state) % 16 == 0)
        memcpy(face.at[2], face.at[0], sizeof face.at[2]); /* a segment */
    return face;
}

START_TEST(test_face_cell_contact_matches_rational)
{
    uint64_t state = 1;
    int touching = 0;
    ebpo_tally tally = { 0 };
    for (int i = 0; i < ROUNDS; i++) {
        ebpo_frame frame = ebpo_frame_make(&box, some_cell(&state));
        ebpo_corners face = some_face(&frame, &state);
        bool exact = ebpo_exact_touches(frame.low, frame.high, &face);
        ck_assert_int_eq(ebpo_face_touches(&frame, &face, &tally), exact);
        touching += exact;
    }
    ck_assert_int_gt(touching, ROUNDS / 10);
    ck_assert_int_lt(touching, ROUNDS - ROUNDS / 10);
    ck_assert_uint_gt(tally.exact_touches, 0);
}
END_TEST

START_TEST(test_single_point_contact_is_contact)
{
    const ebpo_box unit = { { 0, 0, 0 }, { 1, 1, 1 }, 20 };
    ebpo_frame frame = ebpo_frame_make(&unit, (ebpo_cell){ 0, { 0, 0, 0 } });
    ebpo_tally tally = { 0 };
    /* An edge passes through the upper corner of the cell; the rest of the face is outside. */
    ebpo_corners face = { { { 0.5, 1.5, 1 }, { 1.5, 0.5, 1 }, { 1.5, 1.5, 1.75 } } };
    ck_assert(ebpo_face_touches(&frame, &face, &tally));
    face.at[0][0] += 0x1p-50;
    ck_assert(!ebpo_face_touches(&frame, &face, &tally));
    face.at[0][0] -= 0x1p-49;
    ck_assert(ebpo_face_touches(&frame, &face, &tally));
}
END_TEST

/* Compares the counts of the checking function with clipping in rationals. */
START_TEST(test_half_space_certificates_match_rational)
{
    uint64_t state = 2;
    int kept = 0, all = 0;
    ebpo_tally tally = { 0 };
    for (int i = 0; i < ROUNDS; i++) {
        ebpo_frame frame = ebpo_frame_make(&box, some_cell(&state));
        ebpo_corners face = some_face(&frame, &state);
        if (!ebpo_exact_touches(frame.low, frame.high, &face))
            continue;
        ebpo_node_planes planes = { .count = 1 };
        uint32_t code = (uint32_t)(ebpo_test_random(&state) % 1023) |
                        (uint32_t)(ebpo_test_random(&state) % 1023) << 10 |
                        (uint32_t)(ebpo_test_random(&state) % 4095) << 20;
        ck_assert(ebpo_plane_decode(code, planes.normal[0], &planes.d[0]));
        for (int k = 0; k < 3; k++)
            planes.n[0][k] = planes.normal[0][k];
        planes.bound[0] = planes.d[0] / 4096.0;
        uint64_t before = tally.violations[EBPO_VERIFY_CONTAINMENT];
        ebpo_check_face_contained(&tally, &planes, &(ebpo_reference_node){ .code = 1 }, &frame,
                                  &face, 0);
        bool exact =
            ebpo_exact_half_space(frame.low, frame.high, &face, planes.normal[0], planes.d[0]);
        ck_assert_int_eq(tally.violations[EBPO_VERIFY_CONTAINMENT] == before, exact);
        kept += exact;
        all++;
    }
    ck_assert_int_gt(kept, all / 10);
    ck_assert_int_lt(kept, all - all / 10);
}
END_TEST

START_TEST(test_plane_through_highest_point_keeps_it)
{
    const ebpo_box unit = { { 0, 0, 0 }, { 1, 1, 1 }, 20 };
    ebpo_frame frame = ebpo_frame_make(&unit, (ebpo_cell){ 0, { 0, 0, 0 } });
    ebpo_corners face = { { { 0.25, 0.25, 0.5 }, { 0.5, 0.25, 0.5 }, { 0.25, 0.5, 3 } } };
    int32_t n[3], d;
    uint32_t normal;
    ck_assert(ebpo_plane_code_normal((double[3]){ 1, 0, 0 }, &normal));
    ck_assert(ebpo_plane_decode(ebpo_plane_code_make(normal, 2047), n, &d));
    ck_assert_int_eq(d, 511 * 2048); /* x <= 0.5 */
    ck_assert(ebpo_exact_half_space(frame.low, frame.high, &face, n, d));
    ck_assert(!ebpo_exact_half_space(frame.low, frame.high, &face, n, d - 1));
}
END_TEST

static void check_rays(const char *name)
{
    ebpo_mesh mesh = ebpo_test_make(name);
    ebpo_box around = { { -16, -16, -16 }, { 32, 32, 32 }, 20 };
    uint64_t state = 3;
    ebpo_ray_points points = { 0 };
    for (int i = 0; i < 100; i++) {
        double p[3];
        uint64_t v = ebpo_test_random(&state) % mesh.vertex_count,
                 w = ebpo_test_random(&state) % mesh.vertex_count;
        double a[3], b[3];
        ebpo_test_point(&mesh, v, a);
        ebpo_test_point(&mesh, w, b);
        /* on vertices, on lines through vertices, and half-way between them */
        for (int k = 0; k < 3; k++)
            p[k] = ebpo_test_random(&state) % 3 == 0 ? (a[k] + b[k]) / 2
                   : ebpo_test_random(&state) % 2    ? a[k]
                                                     : b[k];
        int64_t sums[3] = { 0 };
        for (uint64_t f = 0; f < mesh.face_count; f++) {
            ebpo_corners face;
            ebpo_face_corners(&mesh, f, &face);
            for (int axis = 0; axis < 3; axis++) {
                int hit = ebpo_ray_hit(p, axis, &face);
                ck_assert_int_eq(hit, -ebpo_axis_crossing(p, 1e9, axis, face.at[0], face.at[1],
                                                          face.at[2]));
                sums[axis] += hit;
            }
        }
        ck_assert_int_eq(sums[0], sums[1]);
        ck_assert_int_eq(sums[0], sums[2]);
        ck_assert(
            ebpo_rays_add(&points, &(ebpo_ray_point){ { p[0], p[1], p[2] }, 1, sums[0], 99 }));
    }
    ck_assert(ebpo_rays_follow(&points, &mesh, &around, 2, NULL, NULL) == EBPO_OK);
    ck_assert_uint_eq(points.count, 100);
    for (uint64_t i = 0; i < points.count; i++)
        ck_assert_int_eq(points.point[i].found, points.point[i].stored);
    ebpo_array_free(points.workspace, points.point);
    ebpo_mesh_free(&mesh);
}

START_TEST(test_axis_rays_agree_at_vertices)
{
    for (int i = 0; i < ebpo_test_solid_count; i++)
        if (ebpo_test_solids[i].balanced)
            check_rays(ebpo_test_solids[i].name);
}
END_TEST

TEST_SUITE(verify_geometry)
{
    TCase *tests = tcase_create("verify geometry");
    tcase_set_timeout(tests, 300);
    tcase_add_test(tests, test_face_cell_contact_matches_rational);
    tcase_add_test(tests, test_single_point_contact_is_contact);
    tcase_add_test(tests, test_half_space_certificates_match_rational);
    tcase_add_test(tests, test_plane_through_highest_point_keeps_it);
    tcase_add_test(tests, test_axis_rays_agree_at_vertices);
    Suite *suite = suite_create("verify geometry");
    suite_add_tcase(suite, tests);
    return suite;
}
