/* Compares animated scenes with queries at many times, and packed scenes with their originals. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <ebpo/collide.h>
#include <ebpo/scene.h>

#include "check_main.h"
#include "exact_reference.h"
#include "model_file.h"
#include "query_support.h"

enum { PARTS = 5, LAST = 3, TIMES = 7 };
static const double clearance = 0.15, tolerance = 0.01;

static double some(uint64_t *state, double size)
{
    return (double)reference_integer(state, -1000000, 1000000) * size / 1000000;
}

/* --- scenes --- */

static void write_model(const char *name, ebpo_mesh mesh)
{
    ebpo_tree tree = model_build_parts(mesh, 4, ebpo_profile_parts(EBPO_PROFILE_FULL));
    ebpo_write_options options = EBPO_WRITE_OPTIONS_INIT;
    options.subtree_faces = 64;
    model_write(&tree, scratch(name), &options);
}

static void begin(void)
{
    static const double low[3] = { -2, -2, -0.1 }, high[3] = { 2, 2, 0.1 }, middle[3] = { 0 };
    scratch_enter();
    write_model("m0.ebpo.h5", ebpo_test_box(low, high, 12));
    write_model("m1.ebpo.h5", ebpo_test_torus(1, 0.3, 32, 16));
    write_model("m2.ebpo.h5", ebpo_test_sphere(middle, 0.4, 3));
}

static void put_pose(FILE *f, uint64_t *state, double far)
{
    fprintf(f, "{\"translation\": [%.9g, %.9g, %.9g], \"quaternion\": [%.9g, %.9g, %.9g, 1]",
            some(state, far), some(state, far), some(state, far), some(state, 1), some(state, 1),
            some(state, 1));
    fprintf(f, ", \"scale\": %.9g}", 0.75 + some(state, 0.25));
}

/* Makes a scene with two routes, one of which may have jumps; fixed plates; and instances that
 * move between the plates. */
static ebpo_scene *some_scene(uint64_t seed)
{
    uint64_t state = 977 * seed + 5;
    ebpo_scene *scene = NULL;
    FILE *f = fopen(scratch("s.json"), "w");
    fprintf(f, "{\"ebpo_scene\": \"1.0\", \"x-own\": [1], \"models\": {");
    for (int i = 0; i < 3; i++)
        fprintf(f, "%s\"m%d\": {\"file\": \"m%d.ebpo.h5\"}", i ? ", " : "", i, i);
    fprintf(f, "}, \"routes\": {");
    for (int i = 0; i < 2; i++) {
        fprintf(f, "%s\"r%d\": {\"step\": 1, \"between\": \"%s\", \"poses\": [", i ? ", " : "", i,
                i && seed % 3 == 2 ? "jump" : "even");
        for (int k = 0; k <= LAST; k++) {
            fputs(k ? ", " : "", f);
            put_pose(f, &state, 2);
        }
        fprintf(f, "]}");
    }
    fprintf(f, "}, \"instances\": [");
    for (int i = 0; i < PARTS; i++) {
        fprintf(f, "%s{\"name\": \"i%d\", \"model\": \"m%d\", ", i ? ", " : "", i,
                i < 2 ? 0 : 1 + i % 2);
        fprintf(f, i < 2 ? "\"fixed\": true, \"pose\": " : "\"route\": \"r%d\", \"pose\": ", i % 2);
        put_pose(f, &state, i < 2 ? 2 : 0.5);
        fprintf(f, "}");
    }
    fprintf(f, "], \"clearance\": [{\"between\": [\"*\", \"i0\"], \"distance\": %.9g}]}",
            clearance);
    fclose(f);
    ASSERT_OK(ebpo_scene_open(scratch("s.json"), NULL, &scene, error));
    ASSERT_OK(ebpo_scene_load(scene, NULL, error));
    return scene;
}

static ebpo_scene *packed_scene(ebpo_scene *from, double begin, double end, double margin)
{
    char path[200];
    ebpo_scene *scene = NULL;
    ebpo_pack_options how = EBPO_PACK_OPTIONS_INIT;
    how.margin = margin;
    snprintf(path, sizeof path, "%s/packed.scene.json", scratch("packed"));
    if (access(scratch("packed"), F_OK) == 0)
        scratch_remove(scratch("packed"));
    ASSERT_OK(ebpo_scene_pack(from, scratch("packed"), begin, end, &how, NULL, NULL, error));
    ASSERT_OK(ebpo_scene_open(path, NULL, &scene, error));
    ASSERT_OK(ebpo_scene_load(scene, NULL, error));
    return scene;
}

static int cut_models(const ebpo_scene *scene)
{
    int cut = 0;
    for (uint64_t i = 0; ebpo_scene_file(scene, i); i++)
        cut += ebpo_file_info(ebpo_scene_file(scene, i))->pruned;
    return cut;
}

/* --- contacts --- */

typedef struct intersected {
    ebpo_scene_clash list[PARTS * PARTS];
    uint64_t count;
} intersected;

static bool keep_clashes(void *user, const ebpo_scene_clash *clashes, uint64_t count)
{
    intersected *m = user;
    memcpy(m->list, clashes, count * sizeof *clashes);
    m->count = count;
    return true;
}

static ebpo_status intersect_by(ebpo_scene *scene, double time, unsigned threads, intersected *out,
                                ebpo_error *error)
{
    ebpo_scene_clash_options how = EBPO_SCENE_CLASH_OPTIONS_INIT;
    how.count = true;
    how.threads = threads;
    memset(out, 0, sizeof *out);
    return ebpo_scene_find_clashes(scene, time, &how, keep_clashes, out, NULL, error);
}

static ebpo_status meet(ebpo_scene *scene, double time, intersected *out, ebpo_error *error)
{
    return intersect_by(scene, time, 0, out, error);
}

START_TEST(test_packed_scene_gives_same_results)
{
    uint64_t rounds = query_scaled(60), clashes = 0, cut = 0;
    for (uint64_t n = 0; n < rounds + 3; n++) {
        uint64_t state = n;
        ebpo_scene *whole = some_scene(n), *part = packed_scene(whole, 0, LAST, n % 2 ? 1e-6 : 0);
        for (int i = 0; i < TIMES; i++) {
            double time = i < 2 ? (i ? LAST + 1 : -1) : 1.5 + some(&state, 1.5);
            intersected a, b;
            ASSERT_OK(meet(whole, time, &a, error));
            ASSERT_OK(meet(part, time, &b, error));
            clashes += a.count;
            ck_assert_msg(memcmp(&a, &b, sizeof a) == 0, "seed %d, time %.17g: %d and %d", (int)n,
                          time, (int)a.count, (int)b.count);
        }
        cut += (uint64_t)cut_models(part);
        ebpo_scene_free(part);
        ebpo_scene_free(whole);
    }
    ck_assert_uint_gt(clashes, 2 * rounds);
    ck_assert_uint_gt(cut, 0);
}
END_TEST

static uint64_t file_reads(const ebpo_scene *scene)
{
    uint64_t bytes = 0;
    for (uint64_t i = 0; ebpo_scene_file(scene, i); i++) {
        ebpo_file_stats stats = EBPO_FILE_STATS_INIT;
        ck_assert_int_eq(ebpo_file_get_stats(ebpo_scene_file(scene, i), &stats), EBPO_OK);
        bytes += stats.bytes_read;
    }
    return bytes;
}

static bool sum_packed(void *user, const ebpo_scene_packed *models, uint64_t count)
{
    uint64_t *sums = user; /* written and read bytes */
    for (uint64_t i = 0; i < count; i++) {
        sums[0] += models[i].bytes;
        sums[1] += models[i].bytes_read;
    }
    return true;
}

static bool ignore_needs(void *user, const ebpo_scene_need *needs, uint64_t count)
{
    (void)user;
    (void)needs;
    return count > 0;
}

/* Packing searches the needs as a plan does, and then reads the needed bytes. With a target size,
 * files are written twice, and the reads of both times count. */
START_TEST(test_packing_counts_all_reads)
{
    uint64_t sums[2][2] = { 0 };
    for (int reduced = 0; reduced < 2; reduced++) {
        ebpo_pack_options how = EBPO_PACK_OPTIONS_INIT;
        ebpo_scene *scene = some_scene(1);
        how.target_bytes = reduced ? sums[0][0] * 2 / 3 : 0;
        uint64_t before = file_reads(scene);
        ASSERT_OK(ebpo_scene_plan(scene, 0, LAST, NULL, ignore_needs, NULL, error));
        uint64_t planned = file_reads(scene) - before;
        ASSERT_OK(ebpo_scene_pack(scene, scratch("packed"), 0, LAST, &how, sum_packed,
                                  sums[reduced], error));
        ck_assert_uint_eq(sums[reduced][1], file_reads(scene) - before - 2 * planned);
        ebpo_scene_free(scene);
        scratch_remove(scratch("packed"));
    }
    ck_assert_uint_le(sums[1][0], sums[0][0] * 2 / 3);
}
END_TEST

/* A scene is packed for one time only. Another time gives the same result as the original scene,
 * or an error. */
START_TEST(test_packed_scene_refuses_omitted_time)
{
    uint64_t refused = 0, rounds = query_scaled(60) + 3;
    for (uint64_t n = 0; n < rounds; n++) {
        ebpo_scene *whole = some_scene(n), *part = packed_scene(whole, 0, 0, 0);
        for (double time = 0.25; time <= LAST; time += 0.25) {
            intersected a, b;
            ebpo_error why = EBPO_ERROR_INIT;
            ebpo_status status = meet(part, time, &b, &why);
            if (status == EBPO_E_ABSENT) {
                ck_assert_msg(strstr(why.message, "is a subset"), "%s", why.message);
                refused++;
                continue;
            }
            ck_assert_int_eq(status, EBPO_OK);
            ASSERT_OK(meet(whole, time, &a, error));
            ck_assert(memcmp(&a, &b, sizeof a) == 0);
        }
        ebpo_scene_free(part);
        ebpo_scene_free(whole);
    }
    ck_assert_uint_gt(refused, rounds);
}
END_TEST

/* --- approaches --- */

typedef struct approaches {
    ebpo_scene_approach_result list[PARTS * PARTS];
    uint64_t count;
} approaches;

static bool keep_approaches(void *user, const ebpo_scene_approach_result *list, uint64_t count)
{
    approaches *w = user;
    memcpy(w->list, list, count * sizeof *list);
    w->count = count;
    return true;
}

/* Returns the exact distance of two instances in the whole scene. */
static double distance_at(ebpo_scene *scene, uint64_t a, uint64_t b, double time)
{
    ebpo_scene_instance at = EBPO_SCENE_INSTANCE_INIT;
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collide_distance_result found;
    ebpo_collider *collider;
    ebpo_model *model[2];
    for (int i = 0; i < 2; i++) {
        ck_assert_int_eq(ebpo_scene_get_instance(scene, i ? b : a, &at), EBPO_OK);
        ASSERT_OK(ebpo_scene_model(scene, at.model, &model[i], error));
        ASSERT_OK(
            ebpo_scene_pose(scene, i ? b : a, time, i ? &options.pose_b : &options.pose_a, error));
    }
    ASSERT_OK(ebpo_collider_new(model[0], model[1], NULL, &collider, error));
    ASSERT_OK(ebpo_collide_distance(collider, &options, NULL, &found, error));
    ebpo_collider_free(collider);
    return found.distance.hi;
}

static void check_approach(ebpo_scene *whole, const ebpo_scene_approach_result *w)
{
    double at = distance_at(whole, w->a, w->b, w->time);
    ck_assert_int_ge(w->reached, 0);
    ck_assert_msg(w->lo <= at && at <= w->hi, "%.17g is not in %.17g to %.17g", at, w->lo, w->hi);
    if (w->reached)
        ck_assert_double_le(at, w->clearance + tolerance);
    else
        ck_assert_double_gt(at, w->clearance);
    for (int i = 0; i < 40; i++) {
        double time = w->time * i / 40, d = distance_at(whole, w->a, w->b, time);
        ck_assert_msg(d > w->clearance || w->time == 0, "pair %d %d: %g at time %.17g, not %.17g",
                      (int)w->a, (int)w->b, d, time, w->time);
    }
}

START_TEST(test_approach_finds_every_pair)
{
    uint64_t rounds = query_scaled(40) + 3, reached = 0, apart = 0;
    for (uint64_t n = 0; n < rounds; n++) {
        ebpo_scene_approach_options how = EBPO_SCENE_APPROACH_OPTIONS_INIT;
        approaches list[2] = { { .count = 0 }, { .count = 0 } };
        ebpo_scene *whole = some_scene(n), *part = packed_scene(whole, 0, LAST, 0);
        how.tolerance = tolerance;
        ASSERT_OK(ebpo_scene_approach(whole, 0, LAST, &how, keep_approaches, &list[0], error));
        ASSERT_OK(ebpo_scene_approach(part, 0, LAST, &how, keep_approaches, &list[1], error));
        ck_assert_uint_eq(list[0].count, list[1].count);
        for (uint64_t i = 0; i < 2 * list[0].count; i++) {
            const ebpo_scene_approach_result *w = &list[i % 2].list[i / 2];
            check_approach(whole, w);
            reached += w->reached == 1 && w->time > 0;
            apart += w->reached == 0;
        }
        ebpo_scene_free(part);
        ebpo_scene_free(whole);
    }
    ck_assert_uint_gt(reached, rounds / 2);
    ck_assert_uint_gt(apart, rounds / 2);
}
END_TEST

typedef struct leasts {
    ebpo_scene_least list[PARTS * PARTS];
    uint64_t count;
} leasts;

static bool keep_leasts(void *user, const ebpo_scene_least *list, uint64_t count)
{
    leasts *l = user;
    memcpy(l->list, list, count * sizeof *list);
    l->count = count;
    return true;
}

static void check_least(ebpo_scene *whole, const ebpo_scene_least *l)
{
    ck_assert_double_ge(l->time, 0);
    ck_assert_double_le(l->time, LAST);
    if (l->hi < INFINITY)
        ck_assert_double_le(distance_at(whole, l->a, l->b, l->time), l->hi);
    for (int i = 0; i <= 60; i++) {
        double d = distance_at(whole, l->a, l->b, LAST * (i / 60.));
        ck_assert_msg(d >= l->lo, "pair %d %d: %.17g below %.17g", (int)l->a, (int)l->b, d, l->lo);
    }
}

START_TEST(test_approach_distance_bounds_hold)
{
    uint64_t rounds = query_scaled(40) + 3, apart = 0, closed = 0;
    for (uint64_t n = 0; n < rounds; n++) {
        ebpo_scene_approach_options how = EBPO_SCENE_APPROACH_OPTIONS_INIT;
        leasts list[2] = { { .count = 0 }, { .count = 0 } };
        ebpo_scene *whole = some_scene(n), *part = packed_scene(whole, 0, LAST, 0);
        how.tolerance = tolerance;
        ASSERT_OK(ebpo_scene_least_distances(whole, 0, LAST, &how, keep_leasts, &list[0], error));
        how.max_evaluations = 200;
        ASSERT_OK(ebpo_scene_least_distances(part, 0, LAST, &how, keep_leasts, &list[1], error));
        ck_assert_uint_eq(list[0].count, list[1].count);
        for (uint64_t i = 0; i < list[0].count; i++) {
            const ebpo_scene_least *l = &list[0].list[i];
            ck_assert_msg(l->hi - l->lo <= tolerance, "%g to %g", l->lo, l->hi);
            check_least(whole, l);
            check_least(whole, &list[1].list[i]);
            apart += l->lo > 0;
            closed += list[1].list[i].hi - list[1].list[i].lo <= tolerance;
        }
        ebpo_scene_free(part);
        ebpo_scene_free(whole);
    }
    ck_assert_uint_gt(apart, rounds);
    ck_assert_uint_gt(closed, rounds);
}
END_TEST

/* --- threads --- */

/* Results of all queries of a scene, with freshly loaded models. */
typedef struct all_results {
    intersected intersected;
    approaches approaches;
    leasts leasts;
} all_results;

static void query_by(uint64_t seed, unsigned threads, all_results *out)
{
    ebpo_scene_approach_options how = EBPO_SCENE_APPROACH_OPTIONS_INIT;
    ebpo_scene *scene = some_scene(seed);
    how.threads = threads;
    how.tolerance = tolerance;
    how.max_evaluations = 100;
    memset(out, 0, sizeof *out);
    ASSERT_OK(intersect_by(scene, 0.5, threads, &out->intersected, error));
    ASSERT_OK(ebpo_scene_approach(scene, 0, LAST, &how, keep_approaches, &out->approaches, error));
    ASSERT_OK(ebpo_scene_least_distances(scene, 0, LAST, &how, keep_leasts, &out->leasts, error));
    ebpo_scene_free(scene);
}

START_TEST(test_scene_results_same_for_any_threads)
{
    for (uint64_t n = 0; n < 3; n++) {
        static all_results one, many;
        query_by(n, 1, &one);
        query_by(n, 4, &many);
        ck_assert(memcmp(&one, &many, sizeof one) == 0);
        ck_assert_uint_gt(one.approaches.count, 0);
    }
}
END_TEST

TEST_SUITE(scene_routes)
{
    Suite *suite = suite_create("scene_routes");
    TCase *tests = tcase_create("scene_routes"), *threads = tcase_create("threads");
    tcase_add_checked_fixture(tests, begin, scratch_leave);
    tcase_set_timeout(tests, 900);
    tcase_add_test(tests, test_packed_scene_gives_same_results);
    tcase_add_test(tests, test_packing_counts_all_reads);
    tcase_add_test(tests, test_packed_scene_refuses_omitted_time);
    tcase_add_test(tests, test_approach_finds_every_pair);
    tcase_add_test(tests, test_approach_distance_bounds_hold);
    suite_add_tcase(suite, tests);
    tcase_add_checked_fixture(threads, begin, scratch_leave);
    tcase_set_timeout(threads, 900);
    tcase_add_test(threads, test_scene_results_same_for_any_threads);
    suite_add_tcase(suite, threads);
    return suite;
}
