/* Tests catalogues: combined results against separate results of each model; parts with caps
 * against the undivided model; budgets that hold only some of the models; and callbacks. */
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/catalogue.h>

#include "check_main.h"
#include "npy_numbers.h"
#include "pending_source.h"
#include "query_support.h"

/* Subdivisions of spheres and of the sides of boxes. Numbers of points and rays are divided by
 * FEWER unless all inputs are wanted. ThreadSanitizer makes everything about 20 times slower, and
 * finds races on small models with few points. */
#ifdef __SANITIZE_THREAD__
enum { SPHERE = 3, BOX = 16, FEWER = 12 };
#else
enum { SPHERE = 4, BOX = 16, FEWER = 4 };
#endif
enum { MODELS = 32, POINTS = 1440, RAYS = 800 };

static uint64_t point_count = POINTS, ray_count = RAYS;

static query_model model[MODELS];
static ebpo_catalogue_entry entry[MODELS];
static double *points; /* [point_count][3] */
static ebpo_ray *rays; /* [ray_count] */

static ebpo_mesh box_mesh(double x, double y, double z, double size)
{
    const double low[3] = { x, y, z }, high[3] = { x + size, y + size, z + size };
    return ebpo_test_box(low, high, BOX);
}

/* Makes mesh i. Some meshes overlap, some are in contact, and one occurs twice. All have a similar
 * number of faces. */
static ebpo_mesh mesh_of(int i)
{
    const double centre[3] = { 0.25 * i, 0.25 * (i % 3), 0.125 * (i % 5) };
    return i == 11      ? box_mesh(0, 0, 0, 1)
           : i % 4 == 0 ? box_mesh(centre[0], centre[1], centre[2], 1)
           : i % 4 == 1 ? ebpo_test_sphere(centre, 0.75, SPHERE)
           : i % 4 == 2 ? box_mesh(centre[0], 0, 0, 0.5)
                        : ebpo_test_sphere(centre, 1.5, SPHERE);
}

static void make_models(void)
{
    uint64_t seed = 7;
    if (ebpo_test_scale() < 1) {
        point_count = POINTS / FEWER;
        ray_count = RAYS / FEWER;
    }
    for (int i = 0; i < MODELS; i++) {
        query_model_make(&model[i], "catalogue", mesh_of(i), &query_variants[0]);
        ebpo_catalogue_entry_of(model[i].file, model[i].path, &entry[i]);
    }
    points = query_alloc(point_count, 3 * sizeof *points);
    rays = query_alloc(ray_count, sizeof *rays);
    for (int i = 0; i < MODELS; i++)
        query_make_points(&model[i], point_count / MODELS, seed + (uint64_t)i,
                          points + 3 * (point_count / MODELS) * (uint64_t)i);
    for (uint64_t i = 0; i < ray_count; i++) {
        ebpo_ray *r = &rays[i];
        query_make_ray(&model[i % MODELS], &seed, r->origin, r->direction, &r->t_max);
        for (int k = 0; k < 3; k++)
            if (!isfinite(r->direction[k]))
                r->direction[k] = copysign(1e308, r->direction[k]);
    }
}

static void free_models(void)
{
    for (int i = 0; i < MODELS; i++)
        query_model_free(&model[i]);
    free(points);
    free(rays);
}

/* --- queries, and results of each model --- */

typedef struct open_catalogue {
    ebpo_catalogue *catalogue;
    ebpo_catalogue_models *models;
} open_catalogue;

static open_catalogue query_entries(const ebpo_catalogue_entry *entries, uint64_t count,
                                    uint64_t memory)
{
    open_catalogue a = { NULL, NULL };
    ebpo_catalogue_models_options o = EBPO_CATALOGUE_MODELS_OPTIONS_INIT;
    o.memory = memory;
    o.threads = 1;
    ASSERT_OK(ebpo_catalogue_new(entries, count, NULL, &a.catalogue, error));
    ASSERT_OK(ebpo_catalogue_models_new(&o, &a.models, error));
    return a;
}

static void end_queries(open_catalogue *a)
{
    ebpo_catalogue_models_free(a->models);
    ebpo_catalogue_free(a->catalogue);
}

static ebpo_catalogue_query_options on_threads(unsigned threads)
{
    ebpo_catalogue_query_options o = EBPO_CATALOGUE_QUERY_OPTIONS_INIT;
    o.threads = threads;
    return o;
}

static void judge_inside(const ebpo_inside_result *got)
{
    for (uint64_t p = 0; p < point_count; p++) {
        int32_t winding = 0;
        bool in = false, on = false;
        for (int i = 0; i < MODELS; i++) {
            ebpo_inside_result reported;
            ASSERT_OK(ebpo_inside(model[i].context, points + 3 * p, NULL, &reported, error));
            winding += reported.winding;
            in |= reported.where == EBPO_IN;
            on |= reported.where == EBPO_ON;
        }
        ck_assert_int_eq(got[p].winding, winding);
        ck_assert_int_eq(got[p].where, in ? EBPO_IN : on ? EBPO_ON : EBPO_OUT);
    }
}

static void judge_distance(const ebpo_distance_result *got, const uint64_t *nearest,
                           double max_distance, const ebpo_inside_result *where)
{
    ebpo_distance_options o = EBPO_DISTANCE_OPTIONS_INIT;
    o.unsigned_distance = true;
    for (uint64_t p = 0; p < point_count; p++) {
        ebpo_distance_result best = { .distance = INFINITY, .face = EBPO_NO_FACE };
        uint64_t first = EBPO_CATALOGUE_NO_MODEL;
        for (int i = 0; i < MODELS; i++) {
            ebpo_distance_result reported;
            ASSERT_OK(ebpo_distance(model[i].context, points + 3 * p, &o, &reported, error));
            if (reported.distance < best.distance && reported.distance <= max_distance) {
                best = reported;
                first = (uint64_t)i;
            }
        }
        bool in = where && where[p].where == EBPO_IN && isfinite(best.distance);
        ck_assert_double_eq(got[p].distance, in ? -best.distance : best.distance);
        ck_assert_uint_eq(got[p].face, best.face);
        ck_assert_uint_eq(nearest[p], first);
        ck_assert(first == EBPO_CATALOGUE_NO_MODEL ||
                  memcmp(got[p].point, best.point, sizeof best.point) == 0);
    }
}

static void judge_rays(const ebpo_ray_hit *got, const uint64_t *intersected)
{
    for (uint64_t r = 0; r < ray_count; r++) {
        ebpo_ray_hit best = { INFINITY, EBPO_NO_FACE, 0 };
        uint64_t first = EBPO_CATALOGUE_NO_MODEL;
        for (int i = 0; i < MODELS; i++) {
            ebpo_ray_hit reported;
            bool hit;
            ASSERT_OK(ebpo_ray_first(model[i].context, rays[r].origin, rays[r].direction,
                                     rays[r].t_max, &reported, &hit, error));
            if (hit && (reported.t < best.t || best.face == EBPO_NO_FACE)) {
                best = reported;
                first = (uint64_t)i;
            }
        }
        if (isinf(best.t) && best.face != EBPO_NO_FACE)
            continue; /* several distances may exceed the range of doubles */
        ck_assert_double_eq(got[r].t, best.t);
        ck_assert_uint_eq(got[r].face, best.face);
        ck_assert_int_eq(got[r].side, best.side);
        ck_assert_uint_eq(intersected[r], first);
    }
}

static void query_everything(open_catalogue *a, unsigned threads)
{
    ebpo_catalogue_query_options o = on_threads(threads);
    ebpo_inside_result *inside = query_alloc(point_count, sizeof *inside);
    ebpo_distance_result *distance = query_alloc(point_count, sizeof *distance);
    ebpo_ray_hit *hits = query_alloc(ray_count, sizeof *hits);
    uint64_t *number = query_alloc(point_count, sizeof *number);
    ASSERT_OK(
        ebpo_catalogue_inside(a->catalogue, a->models, points, point_count, &o, inside, error));
    judge_inside(inside);
    ASSERT_OK(ebpo_catalogue_distance(a->catalogue, a->models, points, point_count, &o, distance,
                                      number, error));
    judge_distance(distance, number, INFINITY, inside);
    o.max_distance = 0.25;
    o.unsigned_distance = true;
    ASSERT_OK(ebpo_catalogue_distance(a->catalogue, a->models, points, point_count, &o, distance,
                                      number, error));
    judge_distance(distance, number, 0.25, NULL);
    ASSERT_OK(
        ebpo_catalogue_ray(a->catalogue, a->models, rays, ray_count, &o, hits, number, error));
    judge_rays(hits, number);
    free(inside);
    free(distance);
    free(hits);
    free(number);
}

START_TEST(test_catalogue_queries_many_models)
{
    open_catalogue a = query_entries(entry, MODELS, 0);
    query_everything(&a, 1);
    query_everything(&a, 3);
    end_queries(&a);
}
END_TEST

/* Returns the memory for querying eight models at a time. Not all of them stay in memory. */
static uint64_t little_memory(void)
{
    uint64_t most = 0;
    for (int i = 0; i < MODELS; i++) {
        ebpo_model_plan plan = EBPO_MODEL_PLAN_INIT;
        ASSERT_OK(ebpo_model_memory(model[i].file, NULL, &plan, error));
        most = plan.least > most ? plan.least : most;
    }
    return 8 * most;
}

static ebpo_catalogue_models_stats stats_of(const open_catalogue *a, ebpo_model_stats *sums)
{
    ebpo_catalogue_models_stats stats = EBPO_CATALOGUE_MODELS_STATS_INIT;
    *sums = (ebpo_model_stats)EBPO_MODEL_STATS_INIT;
    ck_assert_int_eq(ebpo_catalogue_models_get_stats(a->models, &stats, sums), EBPO_OK);
    return stats;
}

START_TEST(test_catalogue_closes_and_reopens_models)
{
    ebpo_model_stats sums;
    uint64_t memory = little_memory();
    open_catalogue a = query_entries(entry, MODELS, memory);
    query_everything(&a, 1);
    ebpo_catalogue_models_stats stats = stats_of(&a, &sums);
    ck_assert_uint_gt(stats.closed, 0);
    ck_assert_uint_gt(stats.opened, MODELS);
    ck_assert_uint_eq(stats.opened, stats.closed + stats.open);
    ck_assert_uint_le(sums.memory, memory);
    ck_assert_uint_eq(sums.budget, memory);
    query_everything(&a, 4);
    ebpo_catalogue_models_set_memory(a.models, 0);
    query_everything(&a, 2);
    ebpo_catalogue_models_close_idle(a.models);
    ck_assert_uint_eq(stats_of(&a, &sums).open, 0);
    ck_assert_uint_eq(sums.memory, 0);
    end_queries(&a);
}
END_TEST

START_TEST(test_catalogue_budget_too_small_is_refused)
{
    ebpo_error reported = EBPO_ERROR_INIT;
    ebpo_inside_result out[1];
    const double middle[3] = { 0.5, 0.5, 0.5 };
    open_catalogue a = query_entries(entry, MODELS, 1000);
    ck_assert_int_eq(ebpo_catalogue_inside(a.catalogue, a.models, middle, 1, NULL, out, &reported),
                     EBPO_E_LIMIT);
    ck_assert_ptr_nonnull(strstr(reported.message, "one part in 8"));
    end_queries(&a);
}
END_TEST

/* --- parts --- */

/* Makes one half of a box, 0 to 1 or 1 to 2 along x; `capped`: with a cap at x = 1. */
static ebpo_mesh half_box(int side, bool capped)
{
    const double low[3] = { side, 0, 0 }, high[3] = { side + 1, 1, 1 };
    ebpo_mesh mesh = ebpo_test_box(low, high, 2);
    uint64_t kept = 0;
    for (uint64_t f = 0; f < mesh.face_count && !capped; f++) {
        bool cap = true;
        for (int k = 0; k < 3; k++)
            cap &= mesh.xyz64[3 * mesh.faces[3 * f + k]] == 1;
        if (!cap)
            memmove(mesh.faces + 3 * kept++, mesh.faces + 3 * f, 3 * sizeof *mesh.faces);
    }
    mesh.face_count = capped ? mesh.face_count : kept;
    return mesh;
}

typedef struct halves {
    query_model closed[2], open[2], whole;
    ebpo_catalogue_entry entry[2];
    open_catalogue a;
} halves;

static void make_halves(halves *h)
{
    ebpo_catalogue_options o = EBPO_CATALOGUE_OPTIONS_INIT;
    const double low[3] = { 0, 0, 0 }, high[3] = { 2, 1, 1 };
    query_model_make(&h->whole, "whole", ebpo_test_box(low, high, 2), &query_variants[0]);
    for (int i = 0; i < 2; i++) {
        ebpo_catalogue_entry *e = &h->entry[i];
        const char *numbers = scratch(i ? "1.npy" : "0.npy");
        query_model_make(&h->closed[i], "half", half_box(i, true), &query_variants[0]);
        query_model_make(&h->open[i], "surface", half_box(i, false), &query_variants[0]);
        ebpo_catalogue_entry_of(h->closed[i].file, h->closed[i].path, e);
        e->surface = h->open[i].path;
        memcpy(e->surface_digest, ebpo_file_info(h->open[i].file)->content_sha256, 32);
        e->numbers = numbers;
        write_numbers(numbers, h->open[i].mesh.face_count, 1000 * (i + 1));
    }
    o.parts = true;
    ASSERT_OK(ebpo_catalogue_new(h->entry, 2, &o, &h->a.catalogue, error));
    ASSERT_OK(ebpo_catalogue_models_new(NULL, &h->a.models, error));
}

static void free_halves(halves *h)
{
    end_queries(&h->a);
    for (int i = 0; i < 2; i++) {
        query_model_free(&h->closed[i]);
        query_model_free(&h->open[i]);
    }
    query_model_free(&h->whole);
}

/* Makes a grid of points: on faces, on the cap, on the border of the cap, and elsewhere. */
static uint64_t grid_points(double *out)
{
    uint64_t count = 0;
    for (int x = -1; x <= 9; x++)
        for (int y = -1; y <= 5; y++)
            for (int z = -1; z <= 5; z++, count++) {
                out[3 * count] = x * 0.25;
                out[3 * count + 1] = y * 0.25;
                out[3 * count + 2] = z * 0.25;
            }
    return count;
}

START_TEST(test_catalogue_parts_match_whole_model)
{
    halves h;
    double at[3 * 11 * 7 * 7];
    ebpo_inside_result got[11 * 7 * 7], expected[11 * 7 * 7];
    ebpo_distance_result near[11 * 7 * 7], nearest[11 * 7 * 7];
    uint64_t number[11 * 7 * 7], count = grid_points(at);
    make_halves(&h);
    ASSERT_OK(ebpo_catalogue_inside(h.a.catalogue, h.a.models, at, count, NULL, got, error));
    ASSERT_OK(ebpo_inside_many(h.whole.context, at, count, NULL, expected, error));
    ASSERT_OK(
        ebpo_catalogue_distance(h.a.catalogue, h.a.models, at, count, NULL, near, number, error));
    ASSERT_OK(ebpo_distance_many(h.whole.context, at, count, NULL, nearest, error));
    for (uint64_t i = 0; i < count; i++) {
        ck_assert_int_eq(got[i].where, expected[i].where);
        ck_assert_int_eq(got[i].winding, expected[i].winding);
        ck_assert_double_eq(near[i].distance, nearest[i].distance);
        ck_assert_uint_le(number[i], 1);
        ck_assert_uint_eq(near[i].face / 1000, number[i] + 1);
    }
    ebpo_ray through = { { -1, 0.3, 0.4 }, { 1, 0, 0 }, INFINITY },
             back = { { 3, 0.3, 0.4 }, { -1, 0, 0 }, INFINITY };
    ebpo_ray_hit hit;
    ASSERT_OK(
        ebpo_catalogue_ray(h.a.catalogue, h.a.models, &through, 1, NULL, &hit, number, error));
    ck_assert(hit.t == 1 && hit.face / 1000 == 1 && number[0] == 0 && hit.side == 1);
    through.origin[0] = 0.5; /* no cap intersects this ray */
    ASSERT_OK(
        ebpo_catalogue_ray(h.a.catalogue, h.a.models, &through, 1, NULL, &hit, number, error));
    ck_assert(hit.t == 1.5 && hit.face / 1000 == 2 && number[0] == 1 && hit.side == -1);
    ASSERT_OK(ebpo_catalogue_ray(h.a.catalogue, h.a.models, &back, 1, NULL, &hit, number, error));
    ck_assert(hit.t == 1 && number[0] == 1);
    free_halves(&h);
}
END_TEST

START_TEST(test_catalogue_of_caps_has_no_surface)
{
    ebpo_error reported = EBPO_ERROR_INIT;
    ebpo_catalogue_entry caps = entry[0];
    ebpo_inside_result where;
    ebpo_distance_result distance;
    uint64_t number;
    const double middle[3] = { 0.5, 0.5, 0.5 };
    caps.only_caps = true;
    open_catalogue a = query_entries(&caps, 1, 0);
    ASSERT_OK(ebpo_catalogue_inside(a.catalogue, a.models, middle, 1, NULL, &where, error));
    ck_assert_int_eq(where.where, EBPO_IN);
    ck_assert_int_eq(ebpo_catalogue_distance(a.catalogue, a.models, middle, 1, NULL, &distance,
                                             &number, &reported),
                     EBPO_E_ABSENT);
    end_queries(&a);
}
END_TEST

/* --- callbacks --- */

typedef struct opener {
    atomic_int opened, closed;
    int fails; /* number of the call that fails to open a model; 0: none */
} opener;

static ebpo_status open_counted(void *user, const char *path, ebpo_file **out, ebpo_error *error)
{
    opener *o = user;
    if (++o->opened == o->fails) {
        o->opened--;
        error->status = EBPO_E_IO;
        snprintf(error->message, sizeof error->message, "the source has failed");
        return EBPO_E_IO;
    }
    return ebpo_open(path, out, error);
}

static void close_counted(void *user, ebpo_file *file)
{
    ((opener *)user)->closed++;
    ebpo_close(file);
}

START_TEST(test_catalogue_uses_callers_open_function)
{
    ebpo_error reported = EBPO_ERROR_INIT;
    opener o = { .fails = 3 };
    ebpo_catalogue_options how = EBPO_CATALOGUE_OPTIONS_INIT;
    ebpo_catalogue_models_options few = EBPO_CATALOGUE_MODELS_OPTIONS_INIT;
    ebpo_inside_result *out = query_alloc(point_count, sizeof *out);
    open_catalogue a;
    how.open_file = open_counted;
    how.close_file = close_counted;
    how.user = &o;
    few.memory = little_memory();
    ASSERT_OK(ebpo_catalogue_new(entry, MODELS, &how, &a.catalogue, error));
    ASSERT_OK(ebpo_catalogue_models_new(&few, &a.models, error));
    ck_assert_int_eq(ebpo_catalogue_inside(a.catalogue, a.models, points, point_count, NULL, out,
                                           &reported),
                     EBPO_E_IO);
    ck_assert_str_eq(reported.message, "the source has failed");
    o.fails = 0;
    query_everything(&a, 2);
    ck_assert_int_gt(o.closed, 0);
    end_queries(&a);
    ck_assert_int_eq(o.opened, o.closed);
    free(out);
}
END_TEST

/* --- files whose bytes arrive asynchronously --- */

static pending_source pending[MODELS];

static ebpo_status open_pending(void *user, const char *path, ebpo_file **out, ebpo_error *error)
{
    int i = 0;
    ebpo_source source = EBPO_SOURCE_INIT;
    (void)user;
    while (strcmp(path, entry[i].path))
        i++;
    ebpo_status status = ebpo_async_source(pending[i].async, &source, error);
    source.prefetched = 4096;
    return status == EBPO_OK ? ebpo_open_source(&source, path, out, error) : status;
}

/* Supplies what all files need after EBPO_E_PENDING; returns true if the call is to be repeated. */
static bool supply_all(ebpo_status status)
{
    uint64_t supplied = 0;
    for (int i = 0; i < MODELS; i++) {
        const ebpo_range *range;
        size_t count = 0;
        ASSERT_OK(ebpo_async_needed(pending[i].async, &range, &count, error));
        for (size_t k = 0; k < count; k++)
            ASSERT_OK(ebpo_async_supply(pending[i].async, range[k].offset, range[k].size,
                                        pending[i].data + range[k].offset, NULL, error));
        supplied += count;
    }
    ck_assert(status != EBPO_E_PENDING || supplied);
    return status == EBPO_E_PENDING;
}

START_TEST(test_catalogue_of_pending_files)
{
    ebpo_catalogue_options how = EBPO_CATALOGUE_OPTIONS_INIT;
    ebpo_catalogue_models_options few = EBPO_CATALOGUE_MODELS_OPTIONS_INIT;
    ebpo_inside_result *where = query_alloc(point_count, sizeof *where);
    ebpo_distance_result *near = query_alloc(point_count, sizeof *near);
    ebpo_ray_hit *hit = query_alloc(ray_count, sizeof *hit);
    uint64_t *number = query_alloc(point_count, sizeof *number), rounds = 0;
    ebpo_catalogue_query_options o = on_threads(_i ? 2 : 1);
    ebpo_error reported;
    open_catalogue a;
    for (int i = 0; i < MODELS; i++)
        pending_begin(&pending[i], model[i].path, 0);
    how.open_file = open_pending;
    few.memory = _i ? little_memory() : 0;
    ASSERT_OK(ebpo_catalogue_new(entry, MODELS, &how, &a.catalogue, error));
    ASSERT_OK(ebpo_catalogue_models_new(&few, &a.models, error));
    while (supply_all(
        ebpo_catalogue_inside(a.catalogue, a.models, points, point_count, &o, where, &reported)))
        rounds++;
    ck_assert_uint_gt(rounds, 1);
    judge_inside(where);
    while (supply_all(ebpo_catalogue_distance(a.catalogue, a.models, points, point_count, &o, near,
                                              number, &reported)))
        rounds++;
    judge_distance(near, number, INFINITY, where);
    while (supply_all(
        ebpo_catalogue_ray(a.catalogue, a.models, rays, ray_count, &o, hit, number, &reported)))
        rounds++;
    judge_rays(hit, number);
    ck_assert_uint_lt(rounds, 500);
    end_queries(&a);
    for (int i = 0; i < MODELS; i++)
        pending_end(&pending[i]);
    free(where);
    free(near);
    free(hit);
    free(number);
}
END_TEST

static bool stop_at_once(void *user, const char *stage, uint64_t done, uint64_t total)
{
    (void)stage;
    (void)done;
    (void)total;
    ++*(int *)user;
    return false;
}

START_TEST(test_catalogue_query_validation_and_cancel)
{
    ebpo_error reported = EBPO_ERROR_INIT;
    ebpo_catalogue_query_options o = on_threads(1);
    ebpo_inside_result *out = query_alloc(point_count, sizeof *out);
    ebpo_distance_result distance;
    ebpo_ray ray = { { 9, 9, 9 }, { 0, 0, 0 }, 1 };
    ebpo_ray_hit hit;
    uint64_t number;
    int calls = 0;
    open_catalogue a = query_entries(entry, MODELS, 0);
    ebpo_model_stats sums;
    double far[6] = { 99, 99, 99, 99, NAN, 99 };
    ck_assert_int_eq(ebpo_catalogue_inside(a.catalogue, a.models, far, 2, &o, out, &reported),
                     EBPO_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(reported.message, "point 1 "));
    ck_assert_int_eq(ebpo_catalogue_ray(a.catalogue, a.models, &ray, 1, &o, &hit, &number,
                                        &reported),
                     EBPO_E_ARGUMENT);
    o.max_distance = -1;
    ck_assert_int_eq(ebpo_catalogue_distance(a.catalogue, a.models, far, 1, &o, &distance, &number,
                                             &reported),
                     EBPO_E_ARGUMENT);
    o.max_distance = INFINITY;
    ASSERT_OK(ebpo_catalogue_inside(a.catalogue, a.models, far, 1, &o, out, error));
    ck_assert_int_eq(out[0].where, EBPO_OUT);
    ck_assert_uint_eq(stats_of(&a, &sums).opened, 0);
    o.progress = (ebpo_progress){ stop_at_once, &calls };
    ck_assert_int_eq(ebpo_catalogue_inside(a.catalogue, a.models, points, point_count, &o, out,
                                           &reported),
                     EBPO_E_CANCELLED);
    ck_assert_int_eq(calls, 1);
    end_queries(&a);
    free(out);
}
END_TEST

static TCase *case_with_models(Suite *suite, const char *name)
{
    TCase *added = tcase_create(name);
    tcase_set_timeout(added, 600);
    tcase_add_unchecked_fixture(added, make_models, free_models);
    tcase_add_checked_fixture(added, scratch_enter, scratch_leave);
    suite_add_tcase(suite, added);
    return added;
}

TEST_SUITE(catalogue)
{
    Suite *suite = suite_create("catalogue");
    TCase *alone = case_with_models(suite, "catalogue"),
          *threads = case_with_models(suite, "threads");
    tcase_add_test(alone, test_catalogue_queries_many_models);
    tcase_add_test(alone, test_catalogue_budget_too_small_is_refused);
    tcase_add_test(alone, test_catalogue_parts_match_whole_model);
    tcase_add_test(alone, test_catalogue_of_caps_has_no_surface);
    tcase_add_test(alone, test_catalogue_query_validation_and_cancel);
    tcase_add_loop_test(alone, test_catalogue_of_pending_files, 0, 2);
    tcase_add_test(threads, test_catalogue_closes_and_reopens_models);
    tcase_add_test(threads, test_catalogue_uses_callers_open_function);
    return suite;
}
