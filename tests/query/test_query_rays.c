/* Rays and boxes against the oracle: through vertices, along edges, within faces, between any
 * points. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "counted_source.h"
#include "query_support.h"

static void some_ray(query_model *m, uint64_t *state, query_ray *r)
{
    query_make_ray(m, state, r->origin, r->direction, &r->t_max);
    if (ebpo_test_random(state) % 8 == 0) { /* the direction may have any length */
        int shift = (int)(ebpo_test_random(state) % 600) - 300;
        bool any = false;
        for (int k = 0; k < 3; k++) {
            double d = ldexp(r->direction[k], shift);
            any |= d != 0;
            r->direction[k] = isfinite(d) ? d : 1;
        }
        if (!any)
            r->direction[0] = 1;
    }
    for (int k = 0; k < 3; k++)
        if (!isfinite(r->direction[k]))
            r->direction[k] = copysign(1e308, r->direction[k]);
}

/* Repeats the ray, ending at a hit, or one floating-point step before or after it. */
static bool query_ends(query_model *m, ebpo_context *context, const query_ray *r)
{
    const oracle_hit *expected;
    uint32_t n;
    bool good = true;
    oracle_ray(m->judge, r->origin, r->direction, INFINITY, &expected, &n);
    double t = n ? expected[n / 2].t : 1;
    for (int i = -1; i <= 1 && isfinite(t); i++) {
        query_ray cut = *r;
        cut.t_max = i < 0 ? fmax(0, nextafter(t, -INFINITY)) : i > 0 ? nextafter(t, INFINITY) : t;
        good &= query_one_ray(m, context, &cut);
    }
    return good;
}

START_TEST(test_rays_match_brute_force)
{
    int variant = _i % query_variant_count;
    query_model m;
    query_model_make(&m, query_solid_name(_i), query_solid_make(_i), &query_variants[variant]);
    uint64_t state = (uint64_t)_i, wrong = 0,
             count = query_scaled(m.mesh.face_count > 500 ? 500 : 3000);
    if (strcmp(m.name, "all_scales") == 0)
        count = query_scaled(100);
    for (uint64_t i = 0; i < count && wrong < 3; i++) {
        query_ray r;
        some_ray(&m, &state, &r);
        wrong += !query_one_ray(&m, m.context, &r);
        if (i % 8 == 0)
            wrong += !query_ends(&m, m.context, &r);
    }
    ck_assert_uint_eq(wrong, 0);
    query_model_free(&m);
}
END_TEST

START_TEST(test_rays_same_in_all_load_modes)
{
    static const char *const names[] = { "sphere", "boxes_in_walls", "blob" };
    query_model m;
    query_model_make(&m, names[_i], query_solid_by_name(names[_i]), &query_variants[5]);
    for (int loading = 0; loading < 3; loading++)
        for (int cut = 0; cut < 3; cut++) {
            ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
            ebpo_model *model;
            ebpo_context *context;
            ebpo_error error = EBPO_ERROR_INIT;
            uint64_t state = (uint64_t)(3 * loading + cut), wrong = 0;
            how.loading = (ebpo_loading)loading;
            how.cut_level = cut;
            ck_assert_msg(ebpo_model_new(m.file, &how, &model, &error) == EBPO_OK, "%s",
                          error.message);
            ck_assert_msg(ebpo_context_new(model, &context, &error) == EBPO_OK, "%s",
                          error.message);
            for (uint64_t i = 0; i < query_scaled(60) && wrong == 0; i++) {
                query_ray r;
                some_ray(&m, &state, &r);
                wrong += !query_one_ray(&m, context, &r);
            }
            ck_assert_uint_eq(wrong, 0);
            ebpo_context_free(context);
            ebpo_model_free(model);
        }
    query_model_free(&m);
}
END_TEST

START_TEST(test_invalid_rays_are_refused)
{
    static const query_ray rays[] = {
        { { 0, 0, 0 }, { 0, 0, 0 }, 1 },        { { NAN, 0, 0 }, { 1, 0, 0 }, 1 },
        { { 0, INFINITY, 0 }, { 1, 0, 0 }, 1 }, { { 0, 0, 0 }, { 1, NAN, 0 }, 1 },
        { { 0, 0, 0 }, { 1, 0, INFINITY }, 1 }, { { 0, 0, 0 }, { 1, 0, 0 }, -1 },
        { { 0, 0, 0 }, { 1, 0, 0 }, NAN },
    };
    query_model m;
    query_model_make(&m, "cube", query_solid_by_name("cube"), &query_variants[0]);
    for (size_t i = 0; i < sizeof rays / sizeof *rays; i++) {
        const ebpo_ray_hit *hits;
        ebpo_ray_hit one;
        uint64_t count;
        bool hit;
        ebpo_error error = EBPO_ERROR_INIT;
        ck_assert_int_eq(ebpo_ray_first(m.context, rays[i].origin, rays[i].direction, rays[i].t_max,
                                        &one, &hit, &error),
                         EBPO_E_ARGUMENT);
        ck_assert_int_eq(ebpo_ray_all(m.context, rays[i].origin, rays[i].direction, rays[i].t_max,
                                      &hits, &count, &error),
                         EBPO_E_ARGUMENT);
        ck_assert_int_ne(error.message[0], 0);
    }
    query_model_free(&m);
}
END_TEST

/* --- boxes --- */

static bool query_box(query_model *m, const double low[3], const double high[3])
{
    const uint32_t *expected;
    const uint64_t *faces;
    uint32_t n;
    uint64_t count;
    ebpo_error error = EBPO_ERROR_INIT;
    oracle_box(m->judge, low, high, &expected, &n);
    ck_assert_msg(ebpo_faces_in_box(m->context, low, high, &faces, &count, &error) == EBPO_OK, "%s",
                  error.message);
    bool same = count == n;
    for (uint32_t i = 0; i < n && same; i++)
        same = faces[i] == query_reported(m, expected[i]);
    if (!same)
        fprintf(stderr,
                "%s, %s: box (%a, %a, %a) .. (%a, %a, %a): %llu faces, %u expected, or others\n",
                m->name, m->variant, low[0], low[1], low[2], high[0], high[1], high[2],
                (unsigned long long)count, n);
    return same;
}

START_TEST(test_box_queries_match_brute_force)
{
    query_model m;
    query_model_make(&m, query_solid_name(_i), query_solid_make(_i),
                     &query_variants[(_i + 1) % query_variant_count]);
    uint64_t count = query_scaled(m.mesh.face_count > 500 ? 200 : 1500), wrong = 0,
             state = (uint64_t)_i;
    double(*p)[3] = query_alloc(2 * count, sizeof *p);
    if (strcmp(m.name, "all_scales") == 0)
        count = query_scaled(100);
    query_make_points(&m, 2 * count, (uint64_t)_i + 77, p[0]);
    for (uint64_t i = 0; i < count && wrong < 3; i++) {
        double low[3], high[3];
        for (int k = 0; k < 3; k++) {
            bool flat = ebpo_test_random(&state) % 4 == 0;
            low[k] = fmin(p[2 * i][k], p[2 * i + 1][k]);
            high[k] = flat ? low[k] : fmax(p[2 * i][k], p[2 * i + 1][k]);
        }
        wrong += !query_box(&m, low, high);
        wrong += !query_box(&m, p[2 * i], p[2 * i]);
    }
    ck_assert_uint_eq(wrong, 0);
    free(p);
    query_model_free(&m);
}
END_TEST

START_TEST(test_invalid_boxes_are_refused)
{
    static const double boxes[][6] = {
        { 1, 0, 0, 0, 1, 1 }, { NAN, 0, 0, 1, 1, 1 }, { 0, 0, 0, 1, NAN, 1 }, { 0, 0, 1, 1, 1, 0.5 }
    };
    query_model m;
    query_model_make(&m, "cube", query_solid_by_name("cube"), &query_variants[0]);
    for (size_t i = 0; i < sizeof boxes / sizeof *boxes; i++) {
        const uint64_t *faces;
        uint64_t count;
        ebpo_error error = EBPO_ERROR_INIT;
        ck_assert_int_eq(ebpo_faces_in_box(m.context, boxes[i], boxes[i] + 3, &faces, &count,
                                           &error),
                         EBPO_E_ARGUMENT);
        ck_assert_int_ne(error.message[0], 0);
        ck_assert_int_eq(ebpo_triangles_in_box(m.context, boxes[i], boxes[i] + 3, NULL, NULL, NULL),
                         EBPO_E_ARGUMENT);
    }
    query_model_free(&m);
}
END_TEST

/* --- triangles --- */

enum { MODES = 4 }; /* number of loading modes */

typedef struct gathered {
    const query_model *m;
    uint32_t *face; /* indices in the file */
    uint64_t count, blocks, most;
    bool fine, ascending;
} gathered;

static int compare_numbers(const void *a, const void *b)
{
    const uint32_t *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

static bool keep_triangles(void *user, const ebpo_triangles *t)
{
    gathered *g = user;
    g->fine &= t->count >= 1 && t->count <= EBPO_TRIANGLES_MAX;
    for (uint64_t i = 0; i < t->count && g->fine; i++) {
        uint64_t face = t->file_faces[i];
        g->fine = g->count < g->m->mesh.face_count && face < g->m->mesh.face_count &&
                  t->faces[i] == query_reported(g->m, (uint32_t)face);
        for (int k = 0; k < 3 && g->fine; k++) {
            double corner[3];
            ebpo_test_point(&g->m->mesh, g->m->mesh.faces[3 * face + (uint64_t)k], corner);
            g->fine = memcmp(t->corners[i][k], corner, sizeof corner) == 0;
        }
        if (!g->fine)
            break;
        g->ascending &= g->count == 0 || g->face[g->count - 1] < face;
        g->face[g->count++] = (uint32_t)face;
    }
    return ++g->blocks < g->most;
}

/* Checks that the triangles are those of the reference, each once. */
static bool query_triangles(query_model *m, ebpo_context *context, bool resident,
                            const double low[3], const double high[3])
{
    const uint32_t *expected;
    uint32_t n;
    ebpo_error error = EBPO_ERROR_INIT;
    gathered g = { .m = m, .most = UINT64_MAX, .fine = true, .ascending = true };
    g.face = query_alloc(m->mesh.face_count + 1, sizeof *g.face);
    oracle_box(m->judge, low, high, &expected, &n);
    ck_assert_msg(ebpo_triangles_in_box(context, low, high, keep_triangles, &g, &error) == EBPO_OK,
                  "%s", error.message);
    bool same = g.fine && g.count == n && (g.ascending || !resident);
    qsort(g.face, g.count, sizeof *g.face, compare_numbers);
    for (uint32_t i = 0; i < n && same; i++)
        same = g.face[i] == expected[i];
    free(g.face);
    return same;
}

static void open_mode(query_model *m, int mode, ebpo_model **model, ebpo_context **context)
{
    static const ebpo_loading loading[MODES] = { EBPO_LOAD_CACHE, EBPO_LOAD_CACHE,
                                                 EBPO_LOAD_SUBTREE, EBPO_LOAD_NODES };
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    options.cut_level = mode ? mode : -1;
    options.loading = loading[mode];
    ASSERT_OK(ebpo_model_new(m->file, &options, model, error));
    ASSERT_OK(ebpo_context_new(*model, context, error));
}

START_TEST(test_box_query_returns_each_triangle_once)
{
    query_model m;
    ebpo_model *model[MODES];
    ebpo_context *context[MODES];
    uint64_t count = query_scaled(100), wrong = 0;
    double(*p)[3] = query_alloc(2 * count, sizeof *p);
    query_model_make(&m, query_solid_name(_i), query_solid_make(_i),
                     &query_variants[(_i + 2) % query_variant_count]);
    for (int mode = 0; mode < MODES; mode++)
        open_mode(&m, mode, &model[mode], &context[mode]);
    query_make_points(&m, 2 * count, (uint64_t)_i + 78, p[0]);
    for (uint64_t i = 0; i < count; i++) {
        double low[3], high[3];
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(p[2 * i][k], p[2 * i + 1][k]);
            high[k] = fmax(p[2 * i][k], p[2 * i + 1][k]);
        }
        for (int mode = 0; mode < MODES; mode++)
            wrong += !query_triangles(&m, context[mode], mode == 0, low, high);
    }
    ck_assert_uint_eq(wrong, 0);
    for (int mode = 0; mode < MODES; mode++) {
        ebpo_context_free(context[mode]);
        ebpo_model_free(model[mode]);
    }
    free(p);
    query_model_free(&m);
}
END_TEST

/* Adds a tetrahedron above an edge of eight cells, upwards in x and y. Its slanting face is so
 * close to the edge that the cell below also lists this face, as a new face. */
static void add_passing(ebpo_mesh *mesh, const double at[3], double a)
{
    static const uint32_t face[4][3] = { { 0, 2, 1 }, { 0, 1, 3 }, { 0, 3, 2 }, { 1, 2, 3 } };
    double x = at[0] + 0x1p-52, y = at[1], z = at[2];
    uint32_t first = ebpo_test_append_vertex(mesh, x + a, y - a, z);
    ebpo_test_append_vertex(mesh, x - a, y + a, z);
    ebpo_test_append_vertex(mesh, x + a / 2, y - a / 2, z + a);
    ebpo_test_append_vertex(mesh, x + a, y + a, z + a / 3);
    for (int i = 0; i < 4; i++)
        ebpo_test_append_face(mesh, first + face[i][0], first + face[i][1], first + face[i][2]);
}

/* The corners of the box belong to complete cubes, so that the box does not depend on the contents.
 */
static ebpo_mesh passing_by(const ebpo_info *box)
{
    static const double low[2][3] = { { 0, 0, 0 }, { 1 - 0x1p-8, 1 - 0x1p-8, 1 - 0x1p-8 } },
                        high[2][3] = { { 0x1p-8, 0x1p-8, 0x1p-8 }, { 1, 1, 1 } };
    ebpo_mesh mesh = ebpo_test_box(low[0], high[0], 1), other = ebpo_test_box(low[1], high[1], 1);
    ebpo_test_append(&mesh, &other);
    ebpo_mesh_free(&other);
    for (int i = 0; box && i < 7 * 7; i++) {
        const int cell_face[3] = { 1 + i % 7, 1 + i / 7, 1 + i % 5 };
        double at[3];
        for (int k = 0; k < 3; k++)
            at[k] = box->box_origin[k] + box->box_size[k] / 8 * cell_face[k];
        add_passing(&mesh, at, box->box_size[0] / 32);
    }
    return mesh;
}

START_TEST(test_triangle_beside_cell_is_returned_once)
{
    static const query_variant variant = { "passing", 1, 6, EBPO_RULE_NONZERO, 0 };
    static const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    query_model frame, m;
    query_model_make(&frame, "frame", passing_by(NULL), &variant);
    query_model_make(&m, "passing", passing_by(ebpo_file_info(frame.file)), &variant);
    query_model_free(&frame);
    for (int mode = 0; mode < MODES; mode++) {
        ebpo_model *model;
        ebpo_context *context;
        open_mode(&m, mode, &model, &context);
        ck_assert_msg(query_triangles(&m, context, mode == 0, low, high), "mode %d", mode);
        ebpo_context_free(context);
        ebpo_model_free(model);
    }
    query_model_free(&m);
}
END_TEST

/* Checks that a query for all triangles, and a query for some blocks, return each triangle once. */
static void take_all(const query_model *m, ebpo_context *context)
{
    for (int turn = 0; turn < 2; turn++) {
        static const double low[3] = { -9, -9, -9 }, high[3] = { 9, 9, 9 };
        gathered g = { .m = m, .most = turn ? 3 : UINT64_MAX, .fine = true };
        g.face = query_alloc(m->mesh.face_count + 1, sizeof *g.face);
        ASSERT_OK(ebpo_triangles_in_box(context, low, high, keep_triangles, &g, error));
        ck_assert(g.fine);
        ck_assert_uint_eq(g.count, turn ? 3 * EBPO_TRIANGLES_MAX : m->mesh.face_count);
        qsort(g.face, g.count, sizeof *g.face, compare_numbers);
        for (uint64_t i = 1; i < g.count; i++)
            if (g.face[i] == g.face[i - 1])
                ck_abort_msg("face %u was returned twice", g.face[i]);
        free(g.face);
    }
}

/* All triangles together exceed the budget. The callback can end the query. The file is large
 * enough for separate subtrees, of which a remote file requests many at a time. */
static query_model large; /* one for all ways of loading */

static void make_large(void)
{
    query_model_make(&large, "torus", ebpo_test_torus(2, 0.7, 400, 250), &query_variants[0]);
}

static void free_large(void) { query_model_free(&large); }

START_TEST(test_triangles_of_whole_model_keep_budget)
{
    counted_source c;
    int level = ebpo_file_info(large.file)->subtree_level;
    ck_assert_int_gt(level, 0);
    ebpo_file *far = _i ? counted_open(&c, large.path, true) : NULL;
    ebpo_model *model;
    ebpo_context *context;
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    options.memory = 12 << 20;
    options.cut_level = _i == 2 ? level : -1;
    ASSERT_OK(ebpo_model_new(far ? far : large.file, &options, &model, error));
    ASSERT_OK(ebpo_context_new(model, &context, error));
    take_all(&large, context);
    ck_assert_int_eq(ebpo_model_get_stats(model, &stats), EBPO_OK);
    ck_assert(!stats.resident && stats.evicted > 0 && stats.memory_peak <= options.memory);
    if (far)
        ck_assert_msg((c.batches + c.alone) * 3 < stats.loads * 2, "%llu batches, %llu reads, %llu",
                      (unsigned long long)c.batches, (unsigned long long)c.alone,
                      (unsigned long long)stats.loads);
    ebpo_context_free(context);
    ebpo_model_free(model);
    if (far)
        counted_close(&c, far);
}
END_TEST

TEST_SUITE(query_rays)
{
    Suite *suite = suite_create("query_rays");
    TCase *rays = tcase_create("rays"), *boxes = tcase_create("boxes"),
          *whole = tcase_create("whole");
    tcase_set_timeout(rays, 600);
    tcase_set_timeout(boxes, 600);
    tcase_set_timeout(whole, 600);
    tcase_add_unchecked_fixture(whole, make_large, free_large);
    tcase_add_loop_test(rays, test_rays_match_brute_force, 0, query_solid_count());
    tcase_add_loop_test(rays, test_rays_same_in_all_load_modes, 0, 3);
    tcase_add_test(rays, test_invalid_rays_are_refused);
    tcase_add_loop_test(boxes, test_box_queries_match_brute_force, 0, query_solid_count());
    tcase_add_test(boxes, test_invalid_boxes_are_refused);
    tcase_add_loop_test(boxes, test_box_query_returns_each_triangle_once, 0, query_solid_count());
    tcase_add_test(boxes, test_triangle_beside_cell_is_returned_once);
    tcase_add_loop_test(whole, test_triangles_of_whole_model_keep_budget, 0, 3);
    suite_add_tcase(suite, rays);
    suite_add_tcase(suite, boxes);
    suite_add_tcase(suite, whole);
    return suite;
}
