/* Tests pairs of faces against brute force in rational arithmetic: kinds, the filter for eight
 * faces, contacts. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "exact_reference.h"
#include "extras/collide/face_pairs.h"
#include "extras/collide/posed_frames.h"
#include "geometry/triangle_pair.h"
#include "pair_reference.h"
#include "solids.h"

enum { CASES = 80000, FILTERED = 8000, CONTACTS = 20000 };

typedef struct faces {
    double a[3][3], b[3][3];
} faces;

#define CORNERS(face) ((const double(*)[3])(face))

static void turn_around(double t[3][3])
{
    double first[3];
    memcpy(first, t[0], sizeof first);
    memmove(t[0], t[1], 2 * sizeof first);
    memcpy(t[2], first, sizeof first);
}

static void mirror(double t[3][3])
{
    double last[3];
    memcpy(last, t[2], sizeof last);
    memcpy(t[2], t[1], sizeof last);
    memcpy(t[1], last, sizeof last);
}

static ebpo_pair_kind kind_of(const faces *f)
{
    return ebpo_triangle_pair(CORNERS(f->a), CORNERS(f->b));
}

START_TEST(test_pair_kinds_match_brute_force)
{
    uint64_t state = (uint64_t)_i + 1;
    int found[4] = { 0 };
    for (int i = 0; i < (int)ebpo_test_scaled(CASES); i++) {
        faces f;
        reference_pair_case(f.a, f.b, _i, &state);
        int expected = reference_pair_kind(CORNERS(f.a), CORNERS(f.b));
        found[expected]++;
        ck_assert_msg((int)kind_of(&f) == expected, "%s, case %d: %d, expected %d",
                      reference_pair_name(_i), i, kind_of(&f), expected);
    }
    ck_assert_int_gt(found[EBPO_PAIR_APART] + found[EBPO_PAIR_TOUCHING], 0);
    if (getenv("EBPO_TEST_TELL"))
        printf("%-40s %8d apart %8d touching %8d crossing %8d coplanar\n", reference_pair_name(_i),
               found[0], found[1], found[2], found[3]);
}
END_TEST

START_TEST(test_pair_kinds_ignore_order)
{
    uint64_t state = (uint64_t)_i + 31;
    for (int i = 0; i < (int)ebpo_test_scaled(CASES); i++) {
        faces f;
        reference_pair_case(f.a, f.b, _i, &state);
        ebpo_pair_kind kind = kind_of(&f);
        ck_assert_int_eq(ebpo_triangle_pair(CORNERS(f.b), CORNERS(f.a)), kind);
        turn_around(i & 1 ? f.a : f.b);
        ck_assert_int_eq(kind_of(&f), kind);
        mirror(i & 2 ? f.a : f.b);
        ck_assert_int_eq(kind_of(&f), kind);
        turn_around(i & 1 ? f.b : f.a);
        ck_assert_int_eq(kind_of(&f), kind);
    }
}
END_TEST

START_TEST(test_pair_kinds_match_documentation)
{
    static const double face[3][3] = { { 0, 0, 0 }, { 4, 0, 0 }, { 0, 4, 0 } };
    static const struct {
        double other[3][3];
        ebpo_pair_kind kind;
    } cases[] = {
        { { { 0, 0, 1 }, { 4, 0, 1 }, { 0, 4, 1 } }, EBPO_PAIR_APART },
        { { { 1, 1, -1 }, { 1, 1, 1 }, { 9, 9, 1 } }, EBPO_PAIR_CROSSING },
        { { { 1, 1, 0 }, { 2, 1, 0 }, { 1, 2, 5 } }, EBPO_PAIR_TOUCHING }, /* an edge within A */
        { { { 1, 1, 0 }, { 1, 1, 2 }, { 2, 1, 5 } }, EBPO_PAIR_TOUCHING }, /* a corner within A */
        /* a common edge in one plane */
        { { { 4, 0, 0 }, { 0, 4, 0 }, { 4, 4, 0 } }, EBPO_PAIR_TOUCHING },
        { { { 1, 1, 0 }, { 2, 1, 0 }, { 1, 2, 0 } }, EBPO_PAIR_COPLANAR }, /* a face within A */
        { { { 0, 0, 0 }, { 4, 0, 0 }, { 0, 4, 0 } }, EBPO_PAIR_COPLANAR }, /* the face itself */
        /* a face without area that crosses A */
        { { { 1, 1, -1 }, { 1, 1, 1 }, { 1, 1, 0 } }, EBPO_PAIR_TOUCHING },
        /* a face that is a point */
        { { { 1, 1, 0 }, { 1, 1, 0 }, { 1, 1, 0 } }, EBPO_PAIR_TOUCHING },
        { { { 3, 3, 0 }, { 3, 3, 0 }, { 3, 3, 0 } }, EBPO_PAIR_APART },
        /* contact at the corner */
        { { { 0, -1, -1 }, { 0, -1, 1 }, { 0, 1, 0 } }, EBPO_PAIR_TOUCHING },
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        ck_assert_int_eq(ebpo_triangle_pair(face, cases[i].other), cases[i].kind);
        ck_assert_int_eq(ebpo_triangle_pair(cases[i].other, face), cases[i].kind);
    }
}
END_TEST

/* --- the filter --- */

typedef struct batch {
    faces f[8];
    float a[72], b[72], error;
} batch;

/* Converts coordinates to floats as a caller does: relative to a point, with an error of up to
 * `blur` of their size. */
static void to_floats(batch *g, double blur, uint64_t *state)
{
    double most = 0;
    for (int lane = 0; lane < 8; lane++)
        for (int i = 0; i < 9; i++) {
            const double *o = g->f[lane].a[0];
            double x = g->f[lane].a[i / 3][i % 3] - o[i % 3],
                   y = g->f[lane].b[i / 3][i % 3] - o[i % 3];
            most = fmax(most, fmax(fabs(x), fabs(y)));
        }
    double off = most * blur;
    for (int lane = 0; lane < 8; lane++)
        for (int i = 0; i < 9; i++) {
            const double *o = g->f[lane].a[0];
            double by_a = off * reference_uniform(state), by_b = off * reference_uniform(state);
            g->a[i * 8 + lane] = (float)(g->f[lane].a[i / 3][i % 3] - o[i % 3] + by_a);
            g->b[i * 8 + lane] = (float)(g->f[lane].b[i / 3][i % 3] - o[i % 3] + by_b);
        }
    g->error = (float)(off * (1 + 0x1p-20) + most * 0x1.1p-24);
}

static void check_masks(const batch *g, ebpo_pair_masks masks, int *open)
{
    for (int lane = 0; lane < 8; lane++) {
        ebpo_pair_kind kind = kind_of(&g->f[lane]);
        bool apart = masks.apart >> lane & 1, crossing = masks.crossing >> lane & 1;
        ck_assert(!apart || kind == EBPO_PAIR_APART);
        ck_assert(!crossing || kind == EBPO_PAIR_CROSSING);
        *open += !apart && !crossing;
    }
}

static void check_builds(const batch *g, ebpo_pair_masks masks)
{
    const ebpo_pair_kernels *builds[] = { &ebpo_pair_kernels_base, ebpo_pair_kernels_best() };
    for (int i = 0; i < 2; i++) {
        ebpo_pair_masks other = builds[i]->eight(g->a, g->b, g->error);
        ck_assert(other.apart == masks.apart && other.crossing == masks.crossing);
        for (int lane = 0; lane < 8; lane++) {
            float a[9], spread[72];
            for (int k = 0; k < 72; k++) {
                a[k / 8] = g->a[k / 8 * 8 + lane];
                spread[k] = a[k / 8];
            }
            ebpo_pair_masks one = builds[i]->one(a, g->b, g->error),
                            eight = builds[0]->eight(spread, g->b, g->error);
            ck_assert(one.apart == eight.apart && one.crossing == eight.crossing);
        }
    }
}

/* Returns true for kinds of numbers that floats can represent. */
static bool fit_for_floats(int kind) { return kind != 12 && kind != 13; }

START_TEST(test_pair_filter_matches_exact_result)
{
    static const double blurs[] = { 0, 0x1p-22, 0x1p-14, 0x1p-6 };
    uint64_t state = (uint64_t)_i + 91;
    if (!fit_for_floats(_i))
        return;
    int open[4] = { 0 }, count = (int)ebpo_test_scaled(FILTERED);
    for (int i = 0; i < count; i++) {
        batch g;
        for (int lane = 0; lane < 8; lane++)
            reference_pair_case(g.f[lane].a, g.f[lane].b, _i, &state);
        to_floats(&g, blurs[i & 3], &state);
        ebpo_pair_masks masks = ebpo_pair_kernels_base.eight(g.a, g.b, g.error);
        check_masks(&g, masks, &open[i & 3]);
        check_builds(&g, masks);
    }
    if (_i == 0) /* only ordinary faces must be decided by the filter */
        ck_assert_int_le(open[0] + open[1], count / 2 * 8 / 100 + 4);
}
END_TEST

/* Checks that all pairs of two blocks give the results of single faces. */
static void check_blocks(const batch *g, unsigned lanes_a, unsigned lanes_b)
{
    ebpo_block_pairs found, other;
    unsigned at = 0;
    ebpo_pair_kernels_base.blocks(g->a, lanes_a, g->b, lanes_b, g->error, &found);
    ebpo_pair_kernels_best()->blocks(g->a, lanes_a, g->b, lanes_b, g->error, &other);
    ck_assert(found.count == other.count && !memcmp(found.pair, other.pair, found.count));
    for (unsigned i = 0; i < 64; i++) {
        unsigned lane_a = i & 7, lane_b = i >> 3;
        float a[9];
        if (!(lanes_a >> lane_a & lanes_b >> lane_b & 1))
            continue;
        for (int k = 0; k < 9; k++)
            a[k] = g->a[8 * k + (int)lane_a];
        ebpo_pair_masks m = ebpo_pair_kernels_base.one(a, g->b, g->error);
        if (m.apart >> lane_b & 1)
            continue;
        ck_assert_uint_lt(at, found.count);
        unsigned expected = i | (m.crossing >> lane_b & 1 ? EBPO_CERTAINLY_CROSSING : 0);
        ck_assert_uint_eq(found.pair[at++], expected);
    }
    ck_assert_uint_eq(at, found.count);
}

START_TEST(test_pair_blocks_match_single_faces)
{
    uint64_t state = (uint64_t)_i + 131;
    if (!fit_for_floats(_i))
        return;
    for (int i = 0; i < (int)ebpo_test_scaled(FILTERED); i++) {
        batch g;
        for (int lane = 0; lane < 8; lane++)
            reference_pair_case(g.f[lane].a, g.f[lane].b, _i, &state);
        to_floats(&g, 0, &state);
        uint64_t lanes = reference_random(&state);
        check_blocks(&g, i & 1 ? 255 : lanes & 255, i & 1 ? 255 : lanes >> 8 & 255);
    }
}
END_TEST

/* --- from blocks in files to pairs in world coordinates --- */

typedef struct posed_model {
    float block[72];
    double world[8][3][3];
    ebpo_posing posing;
    ebpo_posed_block posed;
} posed_model;

/* Returns a pose; equal poses of two faces keep degenerate cases nearly degenerate. `turn`: no
 * rotation, a quarter turn, or any rotation. */
static ebpo_pose pose_by(int turn)
{
    static const double rotations[3][3][3] = {
        { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } },
        { { 0, -1, 0 }, { 1, 0, 0 }, { 0, 0, 1 } },
        { { 0.36, 0.48, -0.8 }, { -0.8, 0.6, 0 }, { 0.48, 0.64, 0.6 } }
    };
    ebpo_pose pose = { .translation = { turn * 0.3, turn * -70.1, 0.5 }, .scale = 1 + turn };
    memcpy(pose.rotation, rotations[turn], sizeof pose.rotation);
    return pose;
}

/* Converts a block to eight faces without common vertices. */
static void to_vertices(const float block[72], float vertex[3][24])
{
    for (int i = 0; i < 72; i++)
        vertex[i / 8 % 3][i / 24 * 8 + i % 8] = block[i];
}

static void to_faces(float (*vertex)[24], float block[72])
{
    for (int i = 0; i < 72; i++)
        block[i] = vertex[i / 8 % 3][i / 24 * 8 + i % 8];
}

static void pose_model(posed_model *m, const ebpo_pose *pose)
{
    static const double reach[3] = { 2e7, 2e7, 2e7 };
    ebpo_block_posing p;
    float vertex[3][24];
    ck_assert_int_eq(ebpo_posing_make(&m->posing, pose, reach, NULL), EBPO_OK);
    ebpo_block_posing_make(&p, &m->posing, 2e8);
    to_vertices(m->block, vertex);
    ebpo_posed_block_make(&m->posed, &p, vertex[0], 24);
    for (int lane = 0; lane < 8; lane++)
        for (int c = 0; c < 3; c++) {
            double x[3];
            for (int k = 0; k < 3; k++)
                x[k] = (double)m->block[8 * (3 * c + k) + lane];
            ebpo_posing_apply(&m->posing, x, m->world[lane][c]);
        }
}

static void fill_models(posed_model *a, posed_model *b, int kind, uint64_t *state)
{
    for (int lane = 0; lane < 8; lane++) {
        faces f;
        reference_pair_case(f.a, f.b, kind, state);
        for (int k = 0; k < 9; k++) {
            a->block[8 * k + lane] = (float)f.a[k / 3][k % 3];
            b->block[8 * k + lane] = (float)f.b[k / 3][k % 3];
        }
    }
}

static void check_posed(const posed_model *a, const posed_model *b)
{
    float x[72], y[72], vertex[2][3][24];
    double unit = ebpo_block_unit(2e8);
    float off_a = ebpo_posed_block_place(&a->posed, unit, a->posed.base, vertex[0]),
          off_b = ebpo_posed_block_place(&b->posed, unit, a->posed.base, vertex[1]);
    to_faces(vertex[0], x);
    to_faces(vertex[1], y);
    ebpo_block_pairs found;
    unsigned at = 0;
    ebpo_pair_kernels_best()->blocks(x, 255, y, 255, fmaxf(off_a, off_b), &found);
    for (unsigned i = 0; i < 64; i++) {
        ebpo_pair_kind kind =
            ebpo_triangle_pair(CORNERS(a->world[i & 7]), CORNERS(b->world[i >> 3]));
        bool listed = at < found.count && (found.pair[at] & 63u) == i;
        ck_assert(listed || kind == EBPO_PAIR_APART);
        if (listed && found.pair[at++] & EBPO_CERTAINLY_CROSSING)
            ck_assert_int_eq(kind, EBPO_PAIR_CROSSING);
    }
    ck_assert_uint_eq(at, found.count);
}

START_TEST(test_posed_blocks_lose_no_pair)
{
    uint64_t state = (uint64_t)_i + 151;
    if (!fit_for_floats(_i))
        return;
    for (int i = 0; i < (int)ebpo_test_scaled(FILTERED); i++) {
        posed_model a, b;
        ebpo_pose pose = pose_by(i % 3);
        fill_models(&a, &b, _i, &state);
        pose_model(&a, &pose);
        if (i & 4)
            pose = pose_by((i + 1) % 3);
        pose_model(&b, &pose);
        check_posed(&a, &b);
    }
}
END_TEST

/* --- the filter near its bounds --- */

/* Returns the determinant of four of six corners, given by index. */
static double determinant(double *const corner[6], const int of[4])
{
    double d[3][3];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            d[i][k] = corner[of[i + 1]][k] - corner[of[0]][k];
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        sum += (d[0][u] * d[1][v] - d[0][v] * d[1][u]) * d[2][k];
    }
    return sum;
}

/* Finds, among the 15 determinants that the filter may use, the one nearest to 0. */
static void find_critical(double *const corner[6], int out[4])
{
    double least = INFINITY;
    for (int i = 0; i < 15; i++) {
        int e = i % 3, f = i / 3;
        int plane[4] = { 3 * (f & 1), 3 * (f & 1) + 1, 3 * (f & 1) + 2, 3 * !(f & 1) + e };
        int edges[4] = { e, (e + 1) % 3, 3 + f % 3, 3 + (f + 1) % 3 };
        const int *of = i < 6 ? plane : edges;
        double size = fabs(determinant(corner, of));
        if (size < least) {
            least = size;
            memcpy(out, of, 4 * sizeof *out);
        }
    }
}

/* Moves each coordinate by `off`, so that this determinant changes as much as possible. */
static void move_worst(double *const corner[6], double off)
{
    int of[4];
    double step[4][3];
    find_critical(corner, of);
    double before = determinant(corner, of);
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 3; k++) {
            double x = corner[of[i]][k];
            corner[of[i]][k] = x + 1;
            step[i][k] = determinant(corner, of) > before ? off : -off;
            corner[of[i]][k] = x;
        }
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 3; k++)
            corner[of[i]][k] += step[i][k];
}

static void make_worst(batch *g, double off, uint64_t *state)
{
    static const int kinds[] = { 4, 5, 6, 9, 10, 14, 14, 14 };
    for (int lane = 0; lane < 8; lane++) {
        faces *f = &g->f[lane], moved;
        reference_pair_case(f->a, f->b, kinds[reference_random(state) & 7], state);
        double sign = reference_random(state) & 1 ? off : -off;
        for (int i = 0; i < 9 && off == 0; i++) {
            f->a[i / 3][i % 3] = (double)(float)f->a[i / 3][i % 3];
            f->b[i / 3][i % 3] = (double)(float)f->b[i / 3][i % 3];
        }
        moved = *f;
        double *corner[6];
        for (int i = 0; i < 6; i++)
            corner[i] = i < 3 ? moved.a[i] : moved.b[i - 3];
        if (off != 0)
            move_worst(corner, sign);
        for (int i = 0; i < 9; i++) {
            g->a[i * 8 + lane] = (float)moved.a[i / 3][i % 3];
            g->b[i * 8 + lane] = (float)moved.b[i / 3][i % 3];
        }
    }
    g->error = (float)(off == 0 ? 0 : off + 0x1p-22);
}

START_TEST(test_pair_filter_holds_at_its_bounds)
{
    static const double offs[] = { 0, 0x1p-20, 0x1p-12, 0x1p-6 };
    uint64_t state = (uint64_t)_i + 191;
    for (int i = 0; i < (int)ebpo_test_scaled(4 * FILTERED); i++) {
        batch g;
        int open = 0;
        make_worst(&g, offs[_i], &state);
        check_masks(&g, ebpo_pair_kernels_base.eight(g.a, g.b, g.error), &open);
    }
}
END_TEST

/* --- contacts --- */

static reference_end end_for_reference(const ebpo_contact_end *end)
{
    return (reference_end){ end->point, (int)end->on_a, (int)end->on_b };
}

static void greatest(const faces *f, double most[3])
{
    for (int k = 0; k < 3; k++) {
        most[k] = 0;
        for (int i = 0; i < 3; i++)
            most[k] = fmax(most[k], fmax(fabs(f->a[i][k]), fabs(f->b[i][k])));
    }
}

static void check_contact(const faces *f, const char *name)
{
    ebpo_contact_end end[2], back[2];
    double most[3];
    ebpo_triangle_contact(CORNERS(f->a), CORNERS(f->b), end);
    const reference_end both[] = { end_for_reference(&end[0]), end_for_reference(&end[1]) };
    greatest(f, most);
    const char *wrong = reference_pair_contact(CORNERS(f->a), CORNERS(f->b), both, most);
    ck_assert_msg(!wrong, "%s: %s", name, wrong);
    ebpo_triangle_contact(CORNERS(f->b), CORNERS(f->a), back);
    for (int i = 0; i < 2; i++) {
        ck_assert_mem_eq(end[i].point, back[1 - i].point, sizeof end[i].point);
        ck_assert(end[i].on_a == back[1 - i].on_b && end[i].on_b == back[1 - i].on_a);
    }
    faces g = *f;
    turn_around(g.a);
    mirror(g.b);
    ebpo_triangle_contact(CORNERS(g.a), CORNERS(g.b), back);
    for (int i = 0; i < 2; i++)
        ck_assert_mem_eq(end[i].point, back[1 - i].point, sizeof end[i].point);
}

START_TEST(test_pair_contacts_are_on_both_faces)
{
    uint64_t state = (uint64_t)_i + 171;
    int found = 0;
    for (int i = 0; i < (int)ebpo_test_scaled(CONTACTS); i++) {
        faces f;
        reference_pair_case(f.a, f.b, _i, &state);
        if (kind_of(&f) != EBPO_PAIR_CROSSING)
            continue;
        found++;
        check_contact(&f, reference_pair_name(_i));
    }
    ck_assert(_i != 0 || found > 0);
}
END_TEST

TEST_SUITE(pair)
{
    TCase *tests = tcase_create("pair");
    tcase_set_timeout(tests, 1000);
    tcase_add_test(tests, test_pair_kinds_match_documentation);
    tcase_add_loop_test(tests, test_pair_kinds_match_brute_force, 0, REFERENCE_PAIR_KINDS);
    tcase_add_loop_test(tests, test_pair_kinds_ignore_order, 0, REFERENCE_PAIR_KINDS);
    tcase_add_loop_test(tests, test_pair_filter_matches_exact_result, 0, REFERENCE_PAIR_KINDS);
    tcase_add_loop_test(tests, test_pair_blocks_match_single_faces, 0, REFERENCE_PAIR_KINDS);
    tcase_add_loop_test(tests, test_posed_blocks_lose_no_pair, 0, REFERENCE_PAIR_KINDS);
    tcase_add_loop_test(tests, test_pair_filter_holds_at_its_bounds, 0, 4);
    tcase_add_loop_test(tests, test_pair_contacts_are_on_both_faces, 0, REFERENCE_PAIR_KINDS);
    Suite *suite = suite_create("pair");
    suite_add_tcase(suite, tests);
    return suite;
}
