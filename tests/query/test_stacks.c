/* Checks that queries need little stack, because threads of a program that links the library may
 * have stacks of 64 KiB. Each kind of query runs on a stack whose unused part is counted
 * afterwards, with the model in memory and in parts that are loaded meanwhile. Sanitizers need
 * more stack, so the test does not run with them. */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "check_main.h"
#include "model_file.h"
#include "query_mix.h"
#include "scratch.h"
#include "solids.h"

/* The limit of ebpo/base.h, reduced by the stack of the C library. */
enum {
    STACK = 1 << 20,
    PROMISED = 64 << 10,
    OTHERS = 256 << 10,
    BESIDE = 4 << 10,
    PAINT = 0xa5,
    NUMBERS = 40
};

static const char *model_path(void) { return scratch("torus.ebpo.h5"); }

/* --- queries not in the mix --- */

enum { ENVELOPE = MIX_KINDS, LEVEL, DEADLINE, KINDS };
static const char *const more_names[] = { "envelope", "to a level", "within a time" };

static ebpo_status query_limited(const mix_session *a, int kind, uint64_t number, ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(a->file);
    ebpo_inside_options inside = EBPO_INSIDE_OPTIONS_INIT;
    ebpo_distance_options distance = EBPO_DISTANCE_OPTIONS_INIT;
    ebpo_inside_result in;
    ebpo_distance_result far;
    double point[3];
    for (int k = 0; k < 3; k++)
        point[k] = info->box_origin[k] +
                   info->box_size[k] * (double)(number * (7 + (unsigned)k) % 41) / 40;
    distance.mode = kind == ENVELOPE ? EBPO_DISTANCE_ENVELOPE : EBPO_DISTANCE_EXACT;
    inside.level = distance.level = kind == DEADLINE ? -1 : 3;
    inside.deadline_ns = distance.deadline_ns = kind == DEADLINE ? 1000000 : 0;
    ebpo_status status = ebpo_distance(a->context, point, &distance, &far, error);
    return status == EBPO_OK && kind != ENVELOPE
               ? ebpo_inside(a->context, point, &inside, &in, error)
               : status;
}

/* --- on a painted stack --- */

typedef struct run {
    const mix_session *session;
    int kind;
    ebpo_status status;
    ebpo_error error;
} run;

static void *query_some(void *user)
{
    run *r = user;
    uint64_t hash;
    for (uint64_t i = 0; i < NUMBERS && r->status == EBPO_OK; i++)
        r->status = r->kind < MIX_KINDS ? mix_query(r->session, r->kind, i, &hash, &r->error)
                                        : query_limited(r->session, r->kind, i, &r->error);
    return NULL;
}

static size_t stack_of(void *(*body)(void *), void *user)
{
    pthread_attr_t attributes;
    pthread_t thread;
    size_t unused = 0;
    uint8_t *stack = aligned_alloc(1 << 16, STACK);
    ck_assert_ptr_nonnull(stack);
    memset(stack, PAINT, STACK);
    pthread_attr_init(&attributes);
    ck_assert_int_eq(pthread_attr_setstack(&attributes, stack, STACK), 0);
    ck_assert_int_eq(pthread_create(&thread, &attributes, body, user), 0);
    pthread_join(thread, NULL);
    pthread_attr_destroy(&attributes);
    while (unused < STACK && stack[unused] == PAINT)
        unused++;
    free(stack);
    return STACK - unused;
}

/* Returns false for haptic devices, which have a separate thread, and for views, which are queried
 * rarely. */
static bool is_query(int kind)
{
    static const char *const others[] = { "stream", "view", "subtree", "level", "touch" };
    for (size_t i = 0; kind < MIX_KINDS && i < sizeof others / sizeof *others; i++)
        if (strcmp(mix_names[kind], others[i]) == 0)
            return false;
    return true;
}

static void check_stacks(uint64_t memory)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    mix_session session = { .file = model_open(model_path()) };
    options.memory = memory;
    model_must(ebpo_model_new(session.file, &options, &session.model, &error), "a model", &error);
    for (int kind = 0; kind < KINDS; kind++) {
        model_must(ebpo_context_new(session.model, &session.context, &error), "a context", &error);
        run r = { .session = &session, .kind = kind, .error = EBPO_ERROR_INIT };
        size_t bytes = stack_of(query_some, &r);
        model_must(r.status, "asking", &r.error);
        const char *name = kind < MIX_KINDS ? mix_names[kind] : more_names[kind - MIX_KINDS];
        printf("%s: %zu bytes of stack\n", name, bytes);
        if (is_query(kind))
            ck_assert_msg(bytes <= PROMISED - BESIDE, "%s: %zu bytes of stack", name, bytes);
        ebpo_context_free(session.context);
    }
    ebpo_model_free(session.model);
    ebpo_close((ebpo_file *)session.file);
}

START_TEST(test_query_stack_size)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_model_plan plan = EBPO_MODEL_PLAN_INIT;
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_tree tree =
        model_build_parts(ebpo_test_torus(3, 1, 120, 80), 4, ebpo_profile_parts(EBPO_PROFILE_FULL));
    model_write(&tree, model_path(), NULL);
    ebpo_file *file = model_open(model_path());
    options.memory = 1;
    (void)!ebpo_model_memory(file, &options, &plan, &error);
    ebpo_close(file);
    check_stacks(0);
    check_stacks(plan.least);
}
END_TEST

/* Finds the first hits of similar rays in the plane of a side of a box. A batch walks them
 * together. So many faces of the plane may be hit that they are compared in exact arithmetic during
 * the walk.
 */
static void *query_in_plane(void *user)
{
    enum { RAYS = 8 };
    run *r = user;
    ebpo_ray_options options = EBPO_RAY_OPTIONS_INIT;
    ebpo_ray rays[RAYS];
    ebpo_ray_hit hits[RAYS];
    options.threads = 1;
    for (int i = 0; i < RAYS; i++)
        rays[i] = (ebpo_ray){ { -0.3, 0.1 + 0.001 * i, 1 }, { 1, 0.7, 0 }, INFINITY };
    r->status = ebpo_ray_first_many(r->session->context, rays, RAYS, &options, hits, &r->error);
    return NULL;
}

START_TEST(test_ray_batch_stack_size)
{
    const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    mix_session session = { 0 };
    run r = { .session = &session, .error = EBPO_ERROR_INIT };
    ebpo_tree tree =
        model_build_parts(ebpo_test_box(low, high, 20), 4, ebpo_profile_parts(EBPO_PROFILE_FULL));
    model_write(&tree, model_path(), NULL);
    session.file = model_open(model_path());
    model_must(ebpo_model_new(session.file, NULL, &session.model, &r.error), "a model", &r.error);
    model_must(ebpo_context_new(session.model, &session.context, &r.error), "a context", &r.error);
    size_t bytes = stack_of(query_in_plane, &r);
    model_must(r.status, "asking", &r.error);
    printf("rays in a plane: %zu bytes of stack\n", bytes);
    ck_assert_msg(bytes <= PROMISED - BESIDE, "%zu bytes of stack", bytes);
    ebpo_context_free(session.context);
    ebpo_model_free(session.model);
    ebpo_close((ebpo_file *)session.file);
}
END_TEST

/* Checks a mesh, and builds, writes, reads and verifies a file, on the calling thread. */
static void *build(void *user)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_verify_options options = EBPO_VERIFY_OPTIONS_INIT;
    ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
    ebpo_build_options how = EBPO_BUILD_OPTIONS_INIT;
    ebpo_tree tree;
    ebpo_mesh mesh = ebpo_test_torus(3, 1, 60, 40);
    (void)user;
    how.threads = options.threads = 1;
    how.max_level = 8;
    how.leaf_faces = 1;
    tree = model_build(mesh, &how);
    model_write(&tree, model_path(), NULL);
    ebpo_file *file = model_open(model_path());
    model_must(ebpo_verify(file, &options, &report, &error), "verifying", &error);
    ebpo_close(file);
    return NULL;
}

START_TEST(test_build_stack_size)
{
    size_t bytes = stack_of(build, NULL);
    printf("building: %zu bytes of stack\n", bytes);
    ck_assert_msg(bytes <= OTHERS - BESIDE, "%zu bytes of stack", bytes);
}
END_TEST

static void *nothing(void *user) { return user; }

START_TEST(test_small_thread_stacks_can_be_created)
{
    for (size_t kib = 32; kib <= 256; kib *= 2) {
        pthread_attr_t attributes;
        pthread_t thread;
        pthread_attr_init(&attributes);
        ck_assert_int_eq(pthread_attr_setstacksize(&attributes, kib << 10), 0);
        ck_assert_msg(pthread_create(&thread, &attributes, nothing, NULL) == 0,
                      "no thread with a stack of %zu KiB", kib);
        pthread_join(thread, NULL);
        pthread_attr_destroy(&attributes);
    }
}
END_TEST

Suite *test_suite(void)
{
    Suite *suite = suite_create("stacks");
    TCase *stacks = tcase_create("stacks");
    tcase_add_test(stacks, test_small_thread_stacks_can_be_created);
    tcase_add_test(stacks, test_query_stack_size);
    tcase_add_test(stacks, test_ray_batch_stack_size);
    tcase_add_test(stacks, test_build_stack_size);
    tcase_set_timeout(stacks, 300);
    suite_add_tcase(suite, stacks);
    return suite;
}
