/* Envelopes as in the theses, without the limits of files: polytopes with thousands of faces, and
 * levels compared with those of a file and with criteria of leaves counted by hand. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/build.h>

#include "check_main.h"
#include "construct/large_polytope.h"
#include "construct/planes.h"
#include "geometry/polytope.h"
#include "solids.h"

static void random_direction(uint64_t *seed, double n[3])
{
    double square = 0;
    do {
        for (int k = 0; k < 3; k++)
            n[k] = 2 * ebpo_test_random_unit(seed) - 1;
        square = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
    } while (square < 0.01 || square > 1);
    for (int k = 0; k < 3; k++)
        n[k] /= sqrt(square);
}

/* --- polytopes --- */

START_TEST(test_large_polytope_matches_small_one)
{
    uint64_t seed = 21;
    ebpo_large_polytope large = { 0 };
    for (int round = 0; round < 400; round++) {
        ebpo_polytope small;
        ebpo_polytope_cube(&small);
        ck_assert(ebpo_large_cube(&large));
        ck_assert_double_eq_tol(ebpo_large_volume(&large), 1, 1e-12);
        for (int cut = 0; cut < 30; cut++) {
            double n[3], d;
            random_direction(&seed, n);
            if (round % 4 == 0) /* through corners and along edges */
                for (int k = 0; k < 3; k++)
                    n[k] = (double)(ebpo_test_random(&seed) % 3) - 1;
            d = 0.5 * (n[0] + n[1] + n[2]) + 0.1 + 0.5 * ebpo_test_random_unit(&seed);
            if (round % 4 == 0)
                d = ceil(2 * d) / 2;
            ck_assert_int_eq(ebpo_large_clip(&large, n, d, cut),
                             ebpo_polytope_clip(&small, n, d, cut));
            ck_assert_double_eq_tol(ebpo_large_volume(&large), ebpo_polytope_volume(&small), 1e-9);
            ck_assert_uint_eq(large.now.face_count, (uint64_t)small.face_count);
        }
    }
    ebpo_large_free(&large);
}
END_TEST

START_TEST(test_large_polytope_of_sphere_has_all_planes)
{
    enum { PLANES = 3000 };
    uint64_t seed = 22;
    const double radius = 0.4, sphere = 4.0 / 3 * 3.14159265358979 * radius * radius * radius;
    ebpo_large_polytope p = { 0 };
    ck_assert(ebpo_large_cube(&p));
    for (int i = 0; i < PLANES; i++) {
        double n[3];
        random_direction(&seed, n);
        ck_assert_int_eq(ebpo_large_clip(&p, n, 0.5 * (n[0] + n[1] + n[2]) + radius, i),
                         EBPO_CLIP_CUT);
    }
    ck_assert_uint_ge(p.now.face_count, PLANES * 99 / 100);
    ck_assert_double_ge(ebpo_large_volume(&p), sphere);
    ck_assert_double_le(ebpo_large_volume(&p), sphere * 1.004);
    ebpo_large_free(&p);
}
END_TEST

/* --- candidates without limits --- */

START_TEST(test_kmedoids_of_many_candidates)
{
    enum { COUNT = 4200 };
    const int wanted = ebpo_test_scale() < 1 ? 20 : 60;
    static ebpo_candidate c[COUNT];
    static bool chosen[COUNT];
    static const double unit_cell[3] = { 1, 1, 1 };
    uint64_t seed = 23;
    int count = 0, equal = 0;
    for (int i = 0; i < COUNT; i++) { /* a third of the candidates has one of 40 normals */
        double n[3];
        random_direction(&seed, n);
        if (i % 3 == 0 && i > 120)
            c[i].normal = c[i % 40].normal;
        else
            ck_assert(ebpo_plane_code_normal(n, &c[i].normal));
    }
    ebpo_choice choice = { .candidates = c,
                           .count = COUNT,
                           .cell_size = unit_cell,
                           .normals = EBPO_NORMALS_ANGLE,
                           .wanted = wanted,
                           .seed = 5 };
    ck_assert(ebpo_choose_candidates(EBPO_SELECT_KMEDOIDS, &choice, chosen));
    for (int i = 0; i < COUNT; i++) {
        count += chosen[i];
        for (int j = 0; j < i; j++)
            equal += chosen[i] && chosen[j] && c[i].normal == c[j].normal;
    }
    ck_assert_int_eq(count, wanted);
    ck_assert_int_eq(equal, 0); /* a medoid at the place of another would lower no cost */
}
END_TEST

/* --- levels --- */

static ebpo_thesis_levels levels_of(ebpo_mesh mesh, const ebpo_build_options *options,
                                    ebpo_coalescing coalesce)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh_report facts;
    ebpo_thesis_levels out = EBPO_THESIS_LEVELS_INIT;
    ck_assert(ebpo_mesh_check(&mesh, 1, (ebpo_progress){ 0 }, &facts, &error) == EBPO_OK);
    ck_assert_msg(ebpo_build_as_theses(&mesh, &facts, options, coalesce, &out, &error) == EBPO_OK,
                  "%s", error.message);
    ck_assert(mesh.face_count == 0);
    return out;
}

static void build_tree(ebpo_mesh mesh, const ebpo_build_options *options, ebpo_tree *tree)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh_report facts;
    ck_assert(ebpo_mesh_check(&mesh, 1, (ebpo_progress){ 0 }, &facts, &error) == EBPO_OK);
    ck_assert_msg(ebpo_build(&mesh, &facts, NULL, options, tree, &error) == EBPO_OK, "%s",
                  error.message);
}

/* With all candidates chosen and at most 255 of them, files and theses differ by the rounding of
 * offsets only. */
START_TEST(test_levels_match_file_without_limits)
{
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    options.select = EBPO_SELECT_OFFSET;
    options.percent = 100;
    options.max_level = 3;
    options.leaf_faces = 6;
    options.parts |= EBPO_PART_LEAF_PLANES;
    ebpo_tree tree;
    build_tree(ebpo_test_torus(2, 0.7, 14, 8), &options, &tree);
    ebpo_thesis_levels l =
        levels_of(ebpo_test_torus(2, 0.7, 14, 8), &options, EBPO_COALESCE_DISTINCT);
    ck_assert_int_eq(l.level_count, tree.info.level_count);
    for (int i = 0; i < l.level_count; i++) {
        ck_assert_uint_eq(l.level[i].gray_count, tree.level[i].gray_count);
        ck_assert_uint_eq(l.level[i].leaf_count, tree.level[i].leaf_count);
        ck_assert_uint_eq(l.level[i].black_count, tree.level[i].black_count);
        double ours = tree.level[i].gray_volume;
        ck_assert_msg(l.level[i].gray_volume <= ours * (1 + 1e-9) &&
                          l.level[i].gray_volume >= ours * 0.99,
                      "level %d: %g without limits, %g in the file", i, l.level[i].gray_volume,
                      ours);
    }
    ebpo_tree_free(&tree);
}
END_TEST

/* The planes of a random run are neighbours on the surface, not in the order of their normals. */
START_TEST(test_random_run_is_not_sorted_by_normal)
{
    enum { MOST = 512 };
    static uint32_t all[MOST], some[MOST];
    uint64_t counts[2];
    for (int i = 0; i < 2; i++) {
        ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
        ebpo_tree tree;
        options.select = EBPO_SELECT_RANDOM;
        options.percent = i ? 25 : 100;
        options.leaf_faces = 400;
        options.parts |= EBPO_PART_LEAF_PLANES;
        build_tree(ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 2), &options, &tree); /* 320 faces */
        counts[i] = tree.level[0].leaf_plane_count;
        ck_assert_uint_le(counts[i], MOST);
        memcpy(i ? some : all, tree.level[0].leaf_planes, counts[i] * sizeof *all);
        ebpo_tree_free(&tree);
    }
    ck_assert_uint_ge(counts[0], 200);
    ck_assert_uint_ge(counts[1], 60);
    uint32_t gaps = 0; /* `all` is sorted, as candidates are */
    bool before = false;
    for (uint64_t i = 0; i < counts[0]; i++) {
        bool now = false;
        for (uint64_t k = 0; k < counts[1]; k++)
            now |= (some[k] & 0xfffff) == (all[i] & 0xfffff);
        gaps += now && !before;
        before = now;
    }
    ck_assert_uint_ge(gaps, 15);
}
END_TEST

/* BP 2008, 3.5.1: a root may have thousands of planes. */
START_TEST(test_root_has_more_planes_than_a_file_stores)
{
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    options.select = EBPO_SELECT_RANDOM;
    options.percent = 100;
    options.max_level = 2;
    options.leaf_faces = 0;
    ebpo_mesh sphere = ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 4); /* 5,120 faces */
    ebpo_mesh_report facts;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert(ebpo_mesh_check(&sphere, 1, (ebpo_progress){ 0 }, &facts, &error) == EBPO_OK);
    ebpo_thesis_levels l = levels_of(sphere, &options, EBPO_COALESCE_DISTINCT);
    ck_assert_uint_ge(l.level[0].plane_count, 1000);
    ck_assert_double_ge(l.level[0].gray_volume, facts.volume * (1 - 1e-9));
    ck_assert_double_le(l.level[0].gray_volume, facts.volume * 1.01);
}
END_TEST

/* A box of 768 faces in six planes: a percentage of the planes is one plane, a percentage of the
 * faces has all six. */
START_TEST(test_percentage_counts_equal_normals)
{
    const double low[3] = { 0, 0, 0 }, high[3] = { 1, 2, 3 };
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    ebpo_tree tree;
    options.select = EBPO_SELECT_KMEDOIDS;
    options.percent = 5;
    options.leaf_faces = 1000;
    options.parts |= EBPO_PART_LEAF_PLANES;
    ebpo_thesis_levels l = levels_of(ebpo_test_box(low, high, 8), &options, EBPO_COALESCE_DISTINCT);
    ck_assert_uint_eq(l.level[0].leaf_plane_count, 6);
    ck_assert_double_eq_tol(l.level[0].leaf_volume, 6, 1e-9);
    build_tree(ebpo_test_box(low, high, 8), &options, &tree);
    ck_assert_uint_le(tree.level[0].leaf_plane_count, 1);
    ebpo_tree_free(&tree);
}
END_TEST

START_TEST(test_levels_do_not_depend_on_threads)
{
    for (int s = EBPO_SELECT_KMEDOIDS; s <= EBPO_SELECT_RANDOM; s++) {
        ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
        options.select = (ebpo_selection)s;
        options.threads = 1;
        ebpo_thesis_levels one =
            levels_of(ebpo_test_torus(2, 0.7, 120, 60), &options, EBPO_COALESCE_SUM);
        options.threads = 3;
        ebpo_thesis_levels three =
            levels_of(ebpo_test_torus(2, 0.7, 120, 60), &options, EBPO_COALESCE_SUM);
        ck_assert_mem_eq(&one, &three, sizeof one);
        options.seed = 2;
        three = levels_of(ebpo_test_torus(2, 0.7, 120, 60), &options, EBPO_COALESCE_SUM);
        ck_assert(!memcmp(&one, &three, sizeof one) ==
                  !ebpo_selection_describe((ebpo_selection)s)->uses_seed);
    }
}
END_TEST

/* A box of 12 faces and eight cells: each criterion turns exactly at its number. */
START_TEST(test_leaves_follow_criterion)
{
    const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    options.select = EBPO_SELECT_OFFSET;
    options.max_level = 1;
    options.leaf_faces = 0;
    ebpo_thesis_levels l = levels_of(ebpo_test_box(low, high, 1), &options, EBPO_COALESCE_DISTINCT);
    uint64_t listed = l.level[1].leaf_faces;
    ck_assert_uint_eq(l.level[1].leaf_count, 8);
    ck_assert_uint_gt(listed, 12);
    const struct {
        ebpo_coalescing coalesce;
        uint64_t gray, leaf; /* greatest number for a gray root, least for a leaf */
    } turn[] = { { EBPO_COALESCE_DISTINCT, 11, 12 },
                 { EBPO_COALESCE_SUM, listed, listed + 1 },
                 { EBPO_COALESCE_MEAN, listed / 8, listed / 8 + 1 } };
    for (size_t i = 0; i < sizeof turn / sizeof *turn; i++) {
        options.leaf_faces = (uint32_t)turn[i].gray;
        l = levels_of(ebpo_test_box(low, high, 1), &options, turn[i].coalesce);
        ck_assert_uint_eq(l.level[0].gray_count, 1);
        ck_assert_uint_eq(l.level[1].leaf_count, 8);
        options.leaf_faces = (uint32_t)turn[i].leaf;
        l = levels_of(ebpo_test_box(low, high, 1), &options, turn[i].coalesce);
        ck_assert_uint_eq(l.level[0].gray_count, 0);
        ck_assert_uint_eq(l.level[0].leaf_count, 1);
        ck_assert_uint_eq(l.level[0].leaf_faces, 12);
    }
}
END_TEST

START_TEST(test_other_selections_are_refused)
{
    const struct {
        ebpo_selection select;
        int coalesce;
    } wrong[] = { { EBPO_SELECT_INHERIT, 0 },
                  { EBPO_SELECTION_COUNT, 0 },
                  { EBPO_SELECT_OFFSET, 3 } };
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
        ebpo_error error = EBPO_ERROR_INIT;
        ebpo_mesh mesh = ebpo_test_tetrahedron(1);
        ebpo_mesh_report facts;
        ebpo_thesis_levels out = EBPO_THESIS_LEVELS_INIT;
        ck_assert(ebpo_mesh_check(&mesh, 1, (ebpo_progress){ 0 }, &facts, &error) == EBPO_OK);
        options.select = wrong[i].select;
        ck_assert_int_eq(ebpo_build_as_theses(&mesh, &facts, &options,
                                              (ebpo_coalescing)wrong[i].coalesce, &out, &error),
                         EBPO_E_ARGUMENT);
    }
}
END_TEST

TEST_SUITE(theses)
{
    Suite *suite = suite_create("theses");
    TCase *tests = tcase_create("theses");
    tcase_set_timeout(tests, 300);
    tcase_add_test(tests, test_large_polytope_matches_small_one);
    tcase_add_test(tests, test_large_polytope_of_sphere_has_all_planes);
    tcase_add_test(tests, test_kmedoids_of_many_candidates);
    tcase_add_test(tests, test_levels_match_file_without_limits);
    tcase_add_test(tests, test_random_run_is_not_sorted_by_normal);
    tcase_add_test(tests, test_root_has_more_planes_than_a_file_stores);
    tcase_add_test(tests, test_percentage_counts_equal_normals);
    tcase_add_test(tests, test_levels_do_not_depend_on_threads);
    tcase_add_test(tests, test_leaves_follow_criterion);
    tcase_add_test(tests, test_other_selections_are_refused);
    suite_add_tcase(suite, tests);
    return suite;
}
