/* Tests the reference implementation of the tests (oracle): against closed forms, against itself
 * without its shortcuts, and against the exact predicates of the library. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "geometry/predicates.h"
#include "oracle.h"
#include "oracle_parts.h"
#include "solids.h"
#include "verify/verify_geometry.h"

static double some(uint64_t *state, double low, double high)
{
    return low + (high - low) * ebpo_test_random_unit(state);
}

/* Multiples of 1/8 in -range .. range. */
static double eighth(uint64_t *state, int range)
{
    return (double)((int64_t)(ebpo_test_random(state) % (uint64_t)(16 * range + 1)) - 8 * range) /
           8;
}

static ebpo_mesh box_mesh(double low, double high, uint32_t n)
{
    double a[3] = { low, low, low }, b[3] = { high, high, high };
    return ebpo_test_box(a, b, n);
}

/* --- rounding --- */

static double rounded(uint64_t num, uint64_t shift, uint64_t plus, uint64_t den, int exponent,
                      bool root)
{
    mpz_t n, d;
    mpz_init_set_ui(n, num);
    mpz_init_set_ui(d, den);
    mpz_mul_2exp(n, n, shift);
    mpz_add_ui(n, n, plus);
    double x = oracle_round(n, d, exponent, root);
    mpz_clears(n, d, NULL);
    return x;
}

START_TEST(test_oracle_rounds_ties_to_even)
{
    const double ulp = 0x1p-52;
    ck_assert_double_eq(rounded(1, 53, 1, 1, -53, false), 1); /* 1 + half an ulp */
    ck_assert_double_eq(rounded(1, 200, 1, 1, -200, false), 1);
    ck_assert_double_eq(rounded((UINT64_C(1) << 53) + 1, 100, 1, 1, -153, false), 1 + ulp);
    ck_assert_double_eq(rounded((UINT64_C(1) << 53) + 3, 0, 0, 1, -53, false), 1 + 2 * ulp);
    ck_assert_double_eq(rounded(1, 0, 0, 3, 0, false), 1.0 / 3);
    ck_assert_double_eq(rounded(2, 0, 0, 1, 0, true), sqrt(2));
    ck_assert_double_eq(rounded(9, 0, 0, 4, 0, true), 1.5);
    ck_assert_double_eq(rounded(5, 0, 0, 7, 0, true), (double)sqrtl(5.0L / 7));
    ck_assert_double_eq(rounded(0, 0, 0, 7, 0, true), 0);
}
END_TEST

START_TEST(test_oracle_rounds_at_range_limits)
{
    ck_assert_double_eq(rounded(1, 0, 0, 1, -2148, true), 0x1p-1074);
    /* half of the smallest double: ties to even */
    ck_assert_double_eq(rounded(1, 0, 0, 1, -2150, true), 0);
    /* a little more than half of the smallest double */
    ck_assert_double_eq(rounded(1, 200, 1, 1, -2350, true), 0x1p-1074);
    ck_assert_double_eq(rounded(9, 0, 0, 1, -2150, true), 0x1p-1073); /* 1.5 times the smallest: to
                                                                       * 2 */
    ck_assert_double_eq(rounded(1, 0, 0, 1, -3000, true), 0);
    ck_assert_double_eq(rounded(1, 0, 0, 1, 2046, true), 0x1p1023);
    ck_assert(isinf(rounded(1, 0, 0, 1, 2048, true)));
    ck_assert(isinf(rounded((UINT64_C(1) << 54) - 1, 0, 0, 1, 970, false)));
    ck_assert_double_eq(rounded((UINT64_C(1) << 53) - 1, 0, 0, 1, 971, false),
                        0x1.fffffffffffffp1023);
}
END_TEST

START_TEST(test_oracle_square_roots_match_hardware)
{
    uint64_t state = 1;
    for (int i = 0; i < 100000; i++) {
        uint64_t n = ebpo_test_random(&state) >> 11;
        ck_assert_double_eq(rounded(n, 0, 0, 1, 0, true), sqrt((double)n));
        ck_assert_double_eq(rounded(n, 0, 0, 1, -600, true), sqrt((double)n) * 0x1p-300);
        ck_assert_double_eq(rounded(n, 0, 0, 1 + (n & 0xffff), 0, false),
                            (double)n / (double)(1 + (n & 0xffff)));
    }
}
END_TEST

/* --- distances --- */

static double cube_distance(const double p[3], double low, double high)
{
    double out = 0, in = INFINITY;
    for (int k = 0; k < 3; k++) {
        double d = fmax(0, fmax(low - p[k], p[k] - high));
        out += d * d;
        in = fmin(in, fmin(p[k] - low, high - p[k]));
    }
    return out > 0 ? sqrt(out) : in;
}

START_TEST(test_oracle_cube_distance_matches_formula)
{
    uint64_t state = 2;
    for (uint32_t n = 1; n <= 4; n++) {
        ebpo_mesh mesh = box_mesh(-2, 4, n);
        oracle *o = oracle_make(&mesh);
        for (int i = 0; i < 4000; i++) {
            double p[3] = { eighth(&state, 8), eighth(&state, 8), eighth(&state, 8) };
            oracle_nearest near;
            oracle_find_nearest(o, p, &near);
            double expected = cube_distance(p, -2, 4);
            ck_assert_double_eq(near.distance, expected);
            ck_assert_int_eq(near.on, expected == 0);
            ck_assert_uint_ge(near.count, 1);
            if (expected == floor(expected)) {
                ck_assert_int_eq(oracle_distance_compare(o, expected), 0);
                ck_assert_int_eq(oracle_distance_compare(o, nextafter(expected, INFINITY)), -1);
            }
        }
        double centre[3] = { 1, 1, 1 };
        oracle_nearest near;
        oracle_find_nearest(o, centre, &near);
        /* the two halves of the middle squares, or all halves that touch the middle */
        ck_assert_uint_eq(near.count, n % 2 ? 2 * 6 : 6 * 6);
        oracle_free(o);
        ebpo_mesh_free(&mesh);
    }
}
END_TEST

/* Compares with a search through all faces that skips none. */
START_TEST(test_oracle_omitted_faces_are_never_nearest)
{
    const char *names[] = { "sphere",    "cone_slivers",   "needle", "giant_and_dust",
                            "thin_wall", "zero_area_face", "blob" };
    uint64_t state = 3;
    for (size_t m = 0; m < sizeof names / sizeof *names; m++) {
        ebpo_mesh mesh = ebpo_test_make(names[m]);
        oracle *o = oracle_make(&mesh);
        for (int i = 0; i < 60; i++) {
            double p[3];
            oracle_nearest near;
            ebpo_test_point(&mesh, ebpo_test_random(&state) % mesh.vertex_count, p);
            for (int k = 0; k < 3 && i % 3; k++)
                p[k] += some(&state, -1, 1) * (i % 3 == 1 ? 1 : 1e-7);
            oracle_find_nearest(o, p, &near);
            ck_assert_uint_ge(near.count, 1);
            uint32_t count = near.count, *faces = malloc(near.count * sizeof *faces), at = 0;
            memcpy(faces, near.faces, near.count * sizeof *faces);
            for (uint32_t f = 0; f < mesh.face_count; f++) {
                double d = oracle_face_distance(o, p, f);
                ck_assert_double_ge(d, near.distance);
                if (at < count && faces[at] == f) {
                    ck_assert_double_eq(d, near.distance);
                    at++;
                }
            }
            ck_assert_uint_eq(at, count); /* the order is ascending */
            free(faces);
        }
        oracle_free(o);
        ebpo_mesh_free(&mesh);
    }
}
END_TEST

START_TEST(test_oracle_distance_scales_with_model)
{
    static const int exponents[] = { -1040, -1000, -300, 300, 990 };
    uint64_t state = 4;
    ebpo_mesh mesh = box_mesh(-2, 4, 2), scaled = box_mesh(-2, 4, 2);
    for (size_t e = 0; e < sizeof exponents / sizeof *exponents; e++) {
        for (uint64_t i = 0; i < 3 * mesh.vertex_count; i++)
            scaled.xyz64[i] = ldexp(mesh.xyz64[i], exponents[e]);
        oracle *a = oracle_make(&mesh), *b = oracle_make(&scaled);
        for (int i = 0; i < 500; i++) {
            double p[3], q[3];
            oracle_nearest one, two;
            for (int k = 0; k < 3; k++) {
                p[k] = eighth(&state, 6);
                q[k] = ldexp(p[k], exponents[e]);
            }
            oracle_find_nearest(a, p, &one);
            oracle_find_nearest(b, q, &two);
            ck_assert_double_eq(ldexp(one.distance, exponents[e]), two.distance);
            ck_assert_uint_eq(one.count, two.count);
            ck_assert_mem_eq(one.faces, two.faces, one.count * sizeof *one.faces);
            if (!one.on)
                ck_assert_int_eq(oracle_winding(a, p), oracle_winding(b, q));
        }
        oracle_free(a);
        oracle_free(b);
    }
    ebpo_mesh_free(&mesh);
    ebpo_mesh_free(&scaled);
}
END_TEST

/* --- winding numbers, and points on faces: against the predicates of the library --- */

static int32_t winding_by_axis(const ebpo_mesh *mesh, const double p[3])
{
    int32_t sum = 0;
    for (uint64_t f = 0; f < mesh->face_count; f++) {
        double c[3][3];
        for (uint64_t i = 0; i < 3; i++)
            ebpo_test_point(mesh, mesh->faces[3 * f + i], c[i]);
        sum -= ebpo_axis_crossing(p, 1e9, 0, c[0], c[1], c[2]);
    }
    return sum;
}

static bool is_on(const ebpo_mesh *mesh, const double p[3])
{
    for (uint64_t f = 0; f < mesh->face_count; f++) {
        double c[3][3];
        for (uint64_t i = 0; i < 3; i++)
            ebpo_test_point(mesh, mesh->faces[3 * f + i], c[i]);
        if (ebpo_point_on_triangle(p, c[0], c[1], c[2]))
            return true;
    }
    return false;
}

START_TEST(test_oracle_winding_matches_predicates)
{
    const ebpo_test_solid *solid = &ebpo_test_solids[_i];
    uint64_t state = (uint64_t)_i;
    if (!solid->balanced)
        return;
    ebpo_mesh mesh = solid->make();
    oracle *o = oracle_make(&mesh);
    int on = 0;
    for (int i = 0; i < 600; i++) {
        double p[3];
        oracle_nearest near;
        ebpo_test_point(&mesh, ebpo_test_random(&state) % mesh.vertex_count, p);
        for (int k = 0; k < 3 && i % 8;
             k++) { /* coordinates of vertices: aligned with edges and faces */
            double q[3];
            ebpo_test_point(&mesh, ebpo_test_random(&state) % mesh.vertex_count, q);
            p[k] = q[k] + (i % 2 ? 0 : some(&state, -1e-2, 1e-2));
        }
        oracle_find_nearest(o, p, &near);
        ck_assert_int_eq(near.on, is_on(&mesh, p));
        on += near.on;
        if (!near.on)
            ck_assert_int_eq(oracle_winding(o, p), winding_by_axis(&mesh, p));
    }
    ck_assert_int_gt(on, 0);
    oracle_free(o);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* --- rays --- */

START_TEST(test_oracle_ray_hits_sum_to_winding)
{
    const char *names[] = {
        "sphere",          "torus", "cavity", "nested_same_direction", "overlapping_cubes",
        "inside_out_cube", "blob"
    };
    uint64_t state = 5;
    for (size_t m = 0; m < sizeof names / sizeof *names; m++) {
        ebpo_mesh mesh = ebpo_test_make(names[m]);
        oracle *o = oracle_make(&mesh);
        for (int i = 0; i < 300; i++) {
            double p[3] = { some(&state, -1, 3), some(&state, -1, 3), some(&state, -1, 3) };
            double d[3] = { some(&state, -1, 1), some(&state, -1, 1), some(&state, -1, 1) },
                   last = 0;
            const oracle_hit *hits;
            uint32_t count;
            int32_t sum = oracle_winding(o, p);
            oracle_ray(o, p, d, INFINITY, &hits, &count);
            for (uint32_t h = 0; h < count; h++) {
                ck_assert_int_ne(hits[h].side, 0);
                ck_assert_double_ge(hits[h].t, last);
                last = hits[h].t;
                sum += hits[h].side;
                if (sum == 0) /* the ends are part of the ray */
                    ck_assert_double_gt(hits[h].t, 0);
            }
            ck_assert_int_eq(sum, 0);
        }
        oracle_free(o);
        ebpo_mesh_free(&mesh);
    }
}
END_TEST

/* Uses a cube from 0 to 4 with two faces on each side. */
START_TEST(test_oracle_rays_along_edges_and_vertices)
{
    static const struct {
        double origin[3], direction[3], t_max;
        uint32_t count;
        double first, last;
        int side; /* side of the first hit */
    } rows[] = {
        { { -1, 1, 2 }, { 1, 0, 0 }, INFINITY, 2, 1, 5, 1 }, /* the ray crosses two faces */
        { { -1, 1, 2 }, { 1, 0, 0 }, 1, 1, 1, 1, 1 },        /* the ray ends at the side */
        { { -1, 1, 2 }, { 1, 0, 0 }, 0.999, 0, 0, 0, 0 },
        /* the ray begins inside; t is in lengths of the direction */
        { { 1, 3, 2 }, { 0.5, 0, 0 }, INFINITY, 1, 6, 6, -1 },
        /* the ray is in the side y = 0 and hits its two faces, and the faces at the edges of both
         * ends */
        { { -1, 0, 1 }, { 1, 0, 0 }, INFINITY, 4, 1, 5, 0 },
        { { 5, 5, 5 }, { 1, 1, 1 }, INFINITY, 0, 0, 0, 0 },
        /* the ray is a point at a vertex, which has at most 6 faces */
        { { 0, 0, 0 }, { 0, 0, 1e-300 }, 0, 6, 0, 0, 0 },
    };
    ebpo_mesh mesh = box_mesh(0, 4, 1);
    oracle *o = oracle_make(&mesh);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const oracle_hit *hits;
        uint32_t count;
        oracle_ray(o, rows[i].origin, rows[i].direction, rows[i].t_max, &hits, &count);
        if (rows[i].count == 6)
            ck_assert(count >= 3 && count <= 6);
        else
            ck_assert_msg(count == rows[i].count, "ray %zu: %u hits", i, count);
        if (count) {
            ck_assert_double_eq(hits[0].t, rows[i].first);
            ck_assert_double_eq(hits[count - 1].t, rows[i].last);
            ck_assert_int_eq(hits[0].side, rows[i].side);
        }
    }
    oracle_free(o);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* The distance of a hit point is 0 when the point is representable by doubles. */
START_TEST(test_oracle_hit_points_are_on_faces)
{
    uint64_t state = 6;
    ebpo_mesh mesh = ebpo_test_make("staircase");
    oracle *o = oracle_make(&mesh);
    int intersected = 0;
    for (int i = 0; i < 3000; i++) {
        double p[3], d[3];
        const oracle_hit *hits;
        uint32_t count;
        for (int k = 0; k < 3; k++) {
            p[k] = eighth(&state, 8);
            d[k] = (double)(ebpo_test_random(&state) % 3) - 1;
        }
        if (d[0] == 0 && d[1] == 0 && d[2] == 0)
            continue;
        oracle_ray(o, p, d, INFINITY, &hits, &count);
        for (uint32_t h = 0; h < count; h++, intersected++) {
            double q[3];
            for (int k = 0; k < 3; k++)
                q[k] = p[k] + hits[h].t * d[k];
            ck_assert_double_eq(oracle_face_distance(o, q, hits[h].face), 0);
        }
    }
    ck_assert_int_gt(intersected, 300);
    oracle_free(o);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* --- boxes --- */

START_TEST(test_oracle_boxes_match_verifier_clipping)
{
    const char *names[] = { "staircase", "torus", "zero_area_face", "index_repeated_face" };
    uint64_t state = 7;
    int intersected = 0;
    for (size_t m = 0; m < sizeof names / sizeof *names; m++) {
        ebpo_mesh mesh = ebpo_test_make(names[m]);
        oracle *o = oracle_make(&mesh);
        for (int i = 0; i < 400; i++) {
            double low[3], high[3];
            const uint32_t *faces;
            uint32_t count, at = 0;
            for (int k = 0; k < 3; k++) {
                low[k] = eighth(&state, 4);
                high[k] = low[k] + (double)(1 + ebpo_test_random(&state) % 16) / 8;
            }
            oracle_box(o, low, high, &faces, &count);
            for (uint32_t f = 0; f < mesh.face_count; f++) {
                ebpo_corners face;
                for (int c = 0; c < 3; c++)
                    ebpo_test_point(&mesh, mesh.faces[3 * (size_t)f + (size_t)c], face.at[c]);
                bool meets = ebpo_exact_touches(low, high, &face),
                     listed = at < count && faces[at] == f;
                ck_assert_int_eq(meets, listed);
                at += listed;
                intersected += meets;
            }
        }
        oracle_free(o);
        ebpo_mesh_free(&mesh);
    }
    ck_assert_int_gt(intersected, 1000);
}
END_TEST

START_TEST(test_oracle_flat_boxes_and_points)
{
    ebpo_mesh mesh = box_mesh(0, 4, 1);
    oracle *o = oracle_make(&mesh);
    static const struct {
        double low[3], high[3];
        uint32_t count;
    } rows[] = {
        { { 4, 1, 2 }, { 4, 1, 2 }, 1 },      { { 1, 1, 1 }, { 3, 3, 3 }, 0 },
        { { 4, 0, 0 }, { 4, 4, 4 }, 12 - 2 }, { { -1, 1, 2 }, { 5, 1, 2 }, 2 },
        { { -9, -9, -9 }, { 9, 9, 9 }, 12 },  { { 4.5, 0, 0 }, { 5, 4, 4 }, 0 },
        { { 1, 2.5, 4 }, { 2, 3, 4 }, 1 },
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const uint32_t *faces;
        uint32_t count;
        oracle_box(o, rows[i].low, rows[i].high, &faces, &count);
        ck_assert_msg(count == rows[i].count, "box %zu: %u faces", i, count);
    }
    oracle_free(o);
    ebpo_mesh_free(&mesh);
}
END_TEST

TEST_SUITE(oracle)
{
    Suite *suite = suite_create("oracle");
    TCase *tests = tcase_create("oracle");
    tcase_set_timeout(tests, 600);
    tcase_add_test(tests, test_oracle_rounds_ties_to_even);
    tcase_add_test(tests, test_oracle_rounds_at_range_limits);
    tcase_add_test(tests, test_oracle_square_roots_match_hardware);
    tcase_add_test(tests, test_oracle_cube_distance_matches_formula);
    tcase_add_test(tests, test_oracle_omitted_faces_are_never_nearest);
    tcase_add_test(tests, test_oracle_distance_scales_with_model);
    tcase_add_loop_test(tests, test_oracle_winding_matches_predicates, 0, ebpo_test_solid_count);
    tcase_add_test(tests, test_oracle_ray_hits_sum_to_winding);
    tcase_add_test(tests, test_oracle_rays_along_edges_and_vertices);
    tcase_add_test(tests, test_oracle_hit_points_are_on_faces);
    tcase_add_test(tests, test_oracle_boxes_match_verifier_clipping);
    tcase_add_test(tests, test_oracle_flat_boxes_and_points);
    suite_add_tcase(suite, tests);
    return suite;
}
