/* Partly loaded models give the results of whole models: distances, contacts, lines and files. The
 * tests use several cut levels, both models or one model in parts, swapped models, and a shared
 * budget. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/collide.h>

#include "check_main.h"
#include "models_reference.h"
#include "extras/collide/posed_subtrees.h"
#include "geometry/triangle_pair.h"
#include "query_support.h"
#include "solids.h"

static const char *const names[] = { "torus", "blob",        "touching_shells", "sheet",
                                     "cube",  "thin_hollow", "far_away_float",  "nested_windings" };
enum { NAMES = sizeof names / sizeof *names };

typedef struct two_models {
    query_model model[2];
    ebpo_budget *budget;
    ebpo_model *part[2];
    ebpo_collider *whole, *parts, *one, *swapped;
} two_models;

static ebpo_model *open_part(const query_model *m, int cut_level, ebpo_budget *budget)
{
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model *out;
    options.cut_level = cut_level;
    options.budget = budget;
    ASSERT_OK(ebpo_model_new(m->file, &options, &out, error));
    return out;
}

static ebpo_collider *meet_in_threads(ebpo_model *a, ebpo_model *b, unsigned threads)
{
    ebpo_collider *out;
    ebpo_collider_options options = EBPO_COLLIDER_OPTIONS_INIT;
    options.threads = threads;
    ASSERT_OK(ebpo_collider_new(a, b, &options, &out, error));
    return out;
}

static ebpo_collider *meet(ebpo_model *a, ebpo_model *b) { return meet_in_threads(a, b, 2); }

enum { BUDGET = 6 << 20 };

static void make_two(two_models *t, const char *name_a, const char *name_b, int variant)
{
    query_model_make(&t->model[0], name_a, query_solid_by_name(name_a), &query_variants[variant]);
    query_model_make(&t->model[1], name_b, query_solid_by_name(name_b),
                     &query_variants[(variant + 1) % query_variant_count]);
    ASSERT_OK(ebpo_budget_new(BUDGET, &t->budget, error));
    t->part[0] = open_part(&t->model[0], variant % 3, t->budget);
    t->part[1] = open_part(&t->model[1], (variant + 1) % 3, t->budget);
    t->whole = meet(t->model[0].model, t->model[1].model);
    t->parts = meet(t->part[0], t->part[1]);
    t->one = meet(t->part[0], t->model[1].model);
    t->swapped = meet(t->part[1], t->model[0].model);
}

static void free_two(two_models *t)
{
    ebpo_budget_stats stats = EBPO_BUDGET_STATS_INIT;
    ck_assert_int_eq(ebpo_budget_get_stats(t->budget, &stats), EBPO_OK);
    ck_assert_uint_eq(stats.budget, BUDGET);
    ck_assert_uint_gt(stats.memory, 0);
    ck_assert_uint_le(stats.memory_peak, BUDGET);
    ebpo_collider_free(t->whole);
    ebpo_collider_free(t->parts);
    ebpo_collider_free(t->one);
    ebpo_collider_free(t->swapped);
    for (int i = 0; i < 2; i++) {
        ebpo_model_free(t->part[i]);
        query_model_free(&t->model[i]);
    }
    ck_assert_int_eq(ebpo_budget_get_stats(t->budget, &stats), EBPO_OK);
    ck_assert_uint_eq(stats.memory, 0);
    ebpo_budget_free(t->budget);
}

/* --- distances --- */

static ebpo_collide_distance_result run_query(ebpo_collider *c, const ebpo_pose pose[2],
                                              double tolerance, double at_least, bool warm)
{
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collide_distance_options how = EBPO_COLLIDE_DISTANCE_OPTIONS_INIT;
    ebpo_collide_distance_result out;
    options.pose_a = pose[0];
    options.pose_b = pose[1];
    how.tolerance = tolerance;
    how.at_least = at_least;
    how.warm = warm;
    ASSERT_OK(ebpo_collide_distance(c, &options, &how, &out, error));
    return out;
}

static ebpo_collide_distance_result turned(ebpo_collide_distance_result c)
{
    ebpo_collide_distance_result out = c;
    out.pair = (ebpo_face_pair){ c.pair.face_b,      c.pair.face_a, c.pair.file_face_b,
                                 c.pair.file_face_a, c.pair.kind,   0 };
    memcpy(out.point_a, c.point_b, sizeof out.point_a);
    memcpy(out.point_b, c.point_a, sizeof out.point_b);
    return out;
}

typedef struct looked_for {
    ebpo_face_pair pair;
    bool found;
} looked_for;

static bool find(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    looked_for *l = user;
    for (uint64_t i = 0; i < count && !l->found; i++)
        l->found = memcmp(&pairs[i], &l->pair, sizeof *pairs) == 0;
    return !l->found;
}

/* For intersecting faces, the reported pair depends on the parts. */
static void check_distance(const two_models *t, const ebpo_pose pose[2],
                           const ebpo_collide_distance_result *want,
                           const ebpo_collide_distance_result *got, const char *what)
{
    ck_assert_msg(memcmp(&want->distance, &got->distance, sizeof want->distance) == 0 &&
                      want->at_least == got->at_least,
                  "%s: %.17g, not %.17g", what, got->distance.hi, want->distance.hi);
    if (want->distance.hi > 0) {
        ck_assert_msg(memcmp(want, got, sizeof *want) == 0, "%s: another pair", what);
        return;
    }
    looked_for l = { got->pair, false };
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    options.pose_a = pose[0];
    options.pose_b = pose[1];
    ASSERT_OK(ebpo_collide_all(t->whole, &options, find, &l, error));
    ck_assert_msg(l.found, "%s: the reported pair has another kind", what);
}

static void check_distances(const two_models *t, const ebpo_pose pose[2], const char *what)
{
    const ebpo_pose back[2] = { pose[1], pose[0] };
    ebpo_collide_distance_result want = run_query(t->whole, pose, 0, -1, false),
                                 both = run_query(t->parts, pose, 0, -1, true),
                                 one = run_query(t->one, pose, 0, -1, false),
                                 swapped = turned(run_query(t->swapped, back, 0, -1, false));
    check_distance(t, pose, &want, &both, what);
    check_distance(t, pose, &want, &one, what);
    check_distance(t, pose, &want, &swapped, what);
    both = run_query(t->parts, pose, 0, -1, true);
    ck_assert_msg(memcmp(&want.distance, &both.distance, sizeof both.distance) == 0, "%s: warm",
                  what);
}

/* Other queries must agree with the exact distance. */
static void check_others(const two_models *t, const ebpo_pose pose[2], const char *what)
{
    double d = run_query(t->whole, pose, 0, -1, false).distance.hi, size = t->model[0].size;
    const double thresholds[] = { d / 2, nextafter(d, 0), nextafter(d, INFINITY), 2 * d + 1 };
    for (int i = 0; i < 4; i++) {
        ebpo_collide_distance_result c =
            run_query(i % 2 ? t->one : t->parts, pose, 0, thresholds[i], i > 1);
        ck_assert_msg(c.at_least == (thresholds[i] <= d), "%s: at least %.17g", what,
                      thresholds[i]);
        ck_assert_msg(c.distance.lo <= d && d <= c.distance.hi, "%s: %.17g not in %.17g .. %.17g",
                      what, d, c.distance.lo, c.distance.hi);
    }
    ebpo_value_bounds about = run_query(t->parts, pose, 0.01 * size, -1, false).distance;
    ck_assert_msg(about.lo <= d && d <= about.hi, "%s: tolerance", what);
    ck_assert_double_le(about.hi - about.lo, 0.011 * size + 1e-9 * d);
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collide_distance_result late;
    options.pose_a = pose[0];
    options.pose_b = pose[1];
    options.deadline_ns = 1;
    ASSERT_OK(ebpo_collide_distance(t->parts, &options, NULL, &late, error));
    ck_assert_msg(late.distance.lo <= d && d <= late.distance.hi, "%s: late", what);
}

/* --- contacts --- */

typedef struct reported {
    char *bytes;
    size_t count, capacity;
} reported;

static void add(reported *t, const void *bytes, size_t count)
{
    while (t->count + count > t->capacity) {
        t->capacity = t->capacity ? 2 * t->capacity : 4096;
        t->bytes = realloc(t->bytes, t->capacity);
        ck_assert(t->bytes != NULL);
    }
    memcpy(t->bytes + t->count, bytes, count);
    t->count += count;
}

static bool take_segments(void *user, const ebpo_contact_segment *segments, uint64_t count)
{
    add(user, segments, count * sizeof *segments);
    return true;
}

static bool take_line(void *user, const ebpo_polyline *l)
{
    add(user, &l->count, sizeof l->count);
    add(user, &l->closed, sizeof l->closed);
    add(user, l->points, l->count * 3 * sizeof *l->points);
    add(user, l->faces, (l->count - 1) * 2 * sizeof *l->faces);
    add(user, l->normals, (l->count - 1) * 6 * sizeof *l->normals);
    return true;
}

static void add_file(reported *t, const char *path)
{
    char buffer[4096];
    FILE *f = fopen(path, "rb");
    ck_assert_msg(f != NULL, "%s", path);
    for (size_t n; (n = fread(buffer, 1, sizeof buffer, f)) > 0;)
        add(t, buffer, n);
    ck_assert_int_eq(fclose(f), 0);
}

/* Runs every query for contacts. */
static reported report_all(ebpo_collider *c, const ebpo_pose pose[2], const char *folder,
                           bool files)
{
    reported out = { 0 };
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    options.pose_a = pose[0];
    options.pose_b = pose[1];
    ASSERT_OK(ebpo_collide_contacts(c, &options, take_segments, &out, error));
    ASSERT_OK(ebpo_collide_polylines(c, &options, take_line, &out, error));
    for (int i = 0; i < 2 && files; i++) {
        char path[512];
        snprintf(path, sizeof path, "%s/met.%s", folder, i ? "ply" : "h5");
        ASSERT_OK(
            ebpo_collide_write(c, &options, i ? EBPO_PAIRS_PLY : EBPO_PAIRS_HDF5, path, error));
        add_file(&out, path);
        ck_assert_int_eq(remove(path), 0);
    }
    return out;
}

static void check_contacts(const two_models *t, const ebpo_pose pose[2], bool files,
                           const char *what)
{
    ebpo_collider *other[2] = { t->parts, t->one };
    reported want = report_all(t->whole, pose, t->model[0].folder, files);
    for (int i = 0; i < 2; i++) {
        reported got = report_all(other[i], pose, t->model[0].folder, files);
        ck_assert_msg(got.count == want.count &&
                          (want.count == 0 || memcmp(got.bytes, want.bytes, want.count) == 0),
                      "%s: contacts of parts differ", what);
        free(got.bytes);
    }
    free(want.bytes);
}

/* --- relations --- */

static ebpo_relation_result relate(ebpo_collider *c, const ebpo_pose pose[2])
{
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_relation_result out;
    options.pose_a = pose[0];
    options.pose_b = pose[1];
    ASSERT_OK(ebpo_collide_relation(c, &options, &out, error));
    return out;
}

static int32_t turned_relation(int32_t r)
{
    return r == EBPO_A_INSIDE_B ? EBPO_B_INSIDE_A : r == EBPO_B_INSIDE_A ? EBPO_A_INSIDE_B : r;
}

static void check_relation(const two_models *t, const ebpo_pose pose[2], const char *what)
{
    const ebpo_pose back[2] = { pose[1], pose[0] };
    ebpo_relation_result want = relate(t->whole, pose), both = relate(t->parts, pose),
                         one = relate(t->one, pose), swapped = relate(t->swapped, back);
    swapped.relation = turned_relation(swapped.relation);
    ck_assert_msg(memcmp(&want, &both, sizeof want) == 0 && memcmp(&want, &one, sizeof want) == 0 &&
                      memcmp(&want, &swapped, sizeof want) == 0,
                  "%s: relation %d, of parts %d, %d, %d; contact %d, %d, %d, %d", what,
                  want.relation, both.relation, one.relation, swapped.relation, want.contact,
                  both.contact, one.contact, swapped.contact);
}

/* --- separation distance along a direction --- */

static ebpo_separation separation(ebpo_collider *c, const ebpo_pose pose[2], const double d[3],
                                  uint64_t deadline)
{
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_separation out;
    options.pose_a = pose[0];
    options.pose_b = pose[1];
    options.deadline_ns = deadline;
    ASSERT_OK(ebpo_collide_separation(c, &options, d, &out, error));
    return out;
}

static ebpo_separation swapped_separation(ebpo_separation w)
{
    const ebpo_face_pair p = w.pair;
    w.pair = (ebpo_face_pair){ p.face_b, p.face_a, p.file_face_b, p.file_face_a, p.kind, 0 };
    return w;
}

/* Along an axis many faces separate at the same time. */
static void check_separation(const two_models *t, const ebpo_pose pose[2], uint64_t *state,
                             const char *what)
{
    const ebpo_pose back[2] = { pose[1], pose[0] };
    double d[3], against[3];
    uint64_t axis = ebpo_test_random(state) % 6;
    for (uint64_t k = 0; k < 3; k++) {
        d[k] = axis < 3 ? (double)(axis == k) : ebpo_test_random_unit(state) - 0.5;
        against[k] = -d[k];
    }
    ebpo_separation want = separation(t->whole, pose, d, 0),
                    both = separation(t->parts, pose, d, 0), one = separation(t->one, pose, d, 0),
                    late = separation(t->parts, pose, d, 1),
                    swapped = swapped_separation(separation(t->swapped, back, against, 0));
    ck_assert_int_eq(want.t.kind, EBPO_VALUE_EXACT);
    ck_assert_msg(memcmp(&want, &both, sizeof want) == 0 && memcmp(&want, &one, sizeof want) == 0 &&
                      memcmp(&want, &swapped, sizeof want) == 0,
                  "%s: separation %.17g, of parts %.17g, %.17g, %.17g", what, want.t.lo, both.t.lo,
                  one.t.lo, swapped.t.lo);
    ck_assert_msg(late.t.lo <= want.t.lo && want.t.lo <= late.t.hi, "%s: late separation", what);
}

/* --- depths --- */

/* Computes the depths. Surfaces have no depth: then all bytes of the result are 0. */
static void depths(ebpo_collider *c, const two_models *t, const ebpo_pose pose[2], bool back,
                   uint64_t deadline, ebpo_value_bounds out[2])
{
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    bool solid[2] = { t->model[back].info.solid, t->model[!back].info.solid };
    options.pose_a = pose[back];
    options.pose_b = pose[!back];
    options.deadline_ns = deadline;
    memset(out, 0, 2 * sizeof *out);
    ASSERT_OK(ebpo_collide_depth(c, &options, 0.01 * t->model[0].size + 1e-6,
                                 solid[1] ? &out[back] : NULL, solid[0] ? &out[!back] : NULL,
                                 error));
}

static void check_depths(const two_models *t, const ebpo_pose pose[2], const char *what)
{
    ebpo_value_bounds want[2], both[2], one[2], swapped[2], late[2];
    depths(t->whole, t, pose, false, 0, want);
    depths(t->parts, t, pose, false, 0, both);
    depths(t->one, t, pose, false, 0, one);
    depths(t->swapped, t, pose, true, 0, swapped);
    depths(t->parts, t, pose, false, 1, late);
    for (int i = 0; i < 2; i++) {
        ck_assert_msg(memcmp(&want[i], &both[i], sizeof *want) == 0 &&
                          memcmp(&want[i], &one[i], sizeof *want) == 0 &&
                          memcmp(&want[i], &swapped[i], sizeof *want) == 0,
                      "%s: %.17g .. %.17g deep, of parts %.17g .. %.17g, %.17g .. %.17g, %.17g .. "
                      "%.17g",
                      what, want[i].lo, want[i].hi, both[i].lo, both[i].hi, one[i].lo, one[i].hi,
                      swapped[i].lo, swapped[i].hi);
        ck_assert_msg(late[i].lo <= want[i].hi && want[i].lo <= late[i].hi, "%s: late depth", what);
    }
}

START_TEST(test_partly_loaded_collision_matches_whole)
{
    two_models t;
    uint64_t state = (uint64_t)_i + 5;
    const char *name_a = names[_i / NAMES], *name_b = names[_i % NAMES];
    if (!ebpo_test_wanted(_i))
        return;
    make_two(&t, name_a, name_b, _i % query_variant_count);
    for (int kind = _i % 3; kind < REFERENCE_POSES; kind += 3) {
        char what[128];
        ebpo_pose pose[2];
        snprintf(what, sizeof what, "%s, %s, %s", name_a, name_b, reference_pose_name(kind));
        reference_pose(kind, t.model[0].size > 0 ? t.model[0].size : 1, &state, &pose[0], &pose[1]);
        check_distances(&t, pose, what);
        check_others(&t, pose, what);
        check_contacts(&t, pose, kind % 2 == 0, what);
        check_relation(&t, pose, what);
        check_separation(&t, pose, &state, what);
        check_depths(&t, pose, what);
    }
    free_two(&t);
}
END_TEST

/* --- small budgets --- */

static bool take_pairs(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    add(user, pairs, count * sizeof *pairs);
    return true;
}

static reported query_pairs(ebpo_collider *c, const ebpo_pose *pose_b)
{
    reported out = { 0 };
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    options.pose_b = *pose_b;
    ASSERT_OK(ebpo_collide_all(c, &options, take_pairs, &out, error));
    return out;
}

static uint64_t evicted(const ebpo_model *m)
{
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    ck_assert_int_eq(ebpo_model_get_stats(m, &stats), EBPO_OK);
    ck_assert(!stats.resident);
    return stats.evicted;
}

static ebpo_collider_stats stats_of(const ebpo_collider *c)
{
    ebpo_collider_stats out = EBPO_COLLIDER_STATS_INIT;
    ck_assert_int_eq(ebpo_collider_get_stats(c, &out), EBPO_OK);
    return out;
}

/* Checks relations of a partly loaded model, and counts the reads. */
static void check_far_relation(ebpo_collider *whole, ebpo_collider *parts, const ebpo_pose pose[2],
                               int32_t expected)
{
    ebpo_collider_stats before = stats_of(parts);
    ebpo_relation_result want = relate(whole, pose), got = relate(parts, pose);
    ck_assert_int_eq(want.relation, expected);
    ck_assert(memcmp(&want, &got, sizeof want) == 0);
    ck_assert_uint_gt(stats_of(parts).bytes_read, before.bytes_read);
}

static void check_far_separation(ebpo_collider *whole, ebpo_collider *parts,
                                 const ebpo_pose pose[2])
{
    const double d[3] = { 1, 0.25, 0.5 };
    ebpo_collider_stats before = stats_of(parts);
    ebpo_separation want = separation(whole, pose, d, 0), got = separation(parts, pose, d, 0);
    ck_assert_double_gt(want.t.lo, 0);
    ck_assert(memcmp(&want, &got, sizeof want) == 0);
    ck_assert_uint_gt(stats_of(parts).loads, before.loads);
    ck_assert_uint_gt(stats_of(parts).bytes_read, before.bytes_read);
}

static void check_far_depth(ebpo_collider *whole, ebpo_collider *parts, const ebpo_pose pose[2])
{
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_value_bounds want[2], got[2];
    options.pose_a = pose[0];
    options.pose_b = pose[1];
    ebpo_collider_stats before = stats_of(parts);
    ASSERT_OK(ebpo_collide_depth(whole, &options, 1e-3, &want[0], &want[1], error));
    ASSERT_OK(ebpo_collide_depth(parts, &options, 1e-3, &got[0], &got[1], error));
    ck_assert(memcmp(want, got, sizeof want) == 0);
    ck_assert_uint_gt(stats_of(parts).loads, before.loads);
}

static void check_far(ebpo_collider *whole, ebpo_collider *parts, const ebpo_pose *b,
                      int32_t relation)
{
    const ebpo_pose pose[2] = { EBPO_POSE_INIT, *b };
    check_far_relation(whole, parts, pose, relation);
    check_far_separation(whole, parts, pose);
    check_far_depth(whole, parts, pose);
}

/* Returns the number of leaves in the subtrees that a model has in memory. */
static uint64_t leaves_of(const ebpo_model *m)
{
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    ck_assert_int_eq(ebpo_model_get_stats(m, &stats), EBPO_OK);
    return stats.leaves;
}

/* Repeats a query whose subtrees do not fit in the budget. Skeletons that the query makes exclude
 * pairs of subtrees before these are loaded again. The second query visits the subtrees in the
 * reverse order, so it loads fewer of them. One thread is used, because the order in which several
 * threads work changes the number of loads. */
static void check_repeated_query(ebpo_model *const part[2], const ebpo_pose *pose_b)
{
    uint64_t loads[3];
    ebpo_collider *parts = meet_in_threads(part[0], part[1], 1);
    for (int i = 0; i < 3; i++) {
        reported all = query_pairs(parts, pose_b);
        loads[i] = stats_of(parts).loads;
        free(all.bytes);
    }
    uint64_t subtrees = stats_of(parts).subtrees / 3; /* of one query */
    ck_assert_msg(4 * loads[0] < 3 * subtrees && 2 * (loads[2] - loads[1]) < subtrees,
                  "%d subtrees, %d loads, then %d", (int)subtrees, (int)loads[0],
                  (int)(loads[2] - loads[1]));
    /* Pairs of faces need no leaves, which would take nearly half of the memory of subtrees. */
    ck_assert_uint_eq(leaves_of(part[0]) + leaves_of(part[1]), 0);
    ebpo_collider_free(parts);
}

/* Two models, each larger than the whole budget. */
START_TEST(test_collision_shares_one_budget)
{
    query_model m[2];
    ebpo_budget *budget;
    ebpo_model *part[2];
    ebpo_budget_stats stats = EBPO_BUDGET_STATS_INIT;
    ebpo_pose pose = EBPO_POSE_INIT, away = EBPO_POSE_INIT, small = EBPO_POSE_INIT;
    pose.translation[0] = 0.31;
    pose.translation[2] = 0.17;
    away.translation[2] = 1.9;
    small.scale = 0.125;
    small.translation[0] = 2;
    for (int i = 0; i < 2; i++)
        query_model_make(&m[i], "fine torus", ebpo_test_torus(2, 0.7 + 0.01 * i, 256, 128),
                         &query_variants[0]);
    ASSERT_OK(ebpo_budget_new(BUDGET, &budget, error));
    for (int i = 0; i < 2; i++)
        part[i] = open_part(&m[i], -1, budget);
    ebpo_collider *whole = meet(m[0].model, m[1].model), *parts = meet(part[0], part[1]);
    reported want = query_pairs(whole, &pose), got = query_pairs(parts, &pose);
    ck_assert_uint_gt(want.count, 0);
    ck_assert_uint_eq(want.count, got.count);
    ck_assert(memcmp(want.bytes, got.bytes, want.count) == 0);
    check_repeated_query(part, &pose);
    const ebpo_pose poses[2] = { EBPO_POSE_INIT, away };
    ebpo_collide_distance_result far = run_query(whole, poses, 0, -1, false),
                                 same = run_query(parts, poses, 0, -1, false);
    ck_assert_double_gt(far.distance.hi, 0);
    ck_assert(memcmp(&far, &same, sizeof far) == 0);
    ck_assert_uint_gt(evicted(part[0]) + evicted(part[1]), 0);
    check_far(whole, parts, &pose, EBPO_INTERSECTING);
    check_far(whole, parts, &small, EBPO_B_INSIDE_A);
    small.translation[0] = 0;
    check_far(whole, parts, &small, EBPO_DISJOINT);
    ck_assert_int_eq(ebpo_budget_get_stats(budget, &stats), EBPO_OK);
    ck_assert_uint_gt(stats.memory_peak, BUDGET / 3);
    ck_assert_uint_le(stats.memory_peak, BUDGET);
    ebpo_collider_free(whole);
    ebpo_collider_free(parts);
    for (int i = 0; i < 2; i++) {
        ebpo_model_free(part[i]);
        query_model_free(&m[i]);
    }
    ebpo_budget_free(budget);
    free(want.bytes);
    free(got.bytes);
}
END_TEST

/* Returns the number of visited pairs of subtrees since `before`. */
static uint64_t pairs_since(const ebpo_collider *c, ebpo_collider_stats before)
{
    return stats_of(c).subtree_pairs - before.subtree_pairs;
}

/* A first contact visits few pairs of subtrees. For all pairs, the envelopes of the levels below
 * the cut level exclude pairs of subtrees that were never loaded, and the skeletons exclude pairs
 * of subtrees that were loaded before. */
START_TEST(test_collision_visits_few_subtrees)
{
    enum { FIRST_MAX = 20, ALL_MAX = 1000, AGAIN_MAX = 400, CUT = 3 };
    query_model m[2];
    ebpo_model *part[2];
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_face_pair pair;
    int32_t found = 0;
    options.pose_b.translation[0] = 0.31;
    options.pose_b.translation[2] = 0.17;
    for (int i = 0; i < 2; i++) {
        ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
        query_model_make(&m[i], "fine torus", ebpo_test_torus(2, 0.7 + 0.01 * i, 256, 128),
                         &query_variants[0]);
        how.cut_level = CUT;
        ASSERT_OK(ebpo_model_new(m[i].file, &how, &part[i], error));
    }
    ebpo_collider *parts = meet(part[0], part[1]);
    ebpo_collider_stats before = stats_of(parts);
    ASSERT_OK(ebpo_collide_first(parts, &options, &pair, &found, error));
    uint64_t first = pairs_since(parts, before);
    ck_assert_int_eq(found, 1);
    before = stats_of(parts);
    reported want = query_pairs(parts, &options.pose_b);
    uint64_t all = pairs_since(parts, before);
    before = stats_of(parts);
    reported again = query_pairs(parts, &options.pose_b);
    ck_assert_uint_eq(want.count, again.count);
    ck_assert(memcmp(want.bytes, again.bytes, want.count) == 0);
    ck_assert_msg(first <= FIRST_MAX, "%d of %d pairs of subtrees", (int)first, (int)all);
    ck_assert_msg(all <= ALL_MAX, "%d pairs of subtrees", (int)all);
    ck_assert_msg(pairs_since(parts, before) <= AGAIN_MAX, "%d pairs of subtrees, then %d",
                  (int)all, (int)pairs_since(parts, before));
    ebpo_collider_free(parts);
    for (int i = 0; i < 2; i++) {
        ebpo_model_free(part[i]);
        query_model_free(&m[i]);
    }
    free(want.bytes);
    free(again.bytes);
}
END_TEST

/* Deep bounds exclude pairs of subtrees of partly loaded models. They are not read for a collision
 * with a whole model. */
START_TEST(test_deep_bounds_are_read_for_two_parts)
{
    enum { CUT = 3 };
    query_model m;
    ebpo_pose pose = EBPO_POSE_INIT;
    pose.translation[0] = 0.31;
    query_model_make(&m, "fine torus", ebpo_test_torus(2, 0.7, 128, 64), &query_variants[0]);
    ebpo_model *part[2] = { open_part(&m, CUT, NULL), open_part(&m, CUT, NULL) };
    for (int i = 0; i < 2; i++) {
        ebpo_collider *collider = meet(part[i], i ? part[0] : m.model);
        reported pairs = query_pairs(collider, &pose);
        ck_assert_uint_gt(pairs.count, 0);
        ck_assert_int_eq(part[i]->deep != NULL, i);
        free(pairs.bytes);
        ebpo_collider_free(collider);
    }
    for (int i = 0; i < 2; i++)
        ebpo_model_free(part[i]);
    query_model_free(&m);
}
END_TEST

/* A collision of a model with itself uses the envelopes of two nodes of the same model. The second
 * envelope leaves the first one as it is, also if it takes the place of the first one. */
START_TEST(test_two_deep_envelopes_at_once)
{
    query_model m;
    ebpo_posed_subtrees s;
    ebpo_posing posing;
    ebpo_convex first, second;
    const ebpo_pose pose = EBPO_POSE_INIT;
    query_model_make(&m, "torus", query_solid_by_name("torus"), &query_variants[0]);
    ebpo_model *part = open_part(&m, 1, NULL);
    ASSERT_OK(ebpo_posing_make(&posing, &pose, (double[]){ 10, 10, 10 }, error));
    ASSERT_OK(ebpo_posed_subtrees_make(&s, part, &posing, error));
    const ebpo_cell at = { 5, { 0, 0, 0 } };
    for (uint32_t i = 1; i < 1 << 12; i++) {
        const ebpo_cell other = { 5, { i & 15, i >> 4 & 15, i >> 8 } };
        double corner[8][3];
        ASSERT_OK(ebpo_posed_deep_envelope(&s, at, &first, error));
        ck_assert_int_eq(first.count, 8);
        memcpy(corner, first.point, sizeof corner);
        ASSERT_OK(ebpo_posed_deep_envelope(&s, other, &second, error));
        ck_assert(memcmp(corner, first.point, sizeof corner) == 0);
    }
    ebpo_posed_subtrees_free(&s);
    ebpo_model_free(part);
    query_model_free(&m);
}
END_TEST

/* Counts the calls of a progress function. */
static bool count_call(void *user, const char *stage, uint64_t done, uint64_t total)
{
    (void)stage, (void)done, (void)total;
    ++*(int *)user;
    return true;
}

/* Two flat boxes whose cells are apart are apart at once, although the balls around their cells
 * intersect. A search of some thousand pairs of nodes would report its progress. */
START_TEST(test_flat_models_are_apart_at_once)
{
    enum { CUT = 4 };
    int calls = 0;
    int32_t found = -1;
    query_model m;
    ebpo_face_pair pair;
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    query_model_make(&m, "flat box",
                     ebpo_test_box((double[]){ 0, 0, 0 }, (double[]){ 10, 10, 0.1 }, 32),
                     &query_variants[0]);
    ebpo_model *part = open_part(&m, CUT, NULL);
    ebpo_collider *parts = meet(part, part);
    options.pose_b.translation[2] = 0.25;
    options.progress = (ebpo_progress){ count_call, &calls };
    ASSERT_OK(ebpo_collide_first(parts, &options, &pair, &found, error));
    ck_assert_int_eq(found, 0);
    ck_assert_int_eq(calls, 0);
    ebpo_collider_free(parts);
    ebpo_model_free(part);
    query_model_free(&m);
}
END_TEST

/* A model that takes up to half of the budget is loaded completely; its memory is returned
 * afterwards. */
START_TEST(test_small_models_load_whole)
{
    query_model m;
    ebpo_budget *budget;
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    ebpo_budget_stats all = EBPO_BUDGET_STATS_INIT;
    query_model_make(&m, "torus", query_solid_by_name("torus"), &query_variants[0]);
    ck_assert_int_eq(ebpo_budget_new(0, &budget, &why), EBPO_E_ARGUMENT);
    ck_assert_int_eq(ebpo_budget_new(1 << 20, &budget, &why), EBPO_E_LIMIT);
    ASSERT_OK(ebpo_budget_new(64 << 20, &budget, error));
    ebpo_model *model = open_part(&m, -1, budget);
    ck_assert_int_eq(ebpo_model_get_stats(model, &stats), EBPO_OK);
    ck_assert(stats.resident && stats.budget == 64 << 20);
    ck_assert_int_eq(ebpo_budget_get_stats(budget, &all), EBPO_OK);
    ck_assert_uint_eq(all.memory, stats.memory);
    ebpo_model_free(model);
    ck_assert_int_eq(ebpo_budget_get_stats(budget, &all), EBPO_OK);
    ck_assert_uint_eq(all.memory, 0);
    ebpo_budget_free(budget);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(collide_parts)
{
    TCase *tests = tcase_create("collide_parts");
    tcase_set_timeout(tests, 900);
    tcase_add_loop_test(tests, test_partly_loaded_collision_matches_whole, 0, NAMES * NAMES);
    tcase_add_test(tests, test_collision_shares_one_budget);
    tcase_add_test(tests, test_collision_visits_few_subtrees);
    tcase_add_test(tests, test_deep_bounds_are_read_for_two_parts);
    tcase_add_test(tests, test_two_deep_envelopes_at_once);
    tcase_add_test(tests, test_flat_models_are_apart_at_once);
    tcase_add_test(tests, test_small_models_load_whole);
    Suite *suite = suite_create("collide_parts");
    suite_add_tcase(suite, tests);
    return suite;
}
