/* Polygons are cut into triangles that cover the polygon: with the same area, and all with the
 * orientation of the polygon. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "geometry/polygon.h"
#include "geometry/predicates.h"
#include "solids.h"

enum { LIMIT = 4000 };

typedef struct shape {
    uint32_t n;
    double at[LIMIT][2];
    uint32_t triangle[LIMIT][3];
} shape;
static shape s;

static void shape_of(const double (*at)[2], uint32_t n)
{
    s.n = n;
    for (uint32_t i = 0; i < n; i++) {
        s.at[i][0] = at[i][0];
        s.at[i][1] = at[i][1];
    }
}

static double twice_area(const double a[2], const double b[2], const double c[2])
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/* Cuts the shape in the plane across `axis`, seen from behind when `mirrored`. */
static ebpo_polygon_kind cut(int axis, bool mirrored)
{
    static double corner[LIMIT][3];
    for (uint32_t i = 0; i < s.n; i++) {
        uint32_t from = mirrored ? s.n - 1 - i : i;
        corner[i][axis] = 0.25 * s.at[from][0] + 7;
        corner[i][(axis + 1) % 3] = s.at[from][0];
        corner[i][(axis + 2) % 3] = s.at[from][1];
    }
    void *scratch = malloc(ebpo_polygon_scratch_bytes(s.n));
    ebpo_polygon_kind kind =
        ebpo_polygon_triangulate(s.triangle, (const double(*)[3])corner, s.n, scratch);
    free(scratch);
    for (uint32_t i = 0; mirrored && i + 2 < s.n;
         i++) /* back to the indices of the shape, in its orientation */
        for (int k = 0; k < 3; k++)
            s.triangle[i][k] = s.n - 1 - s.triangle[i][k];
    return kind;
}

static void check_cover(bool mirrored)
{
    double sum = 0, expected = 0;
    for (uint32_t i = 1; i + 1 < s.n; i++)
        expected += twice_area(s.at[0], s.at[i], s.at[i + 1]);
    for (uint32_t i = 0; i + 2 < s.n; i++) {
        const double *a = s.at[s.triangle[i][0]], *b = s.at[s.triangle[i][1]],
                     *c = s.at[s.triangle[i][2]];
        ck_assert_int_eq(ebpo_orient2d(a, b, c), mirrored ? -1 : 1);
        sum += fabs(twice_area(a, b, c));
    }
    ck_assert_msg(fabs(sum - expected) <= 1e-9 * expected, "triangles cover %g of %g", sum,
                  expected);
}

static void check_shape(ebpo_polygon_kind kind)
{
    for (int axis = 0; axis < 3; axis++)
        for (int mirrored = 0; mirrored < 2; mirrored++) {
            ck_assert_int_eq(cut(axis, mirrored), kind);
            check_cover(mirrored);
        }
}

START_TEST(test_convex_polygon_becomes_fan)
{
    s.n = 11;
    for (uint32_t i = 0; i < s.n; i++) {
        s.at[i][0] = cos(2 * M_PI * i / s.n);
        s.at[i][1] = sin(2 * M_PI * i / s.n);
    }
    check_shape(EBPO_POLYGON_CONVEX);
    ck_assert(cut(2, false) == EBPO_POLYGON_CONVEX);
    for (uint32_t i = 0; i < s.n - 2; i++)
        ck_assert(s.triangle[i][0] == 0 && s.triangle[i][1] == i + 1 && s.triangle[i][2] == i + 2);
}
END_TEST

START_TEST(test_collinear_corners_make_no_empty_triangle)
{
    static const double at[][2] = { { 0, 0 }, { 1, 0 }, { 2, 0 }, { 3, 0 },
                                    { 3, 1 }, { 3, 2 }, { 0, 2 }, { 0, 1 } };
    shape_of(at, 8);
    check_shape(EBPO_POLYGON_FLAT);
}
END_TEST

START_TEST(test_concave_polygons_are_covered)
{
    static const double arrow[][2] = { { 0, 0 }, { 2, 0 }, { 0.5, 0.5 }, { 0, 2 } };
    static const double comb[][2] = { { 0, 0 }, { 7, 0 }, { 7, 3 }, { 6, 3 }, { 6, 1 }, { 5, 1 },
                                      { 5, 3 }, { 4, 3 }, { 4, 1 }, { 3, 1 }, { 3, 3 }, { 2, 3 },
                                      { 2, 1 }, { 1, 1 }, { 1, 3 }, { 0, 3 } };
    /* a square with a hole */
    static const double slit[][2] = { { 0, 0 }, { 4, 0 }, { 4, 4 }, { 0, 4 }, { 0, 0 },
                                      { 1, 1 }, { 1, 3 }, { 3, 3 }, { 3, 1 }, { 1, 1 } };
    shape_of(arrow, 4);
    check_shape(EBPO_POLYGON_CONCAVE);
    shape_of(comb, 16);
    check_shape(EBPO_POLYGON_CONCAVE);
    shape_of(slit, 10);
    check_shape(EBPO_POLYGON_CONCAVE);
}
END_TEST

START_TEST(test_random_star_polygons_are_covered)
{
    uint64_t state = 99 + (uint64_t)_i;
    s.n = 4 + (uint32_t)(_i * _i);
    for (uint32_t i = 0; i < s.n; i++) {
        state = state * UINT64_C(6364136223846793005) + 1442695040888963407u;
        double r = 0.2 + (double)(state >> 40) / (1 << 24);
        s.at[i][0] = r * cos(2 * M_PI * i / s.n);
        s.at[i][1] = r * sin(2 * M_PI * i / s.n);
    }
    ebpo_polygon_kind kind = cut(_i % 3, _i % 2);
    ck_assert(kind == EBPO_POLYGON_CONCAVE || (s.n < 10 && kind == EBPO_POLYGON_CONVEX));
    check_cover(_i % 2);
}
END_TEST

static void check_fan(const double (*at)[2], uint32_t n)
{
    shape_of(at, n);
    ck_assert_int_eq(cut(2, false), EBPO_POLYGON_DEGENERATE);
    for (uint32_t i = 0; i < n - 2; i++)
        ck_assert(s.triangle[i][0] == 0 && s.triangle[i][1] == i + 1 && s.triangle[i][2] == i + 2);
}

START_TEST(test_degenerate_polygons_become_fans)
{
    static const double line[][2] = { { 0, 0 }, { 1, 1 }, { 2, 2 }, { 3, 3 } },
                        point[][2] = { { 1, 1 }, { 1, 1 }, { 1, 1 }, { 1, 1 } };
    static const double infinite[][2] = { { 0, 0 }, { 1, 0 }, { INFINITY, 1 }, { 0, NAN } };
    check_fan(line, 4);
    check_fan(point, 4);
    check_fan(infinite, 4);
}
END_TEST

/* ---- integer coordinates in space, for which areas are exact ---- */

enum { LARGEST = 120000 };

typedef struct solid_shape {
    uint32_t n;
    int64_t at[LARGEST][3];
    double corner[LARGEST][3];
    uint32_t triangle[LARGEST][3];
} solid_shape;
static solid_shape w;

static uint64_t state;

static uint32_t below(uint32_t n)
{
    state = state * UINT64_C(6364136223846793005) + 1442695040888963407u;
    return (uint32_t)((state >> 33) % n);
}

static ebpo_polygon_kind cut_whole(int exponent)
{
    for (uint32_t i = 0; i < w.n; i++)
        for (int k = 0; k < 3; k++)
            w.corner[i][k] = ldexp((double)w.at[i][k], exponent);
    void *scratch = malloc(ebpo_polygon_scratch_bytes(w.n));
    ck_assert_ptr_nonnull(scratch);
    ebpo_polygon_kind kind =
        ebpo_polygon_triangulate(w.triangle, (const double(*)[3])w.corner, w.n, scratch);
    free(scratch);
    return kind;
}

/* Adds the cross product of two sides of a triangle: twice its area, as a vector. */
static void add_area(const int64_t *a, const int64_t *b, const int64_t *c, int64_t sum[3])
{
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        sum[k] += (b[u] - a[u]) * (c[v] - a[v]) - (b[v] - a[v]) * (c[u] - a[u]);
    }
}

/* Checks that the vector areas add up to the area of the outline, exactly. For a planar outline no
 * triangle is reversed, so that each of its points is covered once. Returns the number of
 * triangles without area. */
static uint32_t check_exactly(bool planar)
{
    int64_t outline[3] = { 0 }, sum[3] = { 0 };
    uint32_t flat = 0;
    for (uint32_t i = 1; i + 1 < w.n; i++)
        add_area(w.at[0], w.at[i], w.at[i + 1], outline);
    for (uint32_t i = 0; i + 2 < w.n; i++) {
        int64_t own[3] = { 0 };
        const uint32_t *t = w.triangle[i];
        ck_assert(t[0] < w.n && t[1] < w.n && t[2] < w.n);
        add_area(w.at[t[0]], w.at[t[1]], w.at[t[2]], own);
        flat += own[0] == 0 && own[1] == 0 && own[2] == 0;
        for (int k = 0; k < 3; k++) {
            ck_assert_msg(!planar || own[k] == 0 || (own[k] > 0) == (outline[k] > 0),
                          "triangle %u is reversed", i);
            sum[k] += own[k];
        }
    }
    ck_assert(memcmp(sum, outline, sizeof sum) == 0);
    return flat;
}

static void insert_corner(uint32_t before, const int64_t p[2])
{
    ck_assert(w.n < LARGEST);
    memmove(w.at + before + 1, w.at + before, (w.n++ - before) * sizeof *w.at);
    memcpy(w.at[before], p, 2 * sizeof *p);
}

/* Makes an outline with coincident edges and corners. It covers half squares of a grid, which are
 * joined along the edges of a tree. The diagonal of a square runs from low to high. */
static void grow_glued(uint32_t side, uint32_t corners)
{
    static bool used[400 * 400 * 2];
    memset(used, 0, sizeof used);
    static const int64_t first[3][2] = { { 0, 0 }, { 1, 0 }, { 1, 1 } };
    w.n = 0;
    for (int i = 0; i < 3; i++)
        insert_corner(w.n, first[i]);
    for (int i = 0; i < 3; i++)
        w.at[i][0] += side / 2, w.at[i][1] += side / 2;
    used[(side / 2 * side + side / 2) * 2] = true;
    for (uint32_t tries = 0; w.n < corners && tries < 60 * corners; tries++) {
        uint32_t i = below(w.n), j = i + 1 < w.n ? i + 1 : 0;
        const int64_t *a = w.at[i], *b = w.at[j];
        int64_t dx = b[0] - a[0], dy = b[1] - a[1], apex[2], cell[2];
        bool upper;
        if (dx && dy) { /* the lower half is to the right of a diagonal that goes up */
            upper = dx < 0;
            cell[0] = dx < 0 ? b[0] : a[0], cell[1] = dy < 0 ? b[1] : a[1];
            apex[0] = cell[0] + !upper, apex[1] = cell[1] + upper;
            /* an upper half is below an edge that goes to the right; a lower half is above an edge
             * that goes to the left */
        } else if (dx) {
            upper = dx > 0;
            cell[0] = dx > 0 ? a[0] : b[0], cell[1] = a[1] - upper;
            apex[0] = cell[0] + !upper, apex[1] = cell[1] + !upper;
        } else {
            upper = dy > 0;
            cell[0] = a[0] - !upper, cell[1] = dy > 0 ? a[1] : b[1];
            apex[0] = cell[0] + upper, apex[1] = cell[1] + upper;
        }
        if (cell[0] < 0 || cell[1] < 0 || cell[0] >= side || cell[1] >= side)
            continue;
        bool *mark = &used[((uint64_t)cell[1] * side + (uint64_t)cell[0]) * 2 + upper];
        if (*mark)
            continue;
        *mark = true;
        insert_corner(i + 1, apex);
    }
    int64_t twice[3] = { 0 };
    for (uint32_t i = 1; i + 1 < w.n; i++)
        add_area(w.at[0], w.at[i], w.at[i + 1], twice);
    ck_assert_int_eq(twice[2], w.n - 2); /* the triangles are the half squares, each once */
}

/* Adds spikes without area, inwards and outwards. */
static void add_spikes(uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        uint32_t at = below(w.n);
        const int64_t foot[2] = { w.at[at][0], w.at[at][1] };
        const int64_t tip[2] = { foot[0] + below(3) - 1, foot[1] + below(3) - 1 };
        insert_corner(at + 1, foot);
        insert_corner(at + 1, tip);
    }
}

/* Moves the outline into the plane z = x + 2 y, with another first corner, or seen from behind. */
static void place_in_space(uint32_t begin, bool behind)
{
    static int64_t copy[LARGEST][3];
    memcpy(copy, w.at, w.n * sizeof *copy);
    for (uint32_t i = 0; i < w.n; i++) {
        uint32_t from = (begin + i) % w.n;
        memcpy(w.at[behind ? w.n - 1 - i : i], copy[from], sizeof *copy);
    }
    for (uint32_t i = 0; i < w.n; i++)
        w.at[i][2] = w.at[i][0] + 2 * w.at[i][1];
}

START_TEST(test_self_touching_outlines_are_covered)
{
    state = 1 + (uint64_t)_i;
    for (int round = 0; round < (_i < 30 ? 40 : 4); round++) {
        grow_glued(2 + below(_i < 30 ? 6 : 40), 4 + (uint32_t)(_i * _i));
        if (w.n < 4)
            continue;
        place_in_space(below(w.n), below(2));
        ck_assert_int_le(cut_whole((int)below(3) * 300 - 300), EBPO_POLYGON_CONCAVE);
        check_exactly(true);
    }
}
END_TEST

START_TEST(test_polygon_spikes_are_covered)
{
    state = 1 + (uint64_t)_i;
    for (int round = 0; round < 40; round++) {
        grow_glued(2 + below(6), 4 + (uint32_t)_i);
        add_spikes(1 + below(3));
        place_in_space(below(w.n), below(2));
        ck_assert_int_le(cut_whole(0), EBPO_POLYGON_CONCAVE);
        check_exactly(true);
    }
}
END_TEST

/* In a plate with slits without width, every triangle has an area. */
START_TEST(test_polygon_slits_need_no_empty_triangle)
{
    static const int64_t slit[][2] = { { 0, 0 }, { 10, 0 }, { 10, 10 }, { 5, 10 },
                                       { 5, 5 }, { 5, 10 }, { 0, 10 } };
    for (uint32_t begin = 0; begin < 7; begin++)
        for (int behind = 0; behind < 2; behind++) {
            w.n = 0;
            for (int i = 0; i < 7; i++)
                insert_corner(w.n, slit[i]);
            place_in_space(begin, behind);
            ck_assert_int_eq(cut_whole(0), EBPO_POLYGON_CONCAVE);
            ck_assert_uint_eq(check_exactly(true), 0);
        }
}
END_TEST

/* ---- the simple way of cutting ears, which gives the same triangles if it gives any ---- */

static uint32_t after[LIMIT], before[LIMIT];

static int plain_turn(uint32_t a, uint32_t b, uint32_t c)
{
    return ebpo_orient2d(s.at[a], s.at[b], s.at[c]);
}

static bool plain_same(uint32_t a, uint32_t b)
{
    return s.at[a][0] == s.at[b][0] && s.at[a][1] == s.at[b][1];
}

static bool plain_ear(uint32_t a, uint32_t b, uint32_t c)
{
    if (plain_turn(a, b, c) <= 0)
        return false;
    for (uint32_t i = after[c]; i != a; i = after[i])
        if (!plain_same(i, a) && !plain_same(i, b) && !plain_same(i, c) &&
            plain_turn(a, b, i) >= 0 && plain_turn(b, c, i) >= 0 && plain_turn(c, a, i) >= 0)
            return false;
    return true;
}

/* Returns false when it finds no ear. */
static bool plain_cut(uint32_t (*triangle)[3])
{
    uint32_t left = s.n, done = 0, idle = 0, b = 0;
    for (uint32_t i = 0; i < s.n; i++)
        after[i] = (i + 1) % s.n, before[i] = (i + s.n - 1) % s.n;
    while (left > 2) {
        uint32_t a = before[b], c = after[b];
        if (idle == left || (left == 3 && plain_turn(a, b, c) < 0))
            return false;
        if (left > 3 && !plain_ear(a, b, c)) {
            b = c;
            idle++;
            continue;
        }
        triangle[done][0] = a, triangle[done][1] = b, triangle[done++][2] = c;
        after[a] = c;
        before[c] = a;
        b = after[c];
        idle = 0;
        left--;
    }
    return true;
}

static void compare_with_plain(uint32_t *cut_by_both)
{
    static uint32_t plain[LIMIT][3];
    ebpo_polygon_kind kind = cut(2, false);
    if ((kind != EBPO_POLYGON_CONCAVE && kind != EBPO_POLYGON_FLAT) || !plain_cut(plain))
        return;
    ++*cut_by_both;
    ck_assert(memcmp(s.triangle, plain, (s.n - 2) * sizeof *plain) == 0);
}

START_TEST(test_polygon_ears_match_reference_order)
{
    uint32_t both = 0;
    state = 7 + (uint64_t)_i;
    for (int round = 0; round < 60; round++) {
        s.n = 4 + below(round < 50 ? 100 : 3000);
        for (uint32_t i = 0; i < s.n; i++) { /* a star with many equal coordinates */
            double r = 20 + below(200), angle = 2 * M_PI * i / s.n;
            s.at[i][0] = floor(r * cos(angle));
            s.at[i][1] = floor(r * sin(angle));
        }
        compare_with_plain(&both);
        grow_glued(4 + below(30), 4 + below(round < 50 ? 100 : 3000));
        s.n = w.n;
        for (uint32_t i = 0; i < s.n; i++)
            for (int k = 0; k < 2; k++)
                s.at[i][k] = (double)w.at[i][k];
        compare_with_plain(&both);
    }
    ck_assert_uint_gt(both, 50);
}
END_TEST

/* ---- outlines that cross themselves ---- */

static double area_of(uint32_t a, uint32_t b, uint32_t c)
{
    int64_t n[3] = { 0 };
    add_area(w.at[a], w.at[b], w.at[c], n);
    return sqrt((double)n[0] * (double)n[0] + (double)n[1] * (double)n[1] +
                (double)n[2] * (double)n[2]) /
           2;
}

/* Returns the minimum over all triangulations of the corners from i to j. */
static double least_area(uint32_t i, uint32_t j)
{
    double best = j - i < 2 ? 0 : INFINITY;
    for (uint32_t k = i + 1; k < j; k++)
        best = fmin(best, least_area(i, k) + area_of(i, k, j) + least_area(k, j));
    return best;
}

static double cut_area(void)
{
    double sum = 0;
    for (uint32_t i = 0; i + 2 < w.n; i++)
        sum += area_of(w.triangle[i][0], w.triangle[i][1], w.triangle[i][2]);
    return sum;
}

/* Squares of the areas of very small and very large polygons underflow and overflow. */
START_TEST(test_guessed_triangulation_has_least_area)
{
    static const int exponents[] = { -3, -300, 300, -900, 900 };
    int guessed = 0;
    state = 3;
    for (int round = 0; round < 3000; round++) {
        w.n = 4 + below(5);
        for (uint32_t i = 0; i < w.n; i++)
            for (int k = 0; k < 3; k++)
                w.at[i][k] = below(9);
        bool is_guess = cut_whole(exponents[round % 5]) == EBPO_POLYGON_GUESSED;
        check_exactly(false);
        guessed += is_guess;
        if (is_guess)
            ck_assert_double_eq_tol(cut_area(), least_area(0, w.n - 1), 1e-9);
    }
    ck_assert_int_gt(guessed, 1000);
}
END_TEST

START_TEST(test_folded_quads_and_stars_are_guessed)
{
    static const int64_t fold[][3] = {
        { -12, -27, 17 }, { -16, 9, -1 }, { 43, 9, -13 }, { -16, 9, -2 }
    };
    static const int64_t star[][3] = {
        { 0, 3, 0 }, { -2, -3, 0 }, { 3, 1, 0 }, { -3, 1, 0 }, { 2, -3, 0 }
    };
    w.n = 4;
    memcpy(w.at, fold, sizeof fold);
    ck_assert_int_eq(cut_whole(0), EBPO_POLYGON_GUESSED);
    ck_assert_double_eq_tol(cut_area(), 47.6, 0.1);
    w.n = 5;
    memcpy(w.at, star, sizeof star);
    ck_assert_int_eq(cut_whole(0), EBPO_POLYGON_GUESSED);
    ck_assert_double_eq_tol(cut_area(), least_area(0, 4), 1e-9);
}
END_TEST

/* ---- large outlines ---- */

/* Returns a fifth of a number of corners, unless all inputs are wanted. */
static int corners(int all) { return ebpo_test_scale() < 1 ? all / 5 : all; }

static void make_comb(void)
{
    const int teeth = corners(8000);
    w.n = 0;
    for (int i = 0; i < teeth; i++) {
        const int64_t ground[2] = { 2 * (int64_t)i, 0 }, tip[2] = { 2 * (int64_t)i + 1, 40000 };
        memcpy(w.at[w.n++], ground, sizeof ground);
        memcpy(w.at[w.n++], tip, sizeof tip);
    }
    const int64_t end[2] = { 2 * teeth, 0 }, under[2] = { teeth, -1 };
    memcpy(w.at[w.n++], end, sizeof end);
    memcpy(w.at[w.n++], under, sizeof under);
}

/* Makes a spiral of two arms side by side, inwards and out again. */
static void make_spiral(void)
{
    const int steps = corners(50000);
    w.n = 0;
    for (int arm = 0; arm < 2; arm++)
        for (int i = 0; i < steps; i++) {
            int step = arm ? steps - 1 - i : i;
            double angle = step * 0.01, r = 400000 - 6 * step - arm * 1500;
            w.at[w.n][0] = (int64_t)(r * cos(angle));
            w.at[w.n++][1] = (int64_t)(r * sin(angle));
        }
}

/* Makes triangles with one common corner. */
static void make_petals(void)
{
    const int petals = corners(5000);
    w.n = 0;
    for (int i = 0; i < petals; i++) {
        double angle = i * (2 * M_PI / petals);
        w.at[w.n][0] = w.at[w.n][1] = 0;
        w.n++;
        for (int k = 0; k < 2; k++, angle += 0.0001) {
            w.at[w.n][0] = (int64_t)(1e6 * cos(angle));
            w.at[w.n++][1] = (int64_t)(1e6 * sin(angle));
        }
    }
}

START_TEST(test_large_outlines_take_bounded_time)
{
    void (*make[])(void) = { make_comb, make_spiral, make_petals };
    if (_i < 3)
        make[_i]();
    else {
        state = 5;
        grow_glued(400, 30000);
        ck_assert_uint_gt(w.n, 29000);
    }
    for (int behind = 0; behind < 2; behind++) {
        if (ebpo_test_scale() < 1 && behind != _i % 2)
            continue; /* each shape from one side */
        place_in_space(1, behind);
        ck_assert_int_eq(cut_whole(0), EBPO_POLYGON_CONCAVE);
        check_exactly(true);
    }
}
END_TEST

TEST_SUITE(polygon)
{
    TCase *tests = tcase_create("polygon");
    tcase_set_timeout(tests, 120);
    tcase_add_test(tests, test_convex_polygon_becomes_fan);
    tcase_add_test(tests, test_collinear_corners_make_no_empty_triangle);
    tcase_add_test(tests, test_concave_polygons_are_covered);
    tcase_add_loop_test(tests, test_random_star_polygons_are_covered, 0, 60);
    tcase_add_test(tests, test_degenerate_polygons_become_fans);
    tcase_add_loop_test(tests, test_self_touching_outlines_are_covered, 0, 60);
    tcase_add_loop_test(tests, test_polygon_spikes_are_covered, 0, 60);
    tcase_add_test(tests, test_polygon_slits_need_no_empty_triangle);
    tcase_add_loop_test(tests, test_polygon_ears_match_reference_order, 0, 20);
    tcase_add_test(tests, test_guessed_triangulation_has_least_area);
    tcase_add_test(tests, test_folded_quads_and_stars_are_guessed);
    tcase_add_loop_test(tests, test_large_outlines_take_bounded_time, 0, 4);
    Suite *suite = suite_create("polygon");
    suite_add_tcase(suite, tests);
    return suite;
}
