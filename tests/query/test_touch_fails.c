/* A model in parts whose source fails for good while a hand is moved: each kind of hand is told
 * in its ticks that loading has stopped, and why when it asks. */
#include <ebpo/touch.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "check_main.h"
#include "query_kit.h"

typedef struct line {
    uint8_t *data;
    uint64_t size;
    pthread_t hand;          /* the thread of the ticks; the loader reads in one of its own */
    atomic_bool waits, down; /* the loader waits; all reads fail */
    atomic_int refused;
} line;

static ebpo_status read_line(void *user, uint64_t offset, uint64_t size, void *data,
                             ebpo_error *error)
{
    line *l = user;
    /* Else the loader may have read all that the hand will need before the line is down. */
    while (atomic_load(&l->waits) && !pthread_equal(pthread_self(), l->hand))
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

static uint32_t tick_of(ebpo_touch *touch, uint64_t kind, const double at[3])
{
    static const double turn[4] = { 0, 0, 0, 1 };
    ebpo_touch_result ball;
    ebpo_touch_sensed probe;
    ebpo_touch_turned tool;
    switch (kind) {
    case EBPO_TOUCH_BALL: ebpo_touch_move(touch, at, &ball); return ball.flags;
    case EBPO_TOUCH_PROBE: ebpo_touch_sense(touch, at, &probe); return probe.flags;
    default: ebpo_touch_turn(touch, at, turn, &tool); return tool.flags;
    }
}

START_TEST(a_source_that_fails_is_told_in_ticks)
{
    static const double zero[3] = { 0, 0, 0 }, points[2][3] = { { 0.1, 0, 0 }, { -0.1, 0, 0 } };
    const double far[3] = { 0, 0, 5 }, near[3] = { 0, 0, 1.3 };
    uint64_t kind = (uint64_t)_i;
    query_model m;
    line l = { .data = NULL };
    ebpo_file *file;
    ebpo_model *model;
    ebpo_touch *touch;
    ebpo_model_options parts = EBPO_MODEL_OPTIONS_INIT;
    ebpo_touch_options o = EBPO_TOUCH_OPTIONS_INIT;
    ebpo_error why = EBPO_ERROR_INIT;
    query_model_make(&m, "sphere", ebpo_test_sphere(zero, 1, 4), &query_variants[0]);
    open_line(&l, m.path, &file);
    parts.cut_level = 2;
    ASSERT_OK(ebpo_model_new(file, &parts, &model, error));
    l.hand = pthread_self();
    atomic_store(&l.waits, true);
    o.kind = kind;
    o.look = 0.5;
    o.radius = kind == EBPO_TOUCH_BALL ? 0.1 : 0;
    o.points = kind == EBPO_TOUCH_TOOL ? points : NULL;
    o.point_count = kind == EBPO_TOUCH_TOOL ? 2 : 0;
    ASSERT_OK(ebpo_touch_new(model, &o, far, &touch, error));
    ck_assert_uint_eq(tick_of(touch, kind, far) & EBPO_TOUCH_STOPPED, 0);
    ck_assert_int_eq(ebpo_touch_check(touch, &why), EBPO_OK);
    atomic_store(&l.down, true);
    atomic_store(&l.waits, false);
    for (int i = 0; !(tick_of(touch, kind, near) & EBPO_TOUCH_STOPPED); i++) {
        ck_assert_msg(i < 20000, "nothing is told; %d reads failed", atomic_load(&l.refused));
        nanosleep(&(struct timespec){ .tv_nsec = 300000 }, NULL);
    }
    ck_assert_int_eq(ebpo_touch_check(touch, &why), EBPO_E_IO);
    ck_assert_ptr_nonnull(strstr(why.message, "the line is down"));
    atomic_store(&l.down, false); /* it is not tried again */
    ck_assert_uint_ne(tick_of(touch, kind, far) & EBPO_TOUCH_STOPPED, 0);
    ebpo_touch_free(touch);
    ebpo_model_free(model);
    ebpo_close(file);
    free(l.data);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(touch_fails)
{
    Suite *suite = suite_create("touch_fails");
    TCase *tests = tcase_create("all");
    tcase_set_timeout(tests, 300);
    tcase_add_loop_test(tests, a_source_that_fails_is_told_in_ticks, 0, 3);
    suite_add_tcase(suite, tests);
    return suite;
}
