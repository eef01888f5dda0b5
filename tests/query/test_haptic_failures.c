/* Tests a partly loaded model whose source fails permanently while a haptic device moves. Each
 * kind of device reports in its steps that loading has stopped, and returns the reason on request.
 */
#include <ebpo/haptic.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "check_main.h"
#include "query_support.h"

typedef struct line {
    uint8_t *data;
    uint64_t size;
    pthread_t device;          /* thread of the haptic steps; the loader reads in another thread */
    atomic_bool waiting, down; /* the loader must wait; all reads must fail */
    atomic_int refused;
} line;

static ebpo_status read_line(void *user, uint64_t offset, uint64_t size, void *data,
                             ebpo_error *error)
{
    line *l = user;
    /* Waits, because otherwise the loader may read everything that the device needs before the
     * source fails. */
    while (atomic_load(&l->waiting) && !pthread_equal(pthread_self(), l->device))
        nanosleep(&(struct timespec){ .tv_nsec = 300000 }, NULL);
    if (atomic_load(&l->down)) {
        atomic_fetch_add(&l->refused, 1);
        error->status = EBPO_E_IO;
        strcpy(error->message, "the line is down");
        return EBPO_E_IO;
    }
    memcpy(data, l->data + offset, size);
    return EBPO_OK;
}

static void open_line(line *l, const char *path, ebpo_file **file)
{
    FILE *f = fopen(path, "rb");
    ck_assert_ptr_nonnull(f);
    ck_assert_int_eq(fseek(f, 0, SEEK_END), 0);
    l->size = (uint64_t)ftell(f);
    rewind(f);
    l->data = malloc(l->size);
    ck_assert_uint_eq(fread(l->data, 1, l->size, f), l->size);
    fclose(f);
    ebpo_source source = {
        .struct_size = sizeof source, .user = l, .size = l->size, .read = read_line
    };
    ASSERT_OK(ebpo_open_source(&source, "line", file, error));
}

static uint32_t step_of(ebpo_haptic *haptic, uint64_t kind, const double at[3])
{
    static const double turn[4] = { 0, 0, 0, 1 };
    ebpo_haptic_ball_result ball;
    ebpo_haptic_probe_result probe;
    ebpo_haptic_tool_result tool;
    switch (kind) {
    case EBPO_HAPTIC_BALL: ebpo_haptic_step_ball(haptic, at, &ball); return ball.flags;
    case EBPO_HAPTIC_PROBE: ebpo_haptic_step_probe(haptic, at, &probe); return probe.flags;
    default: ebpo_haptic_step_tool(haptic, at, turn, &tool); return tool.flags;
    }
}

START_TEST(test_haptic_step_reports_source_failure)
{
    static const double zero[3] = { 0, 0, 0 }, points[2][3] = { { 0.1, 0, 0 }, { -0.1, 0, 0 } };
    const double far[3] = { 0, 0, 5 }, near[3] = { 0, 0, 1.3 };
    uint64_t kind = (uint64_t)_i;
    query_model m;
    line l = { .data = NULL };
    ebpo_file *file;
    ebpo_model *model;
    ebpo_haptic *haptic;
    ebpo_model_options parts = EBPO_MODEL_OPTIONS_INIT;
    ebpo_haptic_options o = EBPO_HAPTIC_OPTIONS_INIT;
    ebpo_error why = EBPO_ERROR_INIT;
    query_model_make(&m, "sphere", ebpo_test_sphere(zero, 1, 4), &query_variants[0]);
    open_line(&l, m.path, &file);
    parts.cut_level = 2;
    ASSERT_OK(ebpo_model_new(file, &parts, &model, error));
    l.device = pthread_self();
    atomic_store(&l.waiting, true);
    o.kind = kind;
    o.search_radius = 0.5;
    o.radius = kind == EBPO_HAPTIC_BALL ? 0.1 : 0;
    o.points = kind == EBPO_HAPTIC_TOOL ? points : NULL;
    o.point_count = kind == EBPO_HAPTIC_TOOL ? 2 : 0;
    ASSERT_OK(ebpo_haptic_new(model, &o, far, &haptic, error));
    ck_assert_uint_eq(step_of(haptic, kind, far) & EBPO_HAPTIC_STOPPED, 0);
    ck_assert_int_eq(ebpo_haptic_check(haptic, &why), EBPO_OK);
    atomic_store(&l.down, true);
    atomic_store(&l.waiting, false);
    for (int i = 0; !(step_of(haptic, kind, near) & EBPO_HAPTIC_STOPPED); i++) {
        ck_assert_msg(i < 20000, "nothing is reported; %d reads failed", atomic_load(&l.refused));
        nanosleep(&(struct timespec){ .tv_nsec = 300000 }, NULL);
    }
    ck_assert_int_eq(ebpo_haptic_check(haptic, &why), EBPO_E_IO);
    ck_assert_ptr_nonnull(strstr(why.message, "the line is down"));
    atomic_store(&l.down, false); /* must not cause a retry */
    ck_assert_uint_ne(step_of(haptic, kind, far) & EBPO_HAPTIC_STOPPED, 0);
    ebpo_haptic_free(haptic);
    ebpo_model_free(model);
    ebpo_close(file);
    free(l.data);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(haptic_failures)
{
    Suite *suite = suite_create("haptic_failures");
    TCase *tests = tcase_create("all");
    tcase_set_timeout(tests, 300);
    tcase_add_loop_test(tests, test_haptic_step_reports_source_failure, 0, 3);
    suite_add_tcase(suite, tests);
    return suite;
}
