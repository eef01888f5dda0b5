/* Segments in a plane, divided where they intersect, and the triangulation of their points:
 * compared with all pairs of segments in fractions. Coordinates are small integers, so segments
 * overlap, touch and cross at common points. */
#include <stdlib.h>

#include "check_main.h"
#include "extras/boolean/plane_arrangement.h"
#include "extras/boolean/plane_triangulation.h"
#include "solids.h"

enum { SEGMENTS_MAX = 12, GRID = 7, POINTS_MAX = 4 * SEGMENTS_MAX * SEGMENTS_MAX };

/* A point x / w, y / w, reduced; w > 0. */
typedef struct fraction_point {
    int64_t x, y, w;
} fraction_point;

typedef struct fraction_segment {
    fraction_point from, to;
} fraction_segment;

static int64_t common_divisor(int64_t a, int64_t b) { return b ? common_divisor(b, a % b) : a; }

static fraction_point reduced_point(int64_t x, int64_t y, int64_t w)
{
    int64_t d = common_divisor(common_divisor(llabs(x), llabs(y)), llabs(w)) * (w < 0 ? -1 : 1);
    return (fraction_point){ x / d, y / d, w / d };
}

static int64_t turn_of(fraction_point a, fraction_point b, fraction_point c)
{
    return a.x * (b.y * c.w - b.w * c.y) - a.y * (b.x * c.w - b.w * c.x) +
           a.w * (b.x * c.y - b.y * c.x);
}

static bool same_point(fraction_point p, fraction_point q)
{
    return p.x == q.x && p.y == q.y && p.w == q.w;
}

/* Returns true if the point is on the closed segment. */
static bool is_on(fraction_segment s, fraction_point p)
{
    int64_t along_x = (p.x * s.from.w - s.from.x * p.w) * (p.x * s.to.w - s.to.x * p.w);
    int64_t along_y = (p.y * s.from.w - s.from.y * p.w) * (p.y * s.to.w - s.to.y * p.w);
    return turn_of(s.from, s.to, p) == 0 && along_x <= 0 && along_y <= 0;
}

typedef struct fraction_points {
    fraction_point at[POINTS_MAX];
    int count;
} fraction_points;

static void add_point(fraction_points *set, fraction_point p)
{
    for (int i = 0; i < set->count; i++)
        if (same_point(set->at[i], p))
            return;
    set->at[set->count++] = p;
}

static void add_crossing(fraction_points *set, fraction_segment s, fraction_segment t)
{
    int64_t a = turn_of(t.from, t.to, s.from), b = turn_of(t.from, t.to, s.to),
            c = turn_of(s.from, s.to, t.from), d = turn_of(s.from, s.to, t.to);
    if (a == b || (a > 0) - (a < 0) == (b > 0) - (b < 0) ||
        (c != 0 && (c > 0) - (c < 0) == (d > 0) - (d < 0)))
        return;
    add_point(set, reduced_point(s.from.x * b - s.to.x * a, s.from.y * b - s.to.y * a, b - a));
}

/* --- one arrangement --- */

typedef struct fixture {
    fraction_segment segment[SEGMENTS_MAX];
    int segments;
    fraction_points points;
    ebpo_arrangement_2d arrangement;
    fraction_point *found; /* points of the arrangement as fractions */
} fixture;

/* Adds a point of the plane z = x + 2 y. */
static uint32_t add_exact(ebpo_arrangement_2d *a, fraction_point p)
{
    const double at[3] = { (double)p.x, (double)p.y, (double)(p.x + 2 * p.y) };
    uint32_t number;
    ebpo_exact_point made;
    ebpo_exact_point_init(&made);
    ebpo_exact_point_set(&made, at, a->unit);
    ck_assert(ebpo_point_set_add(&a->set, &made, &number));
    ebpo_exact_point_clear(&made);
    return number;
}

static fraction_point random_point(uint64_t *state)
{
    return (fraction_point){ (int64_t)(ebpo_test_random(state) % GRID),
                             (int64_t)(ebpo_test_random(state) % GRID), 1 };
}

static void make_fixture(fixture *f, uint64_t seed)
{
    uint64_t state = seed;
    ebpo_arrangement_2d *a = &f->arrangement;
    ebpo_arrangement_2d_begin(a, (int)(seed % 3), -60);
    f->segments = 3 + (int)(ebpo_test_random(&state) % (SEGMENTS_MAX - 2));
    f->points.count = 0;
    for (int i = 0; i < f->segments; i++) {
        fraction_segment *s = &f->segment[i];
        s->from = random_point(&state);
        s->to = random_point(&state); /* now and then equal: a single point */
        ck_assert(ebpo_arrangement_2d_add(a, add_exact(a, s->from), add_exact(a, s->to)));
        add_point(&f->points, s->from);
        add_point(&f->points, s->to);
        for (int k = 0; k < i; k++)
            add_crossing(&f->points, *s, f->segment[k]);
    }
    ck_assert(ebpo_arrangement_2d_divide(a));
    f->found = calloc(a->set.count, sizeof *f->found);
    ck_assert_ptr_nonnull(f->found);
    for (uint64_t i = 0; i < a->set.count; i++) {
        mpz_t *x = a->set.point[i].x;
        mpz_t scale;
        mpz_init_set_ui(scale, 1);
        mpz_mul_2exp(scale, scale, 60); /* coordinates are in units of 2^-60 */
        mpz_mul(scale, scale, x[3]);
        mpz_t d;
        mpz_init(d);
        mpz_gcd(d, scale, x[0]);
        mpz_gcd(d, d, x[1]);
        mpz_divexact(scale, scale, d);
        mpz_t u, v;
        mpz_inits(u, v, NULL);
        mpz_divexact(u, x[0], d);
        mpz_divexact(v, x[1], d);
        f->found[i] = (fraction_point){ mpz_get_si(u), mpz_get_si(v), mpz_get_si(scale) };
        mpz_clears(scale, d, u, v, NULL);
    }
}

static void check_arrangement(const fixture *f, uint64_t seed)
{
    const ebpo_arrangement_2d *a = &f->arrangement;
    fraction_points known = f->points;
    ck_assert_msg(a->set.count == (uint64_t)known.count, "seed %d: %d points, not %d", (int)seed,
                  (int)a->set.count, known.count);
    for (uint64_t i = 0; i < a->set.count; i++)
        add_point(&known, f->found[i]);
    ck_assert_int_eq(known.count, f->points.count);
    for (int i = 0; i < f->segments; i++) { /* points on a segment divide it into edges */
        int on = 0, edges = 0;
        for (int k = 0; k < f->points.count; k++)
            on += is_on(f->segment[i], f->points.at[k]);
        for (uint64_t k = 0; k < a->edges; k++) {
            bool again = false;
            fraction_segment e = { f->found[a->edge[k].from], f->found[a->edge[k].to] };
            for (uint64_t m = 0; m < k; m++)
                again |= (a->edge[m].from == a->edge[k].from && a->edge[m].to == a->edge[k].to) ||
                         (a->edge[m].from == a->edge[k].to && a->edge[m].to == a->edge[k].from);
            edges += !again && is_on(f->segment[i], e.from) && is_on(f->segment[i], e.to);
        }
        ck_assert_msg(edges == on - 1, "seed %d: segment %d has %d points and %d edges", (int)seed,
                      i, on, edges);
    }
}

static bool has_edge(const ebpo_triangulation *t, uint32_t from, uint32_t to)
{
    for (uint64_t i = 0; i < 3 * t->count; i++) {
        const uint32_t *c = t->triangle[i / 3].corner;
        uint32_t a = c[i % 3], b = c[(i + 1) % 3];
        if ((a == from && b == to) || (a == to && b == from))
            return true;
    }
    return false;
}

/* Triangles have an area, have all edges, and do not overlap: their number is that of a
 * triangulation of the hull, whose edges have a triangle on one side. */
static void check_triangulation(fixture *f, ebpo_triangulation *t, uint64_t seed)
{
    ebpo_arrangement_2d *a = &f->arrangement;
    uint64_t hull = 0;
    bool flat = true;
    for (uint64_t i = 2; i < a->set.count; i++)
        flat &= turn_of(f->found[0], f->found[1], f->found[i]) == 0;
    if (flat)
        return;
    ck_assert(ebpo_triangulate_points(t, a->axis, a->set.point, (uint32_t)a->set.count));
    for (uint64_t i = 0; i < a->edges; i++)
        ck_assert(ebpo_triangulation_insert(t, a->edge[i].from, a->edge[i].to));
    for (uint64_t i = 0; i < a->edges; i++)
        ck_assert_msg(has_edge(t, a->edge[i].from, a->edge[i].to), "seed %d: edge %d", (int)seed,
                      (int)i);
    int64_t sign = turn_of(f->found[t->triangle[0].corner[0]], f->found[t->triangle[0].corner[1]],
                           f->found[t->triangle[0].corner[2]]);
    for (uint64_t i = 0; i < t->count; i++) {
        const uint32_t *c = t->triangle[i].corner;
        int64_t turn = turn_of(f->found[c[0]], f->found[c[1]], f->found[c[2]]);
        ck_assert(sign > 0 ? turn > 0 : turn < 0);
        for (int k = 0; k < 3; k++) {
            bool outer = t->triangle[i].across[k] == EBPO_NO_TRIANGLE;
            hull += outer;
            for (uint64_t p = 0; p < a->set.count && outer; p++) {
                int64_t side = turn_of(f->found[c[k]], f->found[c[(k + 1) % 3]], f->found[p]);
                ck_assert(sign > 0 ? side >= 0 : side <= 0);
            }
        }
    }
    ck_assert_uint_eq(t->count, 2 * a->set.count - 2 - hull);
}

START_TEST(random_segments)
{
    fixture *f = calloc(1, sizeof *f);
    ebpo_triangulation t = { 0 };
    ck_assert_ptr_nonnull(f);
    ebpo_arrangement_2d_init(&f->arrangement);
    for (uint64_t seed = 0; seed < ebpo_test_scaled(3000); seed++) {
        make_fixture(f, seed);
        check_arrangement(f, seed);
        check_triangulation(f, &t, seed);
        free(f->found);
    }
    ebpo_triangulation_free(&t);
    ebpo_arrangement_2d_free(&f->arrangement);
    free(f);
}
END_TEST

/* Faces around a common vertex add it many times. Comparing all pairs of these points would take
 * minutes. */
START_TEST(repeated_points)
{
    ebpo_arrangement_2d a;
    ebpo_arrangement_2d_init(&a);
    ebpo_arrangement_2d_begin(&a, 2, -60);
    uint32_t apex = add_exact(&a, (fraction_point){ 0, 0, 1 }),
             end = add_exact(&a, (fraction_point){ 2, 0, 1 });
    for (int i = 0; i < 200000; i++)
        ck_assert(ebpo_arrangement_2d_add(&a, apex, i % 1000 ? apex : end));
    ck_assert(ebpo_arrangement_2d_divide(&a));
    ck_assert_uint_eq(a.segments, 2);
    ck_assert_uint_eq(a.edges, 1);
    ebpo_arrangement_2d_free(&a);
}
END_TEST

TEST_SUITE(plane_arrangement)
{
    Suite *suite = suite_create("plane_arrangement");
    TCase *tests = tcase_create("plane_arrangement");
    tcase_set_timeout(tests, 0);
    tcase_add_test(tests, random_segments);
    tcase_add_test(tests, repeated_points);
    suite_add_tcase(suite, tests);
    return suite;
}
