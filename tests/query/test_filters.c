/* Rational arithmetic never contradicts single-precision filters: bounds of a point's distance, and
 * the turns of a face around a line along an axis. docs/develop/bounds.md has the proofs. */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "check_main.h"
#include "exact_reference.h"
#include "filter_faces.h"
#include "oracle.h"
#include "query_support.h"

#if !defined(HAVE_AVX2)
#define face_filters_avx2 face_filters_base
#endif

enum { CORNERS = 3 * EBPO_BLOCK };

/* A block whose faces share no vertices: corner i of lane l is vertex 8 * i + l. */
typedef struct block {
    ebpo_accel s;
    union {
        ebpo_meshlet head;
        char bytes[EBPO_MESHLET_WIDE + CORNERS * 3 * sizeof(double)];
    } record;
    double corner[CORNERS][3];
    double unit; /* unit of the frame in model coordinates: a power of two */
    double centre[3];
} block;

static void close_block(block *b)
{
    b->record.head = (ebpo_meshlet){ .faces = EBPO_BLOCK, .vertices = CORNERS };
    float *narrow = (float *)(void *)(&b->record.head + 1);
    double *broad = (double *)(void *)(b->record.bytes + EBPO_MESHLET_WIDE);
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < CORNERS; i++) {
            if (b->s.wide)
                memcpy(&broad[k * CORNERS + i], &b->corner[i][k], sizeof(double));
            else
                narrow[k * CORNERS + i] = (float)b->corner[i][k];
        }
    b->s.meshlets = b->record.bytes;
    b->s.scale = 1 / b->unit;
    memcpy(b->s.centre, b->centre, sizeof b->centre);
}

static double power(uint64_t *state, int least, int most)
{
    return ldexp(1, (int)reference_integer(state, least, most));
}

/* Makes faces of all sizes and shapes: slivers, needles, faces without area, faces on a grid. */
static void make_faces(block *b, uint64_t *state)
{
    memset(b, 0, sizeof *b);
    b->s.wide = reference_integer(state, 0, 3) == 0;
    b->unit = power(state, -20, 20);
    double far = reference_integer(state, 0, 1) ? 0 : power(state, 0, 12);
    for (int k = 0; k < 3; k++)
        b->centre[k] = b->unit * far * reference_uniform(state);
    for (int lane = 0; lane < EBPO_BLOCK; lane++) {
        double size = power(state, -24, 0), thin = power(state, -24, 0);
        int kind = (int)reference_integer(state, 0, 4);
        for (int k = 0; k < 3; k++) {
            double a = reference_uniform(state), e = size * reference_uniform(state),
                   f = size * reference_uniform(state), share = kind == 1 ? 0.5 : 1.5;
            double other = kind == 0 ? f : share * e + thin * f;
            other = kind == 2 ? 0 : other;
            double x[3] = { a, a + e, a + other };
            for (int i = 0; i < 3; i++) {
                double at = kind == 4 ? rint(4 * x[i]) / 4 : x[i];
                at = b->centre[k] + b->unit * at;
                b->corner[EBPO_BLOCK * i + lane][k] = b->s.wide ? at : (double)(float)at;
            }
        }
    }
    close_block(b);
}

/* Makes a point near a face, or anywhere in the range of the single-precision search; most points
 * are on and above faces. */
static void make_point(const block *b, uint64_t *state, double p[3])
{
    unsigned lane = (unsigned)reference_integer(state, 0, EBPO_BLOCK - 1);
    double u = reference_integer(state, 0, 2) / 2.0,
           v = reference_integer(state, 0, 1) ? (1 - u) / 2 : 0,
           away = reference_integer(state, 0, 3) ? power(state, -30, 4) : 0;
    for (int k = 0; k < 3; k++) {
        double a = b->corner[lane][k], e = b->corner[EBPO_BLOCK + lane][k] - a,
               f = b->corner[2 * EBPO_BLOCK + lane][k] - a;
        p[k] = a + u * e + v * f + b->unit * away * reference_uniform(state);
    }
}

/* Returns the probe that the search would use. */
static ebpo_probe probe_of(const block *b, const double p[3])
{
    ebpo_probe probe = { .scale = (float)b->s.scale, .scale64 = b->s.scale };
    for (int k = 0; k < 3; k++) {
        probe.p[k] = p[k];
        probe.high[k] = (float)p[k];
        probe.low[k] = (float)(p[k] - (double)probe.high[k]);
    }
    return probe;
}

static oracle *oracle_of(const block *b)
{
    double xyz[CORNERS][3];
    uint32_t faces[EBPO_BLOCK][3];
    memcpy(xyz, b->corner, sizeof xyz);
    for (uint32_t lane = 0; lane < EBPO_BLOCK; lane++)
        for (uint32_t i = 0; i < 3; i++)
            faces[lane][i] = EBPO_BLOCK * i + lane;
    ebpo_mesh mesh = { .vertex_count = CORNERS,
                       .face_count = EBPO_BLOCK,
                       .xyz64 = &xyz[0][0],
                       .faces = &faces[0][0] };
    return oracle_make(&mesh);
}

static void check_point(const block *b, oracle *o, const face_filters *filters, const double p[3],
                        uint64_t number)
{
    float low[EBPO_BLOCK], high[EBPO_BLOCK];
    ebpo_probe probe = probe_of(b, p);
    filters->near(&b->s, 0, &probe, low, high);
    for (unsigned lane = 0; lane < EBPO_BLOCK; lane++) {
        double d = oracle_face_distance(o, p, lane) * b->s.scale;
        ck_assert_msg((double)low[lane] <= d && d <= (double)high[lane],
                      "block %" PRIu64 ", lane %u, %s: %.17g is not in %.9g .. %.9g", number, lane,
                      b->s.wide ? "doubles" : "floats", d, (double)low[lane], (double)high[lane]);
    }
}

START_TEST(test_filter_distances_are_within_bounds)
{
    uint64_t state = 15;
    for (uint64_t i = 0; i < query_scaled(20000); i++) {
        block b;
        double p[3];
        make_faces(&b, &state);
        oracle *o = oracle_of(&b);
        for (int j = 0; j < 2; j++) {
            make_point(&b, &state, p);
            check_point(&b, o, &face_filters_base, p, i);
            check_point(&b, o, &face_filters_avx2, p, i);
        }
        oracle_free(o);
    }
}
END_TEST

/* --- turns --- */

/* Makes faces within the box of a model, whose extent determines the allowed error, and a line
 * through a corner, close to an edge, or at a random position. */
static void make_line(block *b, ebpo_axis_segment *g, uint64_t *state)
{
    double p[3], reach = 0, low[3], high[3], size = 0;
    do
        make_faces(b, &state[0]);
    while (b->s.wide);
    make_point(b, state, p);
    for (int k = 0; k < 3; k++) {
        low[k] = high[k] = p[k];
        for (int i = 0; i < CORNERS; i++) {
            low[k] = fmin(low[k], b->corner[i][k]);
            high[k] = fmax(high[k], b->corner[i][k]);
        }
        reach = fmax(reach, fmax(fabs(low[k]), fabs(high[k])));
        size = fmax(size, high[k] - low[k]);
    }
    b->s.turn_error_constant = (float)(0x1p-43 * reach * size);
    *g =
        (ebpo_axis_segment){ .axis = (int)reference_integer(state, 0, 2), .reach = EBPO_REACH_ALL };
    memcpy(g->from, p, sizeof p);
    g->to = high[g->axis];
}

/* Returns the exact turns at a face's corners as bits: 1 when some turn left, 2 when some turn
 * right, 4 when some do neither. */
static unsigned exact_turns(const block *b, const ebpo_axis_segment *g, unsigned lane)
{
    int u = g->axis == 2 ? 0 : g->axis + 1, v = g->axis == 0 ? 2 : g->axis - 1;
    unsigned bits = 0;
    for (unsigned i = 0; i < 3; i++) {
        const double *x = b->corner[EBPO_BLOCK * i + lane],
                     *y = b->corner[EBPO_BLOCK * ((i + 1) % 3) + lane];
        double at[6] = { g->from[u], g->from[v], x[u], x[v], y[u], y[v] };
        int sign = reference_orient2d(at);
        bits |= sign > 0 ? 1 : sign < 0 ? 2 : 4;
    }
    return bits;
}

static void check_turns(const block *b, const ebpo_axis_segment *g, const face_filters *filters,
                        unsigned *certain)
{
    unsigned left, right, open;
    filters->turns(&b->s, 0, g, &left, &right, &open);
    for (unsigned lane = 0; lane < EBPO_BLOCK; lane++) {
        unsigned exact = exact_turns(b, g, lane), bit = 1u << lane;
        if (left & bit)
            ck_assert_uint_eq(exact, 1);
        else if (right & bit)
            ck_assert_uint_eq(exact, 2);
        else if (!(open & bit))
            ck_assert_uint_eq(exact & 3, 3);
        *certain += !(open & bit);
    }
}

START_TEST(test_filter_orientations_are_correct)
{
    uint64_t state = 16, count = query_scaled(40000);
    unsigned certain = 0;
    for (uint64_t i = 0; i < count; i++) {
        block b;
        ebpo_axis_segment g;
        make_line(&b, &g, &state);
        check_turns(&b, &g, &face_filters_base, &certain);
        check_turns(&b, &g, &face_filters_avx2, &certain);
    }
    /* of 16 decisions in each round, more than one must be certain on average, because a filter
     * that decides nothing is useless */
    ck_assert_uint_gt(certain, count);
}
END_TEST

Suite *test_suite(void)
{
    Suite *suite = suite_create("filters");
    TCase *filters = tcase_create("filters");
    tcase_set_timeout(filters, 600);
    tcase_add_test(filters, test_filter_distances_are_within_bounds);
    tcase_add_test(filters, test_filter_orientations_are_correct);
    suite_add_tcase(suite, filters);
    return suite;
}
