/* Tests maps of distance against closed forms, single queries, simple sums and dense samples. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/colours.h>
#include <ebpo/ebpo.h>
#include <ebpo/map.h>

#include "check_main.h"
#include "model_file.h"
#include "scratch.h"
#include "solids.h"

typedef struct opened {
    ebpo_file *file;
    ebpo_model *model;
} opened;

/* cut_level -1: the whole model is in memory. */
static opened open_model(ebpo_mesh mesh, int cut_level)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_tree tree = model_build_parts(mesh, 8, EBPO_PART_PLANES | EBPO_PART_MESH);
    opened o = { NULL, NULL };
    model_write(&tree, scratch("m.ebpo.h5"), NULL);
    o.file = model_open(scratch("m.ebpo.h5"));
    options.cut_level = cut_level;
    model_must(ebpo_model_new(o.file, &options, &o.model, &error), "opening", &error);
    return o;
}

static void close_model(opened *o)
{
    ebpo_model_free(o->model);
    ebpo_close(o->file);
}

/* --- lattices --- */

typedef struct kept {
    double *values;
    const ebpo_lattice *lattice;
    uint64_t layers;
} kept;

static ebpo_status keep(void *user, const double *values, uint64_t first, uint64_t layers,
                        ebpo_error *error)
{
    kept *k = user;
    uint64_t plane = k->lattice->count[0] * k->lattice->count[1];
    (void)error;
    ck_assert_uint_eq(first, k->layers);
    memcpy(k->values + first * plane, values, layers * plane * sizeof *values);
    k->layers += layers;
    return EBPO_OK;
}

static double *map_of(ebpo_model *model, const ebpo_lattice *l, const ebpo_map_options *options)
{
    ebpo_error error = EBPO_ERROR_INIT;
    kept k = { malloc(l->count[0] * l->count[1] * l->count[2] * sizeof *k.values), l, 0 };
    model_must(ebpo_map_lattice(model, l, options, keep, &k, &error), "mapping", &error);
    ck_assert_uint_eq(k.layers, l->count[2]);
    return k.values;
}

/* Returns the distance of a box by the closed form. */
static double box_distance(const double low[3], const double high[3], const double p[3])
{
    double outside[3], inside = -INFINITY;
    for (int c = 0; c < 3; c++) {
        double beyond = fmax(low[c] - p[c], p[c] - high[c]);
        outside[c] = fmax(beyond, 0);
        inside = fmax(inside, beyond);
    }
    return inside > 0 ? hypot(hypot(outside[0], outside[1]), outside[2]) : inside;
}

START_TEST(test_map_of_box_matches_formula)
{
    const double low[3] = { -1, 0, 2 }, high[3] = { 1, 3, 2.5 };
    const double around[2][3] = { { -2.1, -1.3, 1.1 }, { 2.3, 4.2, 3.3 } };
    const uint64_t count[3] = { 37, 21, 50 }; /* incomplete bricks on all axes */
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_lattice l;
    opened o = open_model(ebpo_test_box(low, high, 3), -1);
    model_must(ebpo_lattice_of_box(around[0], around[1], count, &l, &error), "lattice", &error);
    double *values = map_of(o.model, &l, NULL), *at = values;
    for (uint64_t k = 0; k < count[2]; k++)
        for (uint64_t j = 0; j < count[1]; j++)
            for (uint64_t i = 0; i < count[0]; i++) {
                double p[3] = { l.origin[0] + (double)i * l.step[0][0],
                                l.origin[1] + (double)j * l.step[1][1],
                                l.origin[2] + (double)k * l.step[2][2] };
                ck_assert_double_eq_tol(*at++, box_distance(low, high, p), 1e-14);
            }
    free(values);
    close_model(&o);
}
END_TEST

/* On a skewed lattice, in two loading modes, on one thread and many, each value equals a single
 * query. */
START_TEST(test_map_values_match_single_queries)
{
    const ebpo_lattice l = { { -3, -3, -1.5 },
                             { { 0.31, 0.05, 0 }, { 0, 0.41, 0.02 }, { 0.01, 0, 0.19 } },
                             { 19, 15, 17 } };
    uint64_t count = l.count[0] * l.count[1] * l.count[2];
    ebpo_error error = EBPO_ERROR_INIT;
    for (int cut = -1; cut < 3; cut += 3) {
        opened o = open_model(ebpo_test_torus(2, 1, 24, 16), cut);
        ebpo_map_options options = EBPO_MAP_OPTIONS_INIT;
        ebpo_distance_options single = EBPO_DISTANCE_OPTIONS_INIT;
        ebpo_context *context;
        options.max_distance = single.max_distance = 0.9;
        options.threads = 1;
        double *one = map_of(o.model, &l, &options);
        options.threads = 5;
        double *many = map_of(o.model, &l, &options);
        ck_assert_mem_eq(one, many, count * sizeof *one);
        model_must(ebpo_context_new(o.model, &context, &error), "context", &error);
        for (uint64_t i = 0; i < count; i++) {
            ebpo_distance_result r;
            double p[3];
            uint64_t at[3] = { i % l.count[0], i / l.count[0] % l.count[1],
                               i / l.count[0] / l.count[1] };
            for (int c = 0; c < 3; c++)
                p[c] = l.origin[c] + (double)at[0] * l.step[0][c] + (double)at[1] * l.step[1][c] +
                       (double)at[2] * l.step[2][c];
            model_must(ebpo_distance(context, p, &single, &r, &error), "asking", &error);
            ck_assert_mem_eq(&one[i], &r.distance, sizeof *one);
        }
        free(one);
        free(many);
        ebpo_context_free(context);
        close_model(&o);
    }
}
END_TEST

START_TEST(test_map_points_in_any_order)
{
    enum { COUNT = 10000 };
    static double points[COUNT][3], all[COUNT], none[COUNT];
    uint64_t state = 7;
    ebpo_error error = EBPO_ERROR_INIT;
    const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    for (int i = 0; i < COUNT; i++)
        for (int c = 0; c < 3; c++)
            points[i][c] = 3 * ebpo_test_random_unit(&state) - 1;
    for (int cut = -1; cut < 2; cut += 2) {
        opened o = open_model(ebpo_test_box(low, high, 4), cut);
        ebpo_map_options options = EBPO_MAP_OPTIONS_INIT;
        model_must(ebpo_map_points(o.model, points[0], COUNT, NULL, all, &error), "map", &error);
        options.unsigned_distance = true;
        model_must(ebpo_map_points(o.model, points[0], COUNT, &options, none, &error), "map",
                   &error);
        for (int i = 0; i < COUNT; i++) {
            ck_assert_double_eq_tol(all[i], box_distance(low, high, points[i]), 1e-14);
            ck_assert(none[i] == fabs(all[i]));
        }
        close_model(&o);
    }
}
END_TEST

START_TEST(test_map_invalid_input_is_refused)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_lattice l = { { 0, 0, 0 }, { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } }, { 1, 1, 1 } };
    ebpo_map_options options = EBPO_MAP_OPTIONS_INIT;
    ebpo_map_stats stats = EBPO_MAP_STATS_INIT;
    const double bad[3] = { 0, NAN, 0 }, low[3] = { 0, 0, 0 };
    const uint64_t none[3] = { 1, 0, 1 };
    double value;
    opened o = open_model(ebpo_test_tetrahedron(1), -1);
    kept k = { &value, &l, 0 };
    ck_assert_int_eq(ebpo_map_points(o.model, bad, 1, NULL, &value, &error), EBPO_E_ARGUMENT);
    options.max_distance = NAN;
    ck_assert_int_eq(ebpo_map_points(o.model, low, 1, &options, &value, &error), EBPO_E_ARGUMENT);
    ck_assert_int_eq(ebpo_lattice_of_box(low, low, l.count, &l, &error), EBPO_E_ARGUMENT);
    ck_assert_int_eq(ebpo_lattice_of_box(low, (const double[3]){ 1, 1, 1 }, none, &l, &error),
                     EBPO_E_ARGUMENT);
    l = (ebpo_lattice){ { 0, 0, 0 }, { { 1e308, 0, 0 } }, { 3, 1, 1 } };
    ck_assert_int_eq(ebpo_map_lattice(o.model, &l, NULL, keep, &k, &error), EBPO_E_ARGUMENT);
    l = (ebpo_lattice){ { 0, 0, 0 }, { { 0 } }, { UINT64_MAX, UINT64_MAX, 2 } };
    ck_assert_int_eq(ebpo_map_lattice(o.model, &l, NULL, keep, &k, &error), EBPO_E_ARGUMENT);
    /* the axes are not at right angles, which only NRRD supports; the failed attempt leaves no
     * file */
    l = (ebpo_lattice){ { 0, 0, 0 }, { { 1, 0, 0 }, { 1, 1, 0 }, { 0, 0, 1 } }, { 2, 2, 2 } };
    int before = scratch_entries();
    ck_assert_int_eq(ebpo_map_write(o.model, &l, scratch("f"), EBPO_MAP_VTKHDF, NULL, &stats,
                                    &error),
                     EBPO_E_ARGUMENT);
    ck_assert_int_eq(scratch_entries(), before);
    model_must(ebpo_map_write(o.model, &l, scratch("f"), EBPO_MAP_NRRD, NULL, &stats, &error),
               "writing", &error);
    ck_assert_uint_eq(stats.count, 8);
    close_model(&o);
}
END_TEST

/* --- statistics --- */

static int ascending(const void *x, const void *y)
{
    double a = *(const double *)x, b = *(const double *)y;
    return (a > b) - (a < b);
}

static void check_stats(const double *values, int count, double scale)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_map_stats s = EBPO_MAP_STATS_INIT;
    double *sorted = malloc((size_t)count * sizeof *sorted);
    long double sum = 0, size = 0, square = 0;
    for (int i = 0; i < count; i++) {
        long double v = (long double)values[i] / scale;
        sum += v;
        size += fabsl(v);
        square += v * v;
        sorted[i] = values[i];
    }
    model_must(ebpo_map_describe(values, (uint64_t)count, &s, &error), "describing", &error);
    qsort(sorted, (size_t)count, sizeof *sorted, ascending);
    ck_assert_uint_eq(s.count, (uint64_t)count);
    ck_assert(s.min == sorted[0] && s.max == sorted[count - 1]);
    ck_assert_double_eq_tol(s.mean / scale, (double)(sum / count), 1e-15);
    ck_assert_double_eq_tol(s.mean_unsigned / scale, (double)(size / count), 1e-15);
    ck_assert_double_eq_tol(s.rms / scale, (double)sqrtl(square / count), 1e-15);
    ck_assert_double_eq_tol(s.standard_deviation / scale,
                            (double)sqrtl(square / count - sum / count * (sum / count)), 1e-14);
    for (int i = 0; i < EBPO_MAP_PERCENTILES; i++) {
        /* checks the percentile: the least value that this percentage does not exceed */
        int below = 0;
        while ((below + 1) * 100 < ebpo_map_percent(i) * count)
            below++;
        ck_assert(s.percentile[i] == sorted[below]);
    }
    free(sorted);
}

START_TEST(test_map_statistics_match_reference)
{
    enum { COUNT = 999 };
    double values[COUNT];
    uint64_t state = 3;
    const double scales[] = { 1, 1e300, 1e-300, 0x1p-1030, 0x1p400, 0x1p-400 };
    for (int k = 0; k < 6; k++) {
        for (int i = 0; i < COUNT; i++)
            values[i] = scales[k] * (2 * ebpo_test_random_unit(&state) - 0.7);
        if (scales[k] > 0x1p-1000)
            check_stats(values, COUNT, scales[k]);
        check_stats(values, 1, scales[k]);
    }
    for (int i = 0; i < COUNT; i++)
        values[i] = 1e308; /* the sum exceeds the range of doubles */
    check_stats(values, COUNT, 1e308);
}
END_TEST

START_TEST(test_map_counts_values_beyond_limit)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_map_stats s = EBPO_MAP_STATS_INIT;
    const double values[] = { INFINITY, -1, 0, 2, INFINITY };
    model_must(ebpo_map_describe(values, 5, &s, &error), "describing", &error);
    ck_assert(s.count == 3 && s.beyond == 2 && s.inside == 1 && s.on == 1);
    ck_assert(s.min == -1 && s.max == 2 && s.farthest == 2 && s.percentile[3] == 0);
    model_must(ebpo_map_describe(values, 1, &s, &error), "describing", &error);
    ck_assert(s.count == 0 && isnan(s.mean) && isnan(s.min) && isnan(s.percentile[0]));
}
END_TEST

/* --- between vertices --- */

static double reach_of_samples(ebpo_model *model, const ebpo_mesh *m, int steps)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_map_stats s = EBPO_MAP_STATS_INIT;
    uint64_t count = 0, most = m->face_count * (uint64_t)(steps + 1) * (uint64_t)(steps + 2) / 2;
    double(*points)[3] = malloc(most * sizeof *points), *away = malloc(most * sizeof *away);
    for (uint64_t f = 0; f < m->face_count; f++)
        for (int i = 0; i <= steps; i++)
            for (int j = 0; i + j <= steps; j++, count++)
                for (uint64_t c = 0; c < 3; c++)
                    points[count][c] = (i * m->xyz64[3 * m->faces[3 * f] + c] +
                                        j * m->xyz64[3 * m->faces[3 * f + 1] + c] +
                                        (steps - i - j) * m->xyz64[3 * m->faces[3 * f + 2] + c]) /
                                       steps;
    model_must(ebpo_map_points(model, points[0], count, NULL, away, &error), "map", &error);
    model_must(ebpo_map_describe(away, count, &s, &error), "describing", &error);
    free(points);
    free(away);
    return s.farthest;
}

/* Tests a triangle whose corners are close to the model and whose middle is not, and a rotated
 * torus. */
START_TEST(test_map_error_bounds_hold_between_vertices)
{
    for (int which = 0; which < 2; which++) {
        ebpo_error error = EBPO_ERROR_INIT;
        ebpo_map_hausdorff one = EBPO_MAP_HAUSDORFF_INIT, many = EBPO_MAP_HAUSDORFF_INIT;
        ebpo_map_hausdorff_options options = EBPO_MAP_HAUSDORFF_OPTIONS_INIT;
        const double turned[3][3] = { { 0.8, -0.6, 0 }, { 0.6, 0.8, 0 }, { 0, 0, 1 } },
                     moved[3] = { 0.01, 0.02, 0.03 };
        double away[2000];
        opened o = open_model(which ? ebpo_test_torus(2, 1, 30, 20) : ebpo_test_tetrahedra(8), -1);
        ebpo_mesh m = which ? ebpo_test_torus(2, 1, 17, 11) : ebpo_test_tetrahedron(9);
        ebpo_test_transform(&m, turned, moved);
        model_must(ebpo_map_points(o.model, m.xyz64, m.vertex_count, NULL, away, &error), "map",
                   &error);
        options.tolerance = 0.02;
        options.queries = 2000000;
        options.threads = 1;
        model_must(ebpo_map_bound_hausdorff(o.model, &m, away, &options, &one, &error), "reach",
                   &error);
        options.threads = 4;
        model_must(ebpo_map_bound_hausdorff(o.model, &m, away, &options, &many, &error), "reach",
                   &error);
        ck_assert_mem_eq(&one, &many, sizeof one);
        double sampled = reach_of_samples(o.model, &m, which ? 24 : 300);
        ck_assert_msg(one.lo <= one.hi && sampled <= one.hi && sampled >= one.lo / 1.03,
                      "%.9g to %.9g, sampled %.9g", one.lo, one.hi, sampled);
        ck_assert_msg(one.hi <= one.lo * 1.0201, "%.9g to %.9g", one.lo, one.hi);
        ck_assert_uint_gt(one.queries, 0);
        options.queries = 1; /* too few queries: the bounds are wider, and still certain */
        model_must(ebpo_map_bound_hausdorff(o.model, &m, away, &options, &many, &error), "reach",
                   &error);
        ck_assert(sampled <= many.hi && many.hi >= one.hi && many.lo <= one.lo);
        double widest = many.hi;
        /* the queries are used where the bounds are widest, and not more than these are made */
        options.queries = 300;
        model_must(ebpo_map_bound_hausdorff(o.model, &m, away, &options, &many, &error), "reach",
                   &error);
        ck_assert(sampled <= many.hi && many.hi < widest && many.queries <= 303);
        ebpo_mesh_free(&m);
        close_model(&o);
    }
}
END_TEST

/* --- colours --- */

START_TEST(test_map_palette_end_colours)
{
    uint8_t c[3], d[3];
    ebpo_map_colour(EBPO_MAP_THESIS, 0, 2, c);
    ck_assert(c[0] == 0 && c[1] == 0 && c[2] == 0);
    ebpo_map_colour(EBPO_MAP_THESIS, -1e-300, 2, c);
    ck_assert(c[0] == 255 && c[1] == 0 && c[2] == 0);
    ebpo_map_colour(EBPO_MAP_THESIS, 1, 2, c);
    ck_assert(c[0] == 0 && c[1] == 255 && c[2] == 0);
    ebpo_map_colour(EBPO_MAP_THESIS, -7, 2, c);
    ck_assert(c[0] == 0 && c[1] == 0 && c[2] == 255);
    ebpo_map_colour(EBPO_MAP_DIVERGING, NAN, 2, c);
    ck_assert(c[0] == 128 && c[1] == 128 && c[2] == 128);
    ebpo_map_colour(EBPO_MAP_DIVERGING, 0, 2, c);
    ck_assert(abs(c[0] - c[1]) <= 1 && abs(c[1] - c[2]) <= 1);
    double last[2] = { 1e9, 1e9 };
    for (int i = 0; i <= 64; i++) /* darker from step to step, and equal on both sides */
        for (int side = 0; side < 2; side++) {
            ebpo_map_colour(EBPO_MAP_DIVERGING, (side ? 2.0 : -2.0) * i / 64, 2, d);
            double luma = 0.2126 * d[0] + 0.7152 * d[1] + 0.0722 * d[2];
            ck_assert_msg(luma <= last[side], "step %d: %g, %g before", i, luma, last[side]);
            ck_assert(i < 8 || (side ? d[0] > d[2] : d[2] > d[0]));
            last[side] = luma;
        }
    ck_assert_str_eq(ebpo_map_palette_name(EBPO_MAP_THESIS), "thesis");
    ck_assert_ptr_null(ebpo_map_palette_name((ebpo_map_palette)EBPO_MAP_PALETTES));
}
END_TEST

START_TEST(test_map_painted_mesh_ply_round_trip)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh m = ebpo_test_torus(2, 1, 12, 8), back;
    ebpo_mesh_read_options read = EBPO_MESH_READ_OPTIONS_INIT;
    ebpo_colours colours;
    double away[96];
    for (int i = 0; i < 96; i++)
        away[i] = (i - 40) * 0.01;
    ck_assert_int_eq(ebpo_map_paint(&m, away, EBPO_MAP_DIVERGING, 0, &error), EBPO_E_ARGUMENT);
    model_must(ebpo_map_paint(&m, away, EBPO_MAP_THESIS, 1, &error), "painting", &error);
    model_must(ebpo_map_paint(&m, away, EBPO_MAP_DIVERGING, 0.3, &error), "again", &error);
    model_must(ebpo_mesh_write_ply(&m, scratch("p.ply"), &error), "writing", &error);
    read.attributes = 1;
    model_must(ebpo_mesh_read(scratch("p.ply"), &read, &back, &error), "reading", &error);
    model_must(ebpo_mesh_colours(&back, &colours, &error), "colours", &error);
    ck_assert(back.vertex_count == 96 && colours.vertex);
    for (int i = 0; i < 96; i++) {
        uint8_t rgb[3];
        ebpo_map_colour(EBPO_MAP_DIVERGING, away[i], 0.3, rgb);
        ck_assert_mem_eq(colours.vertex + 4 * i, rgb, 3);
    }
    ebpo_colours_free(&colours);
    ebpo_mesh_free(&back);
    ebpo_mesh_free(&m);
}
END_TEST

TEST_SUITE(map)
{
    Suite *suite = suite_create("map");
    TCase *tests = tcase_create("map");
    tcase_set_timeout(tests, 300);
    tcase_add_checked_fixture(tests, scratch_enter, scratch_leave);
    tcase_add_test(tests, test_map_of_box_matches_formula);
    tcase_add_test(tests, test_map_values_match_single_queries);
    tcase_add_test(tests, test_map_points_in_any_order);
    tcase_add_test(tests, test_map_invalid_input_is_refused);
    tcase_add_test(tests, test_map_statistics_match_reference);
    tcase_add_test(tests, test_map_counts_values_beyond_limit);
    tcase_add_test(tests, test_map_error_bounds_hold_between_vertices);
    tcase_add_test(tests, test_map_palette_end_colours);
    tcase_add_test(tests, test_map_painted_mesh_ply_round_trip);
    suite_add_tcase(suite, tests);
    return suite;
}
