/* Tests crossings of faces by axis-parallel segments against a reference implementation that
 * shifts the segment, and on closed meshes. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "exact_reference.h"
#include "geometry/predicates.h"

/* --- the reference implementation: a naive segment-face intersection in rationals --- */

typedef mpq_t vector[3];

static void vector_init(vector v)
{
    for (int k = 0; k < 3; k++)
        mpq_init(v[k]);
}

static void vector_clear(vector v)
{
    for (int k = 0; k < 3; k++)
        mpq_clear(v[k]);
}

static void vector_set(vector out, const double p[3])
{
    for (int k = 0; k < 3; k++)
        mpq_set_d(out[k], p[k]);
}

/* out = (q - p) x (s - r) */
static void cross_of_differences(vector out, vector p, vector q, vector r, vector s)
{
    vector e, f;
    mpq_t t;
    vector_init(e);
    vector_init(f);
    mpq_init(t);
    for (int k = 0; k < 3; k++) {
        mpq_sub(e[k], q[k], p[k]);
        mpq_sub(f[k], s[k], r[k]);
    }
    for (int k = 0; k < 3; k++) {
        mpq_mul(out[k], e[(k + 1) % 3], f[(k + 2) % 3]);
        mpq_mul(t, e[(k + 2) % 3], f[(k + 1) % 3]);
        mpq_sub(out[k], out[k], t);
    }
    mpq_clear(t);
    vector_clear(e);
    vector_clear(f);
}

static void dot(mpq_t out, vector a, vector b)
{
    mpq_t t;
    mpq_init(t);
    mpq_set_ui(out, 0, 1);
    for (int k = 0; k < 3; k++) {
        mpq_mul(t, a[k], b[k]);
        mpq_add(out, out, t);
    }
    mpq_clear(t);
}

/* out = normal . (p - a) */
static void height(mpq_t out, vector normal, vector p, vector a)
{
    mpq_t t;
    mpq_init(t);
    dot(out, normal, p);
    dot(t, normal, a);
    mpq_sub(out, out, t);
    mpq_clear(t);
}

/* Returns true when x, in the plane, is strictly inside the face. */
static bool inside_face(vector x, vector corner[3], vector normal)
{
    bool inside = true;
    vector n;
    mpq_t d;
    vector_init(n);
    mpq_init(d);
    for (int i = 0; i < 3; i++) {
        cross_of_differences(n, corner[i], corner[(i + 1) % 3], corner[i], x);
        dot(d, n, normal);
        inside &= mpq_sgn(d) > 0;
    }
    mpq_clear(d);
    vector_clear(n);
    return inside;
}

/* out = p + (2^-s, 2^-3s, 2^-7s) */
static void set_shifted(vector out, const double p[3], unsigned s)
{
    static const unsigned factor[3] = { 1, 3, 7 };
    mpq_t d;
    mpq_init(d);
    for (int k = 0; k < 3; k++) {
        mpq_set_d(out[k], p[k]);
        mpq_set_ui(d, 1, 1);
        mpq_div_2exp(d, d, s * factor[k]);
        mpq_add(out[k], out[k], d);
    }
    mpq_clear(d);
}

static int reference_crossing(const double from[3], double to, int axis, const double *face,
                              unsigned s)
{
    vector p, q, x, normal, corner[3];
    mpq_t hp, hq, t;
    double end[3] = { from[0], from[1], from[2] };
    int result = 0;
    end[axis] = to;
    mpq_inits(hp, hq, t, NULL);
    vector_init(p);
    vector_init(q);
    vector_init(x);
    vector_init(normal);
    for (int i = 0; i < 3; i++) {
        vector_init(corner[i]);
        vector_set(corner[i], face + 3 * i);
    }
    set_shifted(p, from, s);
    set_shifted(q, end, s);
    cross_of_differences(normal, corner[0], corner[1], corner[0], corner[2]);
    height(hp, normal, p, corner[0]);
    height(hq, normal, q, corner[0]);
    if (mpq_sgn(hp) * mpq_sgn(hq) < 0) {
        result = mpq_sgn(hp);
        mpq_sub(t, hp, hq);
        mpq_div(t, hp, t);
        for (int k = 0; k < 3; k++) {
            mpq_sub(x[k], q[k], p[k]);
            mpq_mul(x[k], x[k], t);
            mpq_add(x[k], x[k], p[k]);
        }
        if (!inside_face(x, corner, normal))
            result = 0;
    }
    for (int i = 0; i < 3; i++)
        vector_clear(corner[i]);
    vector_clear(normal);
    vector_clear(x);
    vector_clear(q);
    vector_clear(p);
    mpq_clears(hp, hq, t, NULL);
    return result;
}

/* --- single faces --- */

START_TEST(test_crossing_matches_rational_on_integers)
{
    uint64_t state = (uint64_t)_i + 3;
    int crossed = 0;
    for (int i = 0; i < 12000; i++) {
        double face[9], from[3];
        int axis = (int)reference_integer(&state, 0, 2);
        for (int k = 0; k < 9; k++)
            face[k] = (double)reference_integer(&state, -2, 2);
        for (int k = 0; k < 3; k++)
            from[k] = (double)reference_integer(&state, -4, 4) / 2;
        double to = from[axis] + (double)reference_integer(&state, 0, 8) / 2;
        int expected = reference_crossing(from, to, axis, face, 80);
        ck_assert_int_eq(ebpo_axis_crossing(from, to, axis, face, face + 3, face + 6), expected);
        ck_assert_int_eq(ebpo_axis_crossing(from, to, axis, face + 3, face + 6, face), expected);
        ck_assert_int_eq(ebpo_axis_crossing(from, to, axis, face + 3, face, face + 6), -expected);
        crossed += expected != 0;
    }
    ck_assert_int_gt(crossed, 200);
}
END_TEST

/* The segment starts or ends on a corner, the middle of an edge or the middle of the face, rounded.
 */
START_TEST(test_crossing_matches_rational_on_floats)
{
    uint64_t state = (uint64_t)_i + 30;
    for (int i = 0; i < 2500; i++) {
        double face[9], from[3];
        int axis = (int)reference_integer(&state, 0, 2), weight[3], sum = 0;
        for (int k = 0; k < 9; k++)
            face[k] = (double)reference_integer(&state, 1 << 10, 1 << 24) * 0x1p-24 +
                      (_i == 1 ? 65536 : 0);
        for (int k = 0; k < 3; k++)
            sum += weight[k] = (int)reference_integer(&state, k == 0, 1);
        for (int k = 0; k < 3; k++)
            from[k] =
                (face[k] * weight[0] + face[3 + k] * weight[1] + face[6 + k] * weight[2]) / sum;
        double to = from[axis] + 0.5 * (double)reference_integer(&state, 0, 2);
        if (reference_random(&state) % 2) {
            to = from[axis];
            from[axis] -= 0.25;
        }
        int expected = reference_crossing(from, to, axis, face, 400);
        ck_assert_int_eq(ebpo_axis_crossing(from, to, axis, face, face + 3, face + 6), expected);
    }
}
END_TEST

START_TEST(test_zero_length_segment_never_crosses)
{
    uint64_t state = 8;
    for (int i = 0; i < 100000; i++) {
        double face[9], from[3];
        for (int k = 0; k < 9; k++)
            face[k] = (double)reference_integer(&state, -1, 1);
        for (int k = 0; k < 3; k++)
            from[k] = (double)reference_integer(&state, -1, 1);
        ck_assert_int_eq(ebpo_axis_crossing(from, from[i % 3], i % 3, face, face + 3, face + 6), 0);
    }
}
END_TEST

/* --- closed meshes --- */

enum { MAX_FACES = 2048 };

typedef struct soup {
    int count;
    double face[MAX_FACES][9];
} soup;

static void add_face(soup *mesh, const double *a, const double *b, const double *c)
{
    double *face = mesh->face[mesh->count++];
    memcpy(face, a, 3 * sizeof *a);
    memcpy(face + 3, b, 3 * sizeof *b);
    memcpy(face + 6, c, 3 * sizeof *c);
}

/* Returns the winding number of p by the faces between it and a point far below it on `axis`. */
static int winding(const soup *mesh, const double p[3], int axis)
{
    double from[3] = { p[0], p[1], p[2] };
    int sum = 0;
    from[axis] = -100;
    for (int i = 0; i < mesh->count; i++)
        sum += ebpo_axis_crossing(from, p[axis], axis, mesh->face[i], mesh->face[i] + 3,
                                  mesh->face[i] + 6);
    return sum;
}

enum { GRID = 3 };

static bool filled(const bool *voxel, int x, int y, int z)
{
    bool in = x >= 0 && y >= 0 && z >= 0 && x < GRID && y < GRID && z < GRID;
    return in && voxel[(x * GRID + y) * GRID + z];
}

/* Adds the two faces of the voxel's side `side` (0 low, 1 high) of `axis`, outward, over a random
 * diagonal. */
static void add_cell_face(soup *mesh, const int at[3], int axis, int side, uint64_t *state)
{
    double q[4][3];
    int u = (axis + 1) % 3, v = (axis + 2) % 3, turn = (int)reference_integer(state, 0, 3);
    for (int i = 0; i < 4; i++) {
        q[i][axis] = at[axis] + side;
        q[i][u] = at[u] + (i == 1 || i == 2);
        q[i][v] = at[v] + (i >= 2);
    }
    const double *a = q[turn], *b = q[(turn + 1) % 4], *c = q[(turn + 2) % 4],
                 *d = q[(turn + 3) % 4];
    add_face(mesh, a, side ? b : c, side ? c : b);
    add_face(mesh, a, side ? c : d, side ? d : c);
}

static void add_voxels(soup *mesh, const bool *voxel, uint64_t *state)
{
    for (int x = 0; x < GRID; x++)
        for (int y = 0; y < GRID; y++)
            for (int z = 0; z < GRID; z++)
                for (int w = 0; w < 6; w++) {
                    int at[3] = { x, y, z }, next[3] = { x, y, z };
                    next[w / 2] += w % 2 ? 1 : -1;
                    if (filled(voxel, x, y, z) && !filled(voxel, next[0], next[1], next[2]))
                        add_cell_face(mesh, at, w / 2, w % 2, state);
                }
}

/* Voxels share edges and corners here. By the shift, each voxel contains its low sides and not its
 * high sides. */
START_TEST(test_winding_of_voxel_solids)
{
    static soup mesh;
    uint64_t state = (uint64_t)_i + 100;
    bool voxel[GRID * GRID * GRID];
    for (int i = 0; i < GRID * GRID * GRID; i++)
        voxel[i] = reference_random(&state) % 2;
    mesh.count = 0;
    add_voxels(&mesh, voxel, &state);
    for (int x = -1; x <= 2 * GRID + 1; x++)
        for (int y = -1; y <= 2 * GRID + 1; y++)
            for (int z = -1; z <= 2 * GRID + 1; z++) {
                const double p[3] = { x / 2.0, y / 2.0, z / 2.0 };
                int expected = filled(voxel, (int)floor(p[0]), (int)floor(p[1]), (int)floor(p[2]));
                for (int axis = 0; axis < 3; axis++)
                    ck_assert_int_eq(winding(&mesh, p, axis), expected);
            }
}
END_TEST

/* Tetrahedra that overlap, are in contact, or are flat, in either orientation. */
START_TEST(test_winding_of_tetrahedra_ignores_path)
{
    static soup mesh;
    uint64_t state = (uint64_t)_i + 200;
    mesh.count = 0;
    for (int i = 0; i < 6; i++) {
        double v[4][3];
        for (int k = 0; k < 12; k++)
            v[k / 3][k % 3] = (double)reference_integer(&state, 0, 3);
        add_face(&mesh, v[0], v[1], v[2]);
        add_face(&mesh, v[0], v[3], v[1]);
        add_face(&mesh, v[1], v[3], v[2]);
        add_face(&mesh, v[2], v[3], v[0]);
    }
    int covered = 0;
    for (int x = -1; x <= 7; x++)
        for (int y = -1; y <= 7; y++)
            for (int z = -1; z <= 7; z++) {
                const double p[3] = { x / 2.0, y / 2.0, z / 2.0 };
                int w = winding(&mesh, p, 0);
                ck_assert_int_eq(winding(&mesh, p, 1), w);
                ck_assert_int_eq(winding(&mesh, p, 2), w);
                covered += w != 0;
                ck_assert(w == 0 || (x >= 0 && x < 6 && y >= 0 && y < 6 && z >= 0 && z < 6));
            }
    ck_assert_int_gt(covered, 0);
}
END_TEST

/* For a point far inside, the sum of solid angles is a full sphere. This determines the sign. */
START_TEST(test_winding_inside_tetrahedron_is_one)
{
    static soup mesh;
    const double v[4][3] = { { 0, 0, 0 }, { 8, 0, 0 }, { 0, 8, 0 }, { 0, 0, 8 } },
                 p[3] = { 1, 1, 1 };
    mesh.count = 0;
    add_face(&mesh, v[0], v[2], v[1]);
    add_face(&mesh, v[0], v[1], v[3]);
    add_face(&mesh, v[1], v[2], v[3]);
    add_face(&mesh, v[2], v[0], v[3]);
    for (int axis = 0; axis < 3; axis++)
        ck_assert_int_eq(winding(&mesh, p, axis), 1);
}
END_TEST

/* --- points on faces --- */

/* Returns true when p = sum w_i corner_i for some weights i/n with n = 0 .. 60. This finds all
 * lattice points of faces this small. */
static bool plain_point_on_triangle(const double p[3], const double *f)
{
    for (int n = 1; n <= 48; n++)
        for (int i = 0; i <= n; i++)
            for (int j = 0; i + j <= n; j++) {
                bool same = true;
                for (int k = 0; k < 3; k++)
                    same &= f[k] * i + f[3 + k] * j + f[6 + k] * (n - i - j) == p[k] * n;
                if (same)
                    return true;
            }
    return false;
}

START_TEST(test_point_on_triangle_edges_and_corners)
{
    uint64_t state = 12;
    int on = 0;
    for (int i = 0; i < 6000; i++) {
        double f[9], p[3];
        for (int k = 0; k < 9; k++)
            f[k] = (double)reference_integer(&state, -1, 1);
        for (int k = 0; k < 3; k++)
            p[k] = (double)reference_integer(&state, -1, 1) / (i % 2 + 1);
        bool expected = plain_point_on_triangle(p, f);
        on += expected;
        ck_assert_int_eq(ebpo_point_on_triangle(p, f, f + 3, f + 6), expected);
    }
    ck_assert_int_gt(on, 300);
}
END_TEST

TEST_SUITE(crossing)
{
    TCase *tests = tcase_create("crossing");
    tcase_set_timeout(tests, 300);
    tcase_add_loop_test(tests, test_crossing_matches_rational_on_integers, 0, 4);
    tcase_add_loop_test(tests, test_crossing_matches_rational_on_floats, 0, 2);
    tcase_add_test(tests, test_zero_length_segment_never_crosses);
    tcase_add_loop_test(tests, test_winding_of_voxel_solids, 0, 20);
    tcase_add_loop_test(tests, test_winding_of_tetrahedra_ignores_path, 0, 60);
    tcase_add_test(tests, test_winding_inside_tetrahedron_is_one);
    tcase_add_test(tests, test_point_on_triangle_edges_and_corners);
    Suite *suite = suite_create("crossing");
    suite_add_tcase(suite, tests);
    return suite;
}
