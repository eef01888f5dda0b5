/* Tests types in group words, and cells and their neighbours, against reference implementations. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "geometry/cells.h"
#include "geometry/level_nodes.h"

static uint32_t random_below(uint64_t *state, uint32_t below)
{
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)((*state >> 33) % below);
}

/* --- types --- */

START_TEST(test_group_word_types_match_octants)
{
    for (unsigned word = 0; word <= UINT16_MAX; word++) {
        unsigned seen[4] = { 0 }, filled = 0;
        uint16_t copy = 0;
        for (unsigned octant = 0; octant < 8; octant++) {
            ebpo_node_type type = ebpo_group_type((uint16_t)word, octant);
            ck_assert_uint_eq(type, word / (1u << 2 * octant) % 4);
            for (int t = 0; t < 4; t++)
                ck_assert_uint_eq(ebpo_group_count((uint16_t)word, (ebpo_node_type)t, octant),
                                  seen[t]);
            seen[type]++;
            filled |= (unsigned)(type == EBPO_LEAF || type == EBPO_GRAY) << 2 * octant;
            copy = ebpo_group_set(copy, octant, EBPO_GRAY);
            copy = ebpo_group_set(copy, octant, type);
        }
        for (int t = 0; t < 4; t++)
            ck_assert_uint_eq(ebpo_group_count((uint16_t)word, (ebpo_node_type)t, 8), seen[t]);
        ck_assert_uint_eq(copy, word);
        ck_assert_uint_eq(ebpo_group_filled((uint16_t)word), filled);
    }
}
END_TEST

START_TEST(test_group_type_counts_match_plain_count)
{
    uint64_t state = (uint64_t)_i + 1, groups = random_below(&state, 700), counts[4],
             sum[4] = { 0 };
    uint16_t *types = malloc((groups + 1) * sizeof *types);
    ck_assert_ptr_nonnull(types);
    for (uint64_t i = 0; i < groups; i++) {
        /* sometimes all nodes have one type, which gives the largest sums of bytes */
        types[i] =
            _i % 5 < 4 ? (uint16_t)(0x5555 * (_i % 5)) : (uint16_t)random_below(&state, 65536);
        for (unsigned octant = 0; octant < 8; octant++)
            sum[ebpo_group_type(types[i], octant)]++;
    }
    ebpo_groups_count(types, groups, counts);
    ck_assert_mem_eq(counts, sum, sizeof sum);
    ebpo_groups_count_at(1, types, groups, counts);
    ck_assert_mem_eq(counts, sum, sizeof sum);
    for (unsigned type = 0; type < 4; type++) {
        types[0] = (uint16_t)type;
        ebpo_groups_count_at(0, types, 1, counts);
        for (unsigned t = 0; t < 4; t++)
            ck_assert_uint_eq(counts[t], t == type);
    }
    free(types);
}
END_TEST

/* --- cells --- */

static ebpo_cell random_cell(uint64_t *state, int level)
{
    ebpo_cell cell = { level, { 0, 0, 0 } };
    for (int k = 0; k < 3; k++)
        cell.at[k] = random_below(state, 1u << level);
    return cell;
}

START_TEST(test_cells_and_octcodes_stay_consistent)
{
    uint64_t state = (uint64_t)_i + 1;
    for (int i = 0; i < 2000; i++) {
        ebpo_cell cell = random_cell(&state, 1 + (int)random_below(&state, EBPO_MAX_LEVEL));
        ebpo_octcode code = ebpo_octcode_of_cell(cell);
        unsigned octant = code & 7;
        ck_assert_uint_eq(ebpo_octcode_of_cell(ebpo_cell_parent(cell)), ebpo_octcode_parent(code));
        ck_assert_uint_eq(ebpo_cell_octant(cell, cell.level - 1), octant);
        ck_assert(ebpo_cell_equal(ebpo_cell_child(ebpo_cell_parent(cell), octant), cell));
        int level = (int)random_below(&state, (uint32_t)cell.level + 1);
        ebpo_cell above = ebpo_cell_ancestor(cell, level);
        ck_assert_uint_eq(ebpo_octcode_of_cell(above), code >> 3 * (cell.level - level));
        for (; level < cell.level; level++)
            above = ebpo_cell_child(above, ebpo_cell_octant(cell, level));
        ck_assert(ebpo_cell_equal(above, cell));
    }
}
END_TEST

/* Returns true when two cells touch, in a root cell of size 1, where these doubles are exact. */
static bool reference_touch(ebpo_cell a, ebpo_cell b)
{
    for (int k = 0; k < 3; k++) {
        double a_side = ldexp(1, -a.level), b_side = ldexp(1, -b.level), a_low = a.at[k] * a_side,
               b_low = b.at[k] * b_side;
        if (a_low > b_low + b_side || b_low > a_low + a_side)
            return false;
    }
    return true;
}

START_TEST(test_neighbours_match_exhaustive_search)
{
    int level = _i;
    uint32_t last = 1u << level;
    for (uint32_t n = 0; n < last * last * last; n++) {
        ebpo_cell cell = { level, { n % last, n / last % last, n / last / last } };
        unsigned found = 0, expected = 0;
        for (int s = 0; s < 27; s++) {
            const int step[3] = { s % 3 - 1, s / 3 % 3 - 1, s / 9 - 1 };
            ebpo_cell beside;
            if (!ebpo_cell_neighbour(cell, step, &beside))
                continue;
            found++;
            ck_assert_int_eq(beside.level, level);
            for (int k = 0; k < 3; k++)
                ck_assert_int_eq((int)beside.at[k] - (int)cell.at[k], step[k]);
            ck_assert(ebpo_cells_touch(cell, beside) && ebpo_cells_touch(beside, cell));
        }
        for (uint32_t m = 0; m < last * last * last; m++) {
            ebpo_cell other = { level, { m % last, m / last % last, m / last / last } };
            expected += reference_touch(cell, other);
        }
        ck_assert_uint_eq(found, expected);
    }
}
END_TEST

START_TEST(test_cells_of_any_level_touch)
{
    uint64_t state = 5;
    unsigned touching = 0;
    for (int i = 0; i < 20000; i++) {
        ebpo_cell a = random_cell(&state, (int)random_below(&state, 6)),
                  b = random_cell(&state, (int)random_below(&state, 6));
        ck_assert_int_eq(ebpo_cells_touch(a, b), reference_touch(a, b));
        touching += reference_touch(a, b);
    }
    ck_assert(touching > 1000 && touching < 19000);
    ebpo_cell deep = { EBPO_MAX_LEVEL, { (1u << EBPO_MAX_LEVEL) - 1, 0, 0 } };
    ck_assert(ebpo_cells_touch(deep, (ebpo_cell){ 0, { 0, 0, 0 } }));
    ck_assert(!ebpo_cells_touch(deep, (ebpo_cell){ EBPO_MAX_LEVEL, { 0, 0, 0 } }));
}
END_TEST

START_TEST(test_found_cell_contains_point)
{
    const double min[3] = { -1, 2, 1e3 }, max[3] = { 3, 2.5, 1e3 + 1e-3 };
    uint64_t state = (uint64_t)_i + 1;
    ebpo_box box;
    int level = _i % (EBPO_MAX_LEVEL + 1);
    ck_assert(ebpo_box_make(&box, min, max, EBPO_MAX_LEVEL));
    for (int i = 0; i < 500; i++) {
        double p[3], low[3], high[3];
        ebpo_cell cell = { level, { 0, 0, 0 } };
        bool inside = true;
        for (int k = 0; k < 3; k++) { /* a random position, often on a cell face or next to one */
            uint32_t cell_face = random_below(&state, (1u << level) + 1);
            p[k] = ebpo_cell_face(&box, k, level, cell_face);
            if (i % 3 == 1)
                p[k] = nextafter(p[k], random_below(&state, 2) ? INFINITY : -INFINITY);
            if (i % 3 == 2)
                p[k] += box.size[k] * (random_below(&state, 4000) / 2000.0 - 1);
            inside = inside && p[k] >= ebpo_cell_face(&box, k, 0, 0) &&
                     p[k] < ebpo_cell_face(&box, k, 0, 1);
        }
        ck_assert_int_eq(ebpo_locate(&box, level, p, cell.at), inside);
        if (!inside)
            continue;
        ebpo_cell_bounds(&box, cell, low, high);
        double volume = 1;
        for (int k = 0; k < 3; k++) {
            ck_assert(low[k] <= p[k] && p[k] < high[k]);
            volume *= high[k] - low[k];
        }
        ck_assert_double_eq_tol(ebpo_cell_volume(&box, level) / volume, 1, 1e-12);
    }
}
END_TEST

TEST_SUITE(octree)
{
    TCase *tests = tcase_create("octree");
    tcase_set_timeout(tests, 120);
    tcase_add_test(tests, test_group_word_types_match_octants);
    tcase_add_loop_test(tests, test_group_type_counts_match_plain_count, 0, 60);
    tcase_add_loop_test(tests, test_cells_and_octcodes_stay_consistent, 0, 4);
    tcase_add_loop_test(tests, test_neighbours_match_exhaustive_search, 0, 4);
    tcase_add_test(tests, test_cells_of_any_level_touch);
    tcase_add_loop_test(tests, test_found_cell_contains_point, 0, 42);
    Suite *suite = suite_create("octree");
    suite_add_tcase(suite, tests);
    return suite;
}
