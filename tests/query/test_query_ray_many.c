/* Batches of rays: results equal those of single rays, in their order, for any number of threads
 * and any part in memory; and properties of closed solids. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef EBPO_COUNTS_INSTRUCTIONS
#include <signal.h>
#include <sys/ptrace.h>
#include <sys/wait.h>
#include <unistd.h>
#endif

#include "check_main.h"
#include "query/face_block.h"
#include "query/query_model.h"
#include "query_support.h"

/* Kernels that count how many sides of boxes they decode for eight children at a time, how many
 * rows of eight numbers they read, and how many products of eight numbers they compute. They also
 * count descents: visits of nodes of `counted_accel` at once after the visit of the parent. */
static uint64_t decoded_sides, products, rows_read, descents;
static const ebpo_accel *counted_accel;
static void count_descent(const uint8_t *x)
{
    static const ebpo_bound *last;
    const ebpo_bound *first = counted_accel->bound;
    const ebpo_bound *node = first + (size_t)(x - (const uint8_t *)first) / sizeof *first;
    descents += node != last && first + node->parent == last;
    last = node;
}
EBPO_EIGHT f8 decode_sides(const uint8_t *x)
{
    decoded_sides++;
    if (counted_accel)
        count_descent(x);
    return f8_from_bytes(x);
}
/* The kernels also note the last addresses that are prefetched, and count the blocks that are read,
 * the blocks whose lines after the first were not prefetched, and the fetches for exact tests. */
static const void *prefetched[64];
static uint64_t prefetches, blocks_read, blocks_late, faces_fetched;
static void note_prefetch(const void *at)
{
    prefetched[prefetches++ % (sizeof prefetched / sizeof *prefetched)] = at;
}
static bool was_prefetched(const void *at)
{
    bool was = false;
    for (size_t i = 0; i < sizeof prefetched / sizeof *prefetched; i++)
        was |= prefetched[i] == at;
    return was;
}
static ebpo_face_block open_block(const ebpo_accel *s, uint32_t block)
{
    const char *record = (const char *)ebpo_accel_meshlet(s, block);
    blocks_read++;
    blocks_late += !was_prefetched(record + 64) || !was_prefetched(record + 128);
    return ebpo_face_block_open(s, block);
}
static void fetch_face(const ebpo_accel *s, uint32_t local)
{
    faces_fetched++;
    ebpo_accel_fetch_face(s, local);
}
EBPO_EIGHT f8 read_row(const float *x)
{
    rows_read++;
    return f8_load(x);
}
EBPO_EIGHT f8 multiply(f8 a, f8 b)
{
    products++;
    return f8_mul(a, b);
}
EBPO_EIGHT f8 multiply_add(f8 a, f8 b, f8 c)
{
    products++;
    return f8_mul_add(a, b, c);
}
EBPO_EIGHT f8 multiply_sub(f8 a, f8 b, f8 c)
{
    products++;
    return f8_mul_sub(a, b, c);
}
#define __builtin_prefetch    note_prefetch
#define ebpo_face_block_open  open_block
#define ebpo_accel_fetch_face fetch_face
#define f8_from_bytes         decode_sides
#define f8_load               read_row
#define f8_mul                multiply
#define f8_mul_add            multiply_add
#define f8_mul_sub            multiply_sub
#define EBPO_KERNEL_SUFFIX    counted
#include "query/ray_kernels.c"
#undef __builtin_prefetch
#undef ebpo_face_block_open
#undef ebpo_accel_fetch_face

/* Counts the exact comparisons of hits, and the intersections of faces without knowledge from other
 * faces; the linker passes calls to __wrap_. */
static uint64_t compared, intersected;
void __real_ebpo_ray_triangle(const ebpo_segment *ray, const double triangle[3][3],
                              ebpo_ray_intersection *out);
void __wrap_ebpo_ray_triangle(const ebpo_segment *ray, const double triangle[3][3],
                              ebpo_ray_intersection *out);
void __wrap_ebpo_ray_triangle(const ebpo_segment *ray, const double triangle[3][3],
                              ebpo_ray_intersection *out)
{
    intersected++;
    __real_ebpo_ray_triangle(ray, triangle, out);
}
int __real_ebpo_ray_compare(const ebpo_segment *ray, const double a[3][3],
                            const ebpo_ray_intersection *at_a, const double b[3][3],
                            const ebpo_ray_intersection *at_b);
int __wrap_ebpo_ray_compare(const ebpo_segment *ray, const double a[3][3],
                            const ebpo_ray_intersection *at_a, const double b[3][3],
                            const ebpo_ray_intersection *at_b);
int __wrap_ebpo_ray_compare(const ebpo_segment *ray, const double a[3][3],
                            const ebpo_ray_intersection *at_a, const double b[3][3],
                            const ebpo_ray_intersection *at_b)
{
    compared++;
    return __real_ebpo_ray_compare(ray, a, at_a, b, at_b);
}

typedef struct results {
    ebpo_ray_hit *first;
    bool *any;
} results;

static ebpo_ray *make_rays(query_model *m, uint64_t count, uint64_t seed)
{
    ebpo_ray *rays = query_alloc(count, sizeof *rays);
    for (uint64_t i = 0; i < count; i++) {
        ebpo_ray *r = &rays[i];
        query_make_ray(m, &seed, r->origin, r->direction, &r->t_max);
        for (int k = 0; k < 3; k++)
            if (!isfinite(r->direction[k]))
                r->direction[k] = copysign(1e308, r->direction[k]);
    }
    return rays;
}

static bool same_hit(const ebpo_ray_hit *a, const ebpo_ray_hit *b)
{
    return memcmp(&a->t, &b->t, sizeof a->t) == 0 && a->face == b->face && a->side == b->side;
}

/* Finds the hits of one ray at a time, for all sides. */
static void query_singly(ebpo_context *context, const ebpo_ray *rays, uint64_t count, results *out)
{
    for (uint64_t i = 0; i < count; i++) {
        bool hit;
        out->first[i] = (ebpo_ray_hit){ INFINITY, EBPO_NO_FACE, 0 };
        ASSERT_OK(ebpo_ray_first(context, rays[i].origin, rays[i].direction, rays[i].t_max,
                                 &out->first[i], &hit, error));
        ASSERT_OK(ebpo_ray_any(context, rays[i].origin, rays[i].direction, rays[i].t_max,
                               &out->any[i], error));
        ck_assert_int_eq(hit, out->any[i]);
    }
}

static void query_together(ebpo_context *context, ebpo_context *other, const ebpo_ray *rays,
                           uint64_t count, unsigned threads, const results *expected)
{
    ebpo_ray_options options = EBPO_RAY_OPTIONS_INIT;
    const ebpo_ray_hit *hits, *single;
    const uint64_t *begin;
    uint64_t n;
    results got = { query_alloc(count, sizeof *got.first), query_alloc(count, sizeof *got.any) };
    options.threads = threads;
    ASSERT_OK(ebpo_ray_first_many(context, rays, count, &options, got.first, error));
    ASSERT_OK(ebpo_ray_any_many(context, rays, count, &options, got.any, error));
    ASSERT_OK(ebpo_ray_all_many(context, rays, count, &options, &hits, &begin, error));
    for (uint64_t i = 0; i < count; i++) {
        ck_assert(same_hit(&got.first[i], &expected->first[i]));
        ck_assert_int_eq(got.any[i], expected->any[i]);
        ASSERT_OK(ebpo_ray_all(other, rays[i].origin, rays[i].direction, rays[i].t_max, &single, &n,
                               error));
        ck_assert_uint_eq(begin[i + 1] - begin[i], n);
        for (uint64_t k = 0; k < n; k++)
            ck_assert(same_hit(&hits[begin[i] + k], &single[k]));
        ck_assert(n == 0 || same_hit(&single[0], &expected->first[i]));
    }
    free(got.first);
    free(got.any);
}

START_TEST(test_ray_batch_matches_single_rays)
{
    query_model m;
    query_model_make(&m, "sphere", query_solid_by_name("sphere"), &query_variants[5]);
    uint64_t count = _i == 2 ? 100 : 1100; /* enough pieces for several threads */
    ebpo_ray *rays = make_rays(&m, count, 7);
    results expected = { query_alloc(count, sizeof *expected.first),
                         query_alloc(count, sizeof *expected.any) };
    query_singly(m.context, rays, count, &expected);
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    how.cut_level = _i ? 2 : -1;
    how.loading = _i == 2 ? EBPO_LOAD_SUBTREE : EBPO_LOAD_CACHE;
    ebpo_model *model;
    ebpo_context *context;
    ASSERT_OK(ebpo_model_new(m.file, &how, &model, error));
    ASSERT_OK(ebpo_context_new(model, &context, error));
    for (unsigned threads = 1; threads < 4; threads += 2)
        query_together(context, m.context, rays, count, threads, &expected);
    ebpo_context_free(context);
    ebpo_model_free(model);
    free(expected.first);
    free(expected.any);
    free(rays);
    query_model_free(&m);
}
END_TEST

START_TEST(test_ray_batch_names_invalid_ray)
{
    query_model m;
    query_model_make(&m, "cube", query_solid_by_name("cube"), &query_variants[0]);
    ebpo_ray rays[3] = { { { 0, 0, 0 }, { 1, 0, 0 }, 1 },
                         { { 0, 0, 0 }, { 1, 0, 0 }, INFINITY },
                         { { 0, 0, 0 }, { 1, 0, 0 }, 1 } };
    ebpo_ray_hit first[3];
    const ebpo_ray_hit *hits;
    const uint64_t *begin;
    bool any[3];
    ebpo_ray_options options = EBPO_RAY_OPTIONS_INIT;
    ASSERT_OK(ebpo_ray_all_many(m.context, rays, 0, NULL, &hits, &begin, error));
    ck_assert_uint_eq(begin[0], 0);
    ebpo_error error = EBPO_ERROR_INIT;
    if (_i == 0)
        rays[2].t_max = -1;
    else if (_i == 1)
        rays[2].direction[0] = 0;
    else if (_i == 2)
        rays[2].origin[1] = NAN;
    else
        options.sides = (ebpo_ray_sides)3;
    ck_assert_int_eq(ebpo_ray_first_many(m.context, rays, 3, &options, first, &error),
                     EBPO_E_ARGUMENT);
    ck_assert(_i == 3 || strstr(error.message, "ray 2 "));
    ck_assert_int_eq(ebpo_ray_any_many(m.context, rays, 3, &options, any, &error), EBPO_E_ARGUMENT);
    ck_assert_int_eq(ebpo_ray_all_many(m.context, rays, 3, &options, &hits, &begin, &error),
                     EBPO_E_ARGUMENT);
    query_model_free(&m);
}
END_TEST

/* Several threads check the rays. The message names the first invalid ray, and only rays with a
 * result are flagged as completed. */
START_TEST(test_ray_batch_of_threads_names_first_invalid_ray)
{
    enum { RAYS = 8192, FIRST = 3001, SECOND = 3600 };
    query_model m;
    ebpo_ray *rays = query_alloc(RAYS, sizeof *rays);
    ebpo_ray_hit *first = query_alloc(RAYS, sizeof *first), single;
    bool *done = query_alloc(RAYS, sizeof *done), found;
    ebpo_ray_options options = EBPO_RAY_OPTIONS_INIT;
    ebpo_error failure = EBPO_ERROR_INIT;
    query_model_make(&m, "cube", query_solid_by_name("cube"), &query_variants[0]);
    uint64_t state = 5;
    for (int i = 0; i < RAYS; i++)
        query_make_ray(&m, &state, rays[i].origin, rays[i].direction, &rays[i].t_max);
    rays[FIRST].t_max = -1;
    rays[SECOND].origin[2] = INFINITY;
    memset(done, 0, RAYS * sizeof *done);
    options.threads = 4;
    options.done = done;
    ck_assert_int_eq(ebpo_ray_first_many(m.context, rays, RAYS, &options, first, &failure),
                     EBPO_E_ARGUMENT);
    ck_assert_msg(strstr(failure.message, "ray 3001 ") != NULL, "%s", failure.message);
    ck_assert(!done[FIRST] && !done[SECOND]);
    for (int i = 0; i < RAYS; i++)
        if (done[i]) {
            ASSERT_OK(ebpo_ray_first(m.context, rays[i].origin, rays[i].direction, rays[i].t_max,
                                     &single, &found, error));
            ck_assert_uint_eq(first[i].face, found ? single.face : EBPO_NO_FACE);
            ck_assert(!found || first[i].t == single.t);
        }
    query_model_free(&m);
    free(rays);
    free(first);
    free(done);
}
END_TEST

/* --- coherent rays, which a batch walks through the model together --- */

/* Makes rays that differ from the first one by about `share` of its origin and direction, or of one
 * of these, or of nothing. Some origins are far away. Some rays end near the hit of the first ray.
 * Some rays have the opposite direction on an axis, so they end a run of similar rays. */
static void make_coherent(query_model *m, uint64_t *state, double share, ebpo_ray *rays,
                          unsigned count)
{
    ebpo_ray *first = &rays[0];
    ebpo_ray_hit hit;
    bool found;
    query_make_ray(m, state, first->origin, first->direction, &first->t_max);
    for (int k = 0; k < 3; k++)
        if (!isfinite(first->direction[k]))
            first->direction[k] = copysign(1e300, first->direction[k]);
    double size = 0;
    for (int k = 0; k < 3; k++)
        size = fmax(size, fabs(first->direction[k]));
    bool far = ebpo_test_random(state) % 4 == 0;
    for (int k = 0; k < 3 && far; k++)
        first->origin[k] -= 8 * m->info.box_size[k] * (first->direction[k] / size);
    ASSERT_OK(ebpo_ray_first(m->context, first->origin, first->direction, first->t_max, &hit,
                             &found, error));
    unsigned how = (unsigned)(ebpo_test_random(state) % 4);
    for (unsigned i = 1; i < count; i++) {
        rays[i] = *first;
        for (int k = 0; k < 3; k++) {
            if (how & 1)
                rays[i].origin[k] +=
                    share * m->info.box_size[k] * (ebpo_test_random_unit(state) - 0.5);
            if (how & 2)
                rays[i].direction[k] += share * size * (ebpo_test_random_unit(state) - 0.5);
        }
        if (found && ebpo_test_random(state) % 4 == 0)
            rays[i].t_max = hit.t * (1 + share * (ebpo_test_random_unit(state) - 0.5));
        if (ebpo_test_random(state) % 32 == 0)
            rays[i].direction[i % 3] *= -1;
    }
}

START_TEST(test_coherent_rays_match_single_rays)
{
    enum { RAYS = EBPO_RAY_GROUP + 1 };
    query_model m;
    ebpo_ray rays[RAYS];
    ebpo_ray_hit together[RAYS], single;
    query_model_make(&m, query_solid_name(_i), query_solid_make(_i),
                     &query_variants[_i % query_variant_count]);
    uint64_t state = 11, count = query_scaled(m.mesh.face_count > 500 ? 200 : 600);
    if (_i % 2) /* the instruction set of tests, which every processor has */
        m.context->model->kernels.ray = &ebpo_ray_kernels_counted;
    for (uint64_t i = 0; i < count; i++) {
        ebpo_ray_options options = EBPO_RAY_OPTIONS_INIT;
        options.threads = 1;
        options.sides = (ebpo_ray_sides)(i % 3);
        make_coherent(&m, &state, ldexp(1, -(int)(i % 52)), rays, RAYS);
        ASSERT_OK(ebpo_ray_first_many(m.context, rays, RAYS, &options, together, error));
        for (int k = 0; k < RAYS; k++) {
            ASSERT_OK(ebpo_ray_first_many(m.context, &rays[k], 1, &options, &single, error));
            ck_assert_msg(same_hit(&together[k], &single), "ray %d of %llu", k,
                          (unsigned long long)i);
        }
    }
    query_model_free(&m);
}
END_TEST

/* Origins so far away that the frame of the model cannot hold them: these rays are not similar. */
START_TEST(test_far_rays_match_single_rays)
{
    enum { RAYS = 8 };
    query_model m;
    ebpo_ray rays[RAYS];
    ebpo_ray_hit together[RAYS], single;
    uint64_t hits = 0;
    query_model_make(&m, "torus", ebpo_test_torus(2, 0.7, 32, 16), &query_variants[0]);
    for (int e = 20; e <= 140; e++) {
        ebpo_ray_options options = EBPO_RAY_OPTIONS_INIT;
        options.threads = 1;
        for (int i = 0; i < RAYS; i++)
            rays[i] = (ebpo_ray){ { i ? 1.5 + i * 0.125 : ldexp(1, e - e % 4), 0.07, ldexp(1, e) },
                                  { 0, 0, -1 },
                                  INFINITY };
        ASSERT_OK(ebpo_ray_first_many(m.context, rays, RAYS, &options, together, error));
        for (int k = 0; k < RAYS; k++) {
            ASSERT_OK(ebpo_ray_first_many(m.context, &rays[k], 1, &options, &single, error));
            ck_assert_msg(same_hit(&together[k], &single), "ray %d, 2^%d", k, e);
            hits += single.face != EBPO_NO_FACE;
        }
    }
    ck_assert_uint_gt(hits, 500);
    query_model_free(&m);
}
END_TEST

/* Counts the searches that a group of rays begins. */
static uint64_t begun;
static ebpo_ray_search *(*uncounted_begin)(void *user, unsigned i);
static ebpo_ray_search *counted_begin(void *user, unsigned i)
{
    begun++;
    return uncounted_begin(user, i);
}
static uint32_t counted_walk_many(ebpo_ray_group *g)
{
    uncounted_begin = g->begin;
    g->begin = counted_begin;
    uint32_t open = ebpo_ray_kernels_counted.walk_many(g);
    g->begin = uncounted_begin;
    return open;
}

enum { SIDE = 64 };

/* Returns the number of sides that are decoded for rays from one eye through SIDE * SIDE pixels,
 * `aside` of the picture's middle, in calls of `part` rays. *hit: the number of rays with a hit. */
static uint64_t count_sides_aside(query_model *m, double aside, uint64_t part, uint64_t *hit)
{
    static ebpo_ray rays[SIDE * SIDE];
    static ebpo_ray_hit hits[SIDE * SIDE];
    ebpo_ray_options options = EBPO_RAY_OPTIONS_INIT;
    options.threads = 1;
    for (int i = 0; i < SIDE * SIDE; i++)
        rays[i] = (ebpo_ray){ { 0.1, 0.2, 5 },
                              { (i % SIDE - SIDE / 2) * 0x1p-7 + aside,
                                (i / SIDE - SIDE / 2) * 0x1p-7, -1 },
                              INFINITY };
    decoded_sides = products = rows_read = 0;
    for (uint64_t i = 0; i < SIDE * SIDE; i += part)
        ASSERT_OK(ebpo_ray_first_many(m->context, rays + i, part, &options, hits + i, error));
    *hit = 0;
    for (int i = 0; i < SIDE * SIDE; i++)
        *hit += hits[i].face != EBPO_NO_FACE;
    return decoded_sides;
}
static uint64_t count_sides(query_model *m, uint64_t part, uint64_t *hit)
{
    return count_sides_aside(m, 0, part, hit);
}

/* The kernel itself places ordinary rays in the frame; only far, long and short rays need `place`.
 */
static uint64_t placed;
static bool (*uncounted_place)(ebpo_ray_search *search);
static bool counted_place(ebpo_ray_search *r)
{
    placed++;
    return uncounted_place(r);
}
static void walk_with_counted_place(ebpo_ray_search *r)
{
    uncounted_place = r->place;
    r->place = counted_place;
    ebpo_ray_kernels_best()->walk(r);
}

START_TEST(test_kernel_places_ordinary_rays)
{
    const ebpo_ray_kernels kernels = { .walk = walk_with_counted_place };
    const double near[3] = { 0.1, 0.2, -2 }, far[3] = { 0.1, 0.2, -1e6 };
    double direction[3] = { 0.01, 0.02, 1 };
    query_model m;
    ebpo_ray_hit hit;
    bool any;
    query_model_make(&m, "sphere", query_solid_by_name("sphere"), &query_variants[5]);
    m.context->model->kernels.ray = &kernels;
    placed = 0;
    ASSERT_OK(ebpo_ray_first(m.context, near, direction, INFINITY, &hit, &any, error));
    ck_assert_uint_eq(placed, 0);
    ASSERT_OK(ebpo_ray_first(m.context, far, direction, INFINITY, &hit, &any, error));
    ck_assert_uint_eq(placed, 1);
    for (int k = 0; k < 3; k++)
        direction[k] *= 0x1p-40;
    ASSERT_OK(ebpo_ray_first(m.context, near, direction, INFINITY, &hit, &any, error));
    ck_assert_uint_eq(placed, 2);
    query_model_free(&m);
}
END_TEST

#ifdef EBPO_COUNTS_INSTRUCTIONS
/* Returns the number of instructions of a child process that finds the first hits of rays. The
 * child stops after each instruction. Returns 0 if the system does not allow this. */
static uint64_t count_instructions(ebpo_context *context, const ebpo_ray *rays, int count)
{
    uint64_t instructions = 0;
    int state = 0;
    ebpo_ray_hit hit;
    bool any;
    pid_t child = fork();
    if (child == 0) {
        if (ptrace(PTRACE_TRACEME, 0, NULL, NULL) != 0 || raise(SIGSTOP) != 0)
            _exit(1);
        for (int i = 0; i < count; i++)
            if (ebpo_ray_first(context, rays[i].origin, rays[i].direction, rays[i].t_max, &hit,
                               &any, NULL) != EBPO_OK)
                _exit(1);
        _exit(0);
    }
    while (waitpid(child, &state, 0) == child && WIFSTOPPED(state) &&
           ptrace(PTRACE_SINGLESTEP, child, NULL, NULL) == 0)
        instructions++;
    return WIFEXITED(state) && WEXITSTATUS(state) == 0 ? instructions : 0;
}

/* With AVX2, a single ray that misses the model takes few instructions. */
START_TEST(test_single_rays_take_few_instructions)
{
    enum { RAYS = 8, MOST = 455 };
    ebpo_ray rays[2 * RAYS];
    query_model m;
    if (!ebpo_cpu_has_v3())
        return;
    query_model_make(&m, "sphere", query_solid_by_name("sphere"), &query_variants[5]);
    for (int i = 0; i < 2 * RAYS; i++)
        rays[i] = (ebpo_ray){ { 0.1, 0.2, -5 },
                              { (i % 8 - 3.7) * 0x1p-6, (i / 8 % 8 - 3.4) * 0x1p-6, -1 },
                              INFINITY };
    /* the first call also loads functions */
    uint64_t once = count_instructions(m.context, rays, RAYS),
             twice = count_instructions(m.context, rays, 2 * RAYS);
    ck_assert_uint_le((twice - once) / RAYS, MOST);
    query_model_free(&m);
}
END_TEST
#endif

/* A picture of nothing needs one visit of a node for each EBPO_RAY_GROUP rays. */
START_TEST(test_bundles_miss_together)
{
    query_model m;
    uint64_t hits, sides;
    query_model_make(&m, "sphere", query_solid_by_name("sphere"), &query_variants[5]);
    m.context->model->kernels.ray = &ebpo_ray_kernels_counted;
    sides = count_sides_aside(&m, 0.8, SIDE * SIDE, &hits);
    ck_assert_uint_eq(hits, 0);
    ck_assert_uint_eq(sides, 6 * SIDE * SIDE / EBPO_RAY_GROUP);
    query_model_free(&m);
}
END_TEST

START_TEST(test_coherent_rays_share_nodes)
{
    query_model m;
    query_model_make(&m, "sphere", query_solid_by_name("sphere"), &query_variants[5]);
    m.context->model->kernels.ray = &ebpo_ray_kernels_counted;
    uint64_t hits, single = count_sides(&m, 1, &hits), single_products = products,
                   together = count_sides(&m, EBPO_RAY_GROUP, &hits);
    ck_assert_msg(together > 0 && 6 * together < single, "%llu sides, single rays %llu",
                  (unsigned long long)together, (unsigned long long)single);
    /* Rays also share the corners and edges of faces. */
    ck_assert_msg(products > 0 && 4 * products < 3 * single_products,
                  "%llu products, single rays %llu", (unsigned long long)products,
                  (unsigned long long)single_products);
    query_model_free(&m);
}
END_TEST

/* A packet whose node only four rays enter tests eight children with each of these rays, and does
 * not read the values of eight rays for each child. */
START_TEST(test_few_rays_of_packet_read_few_rows)
{
    query_model m;
    uint64_t hits, single;
    query_model_make(&m, "sphere", query_solid_by_name("sphere"), &query_variants[5]);
    m.context->model->kernels.ray = &ebpo_ray_kernels_counted;
    count_sides(&m, 1, &hits);
    single = rows_read;
    count_sides(&m, 4, &hits);
    ck_assert_msg(rows_read > 0 && rows_read < single, "%llu rows, single rays %llu",
                  (unsigned long long)rows_read, (unsigned long long)single);
    query_model_free(&m);
}
END_TEST

/* The packet finds the only possible face of most rays, so few rays need a search, also in groups
 * in which a direction changes its sign. */
START_TEST(test_coherent_rays_begin_few_searches)
{
    const ebpo_ray_kernels kernels = { ebpo_ray_kernels_counted.walk, counted_walk_many };
    query_model m;
    uint64_t hits;
    query_model_make(&m, "sphere", query_solid_by_name("sphere"), &query_variants[5]);
    m.context->model->kernels.ray = &kernels;
    begun = 0;
    count_sides_aside(&m, 4 * 0x1p-7, EBPO_RAY_GROUP, &hits);
    ck_assert_msg(3 * hits > SIDE * SIDE && 20 * begun < hits, "%llu searches, %llu hits",
                  (unsigned long long)begun, (unsigned long long)hits);
    query_model_free(&m);
}
END_TEST

/* Returns the number of descents of a call for rays. */
static uint64_t count_descents(query_model *m, ebpo_ray_wants wants, const ebpo_ray *rays,
                               uint64_t count)
{
    static ebpo_ray_hit first[640];
    static bool any[640];
    const ebpo_ray_hit *hits;
    const uint64_t *begin;
    ebpo_ray_options options = EBPO_RAY_OPTIONS_INIT;
    options.threads = 1;
    descents = 0;
    if (wants == EBPO_WANTS_FIRST)
        ASSERT_OK(ebpo_ray_first_many(m->context, rays, count, &options, first, error));
    else if (wants == EBPO_WANTS_ANY)
        ASSERT_OK(ebpo_ray_any_many(m->context, rays, count, &options, any, error));
    else
        ASSERT_OK(ebpo_ray_all_many(m->context, rays, count, &options, &hits, &begin, error));
    return descents;
}

/* Rays that are not similar take turns, so that memory is fetched for one ray while others are
 * evaluated: a ray rarely visits a node at once after its parent. */
START_TEST(test_other_rays_take_turns)
{
    enum { RAYS = 640 };
    query_model m;
    query_model_make(&m, "sphere", query_solid_by_name("sphere"), &query_variants[5]);
    m.context->model->kernels.ray = &ebpo_ray_kernels_counted;
    ebpo_ray *rays = make_rays(&m, RAYS, 5);
    uint64_t single = 0, together;
    counted_accel = m.context->model->whole;
    for (int i = 0; i < RAYS; i++)
        single += count_descents(&m, (ebpo_ray_wants)_i, rays + i, 1);
    together = count_descents(&m, (ebpo_ray_wants)_i, rays, RAYS);
    counted_accel = NULL;
    ck_assert_msg(single > 100 && 5 * together < single, "%llu descents, single rays %llu",
                  (unsigned long long)together, (unsigned long long)single);
    free(rays);
    query_model_free(&m);
}
END_TEST

/* A walk for all hits visits the nodes of a level before the next level, so that memory is fetched
 * for one node while others are evaluated. */
START_TEST(test_walk_for_all_hits_rarely_descends)
{
    enum { RAYS = 640 };
    const double centre[3] = { 0 };
    const ebpo_ray_hit *hits;
    uint64_t count;
    query_model m;
    query_model_make(&m, "sphere", ebpo_test_sphere(centre, 1, 5), &query_variants[0]);
    m.context->model->kernels.ray = &ebpo_ray_kernels_counted;
    ebpo_ray *rays = make_rays(&m, RAYS, 5);
    counted_accel = m.context->model->whole;
    decoded_sides = descents = 0;
    for (int i = 0; i < RAYS; i++)
        ASSERT_OK(ebpo_ray_all(m.context, rays[i].origin, rays[i].direction, rays[i].t_max, &hits,
                               &count, error));
    counted_accel = NULL;
    /* a node has six sides */
    ck_assert_msg(descents > 100 && 4 * descents < decoded_sides / 6, "%llu descents, %llu sides",
                  (unsigned long long)descents, (unsigned long long)decoded_sides);
    free(rays);
    query_model_free(&m);
}
END_TEST

/* More blocks are on the ray's way than the queue of a walk for all hits has space for. */
START_TEST(test_walk_for_all_hits_has_space)
{
    enum { BOXES = 3000 };
    const double from[3] = { 0.3, 0.4, -1 }, up[3] = { 0, 0, 1 };
    const ebpo_ray_hit *hits;
    uint64_t count;
    ebpo_mesh mesh = { 0 };
    query_model m;
    for (int i = 0; i < BOXES; i++) {
        double low[3] = { 0, 0, 2 * i }, high[3] = { 1, 1, 2 * i + 1 };
        ebpo_mesh box = ebpo_test_box(low, high, 1);
        ebpo_test_append(&mesh, &box);
        ebpo_mesh_free(&box);
    }
    query_model_make(&m, "boxes", mesh, &query_variants[4]);
    m.context->model->kernels.ray = &ebpo_ray_kernels_counted;
    blocks_read = 0;
    ASSERT_OK(ebpo_ray_all(m.context, from, up, INFINITY, &hits, &count, error));
    ck_assert_uint_gt(blocks_read, 2 * RAY_QUEUE);
    ck_assert_uint_eq(count, 2 * BOXES);
    for (uint64_t i = 0; i < count; i++)
        ck_assert_double_eq(hits[i].t, (double)i + 1);
    query_model_free(&m);
}
END_TEST

/* Rays in the plane of many faces have so many candidates that some are tested during the walk,
 * between the turns of other rays. */
START_TEST(test_many_hits_during_turns)
{
    enum { RAYS = 16 };
    const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    const ebpo_ray_hit *hits, *single;
    const uint64_t *begin;
    uint64_t count;
    ebpo_ray rays[RAYS];
    query_model m, other;
    query_model_make(&m, "box", ebpo_test_box(low, high, 30), &query_variants[0]);
    query_model_make(&other, "box", ebpo_test_box(low, high, 30), &query_variants[0]);
    for (int i = 0; i < RAYS; i++)
        rays[i] = (ebpo_ray){ { -0.3, 0.05 * i, 1 }, { 1, 0.7 - 0.08 * i, 0 }, INFINITY };
    ASSERT_OK(ebpo_ray_all_many(m.context, rays, RAYS, NULL, &hits, &begin, error));
    ck_assert_uint_gt(begin[RAYS], EBPO_RAY_CANDIDATES * RAYS / 2);
    for (int i = 0; i < RAYS; i++) {
        ASSERT_OK(ebpo_ray_all(other.context, rays[i].origin, rays[i].direction, INFINITY, &single,
                               &count, error));
        ck_assert_uint_eq(begin[i + 1] - begin[i], count);
        for (uint64_t k = 0; k < count; k++)
            ck_assert(same_hit(&hits[begin[i] + k], &single[k]));
    }
    query_model_free(&m);
    query_model_free(&other);
}
END_TEST

/* The memory that a ray reads next is prefetched: a block's record, which may have several cache
 * lines, and what the exact test of a face reads. */
START_TEST(test_memory_is_prefetched)
{
    enum { RAYS = 640 };
    query_model m;
    query_model_make(&m, "sphere", query_solid_by_name("sphere"), &query_variants[5]);
    m.context->model->kernels.ray = &ebpo_ray_kernels_counted;
    ebpo_ray *rays = make_rays(&m, RAYS, 6);
    uint64_t hits = 0;
    blocks_read = blocks_late = faces_fetched = 0;
    for (int i = 0; i < RAYS; i++) {
        ebpo_ray_hit first;
        bool hit;
        ASSERT_OK(ebpo_ray_first(m.context, rays[i].origin, rays[i].direction, rays[i].t_max,
                                 &first, &hit, error));
        hits += hit;
    }
    ck_assert_uint_gt(hits, 100);
    ck_assert_uint_ge(blocks_read, hits);
    ck_assert_uint_eq(blocks_late, 0);
    ck_assert_uint_ge(faces_fetched, hits);
    free(rays);
    query_model_free(&m);
}
END_TEST

/* A ray through a vertex hits all faces around it at the same t. */
START_TEST(test_hits_at_vertex_need_few_exact_comparisons)
{
    query_model m;
    uint64_t hits = 0, count;
    const double down[3] = { 0, 0, -1 };
    const ebpo_ray_hit *found;
    query_model_make(&m, "sphere", query_solid_by_name("sphere"), &query_variants[5]);
    compared = intersected = 0;
    for (uint64_t i = 0; i < m.mesh.vertex_count; i++) {
        double from[3];
        ebpo_test_point(&m.mesh, (uint32_t)i, from);
        from[2] += 4;
        ASSERT_OK(ebpo_ray_all(m.context, from, down, INFINITY, &found, &count, error));
        hits += count;
    }
    ck_assert_uint_gt(hits, 8 * m.mesh.vertex_count);
    ck_assert_msg(2 * compared < hits && 2 * intersected < hits,
                  "%llu comparisons, %llu intersections, %llu hits", (unsigned long long)compared,
                  (unsigned long long)intersected, (unsigned long long)hits);
    query_model_free(&m);
}
END_TEST

/* --- closed solids --- */

/* Aims from p approximately towards a vertex or a point of an edge or face; returns false when
 * there is no direction. */
static bool aim(const query_model *m, const double p[3], uint64_t *state, ebpo_ray *out)
{
    static const double weights[][3] = {
        { 1, 0, 0 }, { .5, .5, 0 }, { .25, .75, 0 }, { .25, .25, .5 }
    };
    const double *w = weights[ebpo_test_random(state) % 4];
    uint64_t face = ebpo_test_random(state) % m->mesh.face_count;
    *out = (ebpo_ray){ .t_max = INFINITY };
    for (int i = 0; i < 3; i++) {
        double corner[3];
        ebpo_test_point(&m->mesh, m->mesh.faces[3 * face + (uint64_t)i], corner);
        for (int k = 0; k < 3; k++)
            out->direction[k] += w[i] * (corner[k] - p[k]);
    }
    memcpy(out->origin, p, sizeof out->origin);
    return isfinite(out->direction[0] + out->direction[1] + out->direction[2]) &&
           (out->direction[0] != 0 || out->direction[1] != 0 || out->direction[2] != 0);
}

/* Checks the rays of a convex solid. A ray from inside hits no front, and may hit the back. A ray
 * from outside hits the front first, and a back behind it or at the same point. */
static bool is_valid_for_convex(ebpo_context *context, const ebpo_ray *ray, bool from_inside)
{
    static const ebpo_ray_sides sides[3] = { EBPO_RAY_BOTH, EBPO_RAY_FRONT, EBPO_RAY_BACK };
    ebpo_ray_hit hit[3];
    for (int i = 0; i < 3; i++) {
        ebpo_ray_options options = EBPO_RAY_OPTIONS_INIT;
        options.sides = sides[i];
        ASSERT_OK(ebpo_ray_first_many(context, ray, 1, &options, &hit[i], error));
    }
    if (from_inside)
        return hit[0].face != EBPO_NO_FACE && hit[1].face == EBPO_NO_FACE &&
               same_hit(&hit[2], &hit[0]);
    /* a ray within a face may hit this face; then t is equal up to rounding */
    return hit[0].face == EBPO_NO_FACE ||
           (fabs(hit[0].t - hit[1].t) <= 4 * DBL_EPSILON * hit[0].t &&
            hit[2].face != EBPO_NO_FACE && hit[2].t >= hit[1].t);
}

START_TEST(test_rays_detect_inside_of_convex_solids)
{
    static const char *const names[] = { "sphere", "cube" };
    query_model m;
    query_model_make(&m, names[_i], query_solid_by_name(names[_i]), &query_variants[5]);
    uint64_t state = 5, count = query_scaled(3000), wrong = 0;
    double *points = query_alloc(count, 3 * sizeof *points);
    query_make_points(&m, count, 9, points);
    for (uint64_t i = 0; i < count; i++) {
        ebpo_inside_result where;
        ebpo_ray ray;
        ASSERT_OK(ebpo_inside(m.context, points + 3 * i, NULL, &where, error));
        if (!aim(&m, points + 3 * i, &state, &ray) || where.where == EBPO_ON)
            continue;
        wrong += !is_valid_for_convex(m.context, &ray, where.where == EBPO_IN);
    }
    ck_assert_uint_eq(wrong, 0);
    free(points);
    query_model_free(&m);
}
END_TEST

/* No ray leaves a solid without a hit. A ray that hits no edge enters as often as it leaves, if
 * its beginning is taken into account. */
START_TEST(test_rays_detect_inside_of_solids)
{
    query_model m;
    query_model_make(&m, query_solid_name(_i), query_solid_make(_i),
                     &query_variants[_i % query_variant_count]);
    uint64_t state = 5, count = query_scaled(m.mesh.face_count > 500 ? 500 : 2000), wrong = 0;
    double *points = query_alloc(count, 3 * sizeof *points);
    query_make_points(&m, count, 9, points);
    for (uint64_t i = 0; i < count && m.info.solid; i++) {
        ebpo_inside_result where;
        const ebpo_ray_hit *hits;
        uint64_t n;
        ebpo_ray ray;
        int sum = 0;
        bool clean = true, any;
        ASSERT_OK(ebpo_inside(m.context, points + 3 * i, NULL, &where, error));
        if (!aim(&m, points + 3 * i, &state, &ray) || where.where == EBPO_ON)
            continue;
        ASSERT_OK(ebpo_ray_any(m.context, ray.origin, ray.direction, INFINITY, &any, error));
        ASSERT_OK(ebpo_ray_all(m.context, ray.origin, ray.direction, INFINITY, &hits, &n, error));
        for (uint64_t k = 0; k < n; k++) {
            clean &= hits[k].side != 0;
            sum += hits[k].side;
        }
        wrong += any != (n > 0) || (where.winding && !any) || (clean && sum != -where.winding);
    }
    ck_assert_uint_eq(wrong, 0);
    free(points);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(query_ray_many)
{
    Suite *suite = suite_create("query_ray_many");
    TCase *many = tcase_create("many"), *tight = tcase_create("tight");
    tcase_set_timeout(many, 600);
    tcase_set_timeout(tight, 600);
    tcase_add_loop_test(many, test_ray_batch_matches_single_rays, 0, 3);
    tcase_add_loop_test(many, test_ray_batch_names_invalid_ray, 0, 4);
    tcase_add_test(many, test_ray_batch_of_threads_names_first_invalid_ray);
    tcase_add_test(many, test_far_rays_match_single_rays);
    tcase_add_test(many, test_kernel_places_ordinary_rays);
    tcase_add_test(many, test_bundles_miss_together);
    tcase_add_test(many, test_coherent_rays_share_nodes);
    tcase_add_test(many, test_few_rays_of_packet_read_few_rows);
    tcase_add_test(many, test_coherent_rays_begin_few_searches);
    tcase_add_loop_test(many, test_other_rays_take_turns, EBPO_WANTS_FIRST, EBPO_WANTS_ALL + 1);
    tcase_add_test(many, test_walk_for_all_hits_rarely_descends);
    tcase_add_test(many, test_walk_for_all_hits_has_space);
    tcase_add_test(many, test_many_hits_during_turns);
    tcase_add_test(many, test_memory_is_prefetched);
    tcase_add_test(many, test_hits_at_vertex_need_few_exact_comparisons);
    tcase_add_loop_test(many, test_coherent_rays_match_single_rays, 0, query_solid_count());
    tcase_add_loop_test(tight, test_rays_detect_inside_of_convex_solids, 0, 2);
    tcase_add_loop_test(tight, test_rays_detect_inside_of_solids, 0, query_solid_count());
#ifdef EBPO_COUNTS_INSTRUCTIONS
    TCase *counts = tcase_create("instructions");
    tcase_set_timeout(counts, 600);
    tcase_add_test(counts, test_single_rays_take_few_instructions);
    suite_add_tcase(suite, counts);
#endif
    suite_add_tcase(suite, many);
    suite_add_tcase(suite, tight);
    return suite;
}
