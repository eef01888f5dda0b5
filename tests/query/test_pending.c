/* Queries of a file whose bytes arrive asynchronously: results are those of a file on disk, in as
 * many round trips as with a source that waits, within the smallest budget, in batches and with
 * threads. */
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/query.h>
#include <ebpo/subset.h>

#include "check_main.h"
#include "counted_source.h"
#include "ebpo_config.h"
#include "pending_source.h"
#include "scratch.h"
#include "solids.h"
#include "two_layouts.h"
#if EBPO_HAVE_EXTRAS
#include <ebpo/boolean.h>
#include <ebpo/collide.h>
#include <ebpo/map.h>
#endif

enum {
    ALL = EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS | EBPO_PART_LEAF_PLANES,
    HEAD = 4096,
    POINTS = 60
};

static ebpo_error error;

/* What a query gets. */
typedef struct subject {
    ebpo_file *file;
    ebpo_model *model;
    ebpo_context *context;
    double points[POINTS][3];
} subject;

static void add(uint64_t *sum, const void *data, uint64_t bytes)
{
    for (uint64_t i = 0; data && i < bytes; i++)
        *sum = (*sum ^ ((const uint8_t *)data)[i]) * UINT64_C(1099511628211);
}

/* --- queries, which add their results to a checksum --- */

typedef ebpo_status (*query_fn)(subject *s, uint64_t *sum);

static ebpo_status sum_inside(subject *s, uint64_t *sum)
{
    ebpo_inside_result result = { 0 };
    ebpo_status status = ebpo_inside(s->context, s->points[0], NULL, &result, &error);
    add(sum, &result.where, sizeof result.where);
    return status;
}

static ebpo_status sum_inside_many(subject *s, uint64_t *sum)
{
    ebpo_inside_result result[POINTS] = { { 0 } };
    ebpo_status status = ebpo_inside_many(s->context, s->points[0], POINTS, NULL, result, &error);
    for (int i = 0; i < POINTS; i++)
        add(sum, &result[i].winding, sizeof result[i].winding);
    return status;
}

static ebpo_status sum_envelopes(subject *s, uint64_t *sum)
{
    ebpo_inside_result result[POINTS] = { { 0 } };
    ebpo_inside_options options = EBPO_INSIDE_OPTIONS_INIT;
    options.envelopes = EBPO_ENVELOPES_USE;
    ebpo_status status =
        ebpo_inside_many(s->context, s->points[0], POINTS, &options, result, &error);
    options.envelopes = EBPO_ENVELOPES_AUTO;
    options.level = 5;
    if (status == EBPO_OK)
        status = ebpo_inside(s->context, s->points[1], &options, &result[0], &error);
    for (int i = 0; i < POINTS; i++)
        add(sum, &result[i].winding, sizeof result[i].winding);
    return status;
}

static ebpo_status sum_distance(subject *s, uint64_t *sum)
{
    ebpo_distance_result result = { 0 };
    ebpo_status status = ebpo_distance(s->context, s->points[0], NULL, &result, &error);
    add(sum, &result, sizeof result);
    return status;
}

static ebpo_status sum_distances(subject *s, uint64_t *sum)
{
    ebpo_distance_result result[POINTS] = { { 0 } };
    ebpo_status status = ebpo_distance_many(s->context, s->points[0], POINTS, NULL, result, &error);
    add(sum, result, sizeof result);
    return status;
}

static ebpo_status sum_modes(subject *s, uint64_t *sum)
{
    ebpo_status status = EBPO_OK;
    for (int mode = 1; mode <= 3 && status == EBPO_OK; mode++) {
        ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
        ebpo_distance_result result = { 0 };
        options.mode = (ebpo_distance_mode)mode;
        options.level = mode == 3 ? 4 : EBPO_LEVEL_ALL;
        status = ebpo_distance(s->context, s->points[2], &options, &result, &error);
        add(sum, &result.lo, sizeof result.lo);
    }
    return status;
}

static bool add_near(void *user, const ebpo_near_face *face)
{
    add(user, &face->file_face, sizeof face->file_face);
    return true;
}

static ebpo_status sum_within(subject *s, uint64_t *sum)
{
    ebpo_within_options within = EBPO_WITHIN_OPTIONS_INIT;
    within.radius = 0.5;
    return ebpo_distance_within(s->context, s->points[0], &within, add_near, sum, &error);
}

static const double AXIS[3] = { -1, 0.01, 0.02 }, START[3] = { 5, 0.1, 0.05 };

static ebpo_status sum_first_hit(subject *s, uint64_t *sum)
{
    ebpo_ray_hit first = { 0 };
    bool hit;
    ebpo_status status = ebpo_ray_first(s->context, START, AXIS, INFINITY, &first, &hit, &error);
    add(sum, &first.face, sizeof first.face);
    return status;
}

static ebpo_status sum_any_hit(subject *s, uint64_t *sum)
{
    bool hit = false;
    ebpo_status status = ebpo_ray_any(s->context, START, AXIS, INFINITY, &hit, &error);
    add(sum, &hit, sizeof hit);
    return status;
}

static void add_hits(uint64_t *sum, const ebpo_ray_hit *hits, uint64_t count)
{
    for (uint64_t i = 0; i < count; i++)
        add(sum, &hits[i].face, sizeof hits[i].face);
}

static ebpo_status sum_hits(subject *s, uint64_t *sum)
{
    const ebpo_ray_hit *hits;
    uint64_t count;
    ebpo_status status = ebpo_ray_all(s->context, START, AXIS, INFINITY, &hits, &count, &error);
    add_hits(sum, hits, count);
    return status;
}

static ebpo_ray ray_number(const subject *s, int i)
{
    const double *p = s->points[i];
    return (ebpo_ray){ { p[0], p[1], p[2] }, { -p[1], p[0] - 1, 0.3 * p[2] + 0.1 }, INFINITY };
}

static ebpo_status sum_many_rays(subject *s, uint64_t *sum)
{
    ebpo_ray rays[POINTS];
    ebpo_ray_hit first[POINTS];
    bool any[POINTS];
    const ebpo_ray_hit *hits = NULL;
    const uint64_t *begin = NULL;
    for (int i = 0; i < POINTS; i++)
        rays[i] = ray_number(s, i);
    ebpo_status status = ebpo_ray_first_many(s->context, rays, POINTS, NULL, first, &error);
    if (status == EBPO_OK)
        status = ebpo_ray_any_many(s->context, rays, POINTS, NULL, any, &error);
    if (status == EBPO_OK)
        status = ebpo_ray_all_many(s->context, rays, POINTS, NULL, &hits, &begin, &error);
    if (status != EBPO_OK)
        return status;
    add(sum, any, sizeof any);
    add_hits(sum, first, POINTS);
    add_hits(sum, hits, begin[POINTS]);
    return status;
}

static bool add_triangles(void *user, const ebpo_triangles *t)
{
    add(user, t->corners, t->count * sizeof *t->corners);
    return true;
}

static const double LOW[3] = { 1.9, -0.5, -0.9 }, HIGH[3] = { 2.9, 0.6, 0.9 };

static ebpo_status sum_box(subject *s, uint64_t *sum)
{
    const uint64_t *faces;
    uint64_t count;
    ebpo_status status = ebpo_faces_in_box(s->context, LOW, HIGH, &faces, &count, &error);
    if (status == EBPO_OK)
        add(sum, faces, count * sizeof *faces);
    return status;
}

static ebpo_status sum_triangles(subject *s, uint64_t *sum)
{
    return ebpo_triangles_in_box(s->context, LOW, HIGH, add_triangles, sum, &error);
}

#if EBPO_HAVE_EXTRAS
static bool add_pairs(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    for (uint64_t i = 0; i < count; i++)
        add(user, &pairs[i].file_face_a, 2 * sizeof pairs[i].file_face_a);
    return true;
}

static bool add_line(void *user, const ebpo_polyline *line)
{
    add(user, &line->count, sizeof line->count);
    return true;
}

static ebpo_status sum_pairs(ebpo_collider *c, const ebpo_collide_options *o, uint64_t *sum)
{
    ebpo_collide_distance_result clearance;
    ebpo_relation_result relation;
    ebpo_value_bounds depth[2] = { { 0 } };
    ebpo_face_pair pair;
    int32_t found;
    memset(&clearance, 0, sizeof clearance);
    memset(&relation, 0, sizeof relation);
    ebpo_status status = ebpo_collide_first(c, o, &pair, &found, &error);
    if (status == EBPO_OK)
        status = ebpo_collide_all(c, o, add_pairs, sum, &error);
    if (status == EBPO_OK)
        status = ebpo_collide_polylines(c, o, add_line, sum, &error);
    if (status == EBPO_OK)
        status = ebpo_collide_distance(c, o, NULL, &clearance, &error);
    if (status == EBPO_OK)
        status = ebpo_collide_relation(c, o, &relation, &error);
    if (status == EBPO_OK)
        status = ebpo_collide_depth(c, o, 0.5, &depth[0], &depth[1], &error);
    add(sum, &relation, sizeof relation);
    return status;
}

static ebpo_status sum_collisions(subject *s, uint64_t *sum)
{
    ebpo_collider *collider;
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    options.pose_b.translation[0] = 0.05;
    ebpo_status status = ebpo_collider_new(s->model, s->model, NULL, &collider, &error);
    if (status == EBPO_OK)
        status = sum_pairs(collider, &options, sum);
    ebpo_collider_free(collider);
    return status;
}

static ebpo_status sum_map(subject *s, uint64_t *sum)
{
    double distances[POINTS] = { 0 };
    ebpo_status status = ebpo_map_points(s->model, s->points[0], POINTS, NULL, distances, &error);
    add(sum, distances, sizeof distances);
    return status;
}

static ebpo_status sum_union(subject *s, uint64_t *sum)
{
    const ebpo_boolean_operand operands[2] = { { s->model, EBPO_POSE_INIT },
                                               { s->model, EBPO_POSE_INIT } };
    const ebpo_boolean_node nodes[3] = { { EBPO_BOOLEAN_OPERAND, 0, 0, 0 },
                                         { EBPO_BOOLEAN_OPERAND, 1, 0, 0 },
                                         { EBPO_BOOLEAN_UNION, 0, 1, 0 } };
    ebpo_boolean *boolean;
    ebpo_boolean_result results[POINTS];
    memset(results, 0, sizeof results);
    ebpo_status status = ebpo_boolean_new(operands, 2, nodes, 3, NULL, &boolean, &error);
    if (status == EBPO_OK)
        status = ebpo_boolean_inside_many(boolean, s->points[0], POINTS, results, &error);
    for (int i = 0; i < POINTS; i++)
        add(sum, &results[i].where, sizeof results[i].where);
    ebpo_boolean_free(boolean);
    return status;
}
#endif

static const struct {
    const char *name;
    query_fn query;
    bool many; /* round trips may be fewer than those of a source that waits, but also more */
} queries[] = {
    { "inside", sum_inside, false },        { "inside_many", sum_inside_many, false },
    { "envelopes", sum_envelopes, true },   { "distance", sum_distance, false },
    { "distances", sum_distances, false },  { "modes", sum_modes, true },
    { "within", sum_within, false },        { "first_hit", sum_first_hit, false },
    { "any_hit", sum_any_hit, false },      { "hits", sum_hits, false },
    { "many_rays", sum_many_rays, true },   { "box", sum_box, false },
    { "triangles", sum_triangles, false },
#if EBPO_HAVE_EXTRAS
    { "collisions", sum_collisions, true }, { "map", sum_map, true },
    { "union", sum_union, true },
#endif
};
enum { QUERIES = sizeof queries / sizeof *queries };

/* --- models --- */

static void make_points(subject *s)
{
    uint64_t state = 11;
    for (int i = 0; i < POINTS; i++) {
        double cosine, sine;
        ebpo_test_circle((uint32_t)(ebpo_test_random(&state) % 1000), 1000, &cosine, &sine);
        s->points[i][0] = (1.2 + 0.025 * i) * cosine;
        s->points[i][1] = (1.2 + 0.025 * i) * sine;
        s->points[i][2] = 0.01 * (i % 50) - 0.2;
    }
}

/* Makes a partly loaded model; repeats while bytes are pending. `memory` 0: the smallest budget. */
static void make_model(subject *s, pending_source *p, uint64_t memory)
{
    enum { CUT_LEVEL = 3 };
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model_plan plan = EBPO_MODEL_PLAN_INIT;
    ebpo_status status;
    make_points(s);
    options.threads = 1;
    options.memory = memory ? memory : 1 << 30;
    ck_assert(ebpo_model_memory(s->file, &options, &plan, &error) == EBPO_OK);
    options.memory = memory ? memory : plan.least;
    options.cut_level = memory ? CUT_LEVEL : -1;
    do
        status = ebpo_model_new(s->file, &options, &s->model, &error);
    while (p && pending_again(p, status));
    ck_assert_msg(status == EBPO_OK, "%s", error.message);
    ck_assert(ebpo_context_new(s->model, &s->context, &error) == EBPO_OK);
}

static void free_model(subject *s)
{
    ebpo_context_free(s->context);
    ebpo_model_free(s->model);
}

static const uint64_t SEED = UINT64_C(14695981039346656037);

/* Runs a cold query with a source that waits. */
static uint64_t query_waiting(query_fn query, const char *path, uint64_t memory, uint64_t *waves)
{
    counted_source c;
    subject s = { .file = counted_open(&c, path, true) };
    uint64_t sum = SEED, opened = c.batches + c.alone;
    make_model(&s, NULL, memory);
    ck_assert_msg(query(&s, &sum) == EBPO_OK, "%s", error.message);
    *waves = c.batches + c.alone - opened;
    free_model(&s);
    counted_close(&c, s.file);
    return sum;
}

static uint64_t query_pending(query_fn query, const char *path, uint64_t memory, uint64_t kept,
                              uint64_t *rounds)
{
    pending_source p;
    uint64_t sum;
    ebpo_status status;
    pending_begin(&p, path, kept);
    subject s = { .file = pending_open(&p, HEAD) };
    uint64_t opened = p.rounds;
    make_model(&s, &p, memory);
    do {
        sum = SEED;
        status = query(&s, &sum);
    } while (pending_again(&p, status));
    ck_assert_msg(status == EBPO_OK, "%s", error.message);
    *rounds = p.rounds - opened;
    free_model(&s);
    ebpo_close(s.file);
    pending_end(&p);
    return sum;
}

static void build(two_layouts *l)
{
    two_layouts_build(l, ebpo_test_torus(2, 0.7, 120, 80), 8, ALL, EBPO_CODEC_ZSTD, 400);
}

/* A cold query needs as many round trips as with a source that waits. */
START_TEST(test_query_round_trips)
{
    if (!ebpo_test_wanted(_i))
        return;
    two_layouts l;
    uint64_t waves, rounds;
    build(&l);
    uint64_t waiting = query_waiting(queries[_i].query, l.packed, 64 << 20, &waves),
             pending = query_pending(queries[_i].query, l.packed, 64 << 20, UINT64_MAX, &rounds);
    ck_assert_msg(waiting == pending, "%s: results differ", queries[_i].name);
    ck_assert_msg(queries[_i].many || rounds <= waves, "%s: %d round trips, %d expected",
                  queries[_i].name, (int)rounds, (int)waves);
    two_layouts_close(&l);
}
END_TEST

/* Within the smallest budget, each query is completed in a bounded number of round trips. */
START_TEST(test_queries_within_smallest_budget)
{
    if (!ebpo_test_wanted(_i))
        return;
    two_layouts l;
    uint64_t waves, rounds;
    build(&l);
    for (int packed = 0; packed < 2; packed++) {
        const char *path = packed ? l.packed : l.plain;
        uint64_t waiting = query_waiting(queries[_i].query, path, 0, &waves),
                 pending = query_pending(queries[_i].query, path, 0, 0, &rounds);
        ck_assert_msg(waiting == pending, "%s: results differ", queries[_i].name);
        ck_assert_msg(rounds <= 4 * waves + 20, "%s: %d round trips, %d with a source that waits",
                      queries[_i].name, (int)rounds, (int)waves);
    }
    two_layouts_close(&l);
}
END_TEST

/* --- batches --- */

enum { MANY = 3000, RAYS = 1500 };

/* A batch of queries; `done` may be NULL. */
typedef ebpo_status (*batch_fn)(subject *s, double (*points)[3], bool *done, void *out);

static ebpo_status batch_inside(subject *s, double (*points)[3], bool *done, void *out)
{
    ebpo_inside_options options = EBPO_INSIDE_OPTIONS_INIT;
    options.done = done;
    return ebpo_inside_many(s->context, points[0], MANY, &options, out, &error);
}

static ebpo_status batch_distance(subject *s, double (*points)[3], bool *done, void *out)
{
    ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
    options.done = done;
    return ebpo_distance_many(s->context, points[0], MANY, &options, out, &error);
}

static ebpo_status batch_rays(subject *s, double (*points)[3], bool *done, void *out)
{
    static ebpo_ray rays[RAYS];
    ebpo_ray_options options = EBPO_RAY_OPTIONS_INIT;
    options.done = done;
    options.threads = 2;
    for (int i = 0; i < RAYS; i++)
        rays[i] = (ebpo_ray){ { 4, points[i][0], 3 }, { -1, points[i][1], -1 }, INFINITY };
    return ebpo_ray_first_many(s->context, rays, RAYS, &options, out, &error);
}

static const struct {
    batch_fn batch;
    uint64_t count, size;
} batches[] = { { batch_inside, MANY, sizeof(ebpo_inside_result) },
                { batch_distance, MANY, sizeof(ebpo_distance_result) },
                { batch_rays, RAYS, sizeof(ebpo_ray_hit) } };

static uint64_t count_done(const bool *done, uint64_t count)
{
    uint64_t sum = 0;
    for (uint64_t i = 0; i < count; i++)
        sum += done[i];
    return sum;
}

/* Completed points keep their results, so their bytes need not stay. Fills `out`. */
static void run_batch(int number, subject *s, pending_source *p, double (*points)[3], uint8_t *out)
{
    static bool done[MANY];
    uint64_t before = 0, count = batches[number].count;
    ebpo_status status;
    memset(done, 0, sizeof done);
    while ((status = batches[number].batch(s, points, done, out)) == EBPO_E_PENDING) {
        ck_assert_msg(error.status == EBPO_E_PENDING, "%s", error.message);
        uint64_t now = count_done(done, count);
        ck_assert(now >= before && now < count);
        ck_assert(now > before ? pending_progress(p, status) : pending_again(p, status));
        before = now;
    }
    ck_assert_msg(status == EBPO_OK, "%s", error.message);
    ck_assert_uint_eq(count_done(done, count), count);
}

static two_layouts large; /* one for all batches */

static void make_large(void)
{
    scratch_enter();
    two_layouts_build(&large, ebpo_test_torus(2, 0.7, 400, 240), 9, ALL, EBPO_CODEC_ZSTD, 400);
}

static void free_large(void)
{
    two_layouts_close(&large);
    scratch_leave();
}

START_TEST(test_batches_resume)
{
    pending_source p;
    static double points[MANY][3];
    uint64_t bytes = batches[_i].count * batches[_i].size, state = 3;
    uint8_t *expected = calloc(bytes, 1), *found = calloc(bytes, 1);
    for (int i = 0; i < MANY; i++)
        for (int k = 0; k < 3; k++)
            points[i][k] =
                (k == 2 ? 1.5 : 6) * ((double)(ebpo_test_random(&state) % 100000) / 100000 - 0.5);
    subject near = { .file = large.without }, far;
    make_model(&near, NULL, 64 << 20);
    ck_assert(batches[_i].batch(&near, points, NULL, expected) == EBPO_OK);
    pending_begin(&p, large.packed, 0);
    far = (subject){ .file = pending_open(&p, HEAD) };
    make_model(&far, &p, 4 << 20);
    run_batch(_i, &far, &p, points, found);
    ck_assert(memcmp(expected, found, bytes) == 0);
    ck_assert_msg(p.rounds <= 40, "%d round trips", (int)p.rounds);
    ck_assert_msg(p.fetched <= 2 * p.size, "%d bytes fetched", (int)p.fetched);
    ck_assert_msg(p.peak < p.size, "%d of %d bytes held", (int)p.peak, (int)p.size);
    free_model(&near);
    free_model(&far);
    ebpo_close(far.file);
    pending_end(&p);
    free(expected);
    free(found);
}
END_TEST

/* --- threads --- */

typedef struct worker {
    pthread_t thread;
    ebpo_model *model;
    pending_source *source;
    pthread_mutex_t *lock;
    double (*points)[3];
    double sum;
} worker;

/* Supplies what all threads need. */
static void supply_needed(worker *w)
{
    pending_source *p = w->source;
    const ebpo_range *range;
    size_t count;
    pthread_mutex_lock(w->lock);
    ck_assert(ebpo_async_needed(p->async, &range, &count, NULL) == EBPO_OK);
    for (size_t i = 0; i < count; i++)
        ck_assert(ebpo_async_supply(p->async, range[i].offset, range[i].size,
                                    p->data + range[i].offset, "1", NULL) == EBPO_OK);
    pthread_mutex_unlock(w->lock);
}

static void *run_worker(void *user)
{
    worker *w = user;
    ebpo_context *context;
    ck_assert(ebpo_context_new(w->model, &context, NULL) == EBPO_OK);
    for (int i = 0; i < POINTS; i++) {
        ebpo_distance_result result;
        ebpo_status status;
        uint64_t operation = ebpo_async_begin(w->source->async);
        while ((status = ebpo_distance(context, w->points[i], NULL, &result, NULL)) ==
               EBPO_E_PENDING)
            supply_needed(w);
        ebpo_async_end(w->source->async, operation);
        ck_assert(status == EBPO_OK);
        w->sum += result.distance;
    }
    ebpo_context_free(context);
    return NULL;
}

/* Threads with operations of their own share one source and one model. */
START_TEST(test_threads_share_a_source)
{
    enum { THREADS = 4 };
    two_layouts l;
    pending_source p;
    worker w[THREADS];
    pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
    build(&l);
    pending_begin(&p, l.packed, 0);
    subject s = { .file = pending_open(&p, HEAD) };
    make_model(&s, &p, 0);
    for (int i = 0; i < THREADS; i++) {
        w[i] = (worker){ .model = s.model, .source = &p, .lock = &lock, .points = s.points };
        ck_assert(pthread_create(&w[i].thread, NULL, run_worker, &w[i]) == 0);
    }
    for (int i = 0; i < THREADS; i++)
        ck_assert(pthread_join(w[i].thread, NULL) == 0);
    for (int i = 1; i < THREADS; i++)
        ck_assert(w[i].sum == w[0].sum);
    free_model(&s);
    ebpo_close(s.file);
    pending_end(&p);
    two_layouts_close(&l);
}
END_TEST

TEST_SUITE(pending)
{
    Suite *suite = suite_create("pending");
    TCase *tests = tcase_create("single"), *batch = tcase_create("batches"),
          *many = tcase_create("many");
    tcase_set_timeout(tests, 900);
    tcase_add_checked_fixture(tests, scratch_enter, scratch_leave);
    tcase_add_loop_test(tests, test_query_round_trips, 0, QUERIES);
    tcase_add_loop_test(tests, test_queries_within_smallest_budget, 0, QUERIES);
    suite_add_tcase(suite, tests);
    tcase_set_timeout(batch, 900);
    tcase_add_unchecked_fixture(batch, make_large, free_large);
    tcase_add_loop_test(batch, test_batches_resume, 0, sizeof batches / sizeof *batches);
    suite_add_tcase(suite, batch);
    tcase_set_timeout(many, 900);
    tcase_add_checked_fixture(many, scratch_enter, scratch_leave);
    tcase_add_test(many, test_threads_share_a_source);
    suite_add_tcase(suite, many);
    return suite;
}
