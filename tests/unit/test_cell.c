/* Root boxes whose cell faces are exact doubles, and octcodes. */
#include <math.h>
#include <stdlib.h>

#include <gmp.h>

#include "check_main.h"
#include "exact_reference.h"
#include "geometry/cells.h"

/* --- boxes --- */

/* Returns true when ebpo_cell_face gives origin + k size / 2^level without rounding. */
static bool cell_face_is_exact(const ebpo_box *box, int axis, int level, uint32_t k)
{
    mpq_t expected, origin, found;
    mpq_inits(expected, origin, found, NULL);
    mpq_set_d(expected, box->size[axis]);
    mpq_set_ui(found, k, 1);
    mpq_mul(expected, expected, found);
    mpq_div_2exp(expected, expected, (mp_bitcnt_t)level);
    mpq_set_d(origin, box->origin[axis]);
    mpq_add(expected, expected, origin);
    mpq_set_d(found, ebpo_cell_face(box, axis, level, k));
    bool exact = mpq_equal(expected, found);
    mpq_clears(expected, origin, found, NULL);
    return exact;
}

static void check_cell_faces(const ebpo_box *box, uint64_t *state)
{
    for (int axis = 0; axis < 3; axis++)
        for (int level = 0; level <= box->grid_level; level++) {
            uint32_t last = (uint32_t)1 << level;
            const uint32_t k[5] = { 0, 1, last - 1, last,
                                    (uint32_t)reference_integer(state, 0, last) };
            for (int i = 0; i < 5; i++)
                ck_assert_msg(cell_face_is_exact(box, axis, level, k[i]),
                              "axis %d level %d cell face %u", axis, level, k[i]);
        }
}

static void check_box(const double min[3], const double max[3], int grid_level, uint64_t *state)
{
    ebpo_box box;
    ck_assert(ebpo_box_make(&box, min, max, grid_level));
    ck_assert(ebpo_box_valid(&box));
    ck_assert_int_eq(box.grid_level, grid_level);
    for (int k = 0; k < 3; k++) {
        ck_assert(box.size[k] > 0);
        ck_assert(box.origin[k] < min[k]);
        ck_assert(max[k] < ebpo_cell_face(&box, k, 0, 1));
    }
    check_cell_faces(&box, state);
}

/* Generates a coordinate of the kinds in files, by scale. */
static double hard_coordinate(int kind, uint64_t *state)
{
    double x = reference_uniform(state);
    switch (kind) {
    case 0: return x;
    case 1: return 1e7 + 1e-3 * x;
    case 2: return (double)(float)(1e7 + x);
    case 3: return (double)(float)(1e-38 * x);
    case 4: return 0x1p-1074 * (double)reference_integer(state, -3, 3);
    case 5: return 1e-300 * x;
    case 6: return 1e300 * x;
    case 7: return 0x1p1000 * (x < 0 ? -1 : 1);
    case 8: return (double)reference_integer(state, -1, 1);
    case 9: return -0x1p53 + (double)reference_integer(state, 0, 3);
    default: return ldexp(x, (int)reference_integer(state, -1074, 1000));
    }
}

START_TEST(test_box_faces_are_exact_outside_model)
{
    uint64_t state = (uint64_t)_i + 1;
    for (int i = 0; i < 400; i++) {
        double min[3], max[3];
        for (int k = 0; k < 3; k++) {
            int kind = i % 4 == 3 ? (int)reference_integer(&state, 0, 10) : _i;
            double a = hard_coordinate(kind, &state), b = hard_coordinate(kind, &state);
            if (reference_random(&state) % 4 == 0)
                b = a;
            min[k] = fmin(a, b);
            max[k] = fmax(a, b);
        }
        check_box(min, max,
                  i % 3 ? EBPO_MAX_LEVEL : (int)reference_integer(&state, 0, EBPO_MAX_LEVEL),
                  &state);
    }
}
END_TEST

START_TEST(test_box_grows_at_most_one_millionth)
{
    uint64_t state = 4;
    for (int i = 0; i < 10000; i++) {
        double min[3], max[3], scale = ldexp(1, (int)reference_integer(&state, -900, 900));
        ebpo_box box;
        for (int k = 0; k < 3; k++) {
            min[k] = scale * 2 * reference_uniform(&state);
            max[k] = min[k] + scale * (1.25 + reference_uniform(&state));
        }
        ck_assert(ebpo_box_make(&box, min, max, EBPO_MAX_LEVEL));
        for (int k = 0; k < 3; k++)
            ck_assert(box.size[k] <= (max[k] - min[k]) * (1 + 1e-6));
    }
}
END_TEST

/* At a distance of 1e7 from 0 the finest step that 53 bits allow is 2^-29, and 2^20 cells of this
 * size are 2^-9 long. */
START_TEST(test_box_of_translated_model_is_tight)
{
    const double min[3] = { 1e7, 1e7, 1e7 }, max[3] = { 1e7 + 1e-3, 1e7 + 1e-3, 1e7 + 1e-3 };
    ebpo_box box;
    ck_assert(ebpo_box_make(&box, min, max, EBPO_MAX_LEVEL));
    ck_assert(box.size[0] == 0x1p-9);
    ck_assert(ebpo_box_make(&box, min, max, 8));
    ck_assert(box.size[0] <= 1.01e-3);
}
END_TEST

START_TEST(test_box_of_single_point_has_volume)
{
    const double zero[3] = { 0, 0, 0 }, point[3] = { 3, -4, 0 };
    uint64_t state = 1;
    check_box(zero, zero, EBPO_MAX_LEVEL, &state);
    check_box(point, point, EBPO_MAX_LEVEL, &state);
}
END_TEST

START_TEST(test_box_make_refuses_bad_bounds)
{
    const double good[3] = { 0, 0, 0 }, bad[][3] = {
        { 0, NAN, 0 }, { INFINITY, 0, 0 }, { 0, 0, 0x1.1p1000 }, { 0, -INFINITY, 0 }, { -1, 1, 1 }
    };
    ebpo_box box;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        ck_assert(!ebpo_box_make(&box, good, bad[i], 5));
    ck_assert(!ebpo_box_make(&box, bad[3], good, 5));
    ck_assert(!ebpo_box_make(&box, good, good, -1));
    ck_assert(!ebpo_box_make(&box, good, good, EBPO_MAX_LEVEL + 1));
}
END_TEST

START_TEST(test_box_valid_refuses_hostile_boxes)
{
    const ebpo_box good = { { -1, 0, 0x1p30 }, { 2, 3, 1 }, 20 };
    const double bad_size[] = { NAN,  INFINITY,  -INFINITY,  -1,  0,
                                -0.0, 0x1p-1074, 0x1.8p1003, 1.1, 0x1.0000000000001p0 };
    const double bad_origin[] = {
        NAN, INFINITY, -INFINITY, 0x1p1003, 0.1, 0x1p-60, 0x1p40, -0x1p60
    };
    ck_assert(ebpo_box_valid(&good));
    for (size_t i = 0; i < sizeof bad_size / sizeof *bad_size; i++) {
        ebpo_box box = good;
        box.size[1] = bad_size[i];
        box.origin[1] = 0x1p-40;
        ck_assert_msg(!ebpo_box_valid(&box), "size %g", bad_size[i]);
    }
    for (size_t i = 0; i < sizeof bad_origin / sizeof *bad_origin; i++) {
        ebpo_box box = good;
        box.origin[2] = bad_origin[i];
        ck_assert_msg(!ebpo_box_valid(&box), "origin %g", bad_origin[i]);
    }
    ebpo_box box = good;
    box.grid_level = 21;
    ck_assert(!ebpo_box_valid(&box));
    box.grid_level = -1;
    ck_assert(!ebpo_box_valid(&box));
}
END_TEST

/* A valid box has exact cell faces, for any bits in a file. */
START_TEST(test_box_valid_requires_exact_cell_faces)
{
    uint64_t state = 6;
    int valid = 0;
    for (int i = 0; i < 3000; i++) {
        ebpo_box box = { .grid_level = (int)reference_integer(&state, -1, 21) };
        int e = (int)reference_integer(&state, -1074, 1000),
            bits = (int)reference_integer(&state, 30, 53);
        for (int k = 0; k < 3; k++) {
            int64_t limit = (int64_t)1 << bits;
            box.origin[k] = ldexp((double)reference_integer(&state, -limit, limit), e - bits);
            box.size[k] = ldexp((double)reference_integer(&state, 1, limit),
                                e - bits + (int)reference_integer(&state, 0, 20));
        }
        if (!ebpo_box_valid(&box))
            continue;
        valid++;
        check_cell_faces(&box, &state);
    }
    ck_assert_int_gt(valid, 100);
}
END_TEST

/* --- octcodes --- */

/* Computes an octcode bit by bit, from the root down. */
static ebpo_octcode plain_octcode(ebpo_cell cell)
{
    ebpo_octcode code = 1;
    for (int bit = cell.level - 1; bit >= 0; bit--)
        code = ebpo_octcode_child(code, (cell.at[0] >> bit & 1) | (cell.at[1] >> bit & 1) << 1 |
                                            (cell.at[2] >> bit & 1) << 2);
    return code;
}

START_TEST(test_octcode_matches_reference_and_inverts)
{
    uint64_t state = (uint64_t)_i + 50;
    int64_t last = ((int64_t)1 << _i) - 1;
    for (int i = 0; i < 20000; i++) {
        ebpo_cell cell = { _i, { 0, 0, 0 } };
        for (int k = 0; k < 3; k++)
            cell.at[k] = (uint32_t)(i == 0 ? last : reference_integer(&state, 0, last));
        ebpo_octcode code = ebpo_octcode_of_cell(cell);
        ck_assert(code == plain_octcode(cell));
        ck_assert(ebpo_octcode_valid(code));
        ck_assert_int_eq(ebpo_octcode_level(code), _i);
        ebpo_cell back = ebpo_cell_of_octcode(code);
        ck_assert(back.level == _i && back.at[0] == cell.at[0] && back.at[1] == cell.at[1] &&
                  back.at[2] == cell.at[2]);
        if (_i == 0)
            continue;
        ebpo_cell up = ebpo_cell_of_octcode(ebpo_octcode_parent(code));
        ck_assert(up.level == _i - 1 && up.at[0] == cell.at[0] / 2 && up.at[1] == cell.at[1] / 2 &&
                  up.at[2] == cell.at[2] / 2);
    }
}
END_TEST

START_TEST(test_octcode_valid_requires_leading_one)
{
    ck_assert(!ebpo_octcode_valid(0));
    ck_assert(ebpo_octcode_valid(1));
    ck_assert(!ebpo_octcode_valid(2));
    ck_assert(!ebpo_octcode_valid(7));
    ck_assert(ebpo_octcode_valid(15));
    ck_assert(ebpo_octcode_valid((uint64_t)1 << 60));
    ck_assert(!ebpo_octcode_valid((uint64_t)1 << 63));
    ck_assert(ebpo_octcode_first_descendant(9, 3) == (uint64_t)9 << 6);
}
END_TEST

TEST_SUITE(cell)
{
    TCase *tests = tcase_create("cell");
    tcase_set_timeout(tests, 120);
    tcase_add_loop_test(tests, test_box_faces_are_exact_outside_model, 0, 11);
    tcase_add_test(tests, test_box_grows_at_most_one_millionth);
    tcase_add_test(tests, test_box_of_translated_model_is_tight);
    tcase_add_test(tests, test_box_of_single_point_has_volume);
    tcase_add_test(tests, test_box_make_refuses_bad_bounds);
    tcase_add_test(tests, test_box_valid_refuses_hostile_boxes);
    tcase_add_test(tests, test_box_valid_requires_exact_cell_faces);
    tcase_add_loop_test(tests, test_octcode_matches_reference_and_inverts, 0, EBPO_MAX_LEVEL + 1);
    tcase_add_test(tests, test_octcode_valid_requires_leading_one);
    Suite *suite = suite_create("cell");
    suite_add_tcase(suite, tests);
    return suite;
}
