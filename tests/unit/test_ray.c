/* Tests rays and boxes against triangles, compared with reference implementations in rational
 * numbers that share no method with the library. The reference clips a ray by linear conditions on
 * t, and a triangle as a polygon by the half-spaces of the box. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gmp.h>

#include "check_main.h"
#include "exact_reference.h"
#include "geometry/ray.h"
#include "solids.h"

enum { ROUNDS = 11000, RAY_KINDS = 12, BOX_KINDS = 7 };

/* Returns the scaled number of rounds, at least a tenth, so that each case occurs. */
static int scaled_rounds(int most)
{
    return (int)ebpo_test_scaled((uint64_t)most * 9 / 10) + most / 10;
}

/* --- rational vectors --- */

typedef struct rational3 {
    mpq_t x[3];
} rational3;

static void init3(rational3 *a) { mpq_inits(a->x[0], a->x[1], a->x[2], NULL); }

static void clear3(rational3 *a) { mpq_clears(a->x[0], a->x[1], a->x[2], NULL); }

static void set3(rational3 *a, const double x[3])
{
    init3(a);
    for (int k = 0; k < 3; k++)
        mpq_set_d(a->x[k], x[k]);
}

/* out = a - b; initialises out */
static void difference3(rational3 *out, const rational3 *a, const rational3 *b)
{
    init3(out);
    for (int k = 0; k < 3; k++)
        mpq_sub(out->x[k], a->x[k], b->x[k]);
}

static void dot3(mpq_t out, const rational3 *a, const rational3 *b)
{
    mpq_t product, sum;
    mpq_inits(product, sum, NULL);
    for (int k = 0; k < 3; k++) {
        mpq_mul(product, a->x[k], b->x[k]);
        mpq_add(sum, sum, product);
    }
    mpq_set(out, sum);
    mpq_clears(product, sum, NULL);
}

static void cross3(rational3 *out, const rational3 *a, const rational3 *b)
{
    mpq_t product;
    mpq_init(product);
    init3(out);
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        mpq_mul(out->x[k], a->x[u], b->x[v]);
        mpq_mul(product, a->x[v], b->x[u]);
        mpq_sub(out->x[k], out->x[k], product);
    }
    mpq_clear(product);
}

static bool zero3(const rational3 *a)
{
    return mpq_sgn(a->x[0]) == 0 && mpq_sgn(a->x[1]) == 0 && mpq_sgn(a->x[2]) == 0;
}

/* --- the reference for rays: the remaining part of [0, t_max] --- */

typedef struct interval {
    bool any, endless;
    bool strict; /* all inequalities hold strictly at `low` */
    mpq_t low, high;
} interval;

/* Keeps the t with c0 + c1 t >= 0. */
static void keep(interval *r, const mpq_t c0, const mpq_t c1)
{
    mpq_t root;
    if (!r->any)
        return;
    if (mpq_sgn(c1) == 0) {
        r->any = mpq_sgn(c0) >= 0;
        return;
    }
    mpq_init(root);
    mpq_div(root, c0, c1);
    mpq_neg(root, root);
    if (mpq_sgn(c1) > 0 && mpq_cmp(root, r->low) > 0)
        mpq_set(r->low, root);
    if (mpq_sgn(c1) < 0 && (r->endless || mpq_cmp(root, r->high) < 0)) {
        mpq_set(r->high, root);
        r->endless = false;
    }
    r->any = r->endless || mpq_cmp(r->low, r->high) <= 0;
    mpq_clear(root);
}

/* Keeps the t with c0 + c1 t = 0. */
static void keep_zero(interval *r, mpq_t c0, mpq_t c1)
{
    keep(r, c0, c1);
    mpq_neg(c0, c0);
    mpq_neg(c1, c1);
    keep(r, c0, c1);
}

/* Keeps the t with normal . (origin + t direction - at) >= 0, or = 0. */
static void keep_plane(interval *r, const rational3 *normal, const rational3 *origin,
                       const rational3 *direction, const rational3 *at, bool equal)
{
    rational3 from;
    mpq_t c0, c1;
    mpq_inits(c0, c1, NULL);
    difference3(&from, origin, at);
    dot3(c0, normal, &from);
    dot3(c1, normal, direction);
    if (equal)
        keep_zero(r, c0, c1);
    else
        keep(r, c0, c1);
    mpq_clears(c0, c1, NULL);
    clear3(&from);
}

/* Returns true when normal . (point - at) > 0 at r->low. */
static bool strictly_within(const interval *r, const rational3 *normal, const rational3 *origin,
                            const rational3 *direction, const rational3 *at)
{
    rational3 point;
    mpq_t c;
    init3(&point);
    mpq_init(c);
    for (int k = 0; k < 3; k++) {
        mpq_mul(c, r->low, direction->x[k]);
        mpq_add(point.x[k], origin->x[k], c);
        mpq_sub(point.x[k], point.x[k], at->x[k]);
    }
    dot3(c, normal, &point);
    bool within = mpq_sgn(c) > 0;
    mpq_clear(c);
    clear3(&point);
    return within;
}

static void keep_area(interval *r, const rational3 p[3], const rational3 *normal,
                      const rational3 *origin, const rational3 *direction)
{
    r->strict = true;
    keep_plane(r, normal, origin, direction, &p[0], true);
    for (int pass = 0; pass < 2; pass++)
        for (int i = 0; i < 3; i++) {
            rational3 edge, inward;
            difference3(&edge, &p[(i + 1) % 3], &p[i]);
            cross3(&inward, normal, &edge);
            if (pass == 0)
                keep_plane(r, &inward, origin, direction, &p[i], false);
            else if (!r->any || !strictly_within(r, &inward, origin, direction, &p[i]))
                r->strict = false;
            clear3(&inward);
            clear3(&edge);
        }
}

/* Keeps the part of the ray on a face whose corners are on one line: uses the segment between the
 * two corners that are farthest apart. */
static void keep_segment(interval *r, const rational3 p[3], const rational3 *origin,
                         const rational3 *direction)
{
    mpq_t length, longest;
    int from = 0, to = 1;
    mpq_inits(length, longest, NULL);
    for (int i = 0; i < 3; i++) {
        rational3 edge;
        difference3(&edge, &p[(i + 1) % 3], &p[i]);
        dot3(length, &edge, &edge);
        if (mpq_cmp(length, longest) > 0) {
            mpq_set(longest, length);
            from = i;
            to = (i + 1) % 3;
        }
        clear3(&edge);
    }
    rational3 along, back;
    difference3(&along, &p[to], &p[from]);
    difference3(&back, &p[from], &p[to]);
    keep_plane(r, &along, origin, direction, &p[from], false);
    keep_plane(r, &back, origin, direction, &p[to], false);
    for (int k = 0; k < 3; k++) {
        rational3 unit, across;
        init3(&unit);
        mpq_set_ui(unit.x[k], 1, 1);
        cross3(&across, &along, &unit);
        if (mpq_sgn(longest) == 0)
            keep_plane(r, &unit, origin, direction, &p[0], true);
        else
            keep_plane(r, &across, origin, direction, &p[from], true);
        clear3(&across);
        clear3(&unit);
    }
    clear3(&along);
    clear3(&back);
    mpq_clears(length, longest, NULL);
}

/* Computes the first common point, r->low. Returns the side of the face, and the side of the
 * origin relative to the line. Initialises r. */
static int reference_ray(const ebpo_segment *ray, const double triangle[3][3], interval *r,
                         int *facing)
{
    rational3 p[3], f, g, normal, origin, direction;
    mpq_t slope;
    int side = 0;
    *facing = 0;
    mpq_inits(r->low, r->high, slope, NULL);
    r->any = true;
    r->endless = ray->t_max == INFINITY;
    if (!r->endless)
        mpq_set_d(r->high, ray->t_max);
    set3(&origin, ray->origin);
    set3(&direction, ray->direction);
    for (int i = 0; i < 3; i++)
        set3(&p[i], triangle[i]);
    difference3(&f, &p[1], &p[0]);
    difference3(&g, &p[2], &p[0]);
    cross3(&normal, &f, &g);
    if (zero3(&normal))
        keep_segment(r, p, &origin, &direction);
    else {
        keep_area(r, p, &normal, &origin, &direction);
        dot3(slope, &normal, &direction);
        *facing = r->any ? -mpq_sgn(slope) : 0;
        side = r->strict ? *facing : 0;
    }
    for (int i = 0; i < 3; i++)
        clear3(&p[i]);
    clear3(&f);
    clear3(&g);
    clear3(&normal);
    clear3(&origin);
    clear3(&direction);
    mpq_clear(slope);
    return side;
}

static void interval_clear(interval *r) { mpq_clears(r->low, r->high, NULL); }

/* Sets out to half the sum of two doubles. */
static void set_middle(mpq_t out, double a, double b)
{
    mpq_t other;
    mpq_init(other);
    mpq_set_d(out, a);
    mpq_set_d(other, b);
    mpq_add(out, out, other);
    mpq_div_2exp(out, out, 1);
    mpq_clear(other);
}

/* Returns true when no double is closer: exact is between the middles to both neighbours. */
static bool is_rounded(double t, const mpq_t exact)
{
    mpq_t end;
    mpq_init(end);
    double largest = 0x1.fffffffffffffp1023,
           low = t == INFINITY ? largest : nextafter(t, -INFINITY);
    if (t == INFINITY)
        mpq_set_d(end, largest);
    else
        set_middle(end, low, t);
    bool ok = mpq_cmp(end, exact) <= 0;
    if (t < largest) {
        set_middle(end, t, nextafter(t, INFINITY));
        ok = ok && mpq_cmp(exact, end) <= 0;
    }
    mpq_clear(end);
    return ok;
}

/* --- cases --- */

static double small(uint64_t *state, int64_t size)
{
    return (double)reference_integer(state, -size, size);
}

static double nudged(double x, uint64_t *state)
{
    for (int64_t ulps = reference_integer(state, 0, 1); ulps > 0; ulps--)
        x = nextafter(x, reference_random(state) & 1 ? INFINITY : -INFINITY);
    return x;
}

/* Returns a point of the triangle: inside, on an edge or a corner. */
static void point_of(const double triangle[3][3], double out[3], uint64_t *state)
{
    static const double weights[][3] = { { 1, 0, 0 },      { 0, 1, 0 },      { 0, 0, 1 },
                                         { .5, .5, 0 },    { 0, .25, .75 },  { .25, .25, .5 },
                                         { .5, .25, .25 }, { .375, 0, .625 } };
    const double *w = weights[reference_integer(state, 0, 7)];
    for (int k = 0; k < 3; k++)
        out[k] = w[0] * triangle[0][k] + w[1] * triangle[1][k] + w[2] * triangle[2][k];
}

static void direction_to(ebpo_segment *ray, const double target[3])
{
    bool zero = true;
    for (int k = 0; k < 3; k++) {
        ray->direction[k] = target[k] - ray->origin[k];
        zero = zero && ray->direction[k] == 0;
    }
    if (zero)
        ray->direction[0] = 1;
}

/* Scales by powers of two, separately for lengths and directions. */
static void scale_all(ebpo_segment *ray, double triangle[3][3], int lengths, int directions)
{
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 3; i++)
            triangle[i][k] = ldexp(triangle[i][k], lengths);
        ray->origin[k] = ldexp(ray->origin[k], lengths);
        ray->direction[k] = ldexp(ray->direction[k], directions);
    }
}

static void flatten(double triangle[3][3], uint64_t *state)
{
    int64_t s = reference_integer(state, -2, 2);
    for (int k = 0; k < 3; k++)
        triangle[2][k] = triangle[0][k] + (double)s * (triangle[1][k] - triangle[0][k]);
    if (reference_random(state) % 4 == 0)
        memcpy(triangle[1], triangle[0], sizeof triangle[0]);
}

static void ray_case(int kind, ebpo_segment *ray, double triangle[3][3], uint64_t *state)
{
    double target[3];
    bool whole = kind <= 3 || kind == 8 || kind == 10;
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 3; i++)
            triangle[i][k] = whole       ? small(state, kind == 0 ? 2 : 8) * 8
                             : kind == 7 ? 1e7 + reference_uniform(state)
                                         : reference_uniform(state);
        ray->origin[k] = whole       ? small(state, kind == 0 ? 2 : 8) * 8
                         : kind == 7 ? 1e7 + reference_uniform(state)
                                     : reference_uniform(state);
        ray->direction[k] = whole ? small(state, 2) : reference_uniform(state);
    }
    if (kind == 2 || kind == 3) /* in one plane, or without area */
        for (int i = 0; i < 3 && kind == 2; i++)
            triangle[i][2] =
                ray->origin[2] + (double)i * (double)(reference_random(state) % 8 == 0);
    if (kind == 2)
        ray->direction[2] = 0;
    if (kind == 3 || (kind == 5 && reference_random(state) % 4 == 0))
        flatten(triangle, state);
    if (kind == 6) /* a sliver */
        for (int k = 0; k < 3; k++)
            triangle[2][k] = nudged(.5 * (triangle[0][k] + triangle[1][k]), state);
    if (ray->direction[0] == 0 && ray->direction[1] == 0 && ray->direction[2] == 0)
        ray->direction[reference_integer(state, 0, 2)] = 1;
    if (kind == 8 || kind == 9) /* along an axis, through the triangle when possible */
        for (int k = 0, axis = (int)reference_integer(state, 0, 2); k < 3; k++)
            ray->direction[k] = k == axis ? (reference_random(state) & 1 ? 1 : -1) : 0;
    point_of((const double(*)[3])triangle, target, state);
    if (kind == 9)
        for (int k = 0; k < 3; k++)
            ray->origin[k] = ray->direction[k] == 0 ? nudged(target[k], state) : ray->origin[k];
    else if (kind != 8 && reference_random(state) % 2)
        direction_to(ray, target);
    if (kind == 10 && reference_random(state) % 2) /* begins on the triangle */
        memcpy(ray->origin, target, sizeof target);
    ray->t_max = INFINITY;
    uint64_t choice = reference_random(state) % 4;
    if (choice == 0)
        ray->t_max = (double)reference_integer(state, 0, 4) / 2;
    if (choice == 1)
        ray->t_max = nudged(1, state);
    if (kind == 5 || kind == 11) {
        int range = kind == 11 ? 1000 : 300,
            lengths = (int)reference_integer(state, -range, range - 1),
            directions = (int)reference_integer(state, -range, range - 1);
        scale_all(ray, triangle, lengths, directions);
        ray->t_max = ldexp(ray->t_max, lengths - directions);
    }
}

/* --- rays --- */

typedef struct tally {
    long cases, hits, touches, misses;
} tally;

static void check_ray(const ebpo_segment *ray, const double triangle[3][3], int kind, tally *count)
{
    interval r;
    ebpo_ray_intersection m;
    int facing, side = reference_ray(ray, triangle, &r, &facing);
    ebpo_ray_triangle(ray, triangle, &m);
    ck_assert_msg(m.intersects == r.any, "kind %d, case %ld: intersects %d, reference %d", kind,
                  count->cases, m.intersects, r.any);
    if (m.intersects) {
        ck_assert_msg(m.side == side, "kind %d, case %ld: side %d, reference %d", kind,
                      count->cases, m.side, side);
        ck_assert_msg(m.facing == facing, "kind %d, case %ld: facing %d, reference %d", kind,
                      count->cases, m.facing, facing);
        ck_assert_msg(is_rounded(m.t, r.low), "kind %d, case %ld: t %a, reference %a", kind,
                      count->cases, m.t, mpq_get_d(r.low));
        ck_assert(m.t <= ray->t_max);
    }
    count->cases++;
    count->misses += !r.any;
    count->hits += r.any && side;
    count->touches += r.any && !side;
    interval_clear(&r);
}

/* Checks limits exactly at the hit, and next to the hit, when the t of the hit is a double. */
static void check_limits(ebpo_segment *ray, const double triangle[3][3], int kind, tally *count)
{
    ebpo_ray_intersection m;
    ebpo_ray_triangle(ray, triangle, &m);
    if (!m.intersects || m.t == INFINITY)
        return;
    double t = m.t;
    for (int step = -1; step <= 1; step++) {
        ray->t_max = step < 0 ? fmax(0, nextafter(t, 0)) : step > 0 ? nextafter(t, INFINITY) : t;
        check_ray(ray, triangle, kind, count);
    }
}

START_TEST(test_ray_triangle_matches_rational_clipping)
{
    tally count = { 0 };
    uint64_t state = 11 + (uint64_t)_i;
    const int most = _i == 11 ? ROUNDS / 4 : ROUNDS;
    const int rounds = scaled_rounds(most);
    const long least = 400L * rounds / most;
    for (int i = 0; i < rounds; i++) {
        ebpo_segment ray;
        double triangle[3][3];
        ray_case(_i, &ray, triangle, &state);
        check_ray(&ray, (const double(*)[3])triangle, _i, &count);
        check_limits(&ray, (const double(*)[3])triangle, _i, &count);
    }
    ck_assert_msg(count.hits + count.touches > least && count.misses > least,
                  "kind %d: %ld hits, %ld touches, %ld misses", _i, count.hits, count.touches,
                  count.misses);
}
END_TEST

START_TEST(test_ray_triangle_difficult_coordinates)
{
    tally count = { 0 };
    uint64_t state = 99;
    const int rounds = scaled_rounds(1500);
    for (int i = 0; i < rounds; i++)
        for (int kind = 0; kind < REFERENCE_KINDS; kind++) {
            double p[12], triangle[3][3];
            ebpo_segment ray = { .t_max = INFINITY };
            reference_points(p, 3, kind, &state);
            memcpy(triangle, p, sizeof triangle);
            memcpy(ray.origin, p + 9, sizeof ray.origin);
            for (int k = 0; k < 3; k++) {
                double by_half = .25 * p[k] + .25 * p[3 + k] + .5 * p[6 + k] - p[9 + k];
                ray.direction[k] = i % 2 ? p[9 + k] - p[3 * (i / 2 % 3) + k] : by_half;
                if (!(fabs(ray.direction[k]) < INFINITY))
                    ray.direction[k] = 1;
            }
            if (ray.direction[0] == 0 && ray.direction[1] == 0 && ray.direction[2] == 0)
                ray.direction[i % 3] = -1;
            check_ray(&ray, (const double(*)[3])triangle, kind, &count);
            check_limits(&ray, (const double(*)[3])triangle, kind, &count);
        }
    ck_assert(count.hits > rounds / 15 && count.touches > rounds / 15 &&
              count.misses > rounds / 15);
}
END_TEST

/* Checks that a corner or edge in which the ray intersects one triangle gives the same result for
 * another triangle as the separate test. Returns true if it gives a result. */
static bool check_shared(const ebpo_segment *ray, const double a[3][3],
                         const ebpo_ray_intersection *at_a, const double b[3][3],
                         const ebpo_ray_intersection *at_b)
{
    ebpo_ray_shared shared;
    ebpo_ray_intersection m;
    ebpo_ray_share(a, at_a, &shared);
    if (shared.count == 0 || !ebpo_ray_shares(ray, &shared, b, &m))
        return false;
    ck_assert(at_b->intersects && m.intersects && m.side == 0 && at_b->side == 0);
    ck_assert_int_eq(m.facing, at_b->facing);
    ck_assert(memcmp(&m.t, &at_b->t, sizeof m.t) == 0);
    return true;
}

/* Fans around a common corner or edge give equal t; others differ slightly. */
START_TEST(test_ray_hits_are_ordered_exactly)
{
    uint64_t state = 5;
    long ties = 0, other = 0, shared = 0;
    const int rounds = scaled_rounds(60000);
    for (int i = 0; i < rounds; i++) {
        ebpo_segment ray;
        double a[3][3], b[3][3], other_case[3][3];
        interval ra, rb;
        int facing;
        ebpo_segment unused;
        ray_case(i % RAY_KINDS, &ray, a, &state);
        ray.t_max = INFINITY;
        ray_case(i % RAY_KINDS, &unused, other_case, &state);
        memcpy(b, a, sizeof a);
        memcpy(b[2], other_case[2], sizeof b[2]);
        if (reference_random(&state) % 4 == 0)
            b[1][0] = nudged(b[1][0], &state);
        if (reference_random(&state) % 8 == 0)
            memcpy(b, other_case, sizeof b);
        if (reference_random(&state) % 8 == 0) /* the same corners, some of them twice */
            for (int k = 0; k < 3; k++)
                memcpy(b[k], a[reference_random(&state) % 3], sizeof b[k]);
        const double(*first)[3] = (const double(*)[3])a, (*second)[3] = (const double(*)[3])b;
        ebpo_ray_intersection at_a, at_b;
        reference_ray(&ray, first, &ra, &facing);
        reference_ray(&ray, second, &rb, &facing);
        ebpo_ray_triangle(&ray, first, &at_a);
        ebpo_ray_triangle(&ray, second, &at_b);
        shared += check_shared(&ray, first, &at_a, second, &at_b);
        if (ra.any && rb.any) {
            int order = mpq_cmp(ra.low, rb.low);
            order = (order > 0) - (order < 0);
            ck_assert_int_eq(ebpo_ray_compare(&ray, first, &at_a, second, &at_b), order);
            ck_assert_int_eq(ebpo_ray_compare(&ray, second, &at_b, first, &at_a), -order);
            ties += order == 0;
            other += order != 0;
        }
        interval_clear(&ra);
        interval_clear(&rb);
    }
    ck_assert_msg(ties > rounds / 20 && other > rounds / 20 && shared > rounds / 20,
                  "%ld ties, %ld others, %ld in a known part", ties, other, shared);
}
END_TEST

START_TEST(test_ray_triangle_known_cases)
{
    const double t[3][3] = { { 0, 0, 1 }, { 2, 0, 1 }, { 0, 2, 1 } }; /* normal +z */
    const double flat[3][3] = { { 1, 0, 0 }, { 3, 0, 0 }, { 2, 0, 0 } },
                 point[3][3] = { { 1, 1, 1 }, { 1, 1, 1 }, { 1, 1, 1 } };
    const struct {
        ebpo_segment ray;
        const double (*triangle)[3];
        ebpo_ray_intersection expected;
    } cases[] = {
        { { { .5, .5, 0 }, { 0, 0, 2 }, INFINITY }, t, { true, -1, -1, .5, 0 } },
        { { { .5, .5, 2 }, { 0, 0, -1 }, INFINITY }, t, { true, 1, 1, 1, 0 } },
        { { { .5, .5, 2 }, { 0, 0, -1 }, 1 }, t, { true, 1, 1, 1, 0 } },
        { { { .5, .5, 2 }, { 0, 0, -1 }, 0x1.fffffffffffffp-1 }, t, { false, 0, 0, 0, 0 } },
        { { { .5, .5, 1 }, { 0, 0, -1 }, 0 }, t, { true, 1, 1, 0, 0 } },
        { { { .5, .5, 0 }, { 0, 0, -1 }, INFINITY }, t, { false, 0, 0, 0, 0 } },
        { { { 1, 1, 0 }, { 0, 0, 1 }, INFINITY }, t, { true, 0, -1, 1, 6 } },
        { { { 0, 0, 0 }, { 0, 0, 1 }, INFINITY }, t, { true, 0, -1, 1, 1 } },
        { { { -1, 1, 1 }, { 1, 0, 0 }, INFINITY }, t, { true, 0, 0, 1, 0 } },
        { { { .5, .5, 1 }, { 1, 0, 0 }, INFINITY }, t, { true, 0, 0, 0, 0 } },
        { { { -1, 1, 1.5 }, { 1, 0, 0 }, INFINITY }, t, { false, 0, 0, 0, 0 } },
        { { { 2, -1, 0 }, { 0, 4, 0 }, INFINITY }, flat, { true, 0, 0, .25, 0 } },
        { { { 0, 0, 0 }, { 1, 0, 0 }, INFINITY }, flat, { true, 0, 0, 1, 0 } },
        { { { 4, 0, 0 }, { 1, 0, 0 }, INFINITY }, flat, { false, 0, 0, 0, 0 } },
        { { { 0, 0, 0 }, { 1, 1, 1 }, 1 }, point, { true, 0, 0, 1, 0 } },
        { { { 0, 0, 0 }, { 1, 1, 2 }, INFINITY }, point, { false, 0, 0, 0, 0 } },
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        ebpo_ray_intersection m;
        ebpo_ray_triangle(&cases[i].ray, cases[i].triangle, &m);
        ck_assert_msg(m.intersects == cases[i].expected.intersects &&
                          m.side == cases[i].expected.side &&
                          m.facing == cases[i].expected.facing && m.part == cases[i].expected.part,
                      "case %zu", i);
        ck_assert_msg(!m.intersects || m.t == cases[i].expected.t, "case %zu: t %g", i, m.t);
    }
}
END_TEST

/* --- boxes --- */

enum { CLIPPED_MAX = 16 };

typedef struct rational_polygon {
    rational3 p[CLIPPED_MAX];
    int n;
} rational_polygon;

static void polygon_push(rational_polygon *poly, const rational3 *p)
{
    ck_assert_int_lt(poly->n, CLIPPED_MAX);
    init3(&poly->p[poly->n]);
    for (int k = 0; k < 3; k++)
        mpq_set(poly->p[poly->n].x[k], p->x[k]);
    poly->n++;
}

static void polygon_clear(rational_polygon *poly)
{
    while (poly->n > 0)
        clear3(&poly->p[--poly->n]);
}

/* Adds the intersection of the segment from p to q with x[axis] = at. */
static void push_cut(rational_polygon *out, const rational3 *p, const rational3 *q, int axis,
                     const mpq_t at)
{
    rational3 cut;
    mpq_t s, length;
    mpq_inits(s, length, NULL);
    init3(&cut);
    mpq_sub(s, at, p->x[axis]);
    mpq_sub(length, q->x[axis], p->x[axis]);
    mpq_div(s, s, length);
    for (int k = 0; k < 3; k++) {
        mpq_sub(length, q->x[k], p->x[k]);
        mpq_mul(length, length, s);
        mpq_add(cut.x[k], p->x[k], length);
    }
    polygon_push(out, &cut);
    clear3(&cut);
    mpq_clears(s, length, NULL);
}

/* Sutherland and Hodgman 1974: keeps side * (x[axis] - at) >= 0. */
static void cut_polygon(rational_polygon *poly, int axis, int side, double at)
{
    rational_polygon out = { .n = 0 };
    mpq_t limit;
    mpq_init(limit);
    mpq_set_d(limit, at);
    for (int i = 0; i < poly->n; i++) {
        const rational3 *p = &poly->p[i], *q = &poly->p[(i + 1) % poly->n];
        int here = side * mpq_cmp(p->x[axis], limit), next = side * mpq_cmp(q->x[axis], limit);
        if (here >= 0)
            polygon_push(&out, p);
        if ((here < 0 && next > 0) || (here > 0 && next < 0))
            push_cut(&out, p, q, axis, limit);
    }
    mpq_clear(limit);
    polygon_clear(poly);
    *poly = out;
}

static bool reference_box(const double triangle[3][3], const double min[3], const double max[3])
{
    rational_polygon poly = { .n = 0 };
    for (int i = 0; i < 3; i++) {
        rational3 p;
        set3(&p, triangle[i]);
        polygon_push(&poly, &p);
        clear3(&p);
    }
    for (int k = 0; k < 3; k++) {
        cut_polygon(&poly, k, 1, min[k]);
        cut_polygon(&poly, k, -1, max[k]);
    }
    bool meets = poly.n > 0;
    polygon_clear(&poly);
    return meets;
}

static void box_case(int kind, double triangle[3][3], double min[3], double max[3], uint64_t *state)
{
    double centre[3], half = kind == 0 ? 1 : .25 * fabs(reference_uniform(state));
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++)
            triangle[i][k] = kind == 0   ? small(state, 3)
                             : kind == 1 ? small(state, 20)
                                         : reference_uniform(state);
    point_of((const double(*)[3])triangle, centre, state);
    if (kind == 3)
        for (int k = 0; k < 3; k++)
            triangle[2][k] = nudged(.5 * (triangle[0][k] + triangle[1][k]), state);
    if (kind == 4 || (kind <= 1 && reference_random(state) % 4 == 0))
        flatten(triangle, state);
    for (int k = 0; k < 3; k++) {
        double a = kind == 0   ? small(state, 3)
                   : kind == 1 ? small(state, 20)
                               : centre[k] - 2 * half * reference_uniform(state);
        double b = kind == 0 ? small(state, 3) : kind == 1 ? a + 16 : a + half;
        /* Makes a box with a corner on the triangle, or one floating-point step off the triangle;
         * also flat boxes and points. */
        if (kind == 2 || kind == 5) {
            a = nudged(centre[k], state);
            b = a + half;
        }
        if (kind == 5 && reference_random(state) % 2) {
            b = a;
            a = b - half;
        }
        if (reference_random(state) % (kind == 2 ? 2 : 8) == 0)
            b = a;
        min[k] = fmin(a, b);
        max[k] = fmax(a, b);
    }
    int shift = kind == 6 ? (int)reference_integer(state, -1000, 1000) : 0;
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 3; i++)
            triangle[i][k] = ldexp(triangle[i][k], shift);
        min[k] = ldexp(min[k], shift);
        max[k] = ldexp(max[k], shift);
    }
}

START_TEST(test_box_triangle_matches_rational_clipping)
{
    long meets = 0, apart = 0;
    uint64_t state = 21 + (uint64_t)_i;
    const int most = _i == 6 ? ROUNDS / 2 : ROUNDS, rounds = scaled_rounds(most);
    const long least = 200L * rounds / most;
    for (int i = 0; i < rounds; i++) {
        double triangle[3][3], min[3], max[3];
        box_case(_i, triangle, min, max, &state);
        bool expected = reference_box((const double(*)[3])triangle, min, max);
        ck_assert_msg(ebpo_triangle_intersects_box((const double(*)[3])triangle, min, max) ==
                          expected,
                      "kind %d, case %d: reference %d", _i, i, expected);
        meets += expected;
        apart += !expected;
    }
    ck_assert_msg(meets > least && apart > least, "kind %d: %ld intersect, %ld apart", _i, meets,
                  apart);
}
END_TEST

START_TEST(test_point_boxes_intersect_their_triangle)
{
    const double t[3][3] = { { 0, 0, 0 }, { 4, 0, 0 }, { 0, 4, 4 } }, on[3] = { 1, 1, 1 },
                 off[3] = { 1, 1, 0x1.0000000000001p0 };
    const double far[3] = { 3, 3, 3 }, low[3] = { 2, 2, 2 }, edge[3] = { 2, 2, 2 },
                 high[3] = { 9, 9, 9 };
    ck_assert(ebpo_triangle_intersects_box(t, on, on));
    ck_assert(!ebpo_triangle_intersects_box(t, off, off));
    ck_assert(!ebpo_triangle_intersects_box(t, far, far));
    ck_assert(ebpo_triangle_intersects_box(t, low, high));
    ck_assert(ebpo_triangle_intersects_box(t, edge, edge));
}
END_TEST

TEST_SUITE(ray)
{
    Suite *suite = suite_create("ray");
    TCase *rays = tcase_create("rays"), *boxes = tcase_create("boxes");
    tcase_set_timeout(rays, 600);
    tcase_set_timeout(boxes, 600);
    tcase_add_test(rays, test_ray_triangle_known_cases);
    tcase_add_loop_test(rays, test_ray_triangle_matches_rational_clipping, 0, RAY_KINDS);
    tcase_add_test(rays, test_ray_triangle_difficult_coordinates);
    tcase_add_test(rays, test_ray_hits_are_ordered_exactly);
    tcase_add_test(boxes, test_point_boxes_intersect_their_triangle);
    tcase_add_loop_test(boxes, test_box_triangle_matches_rational_clipping, 0, BOX_KINDS);
    suite_add_tcase(suite, rays);
    suite_add_tcase(suite, boxes);
    return suite;
}
