/* Tests faces and cells, windings of corners, and selections against reference implementations
 * that sample or enumerate. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "geometry/polytope.h"
#include "construct/construct_stages.h"
#include "construct/planes.h"
#include "construct/sweep.h"
#include "geometry/vec3.h"
#include "solids.h"

static const double shapes[][6] = { { 0, 0, 0, 1, 1, 1 },
                                    { -0.5, -0.5, -0.5, 1, 2, 0.001 },
                                    { 1e7, -1e7, 3, 4, 8, 16 },
                                    { 1e-30, 0, 0, 1e-30, 1e-30, 1e-30 } };

/* Makes a face with corners on a coarse grid around the box, so that exact contact with cell
 * faces, edges and corners is common. */
static ebpo_triangle random_face(const ebpo_box *box, uint64_t *seed, bool on_grid)
{
    ebpo_triangle t;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            double at =
                on_grid ? (double)(ebpo_test_random(seed) % 17) / 16 : ebpo_test_random_unit(seed);
            t.corner[i][k] = box->origin[k] + at * box->size[k];
        }
    return t;
}

static void point_of(const ebpo_triangle *t, uint64_t *seed, double out[3])
{
    /* Weights are multiples of 1/64, so that corners and edge points are common. */
    int a = (int)(ebpo_test_random(seed) % 65),
        b = (int)(ebpo_test_random(seed) % (uint64_t)(65 - a));
    for (int k = 0; k < 3; k++)
        out[k] = (a * t->corner[0][k] + b * t->corner[1][k] + (64 - a - b) * t->corner[2][k]) / 64;
}

static ebpo_box box_of(int i, int grid_level)
{
    ebpo_box box;
    double low[3], high[3];
    for (int k = 0; k < 3; k++) {
        low[k] = shapes[i][k];
        high[k] = shapes[i][k] + shapes[i][3 + k];
    }
    ck_assert(ebpo_box_make(&box, low, high, grid_level));
    return box;
}

/* Returns true when the point is in the cell, and rounding of the sampled point cannot matter. */
static bool clearly_in(const ebpo_box *box, ebpo_cell cell, const double p[3])
{
    for (int k = 0; k < 3; k++) {
        double low = ebpo_cell_face(box, k, cell.level, cell.at[k]),
               high = ebpo_cell_face(box, k, cell.level, cell.at[k] + 1);
        double margin = 1e-12 * (fabs(low) + fabs(high) + (high - low));
        if (p[k] < low + margin || p[k] > high - margin)
            return false;
    }
    return true;
}

START_TEST(test_octants_intersected_by_face_are_found)
{
    uint64_t seed = 1;
    for (int s = 0; s < 4; s++) {
        ebpo_box box = box_of(s, 12);
        for (int i = 0; i < 20000; i++) {
            ebpo_triangle t = random_face(&box, &seed, i % 2);
            ebpo_cell cell = { 0, { 0, 0, 0 } };
            for (int depth = 0; depth < 6; depth++) {
                const ebpo_sweep_cell prepared = ebpo_octants_prepare(&box, cell);
                unsigned mask = ebpo_octants_visited(&prepared, &t);
                for (int j = 0; j < 8; j++) {
                    double p[3];
                    point_of(&t, &seed, p);
                    for (unsigned o = 0; o < 8; o++) {
                        ebpo_cell child = { cell.level + 1, { 0, 0, 0 } };
                        for (unsigned k = 0; k < 3; k++)
                            child.at[k] = cell.at[k] * 2 + (o >> k & 1);
                        if (clearly_in(&box, child, p))
                            ck_assert_msg(mask >> o & 1, "octant %u missed at level %d", o,
                                          cell.level);
                    }
                }
                if (!mask)
                    break;
                unsigned o = (unsigned)__builtin_ctz(mask);
                cell.level++;
                for (unsigned k = 0; k < 3; k++)
                    cell.at[k] = cell.at[k] * 2 + (o >> k & 1);
            }
        }
    }
}
END_TEST

START_TEST(test_octants_far_from_face_are_omitted)
{
    ebpo_box box = box_of(0, 10);
    ebpo_triangle t = { { { 0.1, 0.1, 0.1 }, { 0.2, 0.1, 0.1 }, { 0.1, 0.2, 0.1 } } };
    const ebpo_sweep_cell root = ebpo_octants_prepare(&box, (ebpo_cell){ 0, { 0, 0, 0 } });
    ck_assert_uint_eq(ebpo_octants_visited(&root, &t), 1);
    /* A slanted face whose box intersects all octants, and which cuts off one corner of the cube.
     */
    ebpo_triangle slanted = { { { 0.9, 0, 0 }, { 0, 0.9, 0 }, { 0, 0, 0.9 } } };
    unsigned mask = ebpo_octants_visited(&root, &slanted);
    ck_assert_uint_eq(mask, 0x17);
}
END_TEST

START_TEST(test_clipped_face_bounds_points_in_cell)
{
    uint64_t seed = 2;
    for (int s = 0; s < 4; s++) {
        ebpo_box box = box_of(s, 12);
        for (int i = 0; i < 40000; i++) {
            ebpo_triangle t = random_face(&box, &seed, i % 2);
            int level = (int)(ebpo_test_random(&seed) % 4);
            ebpo_cell cell = { level, { 0, 0, 0 } };
            for (int k = 0; k < 3; k++)
                cell.at[k] = (uint32_t)(ebpo_test_random(&seed) % (1u << level));
            double points[9][3], slack, n[3];
            int count = ebpo_clip_triangle(&box, cell, &t, points, &slack);
            ck_assert_int_le(count, 9);
            ck_assert_double_lt(slack, 1e-9);
            for (int j = 0; j < 8; j++) {
                double p[3], best = -1e300, value = 0;
                point_of(&t, &seed, p);
                if (!clearly_in(&box, cell, p))
                    continue;
                ck_assert_int_gt(count, 0);
                for (int k = 0; k < 3; k++)
                    n[k] = 2 * ebpo_test_random_unit(&seed) - 1;
                for (int q = 0; q < count; q++)
                    best =
                        fmax(best, n[0] * points[q][0] + n[1] * points[q][1] + n[2] * points[q][2]);
                for (int k = 0; k < 3; k++) {
                    double low = ebpo_cell_face(&box, k, level, cell.at[k]);
                    value += n[k] * ((p[k] - low) / (box.size[k] / (1 << level)));
                }
                ck_assert_double_le(value, best + 3 * slack + 1e-8);
            }
        }
    }
}
END_TEST

START_TEST(test_corner_windings_of_cube_in_cell)
{
    ebpo_box box = box_of(0, 4);
    double low[3] = { 0.1, 0.1, 0.1 }, high[3] = { 0.9, 0.9, 0.9 };
    ebpo_mesh cube = ebpo_test_box(low, high, 1);
    ebpo_triangle faces[12];
    for (int f = 0; f < 12; f++)
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++)
                faces[f].corner[i][k] = cube.xyz64[3 * cube.faces[3 * f + i] + (uint32_t)k];
    int32_t delta[8];
    ebpo_corner_windings(&box, (ebpo_cell){ 0, { 0, 0, 0 } }, faces, 12, delta);
    for (int i = 0; i < 8; i++)
        ck_assert_int_eq(delta[i], 0);
    ebpo_corner_windings(&box, (ebpo_cell){ 1, { 0, 0, 0 } }, faces, 12, delta);
    for (int i = 0; i < 8; i++)
        ck_assert_int_eq(delta[i], i == 7);
    ebpo_corner_windings(&box, (ebpo_cell){ 1, { 1, 1, 1 } }, faces, 12, delta);
    for (int i = 0; i < 8; i++)
        ck_assert_int_eq(delta[i], i == 0 ? 0 : -1);
    ebpo_mesh_free(&cube);
}
END_TEST

/* The reference implementation: always the greatest removal, with all planes evaluated in every
 * round. */
static int plain_greedy(ebpo_polytope *envelope, const ebpo_candidate *c, int count, double epsilon,
                        int most, uint32_t *codes)
{
    int taken = 0;
    while (taken < most) {
        double best = 0;
        uint32_t best_code = UINT32_MAX;
        for (int i = 0; i < count; i++) {
            int32_t v[3], d;
            double n[3];
            ebpo_plane_code_decode(c[i].normal, v, &d);
            int q = ebpo_plane_code_offset(v, c[i].support);
            if (q < 0)
                continue;
            uint32_t code = ebpo_plane_code_make(c[i].normal, q);
            ebpo_plane_code_decode(code, v, &d);
            double offset = ebpo_plane_as_double(v, d, n),
                   gain = ebpo_polytope_removed(envelope, n, offset, 0, 0);
            if (gain > best || (gain == best && code < best_code)) {
                best = gain;
                best_code = code;
            }
        }
        if (!(best >= epsilon))
            break;
        int32_t v[3], d;
        double n[3];
        ebpo_plane_code_decode(best_code, v, &d);
        double offset = ebpo_plane_as_double(v, d, n);
        if (ebpo_polytope_clip(envelope, n, offset, taken) != EBPO_CLIP_CUT)
            break;
        codes[taken++] = best_code;
    }
    return taken;
}

START_TEST(test_lazy_greedy_matches_plain_greedy)
{
    uint64_t seed = 3;
    for (int round = 0; round < 400; round++) {
        ebpo_candidate c[40];
        for (int i = 0; i < 40; i++) {
            double n[3] = { ebpo_test_random_unit(&seed) - 0.5, ebpo_test_random_unit(&seed) - 0.5,
                            ebpo_test_random_unit(&seed) - 0.5 };
            int32_t v[3], d;
            ck_assert(ebpo_plane_code_normal(n, &c[i].normal));
            ebpo_plane_code_decode(c[i].normal, v, &d);
            c[i].support =
                0.5 * (v[0] + v[1] + v[2]) + 511 * (0.15 + 0.3 * ebpo_test_random_unit(&seed));
        }
        ebpo_polytope fast, slow;
        ebpo_polytope_cube(&fast);
        ebpo_polytope_cube(&slow);
        uint32_t a[EBPO_PLANES_MAX], b[EBPO_PLANES_MAX];
        int na = ebpo_select_greedy(&fast,
                                    &(ebpo_choice){ .candidates = c,
                                                    .count = 40,
                                                    .codes_max = EBPO_PLANES_MAX,
                                                    .epsilon = 0.002 },
                                    a);
        int nb = plain_greedy(&slow, c, 40, 0.002, EBPO_PLANES_MAX, b);
        ck_assert_int_eq(na, nb);
        for (int i = 0; i < na; i++)
            ck_assert_uint_eq(a[i], b[i]);
        ck_assert_double_eq(ebpo_polytope_volume(&fast), ebpo_polytope_volume(&slow));
    }
}
END_TEST

/* --- the kernels of sweep.h, with the same bits as plain loops --- */

static const ebpo_sweep *sweeps(int i)
{
#if defined(__x86_64__) && !defined(EBPO_BASE_KERNELS_ONLY)
    return i == 0 ? &ebpo_sweep_base : i == 1 && ebpo_cpu_has_v3() ? &ebpo_sweep_v3 : NULL;
#else
    return i == 0 ? &ebpo_sweep_base : NULL;
#endif
}

/* Returns true if a plane separates the face from an octant. x: corners in cell coordinates. */
static bool is_separated(const double x[3][3], unsigned octant)
{
    double edge[3][3], normal[3], centre[3], m = 1, distance = 0, radius = 0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            m = fmax(m, fabs(x[i][k])), edge[i][k] = x[(i + 1) % 3][k] - x[i][k];
    ebpo_vec3_cross(edge[0], edge[1], normal);
    for (int k = 0; k < 3; k++) {
        centre[k] = octant >> k & 1 ? 0.75 : 0.25;
        distance += normal[k] * (x[0][k] - centre[k]);
        radius += fabs(normal[k]);
    }
    if (fabs(distance) > 0.25 * radius + 0x1p-44 * m * m * m)
        return true;
    for (int i = 0; i < 9; i++) {
        int a = (i / 3 + 1) % 3, b = (i / 3 + 2) % 3;
        const double *p = x[i % 3], *q = x[(i + 2) % 3], *e = edge[i % 3];
        double dp = e[a] * (p[b] - centre[b]) - e[b] * (p[a] - centre[a]),
               dq = e[a] * (q[b] - centre[b]) - e[b] * (q[a] - centre[a]),
               r = 0.25 * (fabs(e[a]) + fabs(e[b])) + 0x1p-46 * m * m;
        if ((dp > r && dq > r) || (dp < -r && dq < -r))
            return true;
    }
    return false;
}

START_TEST(test_octants_match_plain_loop)
{
    uint64_t seed = 4;
    int found[8] = { 0 };
    const ebpo_sweep *sweep = sweeps(_i);
    for (int i = 0; i < 40000 && sweep; i++) {
        ebpo_box box = box_of(i % 4, 12);
        ebpo_cell cell = { i / 8 % 3, { 0, 0, 0 } };
        ebpo_triangle t = random_face(&box, &seed, i / 4 % 2);
        const ebpo_sweep_cell prepared = ebpo_octants_prepare(&box, cell);
        double x[3][3];
        unsigned mask = sweep->find_octants(&prepared, (const double(*)[3])t.corner);
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++)
                x[c][k] = (t.corner[c][k] - box.origin[k]) / (box.size[k] / (1 << cell.level));
        unsigned boxes = 255;
        for (unsigned o = 0; o < 8; o++)
            for (int k = 0; k < 3; k++) {
                double centre = ebpo_cell_face(&box, k, cell.level + 1, 1), a = t.corner[0][k],
                       b = t.corner[1][k], c = t.corner[2][k];
                if (o >> k & 1 ? ebpo_max3(a, b, c) < centre : ebpo_min3(a, b, c) > centre)
                    boxes &= ~(1u << o);
            }
        /* a single octant is not tested further */
        for (unsigned o = 0; o < 8; o++) {
            bool expected = boxes >> o & 1 &&
                            ((boxes & (boxes - 1)) == 0 || !is_separated((const double(*)[3])x, o));
            ck_assert_int_eq(mask >> o & 1, expected);
            found[o] += expected;
        }
    }
    for (int o = 0; o < 8 && sweep; o++)
        ck_assert(found[o] > 4000 && found[o] < 36000);
}
END_TEST

/* Points on a coarse grid, so that several are extreme along a direction. */
START_TEST(test_extremes_and_planes_match_plain_loops)
{
    enum { POINTS = 50, EDGES = 7 };
    uint64_t seed = 5;
    const ebpo_sweep *sweep = sweeps(_i);
    for (int round = 0; round < 2000 && sweep; round++) {
        double p[POINTS][3], n[3], u[3], v[3];
        int at[EBPO_SWEEP_EXTREMES], count = 1 + round % POINTS;
        for (int i = 0; i < POINTS; i++)
            for (int k = 0; k < 3; k++)
                p[i][k] = round % 2 ? (double)(ebpo_test_random(&seed) % 4) / 4
                                    : ebpo_test_random_unit(&seed);
        sweep->find_extremes((const double(*)[3])p, count, at);
        for (int w = 0; w < EBPO_SWEEP_EXTREMES; w++) {
            double best = -INFINITY;
            int first = 0;
            for (int i = 0; i < count; i++) {
                double x = p[i][0], y = p[i][1], z = p[i][2],
                       along[7] = { x, y, z, x + y + z, x + y - z, x - y + z, x - y - z },
                       value = w % 2 ? -along[w / 2] : along[w / 2];
                if (value > best)
                    best = value, first = i;
            }
            ck_assert_int_eq(at[w], first);
        }
        uint32_t edge[EDGES];
        ebpo_sweep_plane plane[EDGES], expected;
        for (uint32_t i = 0; i < EDGES; i++)
            edge[i] = (2 * i) << 16 | (2 * i + 1);
        sweep->make_planes((const double(*)[3])p, edge, 1 + round % EDGES, POINTS - 1, plane);
        for (int i = 0; i < 1 + round % EDGES; i++) {
            ebpo_vec3_subtract(p[2 * i + 1], p[2 * i], u);
            ebpo_vec3_subtract(p[POINTS - 1], p[2 * i], v);
            ebpo_vec3_cross(u, v, n);
            expected.length = ebpo_vec3_length(n);
            for (int k = 0; k < 3; k++)
                expected.n[k] = n[k] / expected.length;
            expected.d = ebpo_vec3_dot(expected.n, p[2 * i]);
            ck_assert(plane[i].length == expected.length);
            ck_assert(!(expected.length > 0) || memcmp(&plane[i], &expected, sizeof expected) == 0);
        }
    }
}
END_TEST

/* A half of a polytope has the bits of a clip of the scaled polytope. */
START_TEST(test_halves_match_clips)
{
    uint64_t seed = 6;
    for (int round = 0; round < 2000; round++) {
        ebpo_polytope p, half, clipped;
        ebpo_polytope_cube(&p);
        for (int i = 0; i < round % 12; i++) {
            double n[3] = { ebpo_test_random_unit(&seed) - 0.5, ebpo_test_random_unit(&seed) - 0.5,
                            ebpo_test_random_unit(&seed) - 0.5 },
                   length = ebpo_vec3_length(n);
            for (int k = 0; k < 3; k++)
                n[k] /= length;
            (void)ebpo_polytope_clip(
                &p, n, 0.5 * (n[0] + n[1] + n[2]) + 0.6 * ebpo_test_random_unit(&seed) - 0.1, i);
        }
        int axis = round % 3, side = round / 3 % 2;
        double n[3] = { 0, 0, 0 };
        n[axis] = side ? -1 : 1;
        ebpo_polytope_copy(&clipped, &p);
        for (int i = 0; i < p.vertex_count; i++)
            clipped.vertex[i][axis] = 2 * p.vertex[i][axis] - side;
        ebpo_clip clip = ebpo_polytope_clip(&clipped, n, side ? 0 : 1, -1 - (2 * axis + !side));
        if (clip == EBPO_CLIP_REFUSED)
            ebpo_polytope_cube(&clipped);
        ck_assert_int_eq(ebpo_polytope_half(&p, axis, side, &half), clip != EBPO_CLIP_REFUSED);
        ck_assert_int_eq(half.vertex_count, clipped.vertex_count);
        ck_assert_int_eq(half.face_count, clipped.face_count);
        ck_assert_int_eq(half.corner_count, clipped.corner_count);
        ck_assert(memcmp(half.vertex, clipped.vertex,
                         (size_t)half.vertex_count * sizeof half.vertex[0]) == 0);
        ck_assert(memcmp(half.corner, clipped.corner,
                         (size_t)half.corner_count * sizeof half.corner[0]) == 0);
        ck_assert(memcmp(half.tag, clipped.tag, (size_t)half.face_count * sizeof half.tag[0]) == 0);
    }
}
END_TEST

TEST_SUITE(planes)
{
    Suite *suite = suite_create("planes");
    TCase *tests = tcase_create("planes");
    tcase_set_timeout(tests, 300);
    tcase_add_test(tests, test_octants_intersected_by_face_are_found);
    tcase_add_test(tests, test_octants_far_from_face_are_omitted);
    tcase_add_test(tests, test_clipped_face_bounds_points_in_cell);
    tcase_add_test(tests, test_corner_windings_of_cube_in_cell);
    tcase_add_test(tests, test_lazy_greedy_matches_plain_greedy);
    tcase_add_loop_test(tests, test_octants_match_plain_loop, 0, 2);
    tcase_add_loop_test(tests, test_extremes_and_planes_match_plain_loops, 0, 2);
    tcase_add_test(tests, test_halves_match_clips);
    suite_add_tcase(suite, tests);
    return suite;
}
