/* The pen of `ebpo haptic --paint` on the top of a cube: when it is lifted, its least step, opacity
 * by pressure, undo, brushes, and the lock that it shares with the pages of the viewer. */
#include <arpa/inet.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "check_main.h"
#include "cli/command.h"
#include "cli/commands/haptic_device.h"
#include "cli/commands/haptic_paints.h"
#include "query_support.h"

int command_thread(pthread_t *thread, void *(*body)(void *), void *argument)
{
    return pthread_create(thread, NULL, body, argument);
}

static const double radius = 0.02;

typedef struct pen_test {
    query_model m;
    char path[SCRATCH_LENGTH + 32];
    haptic_pen pen;
    haptic_surface surface;
    haptic_paints *paint; /* NULL: closed */
    ebpo_paint *made;     /* NULL: paint is open */
    uint64_t strokes;     /* in the file */
} pen_test;

static void open_pen(pen_test *t)
{
    t->surface = (haptic_surface){ NULL, t->path, t->m.file, t->m.model };
    ASSERT_OK(haptic_paints_open(&t->paint, &t->pen, &t->surface, 1, NULL, error));
}

static void begin(pen_test *t)
{
    static const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    memset(t, 0, sizeof *t);
    query_model_make(&t->m, "box", ebpo_test_box(low, high, 4), &query_variants[0]);
    snprintf(t->path, sizeof t->path, "%s/pen.paint.h5", t->m.folder);
    t->pen = (haptic_pen){ .pen = EBPO_PAINT_PEN_INIT,
                           .default_layer = true,
                           .stiffness = 1,
                           .full_force = 1,
                           .fade = 1,
                           .rate = 1000 };
    t->pen.pen.radius = radius;
    t->pen.pen.colour = 0xff0000ff;
}

/* Closes the pen, and reads the file. Returns the number of its strokes. */
static uint64_t read_strokes(pen_test *t)
{
    haptic_painted painted;
    ebpo_paint_info info = EBPO_PAINT_INFO_INIT;
    ASSERT_OK(haptic_paints_close(t->paint, &painted, error));
    t->paint = NULL;
    ebpo_paint_free(t->made);
    ASSERT_OK(ebpo_paint_open(t->path, &t->made, error));
    ebpo_paint_get_info(t->made, &info);
    ck_assert_uint_eq(info.stroke_count, t->strokes + painted.strokes);
    return t->strokes = info.stroke_count;
}

static ebpo_paint_stroke stroke_at(const pen_test *t, uint64_t i)
{
    ebpo_paint_stroke stroke = EBPO_PAINT_STROKE_INIT;
    ebpo_paint_get_stroke(t->made, i, &stroke);
    return stroke;
}

static void end(pen_test *t)
{
    ebpo_paint_free(t->made);
    query_model_free(&t->m);
    remove(t->path);
}

/* Returns a step in contact on the top of the cube. pressure: 0 to 1. */
static haptic_sample touch_at(double time, double x, double pressure)
{
    return (haptic_sample){
        .time = time, .touch = { x, 0.5, 1 }, .depth = pressure, .flags = EBPO_HAPTIC_CONTACT
    };
}

/* Moves from x = 0.1 to 0.3, loses `lost` steps, and moves from 0.6 to 0.8. */
static uint64_t strokes_with_gap(double period, double lost)
{
    pen_test t;
    begin(&t);
    t.pen.rate = 1000 / period;
    open_pen(&t);
    for (int i = 0; i < 200; i++) {
        double time = period * (i + (i < 100 ? 0 : lost));
        haptic_sample s = touch_at(time, 0.1 + 0.002 * i + (i < 100 ? 0 : 0.3), 1);
        haptic_paints_take(t.paint, &s, 1);
    }
    uint64_t strokes = read_strokes(&t);
    for (uint64_t i = 0; i < strokes; i++)
        for (uint64_t k = 1; k < stroke_at(&t, i).point_count && strokes > 1; k++)
            ck_assert_double_le(fabs(stroke_at(&t, i).points[k].place[0] -
                                     stroke_at(&t, i).points[k - 1].place[0]),
                                radius / 2 * 1.01);
    end(&t);
    return strokes;
}

/* A gap of over 30 ms between two steps in contact lifts the pen: steps were lost. At a low rate,
 * steps are farther apart. */
START_TEST(test_pen_is_lifted_after_lost_steps)
{
    ck_assert_uint_eq(strokes_with_gap(1, 0), 1);
    ck_assert_uint_eq(strokes_with_gap(1, 28), 1);
    ck_assert_uint_eq(strokes_with_gap(1, 31), 2);
    ck_assert_uint_eq(strokes_with_gap(50, 0), 1);
    ck_assert_uint_eq(strokes_with_gap(50, 1), 2);
}
END_TEST

/* Returns a step in contact with an instance, on the top of its cube at x of the model. */
static haptic_sample touch_instance(double time, const ebpo_pose *poses, uint64_t instance,
                                    double x)
{
    haptic_sample s = touch_at(time, x, 1);
    for (int k = 0; k < 3; k++)
        s.touch[k] = poses[instance].translation[k] + poses[instance].scale * s.touch[k];
    s.instance = instance;
    return s;
}

/* Touches instance 0 of a cube in turns with its instance 1, which is twice as large, so that the
 * pen stays on the first one. Then touches instance 1, and then instance 2, of another cube; some
 * steps do not know the instance. */
static void touch_instances(haptic_paints *paints, const ebpo_pose *poses)
{
    for (int i = 0; i < 300; i++) {
        bool other = i < 100 && i % 2;
        haptic_sample s =
            touch_instance(i + (i < 100 ? 0 : 50), poses, other ? 1 : (uint64_t)i / 100,
                           other ? 0.7 : 0.2 + 0.002 * (i % 100));
        if (i > 200 && i % 3 == 0)
            s.instance = UINT64_MAX;
        haptic_paints_take(paints, &s, 1);
    }
}

/* Continues the last contact of touch_instances, and slides to the other instances. */
static void touch_after_undo(haptic_paints *paints, const ebpo_pose *poses)
{
    for (int i = 0; i < 150; i++) {
        haptic_sample s = touch_instance(350 + i, poses, 2 - (uint64_t)i / 50, 0.5);
        haptic_paints_take(paints, &s, 1);
    }
}

/* Checks the strokes of a file: each goes from x = 0.2 to 0.4. Returns their number. */
static uint64_t check_strokes(pen_test *t, const char *path)
{
    ebpo_paint_info info = EBPO_PAINT_INFO_INIT;
    ebpo_paint_free(t->made);
    ASSERT_OK(ebpo_paint_open(path, &t->made, error));
    ebpo_paint_get_info(t->made, &info);
    for (uint64_t i = 0; i < info.stroke_count; i++) {
        ebpo_paint_stroke stroke = stroke_at(t, i);
        ck_assert_double_eq(stroke.radius, i == 1 ? radius / 2 : radius);
        ck_assert_double_eq_tol(stroke.points[0].place[0], 0.2, 1e-9);
        ck_assert_double_eq_tol(stroke.points[stroke.point_count - 1].place[0], 0.39, 0.011);
    }
    return info.stroke_count;
}

/* A pen paints the models of the touched instances, in their coordinates and files. It is lifted
 * between two instances of a model. Undo removes the last contact of all models. */
START_TEST(test_pen_paints_instances)
{
    static const uint64_t expected[4][2] = { { 2, 1 }, { 2, 0 }, { 1, 0 }, { 0, 0 } };
    static const uint64_t of[3] = { 0, 0, 1 };
    ebpo_pose poses[3] = { EBPO_POSE_INIT, EBPO_POSE_INIT, EBPO_POSE_INIT };
    poses[1].translation[0] = poses[1].scale = 2;
    poses[2].translation[0] = -3;
    for (int undos = 0; undos < 4; undos++) {
        pen_test t;
        begin(&t);
        char other[sizeof t.path + 8];
        snprintf(other, sizeof other, "%s.other", t.path);
        const haptic_surface surfaces[2] = { { "one", t.path, t.m.file, t.m.model },
                                             { "two", other, t.m.file, t.m.model } };
        haptic_paints *paints;
        haptic_painted painted;
        t.pen.poses = poses;
        ASSERT_OK(haptic_paints_open(&paints, &t.pen, surfaces, 2, of, error));
        haptic_sample unknown = touch_at(0, 0.8, 1); /* paints nothing */
        unknown.instance = UINT64_MAX;
        haptic_paints_take(paints, &unknown, 1);
        touch_instances(paints, poses);
        ck_assert(!haptic_paints_command(paints, "layer 0"));
        ck_assert(haptic_paints_command(paints, "new-layer second"));
        for (int i = 0; i < undos; i++)
            ck_assert(haptic_paints_command(paints, "undo"));
        if (undos) /* nothing is painted until the pen is lifted, on any instance */
            touch_after_undo(paints, poses);
        ASSERT_OK(haptic_paints_close(paints, &painted, error));
        ck_assert_uint_eq(check_strokes(&t, t.path), expected[undos][0]);
        ck_assert_uint_eq(check_strokes(&t, other), expected[undos][1]);
        ck_assert_uint_eq(painted.strokes, expected[undos][0] + expected[undos][1]);
        remove(other);
        end(&t);
    }
}
END_TEST

/* A pen of almost no radius makes a step for each 1e-5 of the model's diagonal. */
START_TEST(test_pen_has_least_step)
{
    pen_test t;
    begin(&t);
    t.pen.pen.radius = 1e-12;
    open_pen(&t);
    haptic_sample s[2] = { touch_at(0, 0.2, 1), touch_at(1, 0.3, 1) };
    haptic_paints_take(t.paint, s, 2);
    ck_assert_uint_eq(read_strokes(&t), 1);
    double wanted = 0.1 / (1e-5 * sqrt(3));
    ck_assert_double_le(fabs((double)stroke_at(&t, 0).point_count - wanted), 2);
    end(&t);
}
END_TEST

/* The strokes do not depend on the number of steps that are passed together. */
START_TEST(test_pen_slices_are_equal)
{
    enum { STEPS = 1000 };
    static haptic_sample s[STEPS];
    pen_test t[2];
    uint64_t state = 5, count[2];
    for (int i = 0; i < STEPS; i++)
        s[i] = touch_at(i, 0.1 + 0.0008 * i, 0.5 + 0.4 * sin(0.02 * i));
    for (int k = 0; k < 2; k++) {
        begin(&t[k]);
        t[k].pen.fade = 0.3;
        t[k].pen.pen.spread = 0.05;
        t[k].pen.pen.density = 5;
        open_pen(&t[k]);
        for (uint64_t i = 0, n; i < STEPS; i += n) {
            n = k ? 1 + ebpo_test_random(&state) % 50 : STEPS;
            n = n < STEPS - i ? n : STEPS - i;
            haptic_paints_take(t[k].paint, s + i, n);
        }
        count[k] = read_strokes(&t[k]);
    }
    ck_assert_uint_eq(count[0], count[1]);
    ck_assert_uint_gt(count[0], 20);
    for (uint64_t i = 0; i < count[0]; i++) {
        ebpo_paint_stroke a = stroke_at(&t[0], i), b = stroke_at(&t[1], i);
        ck_assert_uint_eq(a.point_count, b.point_count);
        ck_assert_mem_eq(a.points, b.points, a.point_count * sizeof *a.points);
        ck_assert_uint_eq(a.colour, b.colour);
    }
    end(&t[0]);
    end(&t[1]);
}
END_TEST

/* Presses harder and harder, then at a constant pressure with noise. Each stroke has the opacity of
 * its pressure, in steps of 1/16, and begins where the stroke before ended. The noise begins no
 * stroke. */
START_TEST(test_pen_opacity_follows_pressure)
{
    pen_test t;
    double place = 0.1;
    begin(&t);
    t.pen.fade = 0;
    open_pen(&t);
    for (int i = 0; i < 1000; i++) {
        double pressure = i < 800 ? i / 800.0 : 0.53 + 0.02 * sin(i);
        haptic_sample s = touch_at(i, 0.1 + 0.0008 * i, pressure);
        haptic_paints_take(t.paint, &s, 1);
    }
    ck_assert_uint_eq(read_strokes(&t), 16);
    for (uint64_t i = 0; i < 16; i++) {
        ebpo_paint_stroke s = stroke_at(&t, i);
        uint32_t level = i < 15 ? (uint32_t)i + 1 : 9;
        ck_assert_uint_eq(s.colour, 0xff000000 + (255 * level + 8) / 16);
        ck_assert_double_le(fabs(s.points[0].place[0] - place), radius / 2 * 1.01);
        place = s.points[s.point_count - 1].place[0];
        for (uint64_t k = 0; k < s.point_count && i < 15; k++)
            ck_assert_double_le(fabs(s.points[k].pressure / 65535.0 - level / 16.0), 1 / 15.9);
    }
    end(&t);
}
END_TEST

/* Returns the opacity of all strokes together at a position, at most 1. */
static double opacity_at(const pen_test *t, double x)
{
    double clear = 1;
    for (uint64_t i = 0; i < t->strokes; i++) {
        ebpo_paint_stroke s = stroke_at(t, i);
        bool covers = false;
        for (uint64_t k = 0; k < s.point_count; k++)
            covers |= hypot(s.points[k].place[0] - x, s.points[k].place[1] - 0.5) <=
                      s.radius * s.points[k].size / 32768;
        clear *= covers ? 1 - (s.colour & 255) / 255.0 : 1;
    }
    return 1 - clear;
}

/* A pen that is put down at one position has one stroke there, with the opacity of its greatest
 * pressure. If it moves before it is lifted, it adds a stroke of the least opacity where it is
 * lifted. Pages get no stroke again that was finished before. */
START_TEST(test_pen_opacity_does_not_accumulate)
{
    for (int moves = 0; moves < 2; moves++) {
        pen_test t;
        char *text;
        size_t length;
        haptic_paint_cursor cursor = HAPTIC_PAINT_CURSOR_INIT;
        FILE *out = open_memstream(&text, &length);
        begin(&t);
        t.pen.fade = 0;
        t.pen.pen.colour = 0xff000080;
        open_pen(&t);
        for (int i = -200; i < 600; i++) { /* first another contact */
            double pressure = i < 0 ? 0.5 : fmin(1, fmin(i / 200.0, (600 - i) / 200.0));
            double x = i < 0 ? 0.1 : 0.3 + moves * fmax(0, fmin(0.2, 0.001 * (i - 200)));
            haptic_sample s = touch_at(i + 200, x, pressure);
            s.lifted = i > -100 && i < 0;
            haptic_paints_take(t.paint, &s, 1);
            if (i % 7 == 0)
                haptic_paints_write_news(t.paint, &cursor, out);
        }
        fclose(out);
        uint64_t strokes = read_strokes(&t);
        ck_assert_msg(strokes == (moves ? 3 : 2), "%d: %d strokes", moves, (int)strokes);
        ck_assert_double_eq_tol(opacity_at(&t, 0.3), 128 / 255.0, 1e-12);
        double last = opacity_at(&t, 0.3 + 0.2 * moves), least = moves * 8 / 255.0;
        ck_assert_double_eq_tol(1 - last, (1 - 128 / 255.0) * (1 - least), 1e-12);
        ck_assert_ptr_nonnull(strstr(text, "\"number\":0"));
        ck_assert_ptr_null(strstr(strstr(text, "\"number\":1"), "\"number\":0"));
        free(text);
        end(&t);
    }
}
END_TEST

/* Each undo removes all strokes of a contact, but none that were in the file before. */
START_TEST(test_pen_undo_removes_contacts)
{
    pen_test t;
    begin(&t);
    for (int run = 0; run < 2; run++) {
        t.pen.fade = run;
        open_pen(&t);
        for (int i = 0; i < 400; i++) {
            haptic_sample s = touch_at(i, 0.1 + 0.002 * i, i % 200 / 200.0);
            s.lifted = i % 200 < 20 || i % 200 > 160;
            haptic_paints_take(t.paint, &s, 1);
        }
        for (int k = 0; k < (run ? 3 : 1); k++)
            ck_assert_int_eq(haptic_paints_command(t.paint, "undo"), k < 2);
        /* The first run has an opacity for each level from 2 to 12, the second one a constant one.
         */
        ck_assert_uint_eq(read_strokes(&t), 11);
    }
    end(&t);
}
END_TEST

/* After an undo in contact, nothing is painted until the pen was lifted. */
START_TEST(test_pen_paints_nothing_after_undo)
{
    pen_test t;
    begin(&t);
    open_pen(&t);
    for (int i = 0; i < 600; i++) {
        haptic_sample s = touch_at(i, 0.1 + 0.001 * i, 1);
        s.flags = i >= 150 && i < 160 ? 0 : s.flags; /* a gap that does not lift the pen */
        s.lifted = i >= 300 && i < 350;
        haptic_paints_take(t.paint, &s, 1);
        if (i == 100)
            ck_assert(haptic_paints_command(t.paint, "undo"));
    }
    ck_assert_uint_eq(read_strokes(&t), 1);
    ck_assert_double_gt(stroke_at(&t, 0).points[0].place[0], 0.44);
    end(&t);
}
END_TEST

/* A stylus reports its own pressure. */
START_TEST(test_pen_takes_pressure_of_stylus)
{
    pen_test t;
    begin(&t);
    open_pen(&t);
    for (int i = 0; i < 100; i++) {
        haptic_sample s = touch_at(i, 0.1 + 0.002 * i, 1);
        s.pressure = 0.25;
        haptic_paints_take(t.paint, &s, 1);
    }
    ck_assert_uint_eq(read_strokes(&t), 1);
    ebpo_paint_stroke s = stroke_at(&t, 0);
    for (uint64_t k = 0; k < s.point_count; k++)
        ck_assert_int_eq(s.points[k].pressure, 16384);
    end(&t);
}
END_TEST

/* Sets the device to a pose below the proxy by the depth. */
static void press_down(haptic_sample *s)
{
    memcpy(s->device, s->proxy, sizeof s->device);
    s->device[2] -= s->depth;
    memcpy(s->device_rotation, s->rotation, sizeof s->device_rotation);
}

/* Moves a brush, a square of 11 x 11 points with sides of 0.1 that is tilted about the y axis, by
 * 0.2 in steps of 0.00101. */
static void move_brush(pen_test *t, double tilt, double depth)
{
    static double points[121][3];
    for (int i = 0; i < 121; i++) {
        points[i][0] = 0.01 * (i % 11) - 0.05;
        points[i][1] = 0.01 * (i - i % 11) / 11 - 0.05;
        points[i][2] = 0;
    }
    t->pen.points = (const double(*)[3])points;
    t->pen.point_count = 121;
    open_pen(t);
    for (int i = 0; i <= 200; i++) {
        haptic_sample s = touch_at(i, 0.3 + 0.00101 * i, depth);
        const double low = 0.05 * sin(fabs(tilt)); /* of the point that touches, below the middle */
        s.proxy[0] = s.touch[0];
        s.proxy[1] = s.touch[1];
        s.touch[0] += (i % 2 ? 0.05 : tilt != 0 ? 0.05 : -0.05) * cos(tilt); /* another point */
        s.proxy[2] = 1 + low + 1e-6; /* not below the surface because of rounding */
        s.rotation[1] = sin(tilt / 2);
        s.rotation[3] = cos(tilt / 2);
        press_down(&s);
        haptic_paints_take(t->paint, &s, 1);
    }
}

/* A brush paints its pressed points at each step of half the radius, as one stroke. A tilted brush
 * paints with its lower edge. */
START_TEST(test_pen_brush_paints_its_shape)
{
    for (int tilted = 0; tilted < 2; tilted++) {
        pen_test t;
        const uint64_t count = tilted ? 33 : 64; /* of 121 */
        begin(&t);
        t.pen.full_force = 0.1;
        move_brush(&t, tilted ? 0.5 : 0, 0.01);
        ck_assert_uint_eq(read_strokes(&t), 1);
        ebpo_paint_stroke s = stroke_at(&t, 0);
        ck_assert_uint_eq(s.point_count, 21 * count);
        for (uint64_t i = 0; i < 21; i++) {
            double low[2] = { 1, 1 }, high[2] = { 0, 0 };
            for (uint64_t k = i * count; k < (i + 1) * count; k++) {
                ck_assert_double_eq(s.points[k].place[2], 1);
                ck_assert_int_eq(s.points[k].pressure, 6553);
                for (int c = 0; c < 2; c++) {
                    low[c] = fmin(low[c], s.points[k].place[c]);
                    high[c] = fmax(high[c], s.points[k].place[c]);
                }
            }
            double x = 0.3 + 0.0101 * (double)i;
            ck_assert_double_le(fabs(low[1] - 0.45), 0.011);
            ck_assert_double_le(fabs(high[1] - 0.55), 0.011);
            ck_assert_double_le(fabs(high[0] - x - 0.05 * cos(tilted * 0.5)), 0.011);
            /* points up to 0.01 above the lowest one: 0.01 / sin(0.5) along the brush */
            ck_assert_double_le(fabs(low[0] - x - (tilted ? 0.0255 : -0.05)), 0.011);
        }
        end(&t);
    }
}
END_TEST

/* Presses a brush of one point, at a distance from the top of the cube as kept by a tool, for 100
 * steps at one position and then moves it fast. */
static void press_point(pen_test *t, double height, double depth, double depth_step)
{
    static const double point[1][3] = { { 0, 0, 0 } };
    t->pen.points = point;
    t->pen.point_count = 1;
    open_pen(t);
    for (int i = 0; i < 200; i++) {
        haptic_sample s = touch_at(i, 0.1 + (i < 100 ? 0 : 0.005 * (i - 99)), 0);
        s.touch[2] += height;
        s.depth = depth + i * depth_step;
        memcpy(s.proxy, s.touch, sizeof s.proxy);
        s.rotation[3] = 1;
        press_down(&s);
        haptic_paints_take(t->paint, &s, 1);
    }
}

/* A brush that presses harder has one stroke, with the opacity of the greatest pressure. It prints
 * at most once in 5 ms. */
START_TEST(test_pen_brush_has_bounded_prints)
{
    pen_test t;
    begin(&t);
    t.pen.fade = 0;
    press_point(&t, 0, 0, 0.0125); /* full pressure after 80 steps */
    ck_assert_uint_eq(read_strokes(&t), 1);
    ebpo_paint_stroke s = stroke_at(&t, 0);
    ck_assert_uint_eq(s.colour, 0xff0000ff);
    ck_assert_uint_ge(s.point_count, 20);
    ck_assert_uint_le(s.point_count, 37); /* 17 pressures, and 20 prints in 100 ms */
    end(&t);
}
END_TEST

/* A brush paints at the distance that its skin keeps it from the surface, also if it presses
 * little. Without a surface, it tries again. */
START_TEST(test_pen_brush_reaches_through_skin)
{
    for (int far = 0; far < 2; far++) {
        pen_test t;
        begin(&t);
        t.pen.skin = 0.005;
        t.pen.full_force = 0.01;
        press_point(&t, far ? 0.015 : 0.005, 1e-4, far ? 1e-4 : 0);
        ck_assert_uint_eq(read_strokes(&t), 1);
        ebpo_paint_stroke s = stroke_at(&t, 0);
        ck_assert_double_le(s.points[0].place[0], 0.1 + 1e-9);
        ck_assert_double_gt(s.points[s.point_count - 1].place[0], 0.55);
        end(&t);
    }
}
END_TEST

/* An undo removes all that a brush has painted in a contact. */
START_TEST(test_pen_brush_is_undone)
{
    pen_test t;
    begin(&t);
    move_brush(&t, 0, 0.01);
    ck_assert(haptic_paints_command(t.paint, "undo"));
    ck_assert(!haptic_paints_command(t.paint, "undo"));
    ck_assert_uint_eq(read_strokes(&t), 0);
    end(&t);
}
END_TEST

/* A device on UDP: its socket, the driver, and the number of sent positions. */
typedef struct udp_test {
    int socket;
    haptic_device device;
    uint8_t sent;
} udp_test;

/* Does a step of the driver, after a position of the device if `sends`. Returns true if the pen is
 * lifted. flags: of the result. */
static bool step_udp(udp_test *u, bool sends, uint32_t flags)
{
    uint8_t packet[80] = { 'E', 'B', 'P', 'T', 1, 0, 1 };
    const double one = 1;
    haptic_pose pose;
    haptic_result result = { .flags = flags };
    packet[8] = ++u->sent;
    memcpy(packet + 72, &one, sizeof one); /* not rotated */
    if (sends)
        ck_assert_int_eq(send(u->socket, packet, sizeof packet, 0), sizeof packet);
    ck_assert(u->device.read(u->device.self, 0, &pose));
    u->device.write(u->device.self, &result);
    return pose.lifted;
}

/* After a silence, the pen stays lifted until the proxy has followed the device, for any time. */
START_TEST(test_pen_follows_after_silence)
{
    const struct timespec silence = { 0, 260000000 }, wait = { 0, 60000000 };
    struct sockaddr_in at = { .sin_family = AF_INET };
    socklen_t length = sizeof at;
    udp_test u = { .socket = socket(AF_INET, SOCK_DGRAM, 0) };
    char name[32];
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    ck_assert_int_eq(bind(u.socket, (const struct sockaddr *)&at, sizeof at), 0);
    ck_assert_int_eq(getsockname(u.socket, (struct sockaddr *)&at, &length), 0);
    close(u.socket); /* its port is free now */
    u.socket = socket(AF_INET, SOCK_DGRAM, 0);
    snprintf(name, sizeof name, "udp:%d", ntohs(at.sin_port));
    ck_assert(haptic_udp_open(&u.device, name));
    ck_assert_int_eq(connect(u.socket, (const struct sockaddr *)&at, sizeof at), 0);
    (void)step_udp(&u, true, 0);
    ck_assert(!step_udp(&u, true, 0));
    ck_assert(!step_udp(&u, true, EBPO_HAPTIC_WAITING)); /* no silence */
    nanosleep(&silence, NULL);
    ck_assert(step_udp(&u, false, 0)); /* the proxy is at the old position */
    ck_assert(step_udp(&u, true, EBPO_HAPTIC_WAITING));
    nanosleep(&wait, NULL);
    ck_assert(step_udp(&u, true, EBPO_HAPTIC_PATH_UNFINISHED));
    ck_assert(step_udp(&u, true, EBPO_HAPTIC_CONTACT));
    ck_assert(!step_udp(&u, true, EBPO_HAPTIC_CONTACT));
    u.device.end(u.device.self);
    close(u.socket);
}
END_TEST

typedef struct painter {
    haptic_paints *paint;
    atomic_int slices; /* number of painted slices; SLICES: ended */
} painter;

enum { SLICES = 1000, SLICE = 16 };

static void *paint_slices(void *user)
{
    painter *p = user;
    haptic_sample s[SLICE];
    for (int i = 0; i < SLICES * SLICE; i++) {
        s[i % SLICE] = touch_at(i, 0.1 + 0.8 * i / SLICES / SLICE, 1);
        if (i % SLICE == SLICE - 1) {
            haptic_paints_take(p->paint, s, SLICE);
            atomic_fetch_add(&p->slices, 1);
        }
    }
    return NULL;
}

static int compare_ints(const void *a, const void *b) { return *(const int *)a - *(const int *)b; }

/* A page that waits for the lock gets it after the current slice of 16 steps, also if the painter
 * has more steps to paint at once. */
START_TEST(test_pen_shares_lock)
{
    pen_test t;
    pthread_t thread;
    haptic_paint_cursor cursor = HAPTIC_PAINT_CURSOR_INIT;
    int waited[SLICES], looks = 0;
    begin(&t);
    t.pen.pen.radius = 1e-4;
    open_pen(&t);
    painter p = { .paint = t.paint };
    FILE *out = fopen("/dev/null", "w");
    ck_assert_ptr_nonnull(out);
    ck_assert_int_eq(pthread_create(&thread, NULL, paint_slices, &p), 0);
    for (int before; (before = atomic_load(&p.slices)) < SLICES && looks < SLICES; looks++) {
        haptic_paints_write_news(t.paint, &cursor, out);
        waited[looks] = atomic_load(&p.slices) - before;
        nanosleep(&(struct timespec){ 0, 200000 }, NULL);
    }
    pthread_join(thread, NULL);
    fclose(out);
    ck_assert_uint_eq(read_strokes(&t), 1);
    qsort(waited, (size_t)looks, sizeof *waited, compare_ints);
    ck_assert_int_gt(looks, 10);
    ck_assert_msg(waited[looks * 9 / 10] <= 3, "%d slices in a wait (of %d); at most %d",
                  waited[looks * 9 / 10], looks, waited[looks - 1]);
    end(&t);
}
END_TEST

Suite *test_suite(void)
{
    Suite *suite = suite_create("haptic_pen");
    TCase *tc = tcase_create("haptic_pen");
    tcase_set_timeout(tc, 300);
    tcase_add_test(tc, test_pen_is_lifted_after_lost_steps);
    tcase_add_test(tc, test_pen_paints_instances);
    tcase_add_test(tc, test_pen_has_least_step);
    tcase_add_test(tc, test_pen_slices_are_equal);
    tcase_add_test(tc, test_pen_opacity_follows_pressure);
    tcase_add_test(tc, test_pen_opacity_does_not_accumulate);
    tcase_add_test(tc, test_pen_undo_removes_contacts);
    tcase_add_test(tc, test_pen_paints_nothing_after_undo);
    tcase_add_test(tc, test_pen_takes_pressure_of_stylus);
    tcase_add_test(tc, test_pen_brush_paints_its_shape);
    tcase_add_test(tc, test_pen_brush_has_bounded_prints);
    tcase_add_test(tc, test_pen_brush_reaches_through_skin);
    tcase_add_test(tc, test_pen_brush_is_undone);
    tcase_add_test(tc, test_pen_follows_after_silence);
    tcase_add_test(tc, test_pen_shares_lock);
    suite_add_tcase(suite, tc);
    return suite;
}
