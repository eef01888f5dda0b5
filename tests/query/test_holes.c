/* Inside and signed distance of surfaces with holes, from files, against sums of solid angles over
 * all faces: in long double, which decides except near the boundary of the rule. Decisions at the
 * boundary are tested in test_cap_winding.c. Models in memory, in parts, and read node by node give
 * the same results. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "check_main.h"
#include "geometry/predicates.h"
#include "levels/lod.h"
#include "mesh/mesh_parts.h"
#include "model_file.h"
#include "query/point_bounds.h"
#include "query/query_model.h"
#include "scratch.h"
#include "solids.h"

/* ---- the judge ---- */

static double dot_product(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Adds half the solid angle of a triangle that appears small from p: the arctangent of its sine
 * divided by its cosine, by a series. Returns false for other triangles. */
static bool add_small_angle(const double p[3], const double t[3][3], long double *sum,
                            long double *rounding)
{
    double v[3][3], length[3];
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            v[i][k] = t[i][k] - p[k];
        length[i] = sqrt(dot_product(v[i], v[i]));
    }
    double sine = v[0][0] * (v[1][1] * v[2][2] - v[1][2] * v[2][1]) +
                  v[0][1] * (v[1][2] * v[2][0] - v[1][0] * v[2][2]) +
                  v[0][2] * (v[1][0] * v[2][1] - v[1][1] * v[2][0]),
           product = length[0] * length[1] * length[2],
           cosine = product + dot_product(v[0], v[1]) * length[2] +
                    dot_product(v[1], v[2]) * length[0] + dot_product(v[2], v[0]) * length[1];
    if (!(cosine > product && fabs(sine) < 0x1p-10 * cosine))
        return false;
    double x = sine / cosine;
    *sum += x - x * x * x / 3;
    *rounding += 0x1p-46 + fabs(x) * 0x1p-42; /* also of the series: x^5 / 5 < |x| 2^-42 */
    return true;
}

/* Returns the winding number of p by its definition; NAN on a face. *error: bound of its rounding
 * error, which is large next to edges. */
static double winding_by_sum(const ebpo_mesh *mesh, const double p[3], double *error)
{
    const bool large = mesh->face_count > 10000; /* exact sums of these would take minutes */
    long double sum = 0, rounding = 0;
    for (uint64_t f = 0; f < mesh->face_count; f++) {
        double t[3][3];
        long double v[3][3], length[3], dot[3];
        for (int i = 0; i < 3; i++)
            ebpo_mesh_position(mesh, mesh->faces[3 * f + (uint64_t)i], t[i]);
        if (large && add_small_angle(p, (const double(*)[3])t, &sum, &rounding))
            continue;
        for (int i = 0; i < 3; i++) {
            for (int k = 0; k < 3; k++)
                v[i][k] = (long double)t[i][k] - p[k];
            length[i] = sqrtl(v[i][0] * v[i][0] + v[i][1] * v[i][1] + v[i][2] * v[i][2]);
        }
        if (ebpo_point_on_triangle(p, t[0], t[1], t[2]))
            return NAN;
        for (int i = 0; i < 3; i++) {
            int u = (i + 1) % 3;
            dot[i] = v[i][0] * v[u][0] + v[i][1] * v[u][1] + v[i][2] * v[u][2];
        }
        long double sine = v[0][0] * (v[1][1] * v[2][2] - v[1][2] * v[2][1]) +
                           v[0][1] * (v[1][2] * v[2][0] - v[1][0] * v[2][2]) +
                           v[0][2] * (v[1][0] * v[2][1] - v[1][1] * v[2][0]);
        long double cosine = length[0] * length[1] * length[2] + dot[0] * length[2] +
                             dot[1] * length[0] + dot[2] * length[1];
        if (ebpo_zero_area(t[0], t[1], t[2]))
            continue;
        sum += atan2l(sine, cosine);
        rounding +=
            0x1p-56L * length[0] * length[1] * length[2] / sqrtl(sine * sine + cosine * cosine);
    }
    *error = 1e-14 + (double)rounding; /* infinite or NaN: not known */
    return (double)(sum / (2 * acosl(-1)));
}

/* ---- models ---- */

/* Limit of the terms of sums of bounds for each leaf (ebpo_holes.terms). */
enum { TERMS_OF_LEAF = 40 };

enum { WIDE_FACES = 4000 };

/* The same file in memory, with subtrees below level 1, and read node by node. */
enum { WHOLE, PARTS, NODES, WAYS };

typedef struct holed {
    ebpo_mesh mesh; /* of the source */
    ebpo_file *file;
    ebpo_model *way[WAYS], *model; /* `model`: in memory */
    ebpo_context *context_of[WAYS], *context;
} holed;

static ebpo_model_options options_of(double threshold)
{
    ebpo_model_options o = EBPO_MODEL_OPTIONS_INIT;
    o.threshold = threshold;
    return o;
}

static void holed_open(holed *h, double threshold)
{
    ebpo_error error = EBPO_ERROR_INIT;
    for (int i = 0; i < WAYS; i++) {
        ebpo_model_options options = options_of(threshold);
        options.cut_level = i == PARTS ? 1 : i == NODES ? 0 : -1;
        options.loading = i == NODES ? EBPO_LOAD_NODES : EBPO_LOAD_CACHE;
        model_must(ebpo_model_new(h->file, &options, &h->way[i], &error), "opening", &error);
        model_must(ebpo_context_new(h->way[i], &h->context_of[i], &error), "opening", &error);
    }
    h->model = h->way[WHOLE];
    h->context = h->context_of[WHOLE];
}

static void holed_make(holed *h, ebpo_mesh mesh, ebpo_rule rule, double threshold)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_build_options build = EBPO_BUILD_OPTIONS_INIT;
    build.rule = rule;
    build.leaf_faces = 8;
    model_must(ebpo_mesh_copy(&mesh, &h->mesh, &error), "copying", &error);
    ebpo_tree tree = model_build(mesh, &build);
    model_write(&tree, scratch("holed.ebpo.h5"), NULL);
    h->file = model_open(scratch("holed.ebpo.h5"));
    holed_open(h, threshold);
}

static void holed_free(holed *h)
{
    for (int i = 0; i < WAYS; i++) {
        ebpo_context_free(h->context_of[i]);
        ebpo_model_free(h->way[i]);
    }
    ebpo_close(h->file);
    ebpo_mesh_free(&h->mesh);
}

static int expected_where(double w, double error, ebpo_rule rule, double threshold)
{
    double x = rule == EBPO_RULE_POSITIVE  ? w
               : rule == EBPO_RULE_NONZERO ? fabs(w)
                                           : fabs(w - 2 * nearbyint(w / 2));
    return isnan(w) ? EBPO_ON : !(fabs(x - threshold) > error) ? -1 : x > threshold;
}

/* Compares all queries at a point. Returns the result. */
static int check_point(const holed *h, const double p[3], ebpo_rule rule, double threshold)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_inside_result r;
    ebpo_winding_bounds b;
    ebpo_distance_result d;
    ebpo_distance_options exact = EBPO_DISTANCE_OPTIONS_INIT;
    double error_of_w = 0, w = winding_by_sum(&h->mesh, p, &error_of_w);
    int expected = expected_where(w, error_of_w, rule, threshold);
    model_must(ebpo_inside(h->context, p, NULL, &r, &error), "inside", &error);
    ck_assert_msg(expected == -1 || r.where == expected, "(%a %a %a): %d, expected %d by w = %.17g",
                  p[0], p[1], p[2], (int)r.where, expected, w);
    ck_assert_int_eq(r.winding, r.where == EBPO_IN);
    for (int i = 1; i < (p[0] > 0.1 ? NODES : WAYS); i++) { /* reading nodes is slow */
        ebpo_inside_result other;
        model_must(ebpo_inside(h->context_of[i], p, NULL, &other, &error), "inside", &error);
        ck_assert_msg(other.where == r.where && other.winding == r.winding,
                      "(%a %a %a): %d, but %d if loaded in another way", p[0], p[1], p[2],
                      (int)r.where, (int)other.where);
    }
    model_must(ebpo_winding(h->context, p, 1, 1e-6, &b, &error), "winding", &error);
    if (expected == EBPO_ON) {
        ck_assert(isnan(b.lo) && isnan(b.hi));
    } else {
        ck_assert_msg(!(b.lo > w + error_of_w) && !(w > b.hi + error_of_w),
                      "(%a %a %a): w %.17g, bounds %.17g %.17g", p[0], p[1], p[2], w, b.lo, b.hi);
    }
    model_must(ebpo_distance(h->context, p, &exact, &d, &error), "distance", &error);
    ck_assert_int_eq(signbit(d.distance) != 0, r.where == EBPO_IN);
    return r.where;
}

static void choose_point(uint64_t *state, const holed *h, double p[3])
{
    const ebpo_info *info = ebpo_file_info(h->file);
    uint64_t kind = ebpo_test_random(state) % 4;
    for (int k = 0; k < 3; k++)
        p[k] = info->report.min[k] + (1.2 * ebpo_test_random_unit(state) - 0.1) *
                                         (info->report.max[k] - info->report.min[k]);
    if (kind < 2)
        return;
    /* on a vertex, on an edge, near a face */
    uint64_t f = ebpo_test_random(state) % h->mesh.face_count;
    double t[3][3], s = (double)(ebpo_test_random(state) % 3) / 2,
                    shift = ebpo_test_random_unit(state);
    for (int i = 0; i < 3; i++)
        ebpo_mesh_position(&h->mesh, h->mesh.faces[3 * f + (uint64_t)i], t[i]);
    for (int k = 0; k < 3; k++) {
        p[k] = t[0][k] + s * (t[1][k] - t[0][k]);
        if (kind == 3)
            p[k] += shift * 0.1 * (t[2][(k + 1) % 3] - t[1][k]);
    }
}

typedef struct tally {
    uint64_t of[4];
} tally;

static void check_model(ebpo_mesh mesh, ebpo_rule rule, double threshold, uint64_t points,
                        uint64_t seed, tally *all)
{
    holed h;
    holed_make(&h, mesh, rule, threshold);
    for (uint64_t i = 0; i < points; i++) {
        double p[3];
        choose_point(&seed, &h, p);
        all->of[check_point(&h, p, rule, threshold)]++;
    }
    holed_free(&h);
}

/* Makes a torus with many holes, some of whose faces are turned. */
static ebpo_mesh holed_torus(uint64_t *state, unsigned percent, unsigned turned)
{
    ebpo_mesh m = ebpo_test_torus(3, 1, 24, 12);
    uint64_t kept = 0;
    for (uint64_t f = 0; f < m.face_count; f++)
        if (ebpo_test_random(state) % 100 >= percent)
            memmove(m.faces + 3 * kept++, m.faces + 3 * f, 3 * sizeof *m.faces);
    m.face_count = kept;
    for (uint64_t f = 0; f < m.face_count; f++)
        if (ebpo_test_random(state) % 100 < turned)
            ebpo_test_turn_face(&m, f);
    return m;
}

START_TEST(test_surfaces_match_sums_over_faces)
{
    static const double thresholds[] = { 0.5, 0.25, 0.7 };
    const ebpo_rule rule = (ebpo_rule)(_i % 3);
    const double threshold = thresholds[_i / 3 % 3];
    uint64_t state = (uint64_t)_i, points = ebpo_test_scaled(2000);
    tally all = { { 0 } };
    check_model(holed_torus(&state, 10, 0), rule, threshold, points, state, &all);
    check_model(holed_torus(&state, 30, 5), rule, threshold, points, state, &all);
    check_model(ebpo_test_make("mobius"), rule, threshold, points, state, &all);
    check_model(ebpo_test_make("open_box"), rule, threshold, points, state, &all);
    check_model(ebpo_test_make("flipped_face_cube"), rule, threshold, points, state, &all);
    ck_assert_uint_gt(all.of[EBPO_IN], 0);
    ck_assert_uint_gt(all.of[EBPO_OUT], 0);
    ck_assert_uint_gt(all.of[EBPO_ON], 0);
}
END_TEST

/* Makes a sphere of radius 2 around (1, 2, 3) without the faces whose first corner has a z between
 * two values. */
static ebpo_mesh without_slice(uint32_t subdivisions, double low, double high)
{
    const double centre[3] = { 1, 2, 3 };
    ebpo_mesh m = ebpo_test_sphere(centre, 2, subdivisions);
    uint64_t kept = 0;
    for (uint64_t f = 0; f < m.face_count; f++) {
        double t[3];
        ebpo_mesh_position(&m, m.faces[3 * f], t);
        if (t[2] < low || t[2] > high)
            memmove(m.faces + 3 * kept++, m.faces + 3 * f, 3 * sizeof *m.faces);
    }
    m.face_count = kept;
    return m;
}

/* Most cells are far from the border: one hole, and loops apart from one another. */
START_TEST(test_few_holes_match_sums_over_faces)
{
    const double centre[3] = { 1, 2, 3 };
    const ebpo_rule rule = (ebpo_rule)_i;
    uint64_t points = ebpo_test_scaled(4000);
    tally all = { { 0 } };
    ebpo_mesh mesh = ebpo_test_sphere(centre, 2, 3);
    mesh.face_count -= 3;
    check_model(mesh, rule, 0.5, points, 21, &all);
    mesh = ebpo_test_torus(3, 1, 48, 24);
    mesh.face_count -= 40;
    memmove(mesh.faces + 300, mesh.faces + 309, 3 * (mesh.face_count - 103) * sizeof *mesh.faces);
    mesh.face_count -= 3;
    check_model(mesh, rule, 0.375, points, 22, &all);
    /* caps cross large cells without faces */
    check_model(without_slice(3, 3, 4), rule, 0.125, points, 23, &all);
    ck_assert_uint_gt(all.of[EBPO_IN], 0);
}
END_TEST

/* ebpo_winding is right in cells that caps cross and in which all points have the same result. */
START_TEST(test_winding_numbers_on_both_sides_of_cap)
{
    uint64_t state = 24, points = ebpo_test_scaled(2000) + 100;
    holed h;
    holed_make(&h, without_slice(3, 3.5, 6), EBPO_RULE_NONZERO, 0.125);
    for (uint64_t i = 0; i < points; i++) {
        double p[3];
        for (int k = 0; k < 3; k++)
            p[k] = 1 + k + 0.8 * (2 * ebpo_test_random_unit(&state) - 1);
        p[2] += 0.5; /* the cap is near this height */
        check_point(&h, p, EBPO_RULE_NONZERO, 0.125);
    }
    holed_free(&h);
}
END_TEST

/* The squares of the caps' areas underflow. */
START_TEST(test_tiny_surface_matches_sums_over_faces)
{
    uint64_t state = 25;
    tally all = { { 0 } };
    ebpo_mesh mesh = holed_torus(&state, 20, 0);
    for (uint64_t i = 0; i < 3 * mesh.vertex_count; i++)
        mesh.xyz64[i] *= 0x1p-280;
    check_model(mesh, EBPO_RULE_NONZERO, 0.5, 100, 26, &all);
    ck_assert_uint_gt(all.of[EBPO_IN], 0);
}
END_TEST

/* Makes narrow rings with random axes around the origin. The caps of all rings are near the origin.
 */
static ebpo_mesh crossing_rings(uint64_t *state, unsigned rings)
{
    enum { SIDES = 6 };
    ebpo_mesh m = ebpo_test_tetrahedron(0x1p-10);
    for (unsigned r = 0; r < rings; r++) {
        double along[3], beside[3], axis[3];
        uint32_t corner[SIDES][2];
        for (int k = 0; k < 3; k++) {
            along[k] = ebpo_test_random_unit(state) - 0.5;
            beside[k] = ebpo_test_random_unit(state) - 0.5;
        }
        for (int k = 0; k < 3; k++)
            axis[k] = 0x1p-6 * (along[(k + 1) % 3] * beside[(k + 2) % 3] -
                                along[(k + 2) % 3] * beside[(k + 1) % 3]);
        for (uint32_t i = 0; i < SIDES; i++)
            for (int side = 0; side < 2; side++) {
                double p[3], x, y;
                ebpo_test_circle(i, SIDES, &x, &y);
                for (int k = 0; k < 3; k++)
                    p[k] = x * along[k] + y * beside[k] + side * axis[k];
                corner[i][side] = ebpo_test_append_vertex(&m, p[0], p[1], p[2]);
            }
        for (uint32_t i = 0; i < SIDES; i++) {
            const uint32_t *a = corner[i], *b = corner[(i + 1) % SIDES];
            ebpo_test_append_face(&m, a[0], b[0], b[1]);
            ebpo_test_append_face(&m, a[0], b[1], a[1]);
        }
    }
    return m;
}

/* So many caps touch some cells that ebpo_near_cell.touching is EBPO_TOUCHING_ALL. */
START_TEST(test_many_caps_in_one_cell_match_sums_over_faces)
{
    uint64_t state = 27, all = 0;
    holed h;
    holed_make(&h, crossing_rings(&state, 150), EBPO_RULE_NONZERO, 0.25);
    const ebpo_node_table *t = &h.model->whole->nodes;
    for (uint32_t i = 0; i < t->near_count; i++)
        all += t->near[i].touching == EBPO_TOUCHING_ALL && t->near[i].count > EBPO_TOUCHING_ALL + 1;
    ck_assert_uint_gt(all, 0);
    for (int i = 0; i < 100; i++) {
        double p[3] = { 0.15, 0, 0 }; /* beyond 0.1, so check_point does not read nodes */
        for (int k = 0; k < 3; k++)
            p[k] += 0.04 * ebpo_test_random_unit(&state);
        check_point(&h, p, EBPO_RULE_NONZERO, 0.25);
    }
    holed_free(&h);
}
END_TEST

/* Makes the three faces of a cube of size 2 that touch the origin. */
static ebpo_mesh three_cube_faces(void)
{
    const double low[3] = { 0, 0, 0 }, high[3] = { 2, 2, 2 };
    ebpo_mesh mesh = ebpo_test_box(low, high, 1);
    uint64_t kept = 0;
    for (uint64_t f = 0; f < mesh.face_count; f++) {
        double t[3][3];
        bool keep = false;
        for (int i = 0; i < 3; i++)
            ebpo_mesh_position(&mesh, mesh.faces[3 * f + (uint64_t)i], t[i]);
        for (int k = 0; k < 3; k++)
            keep = keep || (t[0][k] == 0 && t[1][k] == 0 && t[2][k] == 0);
        if (keep)
            memmove(mesh.faces + 3 * kept++, mesh.faces + 3 * f, 3 * sizeof *mesh.faces);
    }
    mesh.face_count = kept;
    return mesh;
}

START_TEST(test_ties_are_counted)
{
    ebpo_mesh mesh = ebpo_test_sheet(4, 1);
    const double p[3] = { 2, 2, 0 }, q[3] = { 5, 5, 0 }, far[3] = { 50, 2, 1 };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_inside_result r;
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    double corner[3] = { 4, 4, 4 };
    uint32_t apex = ebpo_test_append_vertex(&mesh, corner[0], corner[1], corner[2]);
    ebpo_test_append_face(&mesh, 0, 1, apex);
    holed h;
    holed_make(&h, mesh, EBPO_RULE_NONZERO, 0.5);
    model_must(ebpo_inside(h.context, p, NULL, &r, &error), "inside", &error);
    ck_assert_int_eq(r.where, EBPO_ON);
    model_must(ebpo_inside(h.context, q, NULL, &r, &error), "inside", &error);
    ck_assert_int_eq(r.where, EBPO_OUT);
    model_must(ebpo_inside(h.context, far, NULL, &r, &error), "inside", &error);
    ck_assert_int_eq(r.where, EBPO_OUT);
    ebpo_model_get_stats(h.model, &stats);
    ck_assert_uint_eq(stats.ties, 0);
    holed_free(&h);

    /* a cube without three faces around one corner: 1/2 at the centre */
    const double centre[3] = { 1, 1, 1 };
    mesh = three_cube_faces();
    holed_make(&h, mesh, EBPO_RULE_NONZERO, 0.5);
    model_must(ebpo_inside(h.context, centre, NULL, &r, &error), "inside", &error);
    ck_assert_int_eq(r.where, EBPO_OUT);
    ebpo_model_get_stats(h.model, &stats);
    ck_assert_uint_eq(stats.ties, 1);
    holed_free(&h);
}
END_TEST

/* Makes the file of a mesh with or without the border. */
static void write_model(const char *path, ebpo_mesh mesh, bool border)
{
    ebpo_build_options build = EBPO_BUILD_OPTIONS_INIT;
    build.leaf_faces = 8;
    if (!border)
        build.parts &= ~(uint32_t)EBPO_PART_BORDER;
    ebpo_tree tree = model_build(mesh, &build);
    model_write(&tree, path, NULL);
}

START_TEST(test_invalid_queries_are_refused)
{
    holed h;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_model *model = NULL;
    ebpo_context *context = NULL;
    ebpo_model_options bad = options_of(0);
    ebpo_inside_result r;
    ebpo_winding_bounds w;
    const double p[3] = { 0, 0, 0 };
    holed_make(&h, ebpo_test_make("open_box"), EBPO_RULE_NONZERO, 0.5);
    ck_assert_int_eq(ebpo_winding(h.context, p, 1, -1, &w, &error), EBPO_E_ARGUMENT);
    ck_assert_int_eq(ebpo_model_new(h.file, &bad, &model, &error), EBPO_E_ARGUMENT);
    holed_free(&h);

    write_model(scratch("without.ebpo.h5"), ebpo_test_make("open_box"), false);
    ebpo_file *file = model_open(scratch("without.ebpo.h5"));
    model_must(ebpo_model_new(file, NULL, &model, &error), "opening", &error);
    model_must(ebpo_context_new(model, &context, &error), "opening", &error);
    ck_assert_int_eq(ebpo_inside(context, p, NULL, &r, &error), EBPO_E_NOT_SOLID);
    ck_assert_int_eq(ebpo_winding(context, p, 1, 0, &w, &error), EBPO_E_NOT_SOLID);
    ebpo_context_free(context);
    ebpo_model_free(model);
    ebpo_close(file);
}
END_TEST

static void check_same_files(const char *one, const char *other)
{
    FILE *a = fopen(one, "rb"), *b = fopen(other, "rb");
    int x, y;
    ck_assert(a && b);
    do {
        x = getc(a);
        y = getc(b);
        ck_assert_int_eq(x, y);
    } while (x != EOF);
    fclose(a);
    fclose(b);
}

/* Stops when winding numbers of nodes are computed, which is the only stage "border" of a repack.
 */
static bool stop_windings(void *user, const char *stage, uint64_t done, uint64_t total)
{
    (void)user;
    return strcmp(stage, "border") != 0 || done == total;
}

/* The border that is added to a file equals the border that is built, except for envelopes: those
 * of a built surface contain its inside. */
START_TEST(test_border_is_added_to_file)
{
    uint64_t state = 4, seed = 4;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    write.progress.report = stop_windings;
    write_model(scratch("without.ebpo.h5"), holed_torus(&state, 20, 5), false);
    write_model(scratch("with.ebpo.h5"), holed_torus(&seed, 20, 5), true);
    ebpo_file *file = model_open(scratch("without.ebpo.h5"));
    ck_assert_int_eq(ebpo_file_add_border(file, scratch("added.ebpo.h5"), NULL, &write, &error),
                     EBPO_E_CANCELLED);
    model_must(ebpo_file_add_border(file, scratch("added.ebpo.h5"), NULL, NULL, &error), "adding",
               &error);
    ebpo_close(file);
    file = model_open(scratch("added.ebpo.h5"));
    ebpo_file *built = model_open(scratch("with.ebpo.h5"));
    const ebpo_info *added = ebpo_file_info(file), *with = ebpo_file_info(built);
    ck_assert(!added->border_inside && with->border_inside);
    ck_assert_uint_eq(added->border_loops, with->border_loops);
    ck_assert_uint_eq(added->border_points, with->border_points);
    ck_assert_double_eq(added->border_area, with->border_area);
    ebpo_close(file);
    ebpo_close(built);
    /* a repacked file keeps its envelopes and border_inside */
    file = model_open(scratch("with.ebpo.h5"));
    model_must(ebpo_file_add_border(file, scratch("added.ebpo.h5"), NULL, NULL, &error), "adding",
               &error);
    ebpo_close(file);
    check_same_files(scratch("added.ebpo.h5"), scratch("with.ebpo.h5"));
}
END_TEST

/* ---- envelopes contain the inside ---- */

/* Makes faces with random corners, which intersect each other and have nothing in common. */
static ebpo_mesh random_soup(uint64_t *state, uint64_t faces)
{
    ebpo_mesh m = ebpo_test_tetrahedron(1);
    m.face_count = 1;
    for (uint64_t i = 1; i < faces; i++) {
        uint32_t corner[3];
        for (int k = 0; k < 3; k++) {
            double x = ebpo_test_random_unit(state), y = ebpo_test_random_unit(state);
            corner[k] = ebpo_test_append_vertex(&m, x, y, ebpo_test_random_unit(state));
        }
        ebpo_test_append_face(&m, corner[0], corner[1], corner[2]);
    }
    return m;
}

/* Makes a part of a torus: a shell with two large holes, or a sheet. */
static ebpo_mesh part_of_torus(unsigned first, unsigned end)
{
    ebpo_mesh m = ebpo_test_torus(3, 1, 24, 12);
    uint64_t kept = 0;
    for (uint64_t f = 0; f < m.face_count; f++)
        if (f >= first * m.face_count / 24 && f < end * m.face_count / 24)
            memmove(m.faces + 3 * kept++, m.faces + 3 * f, 3 * sizeof *m.faces);
    m.face_count = kept;
    return m;
}

/* Checks that the envelopes of all levels contain a point that is inside. */
static void check_levels(const holed *h, const double p[3], double w)
{
    ebpo_error error = EBPO_ERROR_INIT;
    for (int level = 0; level < ebpo_file_info(h->file)->level_count; level++) {
        ebpo_inside_options o = EBPO_INSIDE_OPTIONS_INIT;
        ebpo_inside_result r;
        o.level = level;
        o.envelopes = EBPO_ENVELOPES_USE;
        model_must(ebpo_inside(h->context, p, &o, &r, &error), "level", &error);
        ck_assert_msg(r.where != EBPO_OUT, "(%a %a %a), level %d: w = %.17g, but outside", p[0],
                      p[1], p[2], level, w);
    }
}

/* Checks that planes derived from the faces of a leaf contain a point that is inside. */
static void check_leaf(const ebpo_lod_model *m, ebpo_leaf_scratch *faces, const double p[3])
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_level_nodes nodes = ebpo_lod_model_nodes(m);
    ebpo_node node = ebpo_level_root(&nodes);
    uint32_t at[3], codes[EBPO_PLANES_MAX];
    int count = 0;
    ebpo_polytope envelope;
    if (!ebpo_locate(&m->box, m->target, p, at))
        return;
    while (node.type == EBPO_GRAY)
        node = ebpo_level_child(&nodes, &node, ebpo_octant_at(at, m->target - 1 - node.cell.level));
    ck_assert_msg(node.type == EBPO_LEAF, "(%a %a %a) is in a white node", p[0], p[1], p[2]);
    ebpo_polytope_cube(&envelope);
    model_must(ebpo_lod_leaf_planes(m, node.cell, node.rank, faces, &envelope, codes, &count,
                                    &error),
               "planes", &error);
    ck_assert_msg(!ebpo_outside_planes(&m->box, node.cell, codes, (uint32_t)count, p),
                  "(%a %a %a) is outside a plane of a leaf", p[0], p[1], p[2]);
}

/* Chooses points in the model's box and near its faces and caps. Returns the number of points whose
 * sum of solid angles is certainly beyond the threshold, all of which must be in all levels. */
static uint64_t check_envelopes(ebpo_mesh mesh, ebpo_rule rule, uint64_t points, uint64_t state)
{
    holed h;
    uint64_t inside = 0;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
    ebpo_lod_model tree;
    ebpo_leaf_scratch faces = { NULL, 0 };
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    holed_make(&h, mesh, rule, 0.5);
    model_must(ebpo_lod_model_read(&tree, h.file, ebpo_file_info(h.file)->level_count - 1, &read,
                                   &error),
               "reading", &error);
    ck_assert(ebpo_file_info(h.file)->border_inside);
    model_must(ebpo_verify(h.file, NULL, &report, &error), "verifying", &error);
    ck_assert_msg(report.violations == 0, "%s; %s", report.structure.first,
                  report.containment.first);
    for (uint64_t i = 0; i < points; i++) {
        double p[3], q[3], error_of_w = 0, share = ebpo_test_random_unit(&state);
        choose_point(&state, &h, p);
        choose_point(&state, &h, q); /* points between two points of faces are near caps */
        for (int k = 0; k < 3; k++)
            p[k] += i % 2 * share * (q[k] - p[k]);
        double w = winding_by_sum(&h.mesh, p, &error_of_w);
        if (expected_where(w, error_of_w, rule, 0.5) != EBPO_IN)
            continue;
        inside++;
        check_levels(&h, p, w);
        check_leaf(&tree, &faces, p);
    }
    free(faces.faces);
    ebpo_lod_model_free(&tree);
    holed_free(&h);
    return inside;
}

START_TEST(test_envelopes_contain_inside)
{
    const ebpo_rule rule = (ebpo_rule)(_i % 3);
    uint64_t state = (uint64_t)_i + 77, points = ebpo_test_scaled(4000);
    uint64_t inside = check_envelopes(holed_torus(&state, 10, 0), rule, points, state);
    inside += check_envelopes(holed_torus(&state, 30, 5), rule, points, state);
    inside += check_envelopes(random_soup(&state, 12), rule, points, state);
    inside += check_envelopes(random_soup(&state, 60), rule, points, state);
    inside += check_envelopes(part_of_torus(0, 20), rule, points, state);
    inside += check_envelopes(part_of_torus(3, 5), rule, points, state);
    static const char *const shapes[] = { "mobius", "open_box", "flipped_face_cube" };
    for (int i = 0; i < 3; i++)
        inside += check_envelopes(ebpo_test_make(shapes[i]), rule, points, state);
    inside += check_envelopes(without_slice(2, -9, 3), rule, points, state); /* a half sphere */
    inside += check_envelopes(three_cube_faces(), rule, points, state);
    ck_assert_uint_gt(inside, points / 4);
}
END_TEST

/* Thousands of triangles as wide as the model, which overlap, so that all of them are caps near
 * every cell. All cells then count whole. */
START_TEST(test_overlapping_caps_take_bounded_work)
{
    uint64_t state = 8;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_build_options build = EBPO_BUILD_OPTIONS_INIT;
    ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
    build.max_level = 4;
    ebpo_tree tree = model_build(random_soup(&state, WIDE_FACES), &build);
    model_write(&tree, scratch("wide.ebpo.h5"), NULL);
    ebpo_file *file = model_open(scratch("wide.ebpo.h5"));
    model_must(ebpo_verify(file, NULL, &report, &error), "verifying", &error);
    ck_assert_msg(report.violations == 0, "%s; %s", report.structure.first,
                  report.containment.first);
    for (int level = 0; level < ebpo_file_info(file)->level_count; level++)
        ck_assert_uint_eq(ebpo_file_info(file)->level[level].white_count, 0);
    ebpo_close(file);
}
END_TEST

/* Makes triangles of size 0.002 with random centres in a unit cube. */
static ebpo_mesh sparse_soup(uint64_t *state, uint64_t faces)
{
    ebpo_mesh m = random_soup(state, faces);
    for (uint64_t f = 0; f < m.face_count; f++)
        for (int i = 1; i < 3; i++)
            for (int k = 0; k < 3; k++)
                m.xyz64[3 * m.faces[3 * f + (uint64_t)i] + (uint64_t)k] =
                    m.xyz64[3 * m.faces[3 * f] + (uint64_t)k] +
                    0.002 * ebpo_test_random_unit(state);
    return m;
}

/* Stops the search for cap cells at the first report after the first tests of cells. */
static bool stop_border(void *user, const char *stage, uint64_t done, uint64_t total)
{
    bool *stopped = user;
    if (strcmp(stage, "border") != 0)
        return true;
    ck_assert(!*stopped && done <= total);
    *stopped = done > 0;
    return !*stopped;
}

/* Cells with long lists of small caps are divided, so the levels become small. A
 * callback can stop the search between levels. */
START_TEST(test_sparse_caps_have_small_envelopes)
{
    uint64_t state = 4;
    bool stopped = false;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh mesh = sparse_soup(&state, 20000), copy;
    ebpo_build_options build = EBPO_BUILD_OPTIONS_INIT;
    ebpo_mesh_report found;
    ebpo_repair_record repairs = { 0 };
    ebpo_tree tree;
    build.leaf_faces = 1;
    model_must(ebpo_mesh_copy(&mesh, &copy, &error), "copying", &error);
    tree = model_build(copy, &build);
    double volume = 0, box = 1; /* of all leaves */
    for (int level = 0; level < tree.info.level_count; level++)
        volume += tree.level[level].leaf_volume;
    for (int k = 0; k < 3; k++)
        box *= tree.info.box_size[k];
    ck_assert_msg(volume > 0 && volume < 0.16 * box, "%g of %g", volume, box);
    ebpo_tree_free(&tree);
    build.progress = (ebpo_progress){ stop_border, &stopped };
    model_must(ebpo_mesh_check(&mesh, 1, (ebpo_progress){ NULL, NULL }, &found, &error), "checking",
               &error);
    ck_assert_int_eq(ebpo_build(&mesh, &found, &repairs, &build, &tree, &error), EBPO_E_CANCELLED);
    ck_assert(stopped);
}
END_TEST

/* Builds a model of a mesh file in a workspace, without these parts. Returns the most bytes of
 * arrays in memory. */
static uint64_t build_in_workspace(const char *path, uint32_t omitted)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_workspace_options options = EBPO_WORKSPACE_OPTIONS_INIT;
    ebpo_workspace_stats stats = EBPO_WORKSPACE_STATS_INIT;
    ebpo_mesh_read_options read = EBPO_MESH_READ_OPTIONS_INIT;
    ebpo_build_options build = EBPO_BUILD_OPTIONS_INIT;
    ebpo_mesh mesh;
    ebpo_mesh_report found;
    ebpo_tree tree;
    build.parts &= ~omitted;
    build.leaf_faces = 1;
    options.memory = UINT64_C(1) << 30;
    model_must(ebpo_workspace_new(&options, &read.workspace, &error), "workspace", &error);
    model_must(ebpo_mesh_read(path, &read, &mesh, &error), "reading", &error);
    model_must(ebpo_mesh_check(&mesh, 1, (ebpo_progress){ NULL, NULL }, &found, &error), "checking",
               &error);
    model_must(ebpo_build(&mesh, &found, NULL, &build, &tree, &error), "building", &error);
    ck_assert_int_eq(ebpo_workspace_get_stats(read.workspace, &stats), EBPO_OK);
    ebpo_tree_free(&tree);
    ebpo_workspace_free(read.workspace);
    return stats.held_peak;
}

/* The lists of caps near the cells are in the workspace, so a budget for memory limits them. */
START_TEST(test_lists_of_caps_are_in_workspace)
{
    uint64_t state = 4;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh mesh = sparse_soup(&state, 5000);
    model_must(ebpo_mesh_write_ply(&mesh, scratch("soup.ply"), &error), "writing", &error);
    ebpo_mesh_free(&mesh);
    uint64_t with = build_in_workspace(scratch("soup.ply"), 0),
             without = build_in_workspace(scratch("soup.ply"), EBPO_PART_BORDER);
    ck_assert_msg(with > without + (1 << 20), "%llu and %llu bytes", (unsigned long long)with,
                  (unsigned long long)without);
}
END_TEST

/* Results at a level or with a deadline are those of the whole file, or "maybe": near a face, and
 * less often at deeper levels. */
START_TEST(test_levels_agree_or_are_undecided)
{
    uint64_t state = 6, maybe[EBPO_LEVELS_MAX][WAYS] = { { 0 } };
    holed h;
    ebpo_error error = EBPO_ERROR_INIT;
    holed_make(&h, holed_torus(&state, 40, 6), EBPO_RULE_NONZERO, 0.5);
    int deepest = ebpo_file_info(h.file)->level_count - 1;
    for (uint64_t i = 0; i < ebpo_test_scaled(4000); i++) {
        double p[3];
        ebpo_inside_result whole, r;
        ebpo_distance_result near = { 0 };
        choose_point(&state, &h, p);
        model_must(ebpo_inside(h.context, p, NULL, &whole, &error), "inside", &error);
        model_must(ebpo_distance(h.context, p, NULL, &near, &error), "distance", &error);
        for (int level = -1; level <= deepest; level++)
            for (int way = 0; way < WAYS; way++) {
                ebpo_inside_options o = EBPO_INSIDE_OPTIONS_INIT;
                o.level = level;
                o.deadline_ns = level < 0 ? 1 : 0;
                o.envelopes = (ebpo_envelopes)(i % 3);
                model_must(ebpo_inside(h.context_of[way], p, &o, &r, &error), "level", &error);
                if (r.where == EBPO_MAYBE)
                    ck_assert(fabs(near.distance) <= r.doubt && r.winding == 0);
                else
                    ck_assert_msg(r.where == whole.where && r.winding == whole.winding,
                                  "(%a %a %a), level %d, way %d: %d instead of %d", p[0], p[1],
                                  p[2], level, way, (int)r.where, (int)whole.where);
                if (level >= 0)
                    maybe[level][way] += r.where == EBPO_MAYBE;
            }
    }
    for (int way = 0; way < WAYS; way++)
        ck_assert_uint_gt(maybe[0][way], maybe[deepest][way]);
    holed_free(&h);
}
END_TEST

/* Adds the volumes of the parts of a leaf, relative to the leaf, to of_mark[mark]. Recursive. */
static void add_parts(const ebpo_node_table *t, int32_t marked, double volume, double of_mark[8])
{
    ebpo_uniform_mark mark = ebpo_entry_mark(marked);
    if (mark != EBPO_MARK_SPLIT)
        of_mark[mark] += volume;
    for (int octant = 0; mark == EBPO_MARK_SPLIT && octant < 8; octant++)
        add_parts(t, t->split[ebpo_marked_value(marked)][octant], volume / 8, of_mark);
}

/* Returns true if the tree has a leaf at a position of the grid. */
static bool is_leaf(const ebpo_node_table *t, const uint32_t at[3])
{
    uint32_t entry = t->root;
    for (int up = t->grid_bits; ebpo_entry_kind_of(entry) == EBPO_ENTRY_GRAY && up-- > 0;)
        entry = ebpo_table_child(t, entry, ebpo_octant_at(at, up));
    return ebpo_entry_kind_of(entry) == EBPO_ENTRY_LEAF;
}

/* Checks that parts of leaves near the border that no face touches are decided by a mark, and that
 * the grid has some of these parts, so that queries do not visit the leaf. */
static void check_parts_of_leaves(const ebpo_accel *s)
{
    const ebpo_node_table *t = &s->nodes;
    double of_mark[8] = { 0 }, sum = 0;
    uint64_t in_grid = 0, i = 0;
    uint32_t side = 1u << t->grid_bits, at[3];
    for (uint32_t k = 0; k < s->leaf_count; k++)
        if (s->leaf[k].cell_face == EBPO_NEAR_BORDER)
            add_parts(t, (int32_t)s->leaf[k].rows, 1, of_mark);
    for (int mark = 0; mark < 8; mark++)
        sum += of_mark[mark];
    for (at[2] = 0; at[2] < side; at[2]++)
        for (at[1] = 0; at[1] < side; at[1]++)
            for (at[0] = 0; at[0] < side; at[0]++, i++)
                in_grid += ebpo_entry_kind_of(t->grid[i]) == EBPO_ENTRY_UNIFORM && is_leaf(t, at);
    ck_assert_double_gt(of_mark[EBPO_MARK_OUT] + of_mark[EBPO_MARK_IN], sum / 12);
    ck_assert_double_lt(of_mark[EBPO_MARK_NEAR] + of_mark[EBPO_MARK_FACES_NEAR], sum / 1000);
    ck_assert_uint_gt(in_grid, 0);
}

/* Checks that few caps of the lists of cells near the border are the nearest or touch the cell, so
 * that queries visit few caps; that the errors of far caps are small; and that the grid has the
 * marks of parts of white nodes. */
static void check_lists(const ebpo_node_table *t)
{
    double error = 0;
    uint64_t entries = 0, nearest = 0, touching = 0, split = 0,
             cells = UINT64_C(1) << 3 * t->grid_bits;
    for (uint32_t i = 0; i < t->near_count; i++) {
        entries += t->near[i].count;
        nearest += t->near[i].nearest;
        touching += ebpo_near_touching(&t->near[i]);
        error += (double)t->near[i].far.error;
    }
    for (uint64_t i = 0; i < cells; i++)
        split += ebpo_entry_kind_of(t->grid[i]) == EBPO_ENTRY_UNIFORM &&
                 ebpo_entry_mark(ebpo_entry_winding(t->grid[i])) == EBPO_MARK_SPLIT &&
                 t->grid_depth[i] < t->grid_bits;
    ck_assert_msg(3 * nearest < entries && 10 * touching < entries,
                  "%llu nearest and %llu touching of %llu entries", (unsigned long long)nearest,
                  (unsigned long long)touching, (unsigned long long)entries);
    ck_assert_uint_eq(split, 0);
    ck_assert_double_lt(error / t->near_count, 0.1);
}

/* Marks take most of the time to open a surface with many holes; the number of terms of their sums
 * does not depend on the machine. */
START_TEST(test_marks_take_few_terms)
{
    uint64_t leaves = 0, kept = 0, state = 3;
    holed h;
    ebpo_mesh mesh = ebpo_test_torus(3, 1, 96, 48);
    for (uint64_t f = 0; f < mesh.face_count; f++)
        if (ebpo_test_random(&state) % 100 >= 4)
            memmove(mesh.faces + 3 * kept++, mesh.faces + 3 * f, 3 * sizeof *mesh.faces);
    mesh.face_count = kept;
    holed_make(&h, mesh, EBPO_RULE_NONZERO, 0.5);
    const ebpo_info *info = ebpo_file_info(h.file);
    for (int level = 0; level < info->level_count; level++)
        leaves += info->level[level].leaf_count;
    uint64_t terms = h.model->holes->terms;
    ck_assert_msg(terms > leaves && terms < TERMS_OF_LEAF * leaves, "%llu terms for %llu leaves",
                  (unsigned long long)terms, (unsigned long long)leaves);
    check_lists(&h.model->whole->nodes);
    check_parts_of_leaves(h.model->whole);
    holed_free(&h);
}
END_TEST

/* Bounds of a distance by the nodes of a level contain the distance of the whole model. */
static void check_bounds(const holed *part, const holed *whole, const double p[3], int level)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
    ebpo_distance_result exact, r;
    options.level = level;
    model_must(ebpo_distance(whole->context, p, NULL, &exact, &error), "distance", &error);
    for (int way = 0; way < WAYS; way++) {
        model_must(ebpo_distance(part->context_of[way], p, &options, &r, &error), "bounds", &error);
        double hi = fmax(fabs(r.lo), fabs(r.hi));
        ck_assert_msg(hi >= fabs(exact.distance) * (1 - 1e-12),
                      "(%a %a %a), way %d, level %d: at most %g, but %g", p[0], p[1], p[2], way,
                      level, hi, exact.distance);
    }
}

/* A subset keeps the border: its results are those of the whole file, or it refuses. */
START_TEST(test_subset_keeps_border)
{
    uint64_t state = 5;
    holed h, part = { .model = NULL };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_subset_options cut = EBPO_SUBSET_OPTIONS_INIT;
    uint64_t same = 0;
    holed_make(&h, holed_torus(&state, 10, 2), EBPO_RULE_NONZERO, 0.5);
    cut.boxed = true;
    for (int k = 0; k < 3; k++) {
        cut.min[k] = 0;
        cut.max[k] = 3;
    }
    model_must(ebpo_subset(h.file, scratch("part.ebpo.h5"), &cut, &error), "cutting", &error);
    part.file = model_open(scratch("part.ebpo.h5"));
    holed_open(&part, 0.5);
    for (uint64_t i = 0; i < ebpo_test_scaled(2000); i++) {
        double p[3];
        ebpo_inside_result whole, r;
        choose_point(&state, &h, p);
        model_must(ebpo_inside(h.context, p, NULL, &whole, &error), "inside", &error);
        for (int way = 0; way < WAYS; way++) {
            ebpo_status status = ebpo_inside(part.context_of[way], p, NULL, &r, &error);
            ck_assert_msg(status == EBPO_E_ABSENT || (status == EBPO_OK && r.where == whole.where),
                          "(%a %a %a), way %d: status %d, %d instead of %d", p[0], p[1], p[2], way,
                          (int)status, (int)r.where, (int)whole.where);
            same += status == EBPO_OK;
        }
        check_bounds(&part, &h, p, 1 + (int)(i % 5));
    }
    ck_assert_uint_gt(same, 0);
    holed_free(&part);
    holed_free(&h);
}
END_TEST

/* A subset that is pruned where envelopes extend little beyond the model still contains the inside.
 */
START_TEST(test_pruned_subset_contains_inside)
{
    uint64_t state = 15, inside = 0;
    holed h, part = { .model = NULL };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_subset_options cut = EBPO_SUBSET_OPTIONS_INIT;
    holed_make(&h, holed_torus(&state, 10, 2), EBPO_RULE_NONZERO, 0.5);
    cut.max_error = 0.2;
    model_must(ebpo_subset(h.file, scratch("part.ebpo.h5"), &cut, &error), "cutting", &error);
    part.file = model_open(scratch("part.ebpo.h5"));
    ck_assert(ebpo_file_info(part.file)->pruned && ebpo_file_info(part.file)->border_inside);
    holed_open(&part, 0.5);
    for (uint64_t i = 0; i < ebpo_test_scaled(2000); i++) {
        double p[3];
        ebpo_inside_result r;
        choose_point(&state, &h, p);
        model_must(ebpo_inside(h.context, p, NULL, &r, &error), "inside", &error);
        if (r.where != EBPO_IN)
            continue;
        check_levels(&part, p, r.winding);
        inside++;
    }
    ck_assert_uint_gt(inside, 0);
    holed_free(&part);
    holed_free(&h);
}
END_TEST

/* A solid has integer bounds. */
START_TEST(test_solid_has_integer_bounds)
{
    holed h;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_winding_bounds w;
    ebpo_inside_result r;
    uint64_t state = 9;
    holed_make(&h, ebpo_test_make("overlapping_cubes"), EBPO_RULE_NONZERO, 0.5);
    for (int i = 0; i < 500; i++) {
        double p[3];
        choose_point(&state, &h, p);
        model_must(ebpo_inside(h.context, p, NULL, &r, &error), "inside", &error);
        model_must(ebpo_winding(h.context, p, 1, 0, &w, &error), "winding", &error);
        if (r.where == EBPO_ON)
            ck_assert(isnan(w.lo));
        else
            ck_assert(w.lo == r.winding && w.hi == r.winding);
    }
    holed_free(&h);
}
END_TEST

/* The first ones are small. Larger ones take most of the time, and are tested with all inputs only.
 */
enum { SMALL_SCANS = 3 };
static const char *const scans[] = { "bunny", "blade", "office_chair", "dragon_vrip", "motorbike" };

START_TEST(test_scans_match_sums_over_faces)
{
    char path[1024];
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    tally all = { { 0 } };
    if (ebpo_test_scale() < 1 && _i >= SMALL_SCANS)
        return;
    snprintf(path, sizeof path, "%s/%s.ply", getenv("EBPO_MODELS"), scans[_i]);
    model_must(ebpo_mesh_read(path, NULL, &mesh, &error), "reading", &error);
    uint64_t points = ebpo_test_scaled(mesh.face_count > 100000 ? 40 : 400);
    ebpo_mesh copy;
    model_must(ebpo_mesh_copy(&mesh, &copy, &error), "copying", &error);
    uint64_t inside =
        check_envelopes(copy, EBPO_RULE_NONZERO, ebpo_test_scaled(10000), (uint64_t)_i + 9);
    check_model(mesh, EBPO_RULE_NONZERO, 0.5, points, (uint64_t)_i + 5, &all);
    printf("%s: %llu points in all levels, %llu in, %llu out, %llu on\n", scans[_i],
           (unsigned long long)inside, (unsigned long long)all.of[EBPO_IN],
           (unsigned long long)all.of[EBPO_OUT], (unsigned long long)all.of[EBPO_ON]);
}
END_TEST

TEST_SUITE(holes)
{
    Suite *suite = suite_create("holes");
    TCase *shapes = tcase_create("shapes");
    tcase_set_timeout(shapes, 300);
    tcase_add_checked_fixture(shapes, scratch_enter, scratch_leave);
    tcase_add_loop_test(shapes, test_surfaces_match_sums_over_faces, 0, 9);
    tcase_add_loop_test(shapes, test_few_holes_match_sums_over_faces, 0, EBPO_RULE_POSITIVE + 1);
    tcase_add_loop_test(shapes, test_envelopes_contain_inside, 0, 3);
    tcase_add_test(shapes, test_winding_numbers_on_both_sides_of_cap);
    tcase_add_test(shapes, test_tiny_surface_matches_sums_over_faces);
    tcase_add_test(shapes, test_many_caps_in_one_cell_match_sums_over_faces);
    tcase_add_test(shapes, test_ties_are_counted);
    tcase_add_test(shapes, test_invalid_queries_are_refused);
    tcase_add_test(shapes, test_border_is_added_to_file);
    tcase_add_test(shapes, test_levels_agree_or_are_undecided);
    tcase_add_test(shapes, test_marks_take_few_terms);
    tcase_add_test(shapes, test_subset_keeps_border);
    tcase_add_test(shapes, test_pruned_subset_contains_inside);
    tcase_add_test(shapes, test_solid_has_integer_bounds);
    suite_add_tcase(suite, shapes);
    TCase *wide = tcase_create("wide");
    tcase_set_timeout(wide, 300);
    tcase_add_checked_fixture(wide, scratch_enter, scratch_leave);
    tcase_add_test(wide, test_overlapping_caps_take_bounded_work);
    tcase_add_test(wide, test_sparse_caps_have_small_envelopes);
    tcase_add_test(wide, test_lists_of_caps_are_in_workspace);
    suite_add_tcase(suite, wide);
    if (getenv("EBPO_MODELS")) {
        TCase *real = tcase_create("scans");
        tcase_set_timeout(real, 600);
        tcase_add_checked_fixture(real, scratch_enter, scratch_leave);
        tcase_add_loop_test(real, test_scans_match_sums_over_faces, 0,
                            sizeof scans / sizeof *scans);
        suite_add_tcase(suite, real);
    }
    return suite;
}
