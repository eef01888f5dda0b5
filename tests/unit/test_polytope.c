/* Tests polytopes and plane codes: volumes add up; codes decode to the encoded values, and never
 * to less than the support. */
#include <math.h>
#include <stdlib.h>

#include "check_main.h"
#include "geometry/polytope.h"
#include "construct/planes.h"
#include "solids.h"

static void random_direction(uint64_t *seed, double n[3])
{
    double length = 0;
    do {
        for (int k = 0; k < 3; k++)
            n[k] = 2 * ebpo_test_random_unit(seed) - 1;
        length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    } while (length < 0.1 || length > 1);
    for (int k = 0; k < 3; k++)
        n[k] /= length;
}

/* Checks that every edge of a closed polyhedron is used once in each direction. */
static void assert_closed(const ebpo_polytope *p)
{
    static int uses[EBPO_POLYTOPE_VERTICES][EBPO_POLYTOPE_VERTICES];
    for (int f = 0; f < p->face_count; f++)
        for (int i = p->first[f]; i < p->first[f + 1]; i++) {
            int a = p->corner[i], b = p->corner[i + 1 < p->first[f + 1] ? i + 1 : p->first[f]];
            ck_assert_int_eq(uses[a][b]++, 0);
        }
    for (int f = 0; f < p->face_count; f++)
        for (int i = p->first[f]; i < p->first[f + 1]; i++) {
            int a = p->corner[i], b = p->corner[i + 1 < p->first[f + 1] ? i + 1 : p->first[f]];
            ck_assert_int_eq(uses[b][a], 1);
        }
    for (int f = 0; f < p->face_count; f++)
        for (int i = p->first[f]; i < p->first[f + 1]; i++)
            uses[p->corner[i]][p->corner[i + 1 < p->first[f + 1] ? i + 1 : p->first[f]]] = 0;
}

START_TEST(test_polytope_cube_has_volume_one)
{
    ebpo_polytope p;
    ebpo_polytope_cube(&p);
    ck_assert_double_eq(ebpo_polytope_volume(&p), 1);
    assert_closed(&p);
}
END_TEST

START_TEST(test_polytope_removed_volume_matches_clipping)
{
    uint64_t seed = 1;
    for (int round = 0; round < 3000; round++) {
        ebpo_polytope p;
        ebpo_polytope_cube(&p);
        for (int cut = 0; cut < 24; cut++) {
            double n[3], before = ebpo_polytope_volume(&p);
            random_direction(&seed, n);
            /* The first planes are near the middle, the later ones closer to the faces, so that
             * some volume remains. */
            double d = 0.5 * (n[0] + n[1] + n[2]) + 0.2 + 0.5 * ebpo_test_random_unit(&seed);
            double removed = ebpo_polytope_removed(&p, n, d, 0, 0);
            ebpo_clip result = ebpo_polytope_clip(&p, n, d, cut);
            double after = ebpo_polytope_volume(&p);
            if (result == EBPO_CLIP_CUT)
                ck_assert_double_eq_tol(before - after, removed, 1e-9);
            else
                ck_assert_double_eq(before, after);
            if (result == EBPO_CLIP_NONE)
                ck_assert_double_le(removed, 1e-9);
            assert_closed(&p);
        }
    }
}
END_TEST

START_TEST(test_polytope_planes_through_vertices)
{
    uint64_t seed = 2;
    for (int round = 0; round < 3000; round++) {
        ebpo_polytope p;
        ebpo_polytope_cube(&p);
        for (int cut = 0; cut < 12; cut++) {
            double n[3];
            for (int k = 0; k < 3; k++)
                n[k] = (double)(ebpo_test_random(&seed) % 5) - 2;
            double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
            if (length == 0)
                continue;
            const double *through = p.vertex[ebpo_test_random(&seed) % (uint64_t)p.vertex_count];
            double d = 0;
            for (int k = 0; k < 3; k++) {
                n[k] /= length;
                d += n[k] * through[k];
            }
            d += (double)(ebpo_test_random(&seed) % 3) * 1e-11;
            ebpo_polytope_clip(&p, n, d, cut);
            assert_closed(&p);
            ck_assert_double_gt(ebpo_polytope_volume(&p), 0);
        }
    }
}
END_TEST

START_TEST(test_polytope_with_nearly_parallel_planes)
{
    ebpo_polytope p;
    ebpo_polytope_cube(&p);
    uint64_t seed = 3;
    for (int i = 0; i < 2000; i++) {
        double n[3] = { 1e-6 * ebpo_test_random_unit(&seed), 1e-6 * ebpo_test_random_unit(&seed),
                        1 };
        ebpo_polytope_clip(&p, n, 0.5 + 1e-9 * ebpo_test_random_unit(&seed), i);
        assert_closed(&p);
    }
    ck_assert_double_eq_tol(ebpo_polytope_volume(&p), 0.5, 1e-5);
}
END_TEST

START_TEST(test_polytope_children_volume)
{
    uint64_t seed = 4;
    for (int round = 0; round < 1000; round++) {
        ebpo_polytope p, child;
        ebpo_polytope_cube(&p);
        for (int cut = 0; cut < 6; cut++) {
            double n[3];
            random_direction(&seed, n);
            ebpo_polytope_clip(&p, n,
                               0.5 * (n[0] + n[1] + n[2]) + 0.3 * ebpo_test_random_unit(&seed),
                               cut);
        }
        double sum = 0;
        for (unsigned o = 0; o < 8; o++) {
            bool some = ebpo_polytope_child(&p, o, &child);
            assert_closed(&child);
            sum += some ? ebpo_polytope_volume(&child) : 0;
        }
        ck_assert_double_eq_tol(sum, 8 * ebpo_polytope_volume(&p), 1e-5);
    }
}
END_TEST

START_TEST(test_plane_code_decodes_or_is_refused)
{
    /* odd, so that all columns of the map are tested */
    uint32_t step = (uint32_t)(16 / ebpo_test_scaled(16)) | 1;
    for (uint32_t normal = 0; normal < 1 << 20; normal += step) {
        int32_t n[3], d;
        bool plane = ebpo_plane_code_decode(normal | 7u << 20, n, &d);
        ck_assert_int_eq(plane, (normal & 1023) <= 1022 && normal >> 10 <= 1022);
        if (!plane)
            continue;
        ck_assert_int_eq(abs(n[0]) + abs(n[1]) + abs(n[2]), 511);
        uint32_t again;
        double direction[3] = { n[0], n[1], n[2] };
        ck_assert(ebpo_plane_code_normal(direction, &again));
        int32_t m[3];
        ck_assert(ebpo_plane_code_decode(again, m, &d));
        ck_assert(n[0] == m[0] && n[1] == m[1] && n[2] == m[2]);
    }
    int32_t n[3], d;
    ck_assert(!ebpo_plane_code_decode(511u | 511u << 10 | 4095u << 20, n, &d));
}
END_TEST

START_TEST(test_plane_offset_is_least_for_support)
{
    uint64_t seed = 5;
    for (uint64_t i = 0; i < ebpo_test_scaled(1000000); i++) {
        double direction[3];
        uint32_t normal;
        int32_t n[3], d;
        random_direction(&seed, direction);
        ck_assert(ebpo_plane_code_normal(direction, &normal));
        ebpo_plane_code_decode(normal, n, &d);
        double least = 0, most = 0;
        for (int k = 0; k < 3; k++) {
            least += n[k] < 0 ? n[k] : 0;
            most += n[k] > 0 ? n[k] : 0;
        }
        double support = least + (most - least) * ebpo_test_random_unit(&seed);
        int q = ebpo_plane_code_offset(n, support);
        if (q < 0) {
            ck_assert_double_gt(support, most - 511.0 / 4096 * 1.001);
            continue;
        }
        ck_assert(ebpo_plane_code_decode(ebpo_plane_code_make(normal, q), n, &d));
        ck_assert_double_ge((double)d, 4096 * support);
        ck_assert_double_le((double)d, 4096 * support + 511.001);
    }
}
END_TEST

START_TEST(test_plane_is_same_in_child_cell)
{
    /* points on a fine dyadic grid, where all results are exact in integers */
    uint64_t seed = 6;
    for (uint64_t i = 0; i < ebpo_test_scaled(300000); i++) {
        int32_t n[3], d32;
        uint32_t code = (uint32_t)ebpo_test_random(&seed);
        if (!ebpo_plane_code_decode(code, n, &d32))
            continue;
        unsigned octant = ebpo_test_random(&seed) % 8;
        int64_t d = ebpo_plane_to_child(n, d32, octant), child_side = 0, parent_side = 0;
        for (unsigned k = 0; k < 3; k++) {
            int64_t x = (int64_t)(ebpo_test_random(&seed) % 1025); /* 1024ths of the child cell */
            child_side += n[k] * x;
            parent_side += n[k] * (x + (int64_t)(octant >> k & 1) * 1024);
        }
        ck_assert_int_eq(4096 * child_side <= 1024 * d, 4096 * parent_side <= 2048 * (int64_t)d32);
    }
}
END_TEST

TEST_SUITE(polytope)
{
    Suite *suite = suite_create("polytope");
    TCase *tests = tcase_create("polytope");
    tcase_set_timeout(tests, 300);
    tcase_add_test(tests, test_polytope_cube_has_volume_one);
    tcase_add_test(tests, test_polytope_removed_volume_matches_clipping);
    tcase_add_test(tests, test_polytope_planes_through_vertices);
    tcase_add_test(tests, test_polytope_with_nearly_parallel_planes);
    tcase_add_test(tests, test_polytope_children_volume);
    tcase_add_test(tests, test_plane_code_decodes_or_is_refused);
    tcase_add_test(tests, test_plane_offset_is_least_for_support);
    tcase_add_test(tests, test_plane_is_same_in_child_cell);
    suite_add_tcase(suite, tests);
    return suite;
}
