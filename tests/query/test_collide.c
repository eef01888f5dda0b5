/* Two small models at poses of all kinds: all pairs of faces against brute force with the exact
 * test of two faces; also swapped, with other threads, and with little memory. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/collide.h>

#include "check_main.h"
#include "core/simd.h"
#include "extras/collide/collider.h"
#include "geometry/triangle_pair.h"
#include "query_support.h"

/* Kernels that count how many sides of boxes they decode for eight children at a time, and how many
 * times they compute eight square roots. */
static uint64_t decoded_sides, square_roots;
EBPO_EIGHT f8 decode_sides(const uint8_t *x)
{
    decoded_sides++;
    return f8_from_bytes(x);
}
EBPO_EIGHT f8 count_roots(f8 x)
{
    square_roots++;
    return f8_sqrt(x);
}
#define f8_from_bytes      decode_sides
#define f8_sqrt            count_roots
#define EBPO_KERNEL_SUFFIX counted
#include "extras/collide/pair_walk_kernels.c"

enum { POSES = 12, LARGE_POSES = 40 };

/* --- poses --- */

/* Sets the rotation from a quaternion. */
static void turn_by(ebpo_pose *pose, const double q[4])
{
    double n = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    double w = q[0], x = q[1], y = q[2], z = q[3];
    double r[3][3] = { { n - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y) },
                       { 2 * (x * y + w * z), n - 2 * (x * x + z * z), 2 * (y * z - w * x) },
                       { 2 * (x * z - w * y), 2 * (y * z + w * x), n - 2 * (x * x + y * y) } };
    for (int i = 0; i < 9; i++)
        pose->rotation[i / 3][i % 3] = r[i / 3][i % 3] / n;
}

static double signed_unit(uint64_t *state) { return 2 * ebpo_test_random_unit(state) - 1; }

/* Makes a pose. The kinds are: identity; quarter turns; translations by halves and by tiny amounts;
 * rotations; random poses, also scaled and far from the origin. */
static ebpo_pose make_pose(int kind, double size, uint64_t *state)
{
    ebpo_pose pose = EBPO_POSE_INIT;
    double q[4] = { 1, kind % 4 == 1, 0, 0 };
    if (kind >= 6)
        for (int i = 0; i < 4; i++)
            q[i] = signed_unit(state);
    turn_by(&pose, q);
    for (int i = 0; i < 3; i++) {
        if (kind == 2 || kind == 3)
            pose.translation[i] = size * 0.5 * (double)(ebpo_test_random(state) % 3);
        if (kind == 4 || kind == 5)
            pose.translation[i] = size * 1e-9 * signed_unit(state);
        if (kind >= 6)
            pose.translation[i] = size * 0.4 * signed_unit(state);
    }
    if (kind >= 9)
        pose.scale = exp(2 * signed_unit(state));
    return pose;
}

/* --- brute force --- */

static void posed(const ebpo_pose *p, const double x[3], double out[3])
{
    for (int i = 0; i < 3; i++) {
        double a = p->scale * p->rotation[i][0] * x[0], b = p->scale * p->rotation[i][1] * x[1],
               c = p->scale * p->rotation[i][2] * x[2];
        out[i] = ((a + b) + c) + p->translation[i];
    }
}

static void posed_face(const query_model *m, const ebpo_pose *p, uint64_t f, double out[3][3])
{
    for (int i = 0; i < 3; i++) {
        double x[3];
        ebpo_test_point(&m->mesh, m->mesh.faces[3 * f + (uint64_t)i], x);
        posed(p, x, out[i]);
    }
}

typedef struct pair_list {
    ebpo_face_pair *pair;
    uint64_t count, capacity;
} pair_list;

static void add_pair(pair_list *l, ebpo_face_pair pair)
{
    if (l->count == l->capacity) {
        l->capacity = l->capacity ? 2 * l->capacity : 1024;
        l->pair = realloc(l->pair, l->capacity * sizeof *l->pair);
        ck_assert(l->pair != NULL);
    }
    l->pair[l->count++] = pair;
}

static bool boxes_apart(const double a[3][3], const double b[3][3])
{
    for (int k = 0; k < 3; k++)
        if (fmax(a[0][k], fmax(a[1][k], a[2][k])) < fmin(b[0][k], fmin(b[1][k], b[2][k])) ||
            fmax(b[0][k], fmax(b[1][k], b[2][k])) < fmin(a[0][k], fmin(a[1][k], a[2][k])))
            return true;
    return false;
}

static pair_list brute_force(const query_model *a, const ebpo_pose *pa, const query_model *b,
                             const ebpo_pose *pb)
{
    pair_list out = { 0 };
    double(*faces)[3][3] = query_alloc(b->mesh.face_count, sizeof *faces);
    for (uint64_t j = 0; j < b->mesh.face_count; j++)
        posed_face(b, pb, j, faces[j]);
    for (uint64_t i = 0; i < a->mesh.face_count; i++) {
        double face[3][3];
        posed_face(a, pa, i, face);
        const double(*f)[3] = (const double(*)[3])face;
        for (uint64_t j = 0; j < b->mesh.face_count; j++) {
            const double(*g)[3] = (const double(*)[3])faces[j];
            ebpo_pair_kind kind = boxes_apart(f, g) ? EBPO_PAIR_APART : ebpo_triangle_pair(f, g);
            if (kind != EBPO_PAIR_APART)
                add_pair(&out, (ebpo_face_pair){ query_reported(a, (uint32_t)i),
                                                 query_reported(b, (uint32_t)j), i, j,
                                                 (int32_t)kind, 0 });
        }
    }
    free(faces);
    return out;
}

/* --- queries --- */

static bool take_pairs(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    for (uint64_t i = 0; i < count; i++)
        add_pair(user, pairs[i]);
    return true;
}

static pair_list query_all(ebpo_model *a, const ebpo_pose *pa, ebpo_model *b, const ebpo_pose *pb,
                           unsigned threads, uint64_t memory)
{
    pair_list out = { 0 };
    ebpo_collider_options with = EBPO_COLLIDER_OPTIONS_INIT;
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collider *collider;
    with.threads = threads;
    with.memory = memory;
    options.pose_a = *pa;
    options.pose_b = *pb;
    ASSERT_OK(ebpo_collider_new(a, b, &with, &collider, error));
    ASSERT_OK(ebpo_collide_all(collider, &options, take_pairs, &out, error));
    ebpo_collider_free(collider);
    return out;
}

static int32_t query_first(ebpo_model *a, const ebpo_pose *pa, ebpo_model *b, const ebpo_pose *pb,
                           ebpo_face_pair *pair)
{
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collider *collider;
    int32_t found;
    options.pose_a = *pa;
    options.pose_b = *pb;
    ASSERT_OK(ebpo_collider_new(a, b, NULL, &collider, error));
    ASSERT_OK(ebpo_collide_first(collider, &options, pair, &found, error));
    ebpo_collider_free(collider);
    return found;
}

static int by_file(const void *x, const void *y)
{
    const ebpo_face_pair *p = x, *q = y;
    if (p->file_face_a != q->file_face_a)
        return p->file_face_a < q->file_face_a ? -1 : 1;
    return (p->file_face_b > q->file_face_b) - (p->file_face_b < q->file_face_b);
}

static void check_same(const pair_list *want, const pair_list *got, const char *what)
{
    ck_assert_msg(want->count == got->count, "%s: %llu pairs, not %llu", what,
                  (unsigned long long)got->count, (unsigned long long)want->count);
    for (uint64_t i = 0; i < want->count; i++)
        ck_assert_msg(memcmp(&want->pair[i], &got->pair[i], sizeof *got->pair) == 0,
                      "%s: pair %llu is %llu %llu kind %d, not %llu %llu kind %d", what,
                      (unsigned long long)i, (unsigned long long)got->pair[i].file_face_a,
                      (unsigned long long)got->pair[i].file_face_b, got->pair[i].kind,
                      (unsigned long long)want->pair[i].file_face_a,
                      (unsigned long long)want->pair[i].file_face_b, want->pair[i].kind);
}

static ebpo_face_pair turned(ebpo_face_pair p)
{
    return (ebpo_face_pair){ p.face_b, p.face_a, p.file_face_b, p.file_face_a, p.kind, 0 };
}

/* --- checks of a case --- */

static void check_first(const pair_list *want, const query_model *a, const ebpo_pose *pa,
                        const query_model *b, const ebpo_pose *pb, const char *what)
{
    ebpo_face_pair pair, other;
    int32_t found = query_first(a->model, pa, b->model, pb, &pair);
    ck_assert_msg(found == (want->count > 0), "%s: first contact", what);
    ck_assert_int_eq(query_first(b->model, pb, a->model, pa, &other), found);
    if (!found)
        return;
    other = turned(other);
    ck_assert_msg(memcmp(&pair, &other, sizeof pair) == 0, "%s: swapped", what);
    const ebpo_face_pair *is = bsearch(&pair, want->pair, want->count, sizeof pair, by_file);
    ck_assert_msg(is && memcmp(is, &pair, sizeof pair) == 0,
                  "%s: the reported pair does not intersect", what);
}

/* --- in parts --- */

/* Opens the same file, cut at a level, or under the minimum budget (level -1). */
static ebpo_model *in_parts(const query_model *m, int cut_level)
{
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model_plan plan = EBPO_MODEL_PLAN_INIT;
    ebpo_model *out;
    options.cut_level = cut_level;
    if (cut_level < 0) {
        ASSERT_OK(ebpo_model_memory(m->file, &options, &plan, error));
        options.memory = plan.least;
    }
    ASSERT_OK(ebpo_model_new(m->file, &options, &out, error));
    return out;
}

static void check_first_of_parts(const pair_list *want, ebpo_model *a, const ebpo_pose *pa,
                                 ebpo_model *b, const ebpo_pose *pb, const char *what)
{
    ebpo_face_pair pair, other;
    int32_t found = query_first(a, pa, b, pb, &pair);
    ck_assert_msg(found == (want->count > 0), "%s: first contact", what);
    ck_assert_int_eq(query_first(b, pb, a, pa, &other), found);
    bool is = !found;
    for (uint64_t i = 0; i < want->count && !is; i++)
        is = memcmp(&want->pair[i], &pair, sizeof pair) == 0;
    ck_assert_msg(is, "%s: the reported pair does not intersect", what);
    other = turned(other);
    ck_assert_msg(!found || memcmp(&pair, &other, sizeof pair) == 0, "%s: swapped", what);
}

/* Partly loaded models give the same pairs as whole models, in the same order and byte for byte:
 * with both in parts, one in parts, swapped, with threads, and with little memory for pairs. */
static void check_parts(const pair_list *want, const query_model *a, const ebpo_pose *pa,
                        const query_model *b, const ebpo_pose *pb, int level, const char *what)
{
    ebpo_model *part_a = in_parts(a, level), *part_b = in_parts(b, level < 0 ? 1 : level + 1);
    pair_list both = query_all(part_a, pa, part_b, pb, 3, 0),
              one = query_all(part_a, pa, b->model, pb, 1, 3000),
              swapped = query_all(part_b, pb, part_a, pa, 2, 2000);
    check_same(want, &both, what);
    check_same(want, &one, what);
    for (uint64_t i = 0; i < swapped.count; i++)
        swapped.pair[i] = turned(swapped.pair[i]);
    check_same(want, &swapped, what);
    check_first_of_parts(want, part_a, pa, part_b, pb, what);
    free(both.pair);
    free(one.pair);
    free(swapped.pair);
    ebpo_model_free(part_a);
    ebpo_model_free(part_b);
}

/* --- by levels --- */

static ebpo_level_result query_levels(ebpo_model *a, const ebpo_pose *pa, ebpo_model *b,
                                      const ebpo_pose *pb, int level, uint64_t deadline)
{
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collider *collider;
    ebpo_level_result out;
    options.pose_a = *pa;
    options.pose_b = *pb;
    options.level = level;
    options.deadline_ns = deadline;
    ASSERT_OK(ebpo_collider_new(a, b, NULL, &collider, error));
    ASSERT_OK(ebpo_collide_levels(collider, &options, &out, error));
    ebpo_collider_free(collider);
    return out;
}

static bool posed_boxes_apart(const query_model *a, const ebpo_pose *pa, const query_model *b,
                              const ebpo_pose *pb)
{
    double low[2][3], high[2][3];
    for (int side = 0; side < 2; side++) {
        const query_model *m = side ? b : a;
        for (int k = 0; k < 3; k++) {
            low[side][k] = INFINITY;
            high[side][k] = -INFINITY;
        }
        for (uint64_t f = 0; f < m->mesh.face_count; f++) {
            double face[3][3];
            posed_face(m, side ? pb : pa, f, face);
            for (int i = 0; i < 9; i++) {
                low[side][i % 3] = fmin(low[side][i % 3], face[i / 3][i % 3]);
                high[side][i % 3] = fmax(high[side][i % 3], face[i / 3][i % 3]);
            }
        }
    }
    for (int k = 0; k < 3; k++)
        if (low[0][k] > high[1][k] || low[1][k] > high[0][k])
            return true;
    return false;
}

static void check_level(const ebpo_level_result *r, bool meet, double distance, bool apart,
                        const char *what)
{
    ck_assert_msg(r->distance.lo <= distance && distance <= r->distance.hi,
                  "%s: %.17g is not in %.17g .. %.17g", what, distance, r->distance.lo,
                  r->distance.hi);
    ck_assert_msg(!meet || (r->contact == -1 && r->common != 0), "%s: faces intersect", what);
    ck_assert_msg((r->undecided_pairs == 0) == (r->contact == 0), "%s: undecided pairs", what);
    ck_assert_msg(!(r->common == 1 && apart), "%s: boxes are apart", what);
}

/* Checks results for whole models, in parts, after the deadline and swapped: the interval contains
 * the true distance. */
static void check_levels(bool meet, const query_model *a, const ebpo_pose *pa, const query_model *b,
                         const ebpo_pose *pb, const char *what)
{
    ebpo_model *part = in_parts(b, 1);
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collider *collider;
    ebpo_collide_distance_result truth;
    options.pose_a = *pa;
    options.pose_b = *pb;
    ASSERT_OK(ebpo_collider_new(a->model, b->model, NULL, &collider, error));
    ASSERT_OK(ebpo_collide_distance(collider, &options, NULL, &truth, error));
    ebpo_collider_free(collider);
    bool apart = posed_boxes_apart(a, pa, b, pb);
    for (int level = 0; level < 4; level++) {
        ebpo_level_result whole = query_levels(a->model, pa, b->model, pb, level, 0),
                          parts = query_levels(a->model, pa, part, pb, level, 0),
                          late = query_levels(a->model, pa, b->model, pb, level, 1),
                          swapped = query_levels(b->model, pb, a->model, pa, level, 0);
        check_level(&whole, meet, truth.distance.lo, apart, what);
        check_level(&parts, meet, truth.distance.lo, apart, what);
        check_level(&late, meet, truth.distance.lo, apart, what);
        ck_assert_int_eq(parts.level_b, level < 1 ? level : whole.level_b < 1 ? whole.level_b : 1);
        ck_assert(
            swapped.common == whole.common && swapped.undecided_pairs == whole.undecided_pairs &&
            swapped.distance.lo == whole.distance.lo && swapped.distance.hi == whole.distance.hi);
    }
    ebpo_model_free(part);
}

/* --- a complete case --- */

static void check_case(const query_model *a, const ebpo_pose *pa, const query_model *b,
                       const ebpo_pose *pb, int kind, const char *what)
{
    pair_list want = brute_force(a, pa, b, pb),
              in_order = query_all(a->model, pa, b->model, pb, 1, 0),
              swapped = query_all(b->model, pb, a->model, pa, 1, 0),
              others = query_all(a->model, pa, b->model, pb, 3, 2000);
    check_same(&in_order, &others, what);
    for (uint64_t i = 0; i < swapped.count; i++)
        swapped.pair[i] = turned(swapped.pair[i]);
    check_same(&in_order, &swapped, what);
    check_parts(&in_order, a, pa, b, pb, kind % 4 - 1, what);
    check_levels(in_order.count > 0, a, pa, b, pb, what);
    if (in_order.count)
        qsort(in_order.pair, in_order.count, sizeof *in_order.pair, by_file);
    check_same(&want, &in_order, what);
    check_first(&want, a, pa, b, pb, what);
    free(want.pair);
    free(in_order.pair);
    free(swapped.pair);
    free(others.pair);
}

static double size_of(const query_model *m) { return m->size > 0 ? m->size : 1; }

static const char *const names[] = {
    "cube",           "torus",           "blob",         "touching_shells", "sheet",
    "cube_twice",     "nested_windings", "sphere_float", "giant_and_dust",  "far_away_float",
    "zero_area_face", "thin_hollow",     "cone_slivers"
};
/* Larger products of face counts are tested at fewer poses. */
enum { FEW_PAIRS = 300000 };
enum { NAMES = sizeof names / sizeof *names };

/* Checks two solids, scaled to sizes of about one. */
static void check_two(const char *name_a, const char *name_b, int variant)
{
    query_model a, b;
    uint64_t state = (uint64_t)variant * 77 + strlen(name_a) * 1000 + strlen(name_b);
    query_model_make(&a, name_a, query_solid_by_name(name_a), &query_variants[variant]);
    query_model_make(&b, name_b, query_solid_by_name(name_b),
                     &query_variants[(variant + 1) % query_variant_count]);
    uint64_t work = a.mesh.face_count * b.mesh.face_count;
    for (int kind = 0; kind < POSES; kind++) {
        char what[128];
        if (work > FEW_PAIRS && kind % 4 != variant % 4)
            continue;
        ebpo_pose pa = make_pose(0, size_of(&a), &state), pb = make_pose(kind, size_of(&b), &state);
        if (kind >= 8)
            pa = make_pose(8, size_of(&a), &state);
        snprintf(what, sizeof what, "%s, %s, pose %d", name_a, name_b, kind);
        check_case(&a, &pa, &b, &pb, kind, what);
    }
    query_model_free(&a);
    query_model_free(&b);
}

START_TEST(test_collide_pairs_match_brute_force)
{
    if (ebpo_test_wanted(_i))
        check_two(names[_i / NAMES], names[_i % NAMES], _i % query_variant_count);
}
END_TEST

/* At one pose each face intersects its neighbours. This gives enough pairs for every thread. */
START_TEST(test_collide_pairs_same_for_any_threads)
{
    query_model m;
    ebpo_pose here = EBPO_POSE_INIT;
    query_model_make(&m, "torus", query_solid_by_name("torus"), &query_variants[0]);
    pair_list one = query_all(m.model, &here, m.model, &here, 1, 0),
              four = query_all(m.model, &here, m.model, &here, 4, 0);
    ck_assert_uint_gt(one.count, 1000);
    check_same(&one, &four, "four threads");
    free(one.pair);
    free(four.pair);
    query_model_free(&m);
}
END_TEST

/* --- one model with itself --- */

static bool same_point(const double p[3], const double q[3])
{
    return p[0] == q[0] && p[1] == q[1] && p[2] == q[2];
}

/* Returns true when the edge opposite the common corner intersects the other face. */
static bool intersects_beyond(const double a[3][3], const double b[3][3])
{
    for (int i = 0; i < 9; i++)
        if (same_point(a[i / 3], b[i % 3])) {
            double edge[3][3];
            for (int k = 0; k < 3; k++)
                memcpy(edge[k], a[(i / 3 + 1 + (k > 0)) % 3], sizeof edge[k]);
            return ebpo_triangle_pair((const double(*)[3])edge, b) != EBPO_PAIR_APART;
        }
    return false;
}

/* Returns true when a pair of faces intersects other than as neighbours. */
static bool intersect_unrelated(const query_model *m, const ebpo_face_pair *p)
{
    ebpo_pose here = EBPO_POSE_INIT;
    double x[3][3], y[3][3];
    posed_face(m, &here, p->file_face_a, x);
    posed_face(m, &here, p->file_face_b, y);
    const double(*a)[3] = (const double(*)[3])x, (*b)[3] = (const double(*)[3])y;
    int shared = 0;
    for (int i = 0; i < 9; i++)
        shared += same_point(a[i / 3], b[i % 3]);
    if (shared > 1)
        return p->kind == EBPO_PAIR_COPLANAR;
    return shared == 0 || p->kind != EBPO_PAIR_TOUCHING || intersects_beyond(a, b) ||
           intersects_beyond(b, a);
}

START_TEST(test_collide_finds_self_intersections)
{
    query_model m;
    ebpo_pose here = EBPO_POSE_INIT;
    pair_list got = { 0 };
    ebpo_collider *collider;
    const char *name = names[_i];
    query_model_make(&m, name, query_solid_by_name(name), &query_variants[0]);
    pair_list all = brute_force(&m, &here, &m, &here);
    ASSERT_OK(ebpo_collider_new(m.model, m.model, NULL, &collider, error));
    ASSERT_OK(ebpo_collide_self(collider, NULL, take_pairs, &got, error));
    uint64_t at = 0;
    for (uint64_t i = 0; i < all.count; i++) {
        const ebpo_face_pair *p = &all.pair[i];
        if (p->file_face_a >= p->file_face_b || !intersect_unrelated(&m, p))
            continue;
        ck_assert_msg(at < got.count && memcmp(p, &got.pair[at], sizeof *p) == 0,
                      "%s: %llu %llu kind %d is missing", name, (unsigned long long)p->file_face_a,
                      (unsigned long long)p->file_face_b, p->kind);
        at++;
    }
    ck_assert_uint_eq(at, got.count);
    ebpo_collider_free(collider);
    for (int level = -1; level < 4; level++) {
        if (ebpo_test_scale() < 1 && level >= 0 && level != _i % 4)
            continue;
        pair_list parts = { 0 };
        ebpo_model *model = in_parts(&m, level);
        ebpo_collider_options with = EBPO_COLLIDER_OPTIONS_INIT;
        with.threads = 1 + (unsigned)level % 3;
        with.memory = level > 1 ? 1000 : 0;
        ASSERT_OK(ebpo_collider_new(model, model, &with, &collider, error));
        ASSERT_OK(ebpo_collide_self(collider, NULL, take_pairs, &parts, error));
        check_same(&got, &parts, name);
        ebpo_collider_free(collider);
        ebpo_model_free(model);
        free(parts.pair);
    }
    free(all.pair);
    free(got.pair);
    query_model_free(&m);
}
END_TEST

/* --- errors, and early ends --- */

static bool take_one(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    (void)pairs;
    *(uint64_t *)user += count;
    return false;
}

START_TEST(test_collide_levels_bound_result)
{
    query_model m;
    ebpo_pose here = EBPO_POSE_INIT, beside = EBPO_POSE_INIT, within = EBPO_POSE_INIT;
    query_variant fine = { "fine", 1, 5, EBPO_RULE_NONZERO, 0 };
    query_model_make(&m, "blob", query_solid_by_name("blob"), &fine);
    beside.translation[0] = 1.5 * m.size;
    within.translation[1] = 0.05 * m.size;
    ebpo_level_result r = query_levels(m.model, &here, m.model, &beside, -1, 0);
    ck_assert(r.common == 0 && r.contact == 0 && r.distance.lo > 0.2 * m.size);
    r = query_levels(m.model, &here, m.model, &within, -1, 0);
    ck_assert(r.common == 1 && r.distance.lo == 0);
    query_model_free(&m);
}
END_TEST

/* A small box within a large one: their boxes intersect, and there are no pairs to merge. Clang's
 * sanitizer would detect a call of qsort with memory that was not allocated. */
START_TEST(test_collide_boxes_overlap_without_contact)
{
    static const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    query_model large, small;
    ebpo_pose here = EBPO_POSE_INIT, within = EBPO_POSE_INIT;
    query_model_make(&large, "large", ebpo_test_box(low, high, 6), &query_variants[0]);
    query_model_make(&small, "small", ebpo_test_box(low, high, 6), &query_variants[0]);
    within.scale = 0.5;
    for (int k = 0; k < 3; k++)
        within.translation[k] = 0.25;
    for (uint64_t memory = 0; memory < 2; memory++) {
        pair_list none = query_all(large.model, &here, small.model, &within, 1, memory << 20);
        ck_assert_uint_eq(none.count, 0);
        free(none.pair);
    }
    query_model_free(&large);
    query_model_free(&small);
}
END_TEST

START_TEST(test_collide_bad_pose_and_cancel)
{
    query_model m;
    ebpo_collider *collider;
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_error refusal = EBPO_ERROR_INIT;
    ebpo_face_pair pair;
    int32_t found;
    uint64_t given = 0;
    query_model_make(&m, "torus", query_solid_by_name("torus"), &query_variants[0]);
    ASSERT_OK(ebpo_collider_new(m.model, m.model, NULL, &collider, error));
    ASSERT_OK(ebpo_collide_all(collider, NULL, take_one, &given, error));
    ck_assert_uint_gt(given, 0);
    options.deadline_ns = 1;
    ck_assert_int_eq(ebpo_collide_all(collider, &options, take_one, &given, &refusal),
                     EBPO_E_CANCELLED);
    ck_assert_ptr_nonnull(strstr(refusal.message, "deadline"));
    options.deadline_ns = 0;
    options.pose_b.rotation[0][0] = 1.1;
    ck_assert_int_eq(ebpo_collide_first(collider, &options, &pair, &found, &refusal),
                     EBPO_E_ARGUMENT);
    ck_assert_int_eq(ebpo_pose_check(m.model, &options.pose_b, &refusal), EBPO_E_ARGUMENT);
    ck_assert_int_eq(ebpo_pose_check(m.model, &options.pose_a, &refusal), EBPO_OK);
    ebpo_collider_free(collider);
    query_model_free(&m);
}
END_TEST

/* Begins a walk of the collider with the counting kernels. */
static void begin_counted_walk(ebpo_collider *c, const ebpo_collide_options *options,
                               ebpo_collision *q, ebpo_accel_pair *pair)
{
    ASSERT_OK(ebpo_collision_begin(q, c, options, error));
    const ebpo_accel *accel[2] = { q->model[0]->whole, q->model[1]->whole };
    const ebpo_block_posing *posing[2] = { &q->posing[0], &q->posing[1] };
    ebpo_accel_pair_make(pair, accel, posing, q->max_coordinate);
    ebpo_pair_walk_begin(&c->walk, pair);
    c->walk.kernels = &ebpo_walk_kernels_counted;
    decoded_sides = square_roots = 0;
}

START_TEST(test_collide_keeps_transformed_nodes)
{
    query_model m;
    ebpo_collider *c;
    ebpo_collision q;
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_accel_pair pair;
    query_model_make(&m, "sphere", query_solid_by_name("sphere"), &query_variants[0]);
    ASSERT_OK(ebpo_collider_new(m.model, m.model, NULL, &c, error));
    options.pose_b.translation[0] = m.size / 2;
    begin_counted_walk(c, &options, &q, &pair);
    ck_assert(c->walk.kernels->start(&c->walk) && c->walk.kernels->run(&c->walk, UINT64_MAX));
    uint64_t transformed = decoded_sides / 6; /* two sides on each axis */
    ck_assert_uint_eq(c->walk.node_pairs, 92);
    ck_assert_uint_le(transformed, 55); /* 61 with half of EBPO_TURNED_NODES */
    ebpo_collider_free(c);
    query_model_free(&m);
}
END_TEST

/* Finds the first contact at each pose. Returns the number of visited pairs of nodes. */
static uint64_t first_contacts(const query_model *m, const ebpo_pose *pose, int32_t *found,
                               ebpo_face_pair *pair)
{
    ebpo_collider *c;
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collider_stats stats = EBPO_COLLIDER_STATS_INIT;
    ASSERT_OK(ebpo_collider_new(m->model, m->model, NULL, &c, error));
    for (int i = 0; i < LARGE_POSES; i++) {
        options.pose_b = pose[i];
        ASSERT_OK(ebpo_collide_first(c, &options, &pair[i], &found[i], error));
    }
    ck_assert_int_eq(ebpo_collider_get_stats(c, &stats), EBPO_OK);
    ebpo_collision q;
    ebpo_accel_pair walked;
    begin_counted_walk(c, &options, &q, &walked);
    ck_assert(c->walk.kernels->start(&c->walk));
    ck_assert_uint_eq(square_roots, 2); /* each root was transformed; no cylinders were compared */
    ebpo_collider_free(c);
    return stats.node_pairs;
}

/* Removes the bounding cylinders of large children. A child without a cylinder has a radius that is
 * not less than half the diagonal of its box. */
static void remove_large_cylinders(const ebpo_accel *s)
{
    for (uint32_t n = 0; n < s->bound_count; n++) {
        ebpo_bound_cylinder *b = &s->cylinder[n];
        b->aside_step *= b->large ? 2 : 1;
        for (int lane = 0; lane < 8; lane++) {
            if (b->large && !(b->large >> lane & 1)) /* this child keeps its cylinder */
                b->radius[lane] = (int16_t)((b->radius[lane] + 1) / 2);
            if (!(b->large >> lane & 1))
                continue;
            for (int k = 0; k < 3; k++)
                b->axis[k][lane] = 0;
            b->from[lane] = b->to[lane] = 0;
            b->radius[lane] = INT16_MAX;
        }
    }
}

/* The bounding cylinders of large children exclude pairs of nodes, but they do not change the first
 * contact. */
START_TEST(test_collide_large_cylinders_exclude_pairs)
{
    query_model m;
    ebpo_pose pose[LARGE_POSES];
    int32_t found[2][LARGE_POSES], contacts = 0;
    ebpo_face_pair pair[2][LARGE_POSES];
    uint64_t state = 7;
    query_model_make(&m, "large sphere", ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 8),
                     &query_variants[0]);
    for (int i = 0; i < LARGE_POSES; i++) { /* the middles have distances of 1.7 to 2.2 */
        pose[i] = make_pose(6, 1, &state);
        double *t = pose[i].translation, length = sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]);
        for (int k = 0; k < 3; k++)
            t[k] *= (1.7 + 0.5 * i / LARGE_POSES) / length;
    }
    uint64_t with = first_contacts(&m, pose, found[0], pair[0]);
    remove_large_cylinders(m.model->whole);
    uint64_t without = first_contacts(&m, pose, found[1], pair[1]);
    ck_assert_uint_lt(5 * with, 4 * without); /* 588, 815 */
    for (int i = 0; i < LARGE_POSES; i++) {
        ck_assert_int_eq(found[0][i], found[1][i]);
        ck_assert_mem_eq(&pair[0][i], &pair[1][i], sizeof pair[0][i]);
        contacts += found[0][i];
    }
    ck_assert_int_gt(contacts, LARGE_POSES / 4);
    ck_assert_int_lt(contacts, LARGE_POSES);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(collide)
{
    TCase *tests = tcase_create("collide"), *threads = tcase_create("threads"),
          *nested = tcase_create("nested");
    tcase_set_timeout(tests, 900);
    tcase_set_timeout(threads, 900);
    tcase_set_timeout(nested, 900);
    tcase_add_test(threads, test_collide_pairs_same_for_any_threads);
    tcase_add_loop_test(tests, test_collide_pairs_match_brute_force, 0, NAMES * NAMES);
    tcase_add_loop_test(tests, test_collide_finds_self_intersections, 0, NAMES);
    tcase_add_test(nested, test_collide_boxes_overlap_without_contact);
    tcase_add_test(tests, test_collide_levels_bound_result);
    tcase_add_test(tests, test_collide_bad_pose_and_cancel);
    tcase_add_test(tests, test_collide_keeps_transformed_nodes);
    tcase_add_test(nested, test_collide_large_cylinders_exclude_pairs);
    Suite *suite = suite_create("collide");
    suite_add_tcase(suite, tests);
    suite_add_tcase(suite, threads);
    suite_add_tcase(suite, nested);
    return suite;
}
