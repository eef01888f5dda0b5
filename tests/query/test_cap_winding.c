/* Winding numbers of meshes with holes, as an integer and the solid angles of the border's discs,
 * against sums over all faces in 400 bits (GMP, arctangents by halving and series). The points are
 * random, on caps, on chords of caps, next to them, and where the winding number is a tie. */
#include "core/strict_fp.h"

#include <gmp.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "check_main.h"
#include "geometry/cap_bounds.h"
#include "geometry/cap_triangles.h"
#include "geometry/predicates.h"
#include "mesh/border.h"
#include "mesh/mesh_parts.h"
#include "solids.h"

/* ---- the judge ---- */

enum { BITS = 400 };

typedef struct judge {
    mpf_t angle, pi, v[3][3], length[3], x, y, t, u, w;
} judge;

static void arctangent_of_inverse(judge *j, unsigned long n, mpf_t out)
{
    mpf_set_ui(j->t, 1);
    mpf_div_ui(j->t, j->t, n);
    mpf_set(out, j->t);
    for (unsigned long k = 3; k < 2 * BITS; k += 2) {
        mpf_div_ui(j->t, j->t, n * n);
        mpf_div_ui(j->u, j->t, k);
        if (k % 4 == 3)
            mpf_sub(out, out, j->u);
        else
            mpf_add(out, out, j->u);
    }
}

static void judge_begin(judge *j)
{
    mpf_set_default_prec(BITS + 64);
    for (int i = 0; i < 9; i++)
        mpf_init(j->v[i / 3][i % 3]);
    for (int i = 0; i < 3; i++)
        mpf_init(j->length[i]);
    mpf_inits(j->angle, j->pi, j->x, j->y, j->t, j->u, j->w, NULL);
    arctangent_of_inverse(j, 5, j->pi);
    mpf_mul_ui(j->pi, j->pi, 4);
    arctangent_of_inverse(j, 239, j->x);
    mpf_sub(j->pi, j->pi, j->x);
    mpf_mul_ui(j->pi, j->pi, 4);
}

static void judge_end(judge *j)
{
    for (int i = 0; i < 9; i++)
        mpf_clear(j->v[i / 3][i % 3]);
    for (int i = 0; i < 3; i++)
        mpf_clear(j->length[i]);
    mpf_clears(j->angle, j->pi, j->x, j->y, j->t, j->u, j->w, NULL);
}

/* Adds the argument of x + i y to the angle. */
static void add_argument(judge *j)
{
    if (mpf_sgn(j->y) == 0) {
        if (mpf_sgn(j->x) < 0)
            mpf_add(j->angle, j->angle, j->pi);
        return;
    }
    for (int i = 0; i < 6; i++) {
        mpf_mul(j->t, j->x, j->x);
        mpf_mul(j->u, j->y, j->y);
        mpf_add(j->t, j->t, j->u);
        mpf_sqrt(j->t, j->t);
        mpf_add(j->x, j->x, j->t);
    }
    mpf_div(j->t, j->y, j->x);
    mpf_mul(j->x, j->t, j->t);
    mpf_set(j->y, j->t);
    for (unsigned long k = 3; k < 2 * BITS / 5; k += 2) {
        mpf_mul(j->t, j->t, j->x);
        mpf_div_ui(j->u, j->t, k);
        if (k % 4 == 3)
            mpf_sub(j->y, j->y, j->u);
        else
            mpf_add(j->y, j->y, j->u);
    }
    mpf_mul_2exp(j->y, j->y, 6);
    mpf_add(j->angle, j->angle, j->y);
}

static void set_dot(judge *j, mpf_t out, int a, int b)
{
    mpf_set_ui(out, 0);
    for (int k = 0; k < 3; k++) {
        mpf_mul(j->t, j->v[a][k], j->v[b][k]);
        mpf_add(out, out, j->t);
    }
}

/* Adds the half angle of a triangle at p, which is not on it. */
static void add_face(judge *j, const double p[3], double t[3][3])
{
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            mpf_set_d(j->v[i][k], t[i][k]);
            mpf_set_d(j->t, p[k]);
            mpf_sub(j->v[i][k], j->v[i][k], j->t);
        }
        set_dot(j, j->u, i, i);
        mpf_sqrt(j->length[i], j->u);
    }
    mpf_mul(j->x, j->length[0], j->length[1]);
    mpf_mul(j->x, j->x, j->length[2]);
    mpf_set_ui(j->y, 0);
    for (int i = 0; i < 3; i++) {
        int u = (i + 1) % 3, v = (i + 2) % 3;
        set_dot(j, j->u, i, u);
        mpf_mul(j->u, j->u, j->length[v]);
        mpf_add(j->x, j->x, j->u);
        mpf_mul(j->t, j->v[1][u], j->v[2][v]);
        mpf_mul(j->u, j->v[1][v], j->v[2][u]);
        mpf_sub(j->t, j->t, j->u);
        mpf_mul(j->t, j->t, j->v[0][i]);
        mpf_add(j->y, j->y, j->t);
    }
    add_argument(j);
}

/* Sets `angle` to the winding number of the mesh. Returns false if p is on a face. */
static bool judge_winding(judge *j, const ebpo_mesh *mesh, const double p[3])
{
    mpf_set_ui(j->angle, 0);
    for (uint64_t f = 0; f < mesh->face_count; f++) {
        double t[3][3];
        for (int i = 0; i < 3; i++)
            ebpo_mesh_position(mesh, mesh->faces[3 * f + (uint64_t)i], t[i]);
        if (ebpo_point_on_triangle(p, t[0], t[1], t[2]))
            return false;
        if (!ebpo_zero_area(t[0], t[1], t[2]))
            add_face(j, p, t);
    }
    mpf_div(j->angle, j->angle, j->pi);
    mpf_div_ui(j->angle, j->angle, 2);
    return true;
}

/* Returns the sign of the winding number less `boundary`; 0 within 2^-300. */
static int judge_sign(judge *j, double boundary)
{
    mpf_set_d(j->t, boundary);
    mpf_sub(j->t, j->angle, j->t);
    mpf_mul_2exp(j->u, j->t, 300);
    mpf_abs(j->u, j->u);
    return mpf_cmp_ui(j->u, 1) < 0 ? 0 : mpf_sgn(j->t);
}

/* Returns 1 or 0 for inside or outside, 2 for a tie. */
static int judge_rule(judge *j, const ebpo_cap_rule *rule)
{
    if (rule->rule == EBPO_RULE_POSITIVE) {
        int s = judge_sign(j, rule->threshold);
        return s == 0 ? 2 : s > 0;
    }
    double even = rule->rule == EBPO_RULE_EVENODD ? 2 * nearbyint(mpf_get_d(j->angle) / 2) : 0;
    int high = judge_sign(j, even + rule->threshold), low = judge_sign(j, even - rule->threshold);
    return high == 0 || low == 0 ? 2 : high > 0 || low < 0;
}

/* ---- models ---- */

typedef struct holed {
    ebpo_mesh mesh;
    ebpo_border border;
    ebpo_cap_tree tree;
} holed;

static void holed_make(holed *h, ebpo_mesh mesh)
{
    ebpo_error error = EBPO_ERROR_INIT;
    h->mesh = mesh;
    ck_assert_msg(ebpo_border_find(&h->border, &h->mesh, 1, &error) == EBPO_OK, "%s",
                  error.message);
    uint64_t count = h->border.loop_count ? h->border.first[h->border.loop_count] : 0;
    double(*position)[3] = malloc((count + 1) * sizeof *position);
    for (uint64_t i = 0; i < count; i++)
        ebpo_mesh_position(&h->mesh, h->border.vertex[i], position[i]);
    ck_assert_msg(ebpo_cap_tree_make(&h->tree, position, h->border.first, h->border.weight,
                                     h->border.loop_count, &error) == EBPO_OK,
                  "%s", error.message);
    h->tree.second_order = true;
    ck_assert_uint_eq(h->tree.triangle_count, ebpo_border_cap_count(&h->border));
}

static void holed_free(holed *h)
{
    ebpo_cap_tree_free(&h->tree);
    ebpo_border_free(&h->border);
    ebpo_mesh_free(&h->mesh);
}

/* Returns the winding number of mesh and caps at p, shifted: crossings of a segment from far
 * outside. */
static int32_t winding_with_caps(const holed *h, const double p[3])
{
    const double from[3] = { -1e9, p[1], p[2] };
    int32_t sum = 0;
    for (uint64_t f = 0; f < h->mesh.face_count; f++) {
        double t[3][3];
        for (int i = 0; i < 3; i++)
            ebpo_mesh_position(&h->mesh, h->mesh.faces[3 * f + (uint64_t)i], t[i]);
        sum += ebpo_axis_crossing(from, p[0], 0, t[0], t[1], t[2]);
    }
    for (uint64_t l = 0; l < h->border.loop_count; l++) {
        const double(*at)[3] = (const double(*)[3])h->tree.position + h->border.first[l];
        uint64_t n = h->border.first[l + 1] - h->border.first[l], t[3];
        for (uint64_t c = 0; c < ebpo_cap_count(0, n - 1); c++) {
            ebpo_cap_triangle(0, n - 1, c, t);
            sum -= (int32_t)h->border.weight[l] *
                   ebpo_axis_crossing(from, p[0], 0, at[t[0]], at[t[1]], at[t[2]]);
        }
    }
    return sum;
}

typedef struct tally {
    uint64_t points, ties, on_faces, exact;
} tally;

static void check_contains(judge *j, ebpo_bounded b, const char *what)
{
    mpf_set_d(j->t, b.middle);
    mpf_sub(j->t, j->angle, j->t);
    ck_assert_msg(fabs(mpf_get_d(j->t)) <= b.error + 1e-100,
                  "%s: %.17g is not within %.17g of %.17g", what, mpf_get_d(j->angle), b.error,
                  b.middle);
}

/* Checks decision and bounds at a point. */
static void check_point(judge *j, const holed *h, const double p[3], const ebpo_cap_rule *rule,
                        tally *sums)
{
    sums->points++;
    if (!judge_winding(j, &h->mesh, p)) {
        sums->on_faces++;
        return;
    }
    int32_t k = winding_with_caps(h, p);
    int expected = judge_rule(j, rule);
    ebpo_cap_decision d = ebpo_cap_decide(&h->tree, p, k, rule);
    ck_assert_msg((expected == 2) == d.tie && (expected == 1) == d.inside,
                  "(%a %a %a): inside %d, tie %d, expected %d; w %.17g, winding with caps %d", p[0],
                  p[1], p[2], d.inside, d.tie, expected, mpf_get_d(j->angle), (int)k);
    sums->ties += d.tie;
    check_contains(j, d.winding, "decision");
    ebpo_bounded w = ebpo_cap_winding(&h->tree, p, k, 1e-9);
    check_contains(j, w, "winding");
}

static double integer_coordinate(uint64_t *state, unsigned most, unsigned parts)
{
    return (double)(ebpo_test_random(state) % (most * parts + 1)) / parts;
}

/* Chooses a point: random, of a grid, on a cap, on a chord, or next to one of these; `least` is the
 * exponent of neighbours of 0. */
static void choose_point(uint64_t *state, const holed *h, int least, double p[3])
{
    uint64_t kind = ebpo_test_random(state) % 8;
    for (int k = 0; k < 3; k++)
        p[k] = kind < 2 ? 6 * ebpo_test_random_unit(state) - 1 : integer_coordinate(state, 4, 2);
    if (kind < 4 || h->tree.triangle_count == 0)
        return;
    const ebpo_cap_node *n;
    do
        n = &h->tree.node[ebpo_test_random(state) % h->tree.node_count];
    while (n->weight == 0);
    const double *a = h->tree.position[n->from], *b = h->tree.position[n->to],
                 *m = h->tree.position[ebpo_cap_middle(n->from, n->to)];
    double s = (double)(1 + ebpo_test_random(state) % 3) / 4,
           t = kind == 4 ? 0.25 * (1 - s) : 0; /* on the cap, else on its chord: exact */
    for (int k = 0; k < 3; k++)
        p[k] = a[k] + s * (b[k] - a[k]) + t * (m[k] - a[k]);
    if (kind >= 6)
        for (int k = 0; k < 3; k++) {
            double to = (double)(ebpo_test_random(state) % 3) * 100 - 100;
            p[k] = p[k] == 0 ? ldexp(to, least) : nextafter(p[k], to);
        }
    if (kind == 7)
        p[ebpo_test_random(state) % 3] += ldexp(1, -(int)(ebpo_test_random(state) % 60));
}

static ebpo_cap_rule random_rule(uint64_t *state)
{
    static const double thresholds[] = { 0.5, 0.5, 0.5, 0.25, 0.125, 0.3, 0.875 };
    return (ebpo_cap_rule){ (uint8_t)(ebpo_test_random(state) % 3),
                            thresholds[ebpo_test_random(state) % 7] };
}

static void check_model(ebpo_mesh mesh, uint64_t points, uint64_t seed, tally *sums)
{
    holed h;
    judge j;
    uint64_t state = seed;
    judge_begin(&j);
    holed_make(&h, mesh);
    for (uint64_t i = 0; i < points; i++) {
        double p[3];
        ebpo_cap_rule rule = random_rule(&state);
        choose_point(&state, &h, -100, p);
        check_point(&j, &h, p, &rule, sums);
    }
    holed_free(&h);
    judge_end(&j);
}

static ebpo_mesh half_sphere(void)
{
    const double centre[3] = { 2, 2, 2 };
    ebpo_mesh m = ebpo_test_sphere(centre, 2, 1);
    uint64_t kept = 0;
    for (uint64_t f = 0; f < m.face_count; f++) {
        double t[3][3], sum = 0;
        for (int i = 0; i < 3; i++) {
            ebpo_mesh_position(&m, m.faces[3 * f + (uint64_t)i], t[i]);
            sum += t[i][2];
        }
        if (sum > 6)
            memmove(m.faces + 3 * kept++, m.faces + 3 * f, 3 * sizeof *m.faces);
    }
    m.face_count = kept;
    return m;
}

/* Three faces of the cube 0 .. 4 around the corner at the origin: at its centre w is 1/2. */
static ebpo_mesh three_cube_faces(void)
{
    const double low[3] = { 0, 0, 0 }, high[3] = { 4, 4, 4 };
    ebpo_mesh m = ebpo_test_box(low, high, 1);
    uint64_t kept = 0;
    for (uint64_t f = 0; f < m.face_count; f++)
        for (int k = 0; k < 3; k++) {
            double most = 0;
            for (int i = 0; i < 3; i++) {
                double t[3];
                ebpo_mesh_position(&m, m.faces[3 * f + (uint64_t)i], t);
                most = fmax(most, t[k]);
            }
            if (most == 0)
                memmove(m.faces + 3 * kept++, m.faces + 3 * f, 3 * sizeof *m.faces);
        }
    m.face_count = kept;
    return m;
}

/* Triangles over few vertices with small integer coordinates: degenerate in every way. */
static ebpo_mesh integer_soup(uint64_t *state)
{
    ebpo_mesh m = { 0 };
    uint32_t vertices = 3 + (uint32_t)(ebpo_test_random(state) % 9),
             faces = 1 + (uint32_t)(ebpo_test_random(state) % 9);
    for (uint32_t v = 0; v < vertices; v++)
        ebpo_test_append_vertex(&m, integer_coordinate(state, 4, 1),
                                integer_coordinate(state, 4, 1), integer_coordinate(state, 4, 1));
    for (uint32_t f = 0; f < faces; f++) {
        uint32_t v[3];
        for (int k = 0; k < 3; k++)
            v[k] = (uint32_t)(ebpo_test_random(state) % vertices);
        ebpo_test_append_face(&m, v[0], v[1], v[2]);
    }
    return m;
}

START_TEST(test_small_models_agree_with_sums_in_400_bits)
{
    tally sums = { 0 };
    uint64_t points = ebpo_test_scaled(4000);
    check_model(ebpo_test_sheet(4, 2), points, 1, &sums);
    check_model(ebpo_test_band(5, true), points, 2, &sums);
    check_model(half_sphere(), points, 3, &sums);
    check_model(three_cube_faces(), points, 4, &sums);
    check_model(ebpo_test_tetrahedron(4), points, 5, &sums);
    printf("%llu points: %llu ties, %llu on faces\n", (unsigned long long)sums.points,
           (unsigned long long)sums.ties, (unsigned long long)sums.on_faces);
    ck_assert_uint_gt(sums.ties, points / 1000);
}
END_TEST

START_TEST(test_soups_agree_with_sums_in_400_bits)
{
    tally sums = { 0 };
    uint64_t state = 11;
    for (uint64_t i = 0; i < ebpo_test_scaled(400); i++)
        check_model(integer_soup(&state), 100, i, &sums);
    printf("%llu points: %llu ties, %llu on faces\n", (unsigned long long)sums.points,
           (unsigned long long)sums.ties, (unsigned long long)sums.on_faces);
}
END_TEST

START_TEST(test_centre_of_three_cube_faces_is_a_tie)
{
    const double p[3] = { 2, 2, 2 };
    const ebpo_cap_rule rule = { EBPO_RULE_NONZERO, 0.5 };
    holed h;
    holed_make(&h, three_cube_faces());
    ebpo_cap_decision d = ebpo_cap_decide(&h.tree, p, winding_with_caps(&h, p), &rule);
    ck_assert(d.tie && !d.inside);
    for (int k = 0; k < 3; k++)
        for (int side = -1; side <= 1; side += 2) {
            double q[3] = { 2, 2, 2 };
            q[k] = nextafter(2, 2 + side);
            d = ebpo_cap_decide(&h.tree, q, winding_with_caps(&h, q), &rule);
            ck_assert(!d.tie && d.inside == (side < 0));
        }
    holed_free(&h);
}
END_TEST

/* Checks the bounds of a box at its point p: `far`, with the bounds of entries that have a small
 * error in the box, and the other entries. */
static void check_slopes(judge *j, const holed *h, ebpo_cap_front *front, const ebpo_cap_box *box,
                         const ebpo_cap_field *far, const uint32_t *entry, uint64_t count,
                         const double p[3])
{
    const ebpo_cap_box point = ebpo_cap_point(p);
    uint32_t *others = malloc((count + 1) * sizeof *others);
    uint64_t other_count = 0;
    ebpo_cap_field sum = *far;
    for (uint64_t i = 0; i < count; i++)
        if (!ebpo_cap_field_add(&sum, &h->tree, box, entry[i], 0.25))
            others[other_count++] = entry[i];
    for (int k = 0; k < 3; k++)
        sum.at_centre.middle += sum.slope[k] * (p[k] - box->centre[k]);
    sum.at_centre.error += 1e-14 * (1 + fabs(sum.at_centre.middle));
    ebpo_cap_front_begin(front, &h->tree, &point, others, other_count, &sum);
    do
        check_contains(j, ebpo_cap_front_sum(front).all, "point of a box");
    while (ebpo_cap_front_refine(front));
    free(others);
}

/* Checks the bounds of boxes around p, each in the one before, against the value at p. */
static void check_boxes(judge *j, const holed *h, const double q[3], const double half[3],
                        const double p[3])
{
    ebpo_cap_lists lists = { NULL, NULL, 0, 0 };
    ebpo_cap_front *front = malloc(sizeof *front);
    ebpo_cap_field far = { .at_centre = { 0, 0 } };
    uint64_t begin = 0, end = h->tree.node_count > 0;
    double low[3], high[3];
    lists.entry = calloc(lists.capacity = 1, sizeof *lists.entry);
    lists.count = end;
    for (int k = 0; k < 3; k++) {
        low[k] = q[k] - half[k];
        high[k] = q[k] + half[k];
    }
    for (int step = 0; step < 8; step++) {
        const ebpo_cap_box box = ebpo_cap_box_of(low, high);
        ck_assert_int_eq(ebpo_cap_lists_narrow(&lists, &h->tree, &box, begin, end, UINT64_MAX,
                                               &far),
                         EBPO_OK);
        begin = end;
        end = lists.count;
        ebpo_cap_front_begin(front, &h->tree, &box, lists.entry + begin, end - begin, &far);
        do
            check_contains(j, ebpo_cap_front_sum(front).all, "list of a box");
        while (ebpo_cap_front_refine(front));
        check_slopes(j, h, front, &box, &far, lists.entry + begin, end - begin, p);
        ebpo_cap_front_begin_all(front, &h->tree, &box);
        do
            check_contains(j, ebpo_cap_front_sum(front).all, "box");
        while (ebpo_cap_front_refine(front));
        ck_assert(!ebpo_cap_front_sum(front).apart || !ebpo_caps_near(&h->tree, low, high) ||
                  front->stuck >= 3);
        for (int k = 0; k < 3; k++) {
            low[k] = low[k] / 2 + p[k] / 2;
            high[k] = high[k] / 2 + p[k] / 2;
        }
    }
    free(front);
    free(lists.entry);
}

/* Returns true if a face may touch the box. */
static bool faces_near(const holed *h, const double q[3], const double half[3])
{
    for (uint64_t f = 0; f < h->mesh.face_count; f++) {
        bool apart = false;
        double t[3][3];
        for (int i = 0; i < 3; i++)
            ebpo_mesh_position(&h->mesh, h->mesh.faces[3 * f + (uint64_t)i], t[i]);
        for (int k = 0; k < 3; k++)
            apart = apart || fmin(fmin(t[0][k], t[1][k]), t[2][k]) > q[k] + half[k] ||
                    fmax(fmax(t[0][k], t[1][k]), t[2][k]) < q[k] - half[k];
        if (!apart)
            return true;
    }
    return false;
}

/* Checks the bound of the difference of w_S between q and p, if no face touches the box. Returns
 * the bound, or INFINITY. */
static double check_variation(judge *j, const holed *h, const double q[3], const double half[3],
                              const double p[3])
{
    const double low[3] = { q[0] - half[0], q[1] - half[1], q[2] - half[2] },
                 high[3] = { q[0] + half[0], q[1] + half[1], q[2] + half[2] };
    const ebpo_cap_box box = ebpo_cap_box_of(low, high);
    double bound = ebpo_cap_variation(&h->tree, &box, NULL, 0, INFINITY), at_p;
    if (faces_near(h, q, half) || !judge_winding(j, &h->mesh, p))
        return INFINITY;
    at_p = mpf_get_d(j->angle);
    ck_assert(judge_winding(j, &h->mesh, box.centre));
    double varied = 2 * EBPO_PI_LOW * fabs(mpf_get_d(j->angle) - at_p);
    ck_assert_msg(varied <= bound + 1e-12, "varies by %g, beyond %g", varied, bound);
    return bound;
}

START_TEST(test_variation_in_boxes_is_bounded)
{
    uint64_t state = 6, bounded = 0;
    judge j;
    judge_begin(&j);
    for (uint64_t i = 0; i < ebpo_test_scaled(200); i++) {
        holed h;
        holed_make(&h, i % 2 ? integer_soup(&state) : half_sphere());
        for (int c = 0; c < 40; c++) {
            double q[3], p[3], half[3], size = ldexp(1, (int)(c % 6) - 4);
            for (int k = 0; k < 3; k++) {
                q[k] = 8 * ebpo_test_random_unit(&state) - 2;
                half[k] = size * ebpo_test_random_unit(&state);
                p[k] = q[k] + half[k] * (2 * ebpo_test_random_unit(&state) - 1);
            }
            bounded += check_variation(&j, &h, q, half, p) < 3;
        }
        holed_free(&h);
    }
    ck_assert_uint_gt(bounded, 0);
    judge_end(&j);
}
END_TEST

/* Bounds for a box of points contain the values at its points, at every step. */
START_TEST(test_bounds_of_boxes_contain_their_points)
{
    uint64_t state = 5;
    judge j;
    judge_begin(&j);
    for (uint64_t i = 0; i < ebpo_test_scaled(60); i++) {
        holed h;
        holed_make(&h, i % 2 ? integer_soup(&state) : half_sphere());
        h.tree.second_order = i % 3 < 2;
        for (int c = 0; c < 40; c++) {
            double q[3], p[3], half[3], size = ldexp(1, (int)(c % 6) - 4);
            for (int k = 0; k < 3; k++) {
                q[k] = 12 * ebpo_test_random_unit(&state) - 4;
                half[k] = size * ebpo_test_random_unit(&state);
                p[k] = q[k] + half[k] * (2 * ebpo_test_random_unit(&state) - 1);
            }
            if (!judge_winding(&j, &h.mesh, p))
                continue;
            mpf_set_si(j.t, winding_with_caps(&h, p));
            mpf_sub(j.angle, j.angle, j.t);
            mpf_mul(j.angle, j.angle, j.pi);
            mpf_mul_ui(j.angle, j.angle, 2);
            for (double tolerance = 4; tolerance > 1e-9; tolerance /= 16)
                check_contains(&j, ebpo_cap_tree_bound(&h.tree, p, tolerance), "point");
            check_boxes(&j, &h, q, half, p);
        }
        holed_free(&h);
    }
    judge_end(&j);
}
END_TEST

TEST_SUITE(cap_winding)
{
    Suite *suite = suite_create("cap_winding");
    TCase *all = tcase_create("caps");
    tcase_set_timeout(all, 600);
    tcase_add_test(all, test_centre_of_three_cube_faces_is_a_tie);
    tcase_add_test(all, test_small_models_agree_with_sums_in_400_bits);
    tcase_add_test(all, test_soups_agree_with_sums_in_400_bits);
    tcase_add_test(all, test_bounds_of_boxes_contain_their_points);
    tcase_add_test(all, test_variation_in_boxes_is_bounded);
    suite_add_tcase(suite, all);
    return suite;
}
