/* Two paints are in memory. The pen paints into `drawn`. `saved` belongs to the file. A thread
 * copies new strokes from `drawn` to `saved` under a lock, and then saves `saved` without the lock,
 * so that a slow disk does not delay the pen. Strokes that were copied before are equal in both,
 * except that the last stroke may be longer in `drawn`. */
#include "cli/commands/haptic_paint.h"

#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/tool_clock.h"

/* A killed process loses the paint of at most SAVE_NS, plus the time of a save. */
enum { SAVE_NS = 500000000, POLL_NS = 20000000 };

/* Seconds to wait for another program that changes the file. */
static const double LOCK_SECONDS = 1;

/* The pen is lifted when it was not in contact for this time. Shorter gaps do not end a stroke. */
static const double LIFT_MS = 30;

struct haptic_paint {
    haptic_pen pen;
    ebpo_context *context;
    /* Used by the thread that paints. */
    ebpo_paint_drawing *drawing; /* NULL: the pen is lifted */
    double touched;              /* time of the last sample in contact */
    ebpo_error error;            /* first error of painting */
    /* Under the lock. */
    pthread_mutex_t lock;
    ebpo_paint *drawn;
    uint64_t finished; /* number of strokes of `drawn` that will not change */
    uint64_t changes;  /* number of changes of `drawn` */
    /* Used by the thread that saves. */
    ebpo_paint *saved;
    uint64_t copied; /* number of strokes of `saved` that will not change */
    uint64_t copied_changes, saved_changes;
    uint64_t strokes_before, points_before; /* numbers of strokes and points in the opened file */
    ebpo_error save_error;                  /* of the last save */
    haptic_painted result;
    pthread_t saver;
    atomic_bool ended;
};

static ebpo_paint_info info_of(const ebpo_paint *paint)
{
    ebpo_paint_info info = EBPO_PAINT_INFO_INIT;
    ebpo_paint_get_info(paint, &info);
    return info;
}

/* --- saving --- */

/* Makes `saved` equal to `drawn`. The caller has the lock. */
static ebpo_status copy_strokes(haptic_paint *p, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    uint64_t count = info_of(p->drawn).stroke_count;
    for (uint64_t i = info_of(p->saved).stroke_count; i > p->copied && status == EBPO_OK; i--)
        status = ebpo_paint_remove_stroke(p->saved, i - 1, error);
    for (uint64_t i = p->copied; i < count && status == EBPO_OK; i++) {
        ebpo_paint_stroke stroke = EBPO_PAINT_STROKE_INIT;
        ebpo_paint_get_stroke(p->drawn, i, &stroke);
        status = ebpo_paint_add_stroke(p->saved, &stroke, error);
    }
    if (status == EBPO_OK) {
        p->copied = p->finished;
        p->copied_changes = p->changes;
    }
    return status;
}

/* Saves the paint if it has changed. Reports the first of successive failures. */
static ebpo_status save_paint(haptic_paint *p)
{
    ebpo_error error = EBPO_ERROR_INIT;
    uint64_t begin = tool_clock();
    pthread_mutex_lock(&p->lock);
    ebpo_status status = p->changes == p->saved_changes ? EBPO_OK : copy_strokes(p, &error);
    bool changed = p->changes != p->saved_changes;
    pthread_mutex_unlock(&p->lock);
    if (!changed)
        return EBPO_OK;
    if (status == EBPO_OK)
        status = ebpo_paint_checkpoint(p->saved, &error);
    if (status == EBPO_OK) {
        p->saved_changes = p->copied_changes;
        p->result.saves++;
        p->result.save_seconds_max =
            fmax(p->result.save_seconds_max, 1e-9 * (double)(tool_clock() - begin));
        if (p->save_error.status != EBPO_OK)
            fprintf(stderr, "ebpo haptic: %s: saved again\n", p->pen.path);
        p->save_error = (ebpo_error)EBPO_ERROR_INIT;
        return EBPO_OK;
    }
    if (p->save_error.status == EBPO_OK)
        fprintf(stderr,
                "ebpo haptic: %s; the device continues, the paint stays in memory, and saving is "
                "tried again every half second\n",
                error.message);
    p->save_error = error;
    p->result.failed_saves++;
    return status;
}

static void *save_often(void *user)
{
    haptic_paint *p = user;
    for (uint64_t due = tool_clock() + SAVE_NS; !atomic_load(&p->ended);) {
        tool_wait_until(tool_clock() + POLL_NS);
        if (tool_clock() >= due) {
            due = tool_clock() + SAVE_NS;
            (void)save_paint(p);
        }
    }
    return NULL;
}

/* --- painting --- */

/* Reports the first error. */
static void report_painting(haptic_paint *p, const ebpo_error *error)
{
    if (p->error.status == EBPO_OK)
        fprintf(stderr,
                "ebpo haptic: %s: painting failed: %s; the device continues, and later contacts "
                "are painted if possible\n",
                p->pen.path, error->message);
    if (p->error.status == EBPO_OK)
        p->error = *error;
}

/* Lifts the pen, which ends a stroke. The caller has the lock. */
static void lift_pen(haptic_paint *p)
{
    if (!p->drawing)
        return;
    ebpo_paint_drawing_free(p->drawing);
    p->drawing = NULL;
    p->finished = info_of(p->drawn).stroke_count;
}

/* Begins a stroke. The caller has the lock. */
static ebpo_status begin_stroke(haptic_paint *p, ebpo_error *error)
{
    ebpo_paint_pen pen = p->pen.pen;
    pen.pressure_step = 0x1p-4;
    pen.seed = 1 + info_of(p->drawn).stroke_count;
    pen.time = p->pen.dated ? 1000 * (uint64_t)time(NULL) : 0;
    return ebpo_paint_drawing_new(p->drawn, p->context, &pen, &p->drawing, error);
}

static bool is_touching(const haptic_sample *s) { return s->flags & EBPO_HAPTIC_CONTACT; }

static ebpo_paint_input input_of(const haptic_paint *p, const haptic_sample *s)
{
    ebpo_paint_input input = { .time = fmin(s->time, UINT32_MAX) };
    memcpy(input.place, s->touch, sizeof input.place);
    input.pressure = fmin(1, p->pen.stiffness * s->depth / p->pen.full_force) * s->pressure;
    return input;
}

/* Paints successive steps in contact. The caller has the lock. */
static void paint_contact(haptic_paint *p, const ebpo_paint_input *input, uint64_t count)
{
    ebpo_error error = EBPO_ERROR_INIT;
    uint64_t before = info_of(p->drawn).point_count;
    ebpo_status status = p->drawing ? EBPO_OK : begin_stroke(p, &error);
    if (status == EBPO_OK)
        status = ebpo_paint_drawing_add(p->drawing, input, count, NULL, &error);
    p->changes += info_of(p->drawn).point_count > before;
    if (status != EBPO_OK)
        report_painting(p, &error);
}

void haptic_paint_take(void *user, const haptic_sample *samples, uint64_t count)
{
    enum { MOST = 256 };
    haptic_paint *p = user;
    ebpo_paint_input input[MOST];
    pthread_mutex_lock(&p->lock);
    for (uint64_t i = 0; i < count;) {
        uint64_t n = 0;
        if (!is_touching(&samples[i])) {
            if (samples[i].time - p->touched > LIFT_MS)
                lift_pen(p);
            i++;
            continue;
        }
        for (; n < MOST && i < count && is_touching(&samples[i]); n++, i++)
            input[n] = input_of(p, &samples[i]);
        p->touched = samples[i - 1].time;
        paint_contact(p, input, n);
    }
    pthread_mutex_unlock(&p->lock);
}

/* --- opening and closing --- */

/* Sets the layer and the colour of the pen. Adds a layer if there is none. */
static ebpo_status choose_layer(haptic_paint *p, ebpo_error *error)
{
    ebpo_paint_layer layer = EBPO_PAINT_LAYER_INIT;
    ebpo_status status = EBPO_OK;
    ebpo_paint_pen *pen = &p->pen.pen;
    if (info_of(p->saved).layer_count == 0) {
        layer.title = "Touched";
        if (!p->pen.default_colour)
            layer.colour = pen->colour;
        status = ebpo_paint_add_layer(p->saved, &layer, NULL, error);
    }
    uint64_t layers = info_of(p->saved).layer_count;
    if (p->pen.default_layer)
        pen->layer = layers - 1;
    if (status == EBPO_OK && pen->layer >= layers) {
        *error = (ebpo_error){ .status = EBPO_E_ARGUMENT, .offset = -1 };
        snprintf(error->message, sizeof error->message,
                 "%.200s: layer %llu not found; the file has %llu layers, counted from 0",
                 p->pen.path, (unsigned long long)pen->layer, (unsigned long long)layers);
        return EBPO_E_ARGUMENT;
    }
    ebpo_paint_get_layer(p->saved, pen->layer, &layer);
    if (pen->kind == EBPO_PAINT_ERASES)
        pen->colour = 0;
    else if (p->pen.default_colour)
        pen->colour = layer.colour;
    return status;
}

static ebpo_status open_paints(haptic_paint *p, const ebpo_file *file, ebpo_error *error)
{
    ebpo_status status =
        ebpo_paint_open_to_change(p->pen.path, file, LOCK_SECONDS, NULL, &p->saved, error);
    if (status == EBPO_OK)
        status = ebpo_paint_check_model(p->saved, file, error);
    if (status == EBPO_OK)
        status = ebpo_paint_check_points(p->saved, p->context, NULL, error);
    if (status == EBPO_OK)
        status = choose_layer(p, error);
    if (status == EBPO_OK)
        status = ebpo_paint_checkpoint(p->saved, error);
    return status == EBPO_OK ? ebpo_paint_open(p->pen.path, &p->drawn, error) : status;
}

static void free_paint(haptic_paint *p)
{
    ebpo_paint_drawing_free(p->drawing);
    ebpo_paint_free(p->drawn);
    ebpo_paint_free(p->saved);
    ebpo_context_free(p->context);
    pthread_mutex_destroy(&p->lock);
    free(p);
}

static ebpo_status fail_memory(ebpo_error *error)
{
    *error = (ebpo_error){ .status = EBPO_E_MEMORY, .offset = -1 };
    snprintf(error->message, sizeof error->message,
             "not enough memory or threads for painting; close other programs");
    return EBPO_E_MEMORY;
}

ebpo_status haptic_paint_open(haptic_paint **out, const haptic_pen *pen, const ebpo_file *file,
                              ebpo_model *model, ebpo_error *error)
{
    haptic_paint *p = calloc(1, sizeof *p);
    *out = NULL;
    if (!p)
        return fail_memory(error);
    pthread_mutex_init(&p->lock, NULL);
    p->pen = *pen;
    p->error = p->save_error = (ebpo_error)EBPO_ERROR_INIT;
    ebpo_status status = ebpo_context_new(model, &p->context, error);
    if (status == EBPO_OK)
        status = open_paints(p, file, error);
    if (status != EBPO_OK) {
        free_paint(p);
        return status;
    }
    p->copied = p->finished = p->strokes_before = info_of(p->drawn).stroke_count;
    p->points_before = info_of(p->drawn).point_count;
    if (command_thread(&p->saver, save_often, p) != 0) {
        free_paint(p);
        return fail_memory(error);
    }
    *out = p;
    return EBPO_OK;
}

ebpo_status haptic_paint_close(haptic_paint *p, haptic_painted *out, ebpo_error *error)
{
    if (!p)
        return EBPO_OK;
    atomic_store(&p->ended, true);
    pthread_join(p->saver, NULL);
    pthread_mutex_lock(&p->lock);
    lift_pen(p);
    pthread_mutex_unlock(&p->lock);
    ebpo_status status = save_paint(p);
    const ebpo_error *last = status != EBPO_OK ? &p->save_error : &p->error;
    if (last->status != EBPO_OK)
        *error = *last;
    status = last->status;
    *out = p->result;
    out->strokes = info_of(p->saved).stroke_count - p->strokes_before;
    out->points = info_of(p->saved).point_count - p->points_before;
    free_paint(p);
    return status;
}
