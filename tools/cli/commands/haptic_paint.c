/* Two paints are in memory. The pen paints into `drawn`. `saved` belongs to the file. A thread
 * copies new strokes from `drawn` to `saved` under a lock, and then saves `saved` without the lock,
 * so that saving does not delay the pen. Strokes that were copied before are equal in both, except
 * that the last stroke may be longer in `drawn`. A save does not wait for the disk: a second thread
 * syncs the file, so that a slow disk does not delay the next save. */
#include "cli/commands/haptic_paint.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/commands/haptic_brush.h"
#include "cli/numbers.h"
#include "cli/tool_clock.h"
#include "cli/words.h"

/* Size of a point with the radius of the stroke. */
enum { FULL_SIZE = 1 << 15 };

/* A killed process loses the paint of at most SAVE_NS, plus the time of a save without the disk. */
enum { SAVE_NS = 500000000, POLL_NS = 20000000 };

/* Maximum number of steps that are painted while the lock is held. */
enum { SLICE = 16 };

/* The format has one opacity for each stroke. If the opacity follows the pressure, it has LEVELS
 * steps, and a contact has a stroke for each change. It changes when it is a whole level from the
 * current one, so that it does not change back and forth. Strokes blend, so a pen that is put down
 * or lifted at one position must not add strokes there: while the pen is within a radius of where
 * the stroke began, a stroke of the new opacity replaces the stroke. A lower opacity replaces only
 * strokes that began because the pressure fell. */
enum { LEVELS = 16 };

/* Shortest time between two prints of a brush, and greatest number of points in one of its strokes,
 * which is copied for each print. */
static const double PRINT_MS = 5;
enum { PRINT_POINTS = 1 << 15 };

/* Shortest step of the pen, as a share of the model's diagonal. It bounds the work for a movement
 * with a thin pen. */
static const double SHORTEST_STEP = 1e-5;

/* Seconds to wait for another program that changes the file. */
static const double LOCK_SECONDS = 1;

/* A contact of this run. */
typedef struct haptic_contact {
    uint64_t strokes; /* number of strokes of `drawn` before the contact */
    double begin;     /* time of its first step */
} haptic_contact;

struct haptic_paint {
    haptic_pen pen;
    uint32_t colour; /* of the pen when it does not erase */
    double lost_ms;  /* time between two steps in contact above which steps were lost */
    ebpo_context *context;
    /* Used by the thread that paints. Its lengths and positions are those of the world. */
    uint64_t instance;           /* the instance that was touched last; UINT64_MAX: none yet */
    const ebpo_pose *pose;       /* of this instance; NULL: the model is not posed */
    ebpo_paint_drawing *drawing; /* NULL: the pen is lifted */
    double touched;              /* time of the last sample in contact */
    ebpo_paint_input first;      /* first position of the stroke */
    ebpo_paint_input last;       /* last position of `drawing` */
    double moved;                /* greatest distance from `first` */
    bool falls;                  /* the stroke began because the pressure fell */
    int level;                   /* opacity of the stroke: 1 to LEVELS; 0: no stroke */
    bool pressed;                /* the brush has painted in this contact, at `print` */
    haptic_sample print;         /* the last step in which the brush has painted */
    double print_pressure;
    uint64_t print_size;      /* number of points of the last print */
    double print_time;        /* when the brush has painted last, or has found no surface */
    ebpo_paint_point *prints; /* [print_count], at most PRINT_POINTS: the brush's last stroke */
    uint64_t print_count;
    uint64_t prints_time; /* time of that stroke */
    haptic_brush *brush;  /* NULL: not a brush */
    double arm;           /* of a brush: distance of its farthest point from its origin */
    ebpo_error error;     /* first error of painting */
    pthread_mutex_t turn; /* held while a thread waits for the lock */
    /* Under the lock. */
    pthread_mutex_t lock;
    ebpo_paint *drawn;
    uint64_t finished;       /* number of strokes of `drawn` that will not change */
    haptic_contact *contact; /* [contact_count] */
    uint64_t contact_count, contact_capacity;
    bool in_contact;     /* the last contact has not ended */
    uint64_t changes;    /* number of changes of `drawn` */
    uint64_t epoch;      /* number of removals of strokes */
    uint64_t kept;       /* number of strokes that the last removals have kept */
    uint64_t kept_epoch; /* all removals since this epoch have kept the same number */
    uint64_t layer_changes;
    /* Used by the thread that saves. */
    ebpo_paint *saved;
    uint64_t copied; /* number of strokes of `saved` that will not change */
    uint64_t copied_changes, saved_changes;
    uint64_t strokes_before, points_before; /* numbers of strokes and points in the opened file */
    ebpo_error save_error;                  /* of the last save */
    haptic_painted result;
    pthread_t saver, syncer;
    atomic_bool unsynced; /* the file was saved, and not synced since then */
    atomic_bool again;    /* a sync has failed, so the file must be saved again */
    atomic_bool ended;
};

static ebpo_paint_info info_of(const ebpo_paint *paint)
{
    ebpo_paint_info info = EBPO_PAINT_INFO_INIT;
    ebpo_paint_get_info(paint, &info);
    return info;
}

/* A thread that has waited for the lock gets it before the thread that released it: that thread
 * must wait for its turn. */
static void lock_paint(haptic_paint *p)
{
    pthread_mutex_lock(&p->turn);
    pthread_mutex_lock(&p->lock);
    pthread_mutex_unlock(&p->turn);
}

static void unlock_paint(haptic_paint *p) { pthread_mutex_unlock(&p->lock); }

/* --- saving --- */

/* Adds the layers of `drawn` that `saved` does not have. The caller has the lock. */
static ebpo_status copy_layers(haptic_paint *p, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    uint64_t count = info_of(p->drawn).layer_count;
    for (uint64_t i = info_of(p->saved).layer_count; i < count && status == EBPO_OK; i++) {
        ebpo_paint_layer layer = EBPO_PAINT_LAYER_INIT;
        ebpo_paint_get_layer(p->drawn, i, &layer);
        status = ebpo_paint_add_layer(p->saved, &layer, NULL, error);
    }
    return status;
}

/* Makes `saved` equal to `drawn`. The caller has the lock. */
static ebpo_status copy_strokes(haptic_paint *p, ebpo_error *error)
{
    ebpo_status status = copy_layers(p, error);
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

/* Saves the paint if it has changed, or if its file could not be synced. Reports the first of
 * successive failures. */
static ebpo_status save_paint(haptic_paint *p)
{
    ebpo_error error = EBPO_ERROR_INIT;
    uint64_t begin = tool_clock();
    bool again = atomic_exchange(&p->again, false);
    lock_paint(p);
    ebpo_status status = p->changes == p->saved_changes ? EBPO_OK : copy_strokes(p, &error);
    bool changed = p->changes != p->saved_changes;
    unlock_paint(p);
    if (!changed && !again)
        return EBPO_OK;
    if (status == EBPO_OK)
        status = ebpo_paint_checkpoint(p->saved, &error);
    if (status == EBPO_OK) {
        p->saved_changes = p->copied_changes;
        atomic_store(&p->unsynced, true);
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
    if (again)
        atomic_store(&p->again, true);
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

/* Syncs a file or a folder. Returns false, with errno, on failure. */
static bool sync_path(const char *path)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    bool synced =
        fd >= 0 && (fsync(fd) == 0 || errno == EINVAL); /* a folder that cannot be synced */
    int saved = errno;
    if (fd >= 0)
        close(fd);
    errno = saved;
    return synced;
}

/* Syncs the paint file and its folder if the file was saved since the last call. A save through a
 * symbolic link replaces the file to which the link leads. */
static ebpo_status sync_paint(haptic_paint *p, ebpo_error *error)
{
    char folder[PATH_MAX];
    if (!atomic_exchange(&p->unsynced, false))
        return EBPO_OK;
    if (sync_path(p->pen.path) && realpath(p->pen.path, folder)) {
        strrchr(folder, '/')[1] = 0;
        if (sync_path(folder))
            return EBPO_OK;
    }
    int number = errno;
    atomic_store(&p->again, true);
    *error = (ebpo_error){ .status = EBPO_E_IO, .offset = -1 };
    snprintf(error->message, sizeof error->message, "%.200s: could not be synced to the disk: %s",
             p->pen.path, strerror(number));
    return EBPO_E_IO;
}

static void *sync_often(void *user)
{
    haptic_paint *p = user;
    ebpo_error error = EBPO_ERROR_INIT;
    for (bool failed = false; !atomic_load(&p->ended);) {
        tool_wait_until(tool_clock() + POLL_NS);
        if (sync_paint(p, &error) == EBPO_OK || failed)
            continue;
        failed = true;
        fprintf(stderr, "ebpo haptic: %s; the device continues, and the paint is saved again\n",
                error.message);
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

/* Ends a stroke. The caller has the lock. */
static void end_stroke(haptic_paint *p)
{
    ebpo_paint_drawing_free(p->drawing);
    p->drawing = NULL;
    p->print_count = 0;
    p->finished = info_of(p->drawn).stroke_count;
}

/* Removes the strokes from number `count` on. The caller has the lock. */
static bool remove_strokes(haptic_paint *p, uint64_t count)
{
    ebpo_error error = EBPO_ERROR_INIT;
    uint64_t i = info_of(p->drawn).stroke_count;
    while (i > count && ebpo_paint_remove_stroke(p->drawn, i - 1, &error) == EBPO_OK)
        i--;
    if (p->kept != i)
        p->kept_epoch = p->epoch;
    p->kept = i;
    p->epoch++;
    p->changes++;
    return i == count;
}

/* Lifts the pen, which ends a contact. The caller has the lock. */
static void lift_pen(haptic_paint *p)
{
    end_stroke(p);
    p->in_contact = p->pressed = p->falls = false;
    p->level = 0;
}

static ebpo_status fail_memory(ebpo_error *error)
{
    *error = (ebpo_error){ .status = EBPO_E_MEMORY, .offset = -1 };
    snprintf(error->message, sizeof error->message,
             "not enough memory or threads for painting; close other programs");
    return EBPO_E_MEMORY;
}

/* Notes where a contact begins, for undo. The caller has the lock. */
static ebpo_status begin_contact(haptic_paint *p, ebpo_error *error)
{
    if (p->in_contact)
        return EBPO_OK;
    if (p->contact_count == p->contact_capacity) {
        uint64_t capacity = p->contact_capacity ? 2 * p->contact_capacity : 64;
        haptic_contact *contact = realloc(p->contact, capacity * sizeof *contact);
        if (!contact)
            return fail_memory(error);
        p->contact = contact;
        p->contact_capacity = capacity;
    }
    p->contact[p->contact_count++] = (haptic_contact){ info_of(p->drawn).stroke_count, p->touched };
    p->in_contact = true;
    return EBPO_OK;
}

/* Returns the greatest distance from the beginning of the stroke, up to the next position. */
static double moved_to(const haptic_paint *p, const ebpo_paint_input *next)
{
    const double *a = p->first.place, *b = next->place;
    return fmax(p->moved, hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]));
}

/* Returns the level of opacity at the next position of the pen. */
static int next_level(const haptic_paint *p, const ebpo_paint_input *next)
{
    double exact = LEVELS * (p->pen.fade + (1 - p->pen.fade) * next->pressure);
    int level = (int)fmax(1, floor(exact + 0.5));
    if (p->level == 0)
        return level;
    bool keeps = level < p->level && !p->falls && moved_to(p, next) < p->pen.pen.radius;
    return keeps || fabs(exact - p->level) < 1 ? p->level : level;
}

/* Moves the pen to the next position, with its level. */
static void move_pen(haptic_paint *p, const ebpo_paint_input *next, int level)
{
    if (p->level == 0) {
        p->first = *next;
        p->moved = 0;
    }
    p->level = level;
    p->moved = moved_to(p, next);
}

/* Ends a stroke before the opacity changes to another level at the next position. If the pen has
 * not moved far, removes the stroke instead. Returns true then: the new stroke begins where that
 * stroke began. */
static bool replace_stroke(haptic_paint *p, const ebpo_paint_input *next, int level)
{
    if (moved_to(p, next) < p->pen.pen.radius) {
        ebpo_paint_drawing_free(p->drawing);
        p->drawing = NULL;
        return remove_strokes(p, p->finished);
    }
    end_stroke(p);
    p->falls = level < p->level;
    p->level = 0;
    return false;
}

/* Returns the colour of the pen with the opacity of p->level. */
static uint32_t faded_colour(const haptic_paint *p)
{
    uint32_t colour = p->pen.pen.colour, opacity = colour & 255;
    return colour - opacity + (opacity * (uint32_t)p->level + LEVELS / 2) / LEVELS;
}

static uint64_t stroke_time(const haptic_paint *p)
{
    return p->pen.dated ? 1000 * (uint64_t)time(NULL) : 0;
}

/* Returns the scale of the touched instance. */
static double scale_of(const haptic_paint *p) { return p->pose ? p->pose->scale : 1; }

/* Returns the shortest step of the pen, in the unit of the world. */
static double least_step(const haptic_paint *p)
{
    return SHORTEST_STEP * p->pen.diagonal * scale_of(p);
}

/* Begins a stroke. The caller has the lock. */
static ebpo_status begin_stroke(haptic_paint *p, ebpo_error *error)
{
    ebpo_paint_pen pen = p->pen.pen;
    double reach = fmax(pen.radius, pen.spread), scale = scale_of(p);
    pen.step = fmax(reach / 2, least_step(p)) / scale;
    pen.within = fmax(reach, least_step(p)) / scale; /* nothing is painted through the air */
    pen.radius /= scale;
    pen.spread /= scale;
    pen.pressure_step = 0x1p-4;
    pen.seed = 1 + info_of(p->drawn).stroke_count;
    pen.time = stroke_time(p);
    pen.colour = faded_colour(p);
    ebpo_status status = begin_contact(p, error);
    return status == EBPO_OK
               ? ebpo_paint_drawing_new(p->drawn, p->context, &pen, &p->drawing, error)
               : status;
}

static bool is_touching(const haptic_sample *s)
{
    return s->flags & EBPO_HAPTIC_CONTACT && !s->lifted;
}

static ebpo_paint_input input_of(const haptic_paint *p, const haptic_sample *s)
{
    ebpo_paint_input input = { .time = fmin(s->time, UINT32_MAX) };
    memcpy(input.place, s->touch, sizeof input.place);
    input.pressure =
        s->pressure > 0 ? s->pressure : fmin(1, p->pen.stiffness * s->depth / p->pen.full_force);
    return input;
}

/* Paints successive steps in contact, at most SLICE + 1. The caller has the lock. */
static void paint_contact(haptic_paint *p, const ebpo_paint_input *input, uint64_t count)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_paint_input on_model[SLICE + 1];
    for (uint64_t i = 0; i < count; i++) {
        on_model[i] = input[i];
        haptic_to_model(p->pose, input[i].place, on_model[i].place);
    }
    uint64_t before = info_of(p->drawn).point_count;
    ebpo_status status = p->drawing ? EBPO_OK : begin_stroke(p, &error);
    if (status == EBPO_OK)
        status = ebpo_paint_drawing_add(p->drawing, on_model, count, NULL, &error);
    p->changes += info_of(p->drawn).point_count > before;
    if (status != EBPO_OK)
        report_painting(p, &error);
    p->last = input[count - 1];
}

/* Adds the pressed points of the brush to `prints`. */
static ebpo_status take_print(haptic_paint *p, const haptic_sample *sample, double pressure,
                              ebpo_error *error)
{
    double place[HAPTIC_BRUSH_MAX][3], on_model[3], least = p->pen.pen.size_least;
    int count;
    /* the proxy keeps the skin from the surface */
    double near = fmax(0x1p-12 * p->pen.diagonal * scale_of(p), 2 * p->pen.skin);
    ebpo_status status =
        haptic_brush_press(p->brush, p->context, p->pose, sample, near, place, &count, error);
    for (int i = 0; i < count && status == EBPO_OK; i++) {
        ebpo_paint_point *q = &p->prints[p->print_count];
        haptic_to_model(p->pose, place[i], on_model);
        status = ebpo_paint_locate(p->drawn, p->context, on_model, q, error);
        q->size = (uint16_t)(FULL_SIZE * (least + pressure * (1 - least)));
        q->pressure = (uint16_t)(pressure * UINT16_MAX);
        p->print_count += status == EBPO_OK;
    }
    return status;
}

/* Makes `prints` the last stroke, in place of a shorter one. The caller has the lock. */
static ebpo_status add_prints(haptic_paint *p, ebpo_error *error)
{
    const ebpo_paint_pen *pen = &p->pen.pen;
    ebpo_status status = EBPO_OK;
    ebpo_paint_stroke stroke = EBPO_PAINT_STROKE_INIT;
    stroke.layer = pen->layer;
    stroke.kind = pen->kind;
    stroke.colour = faded_colour(p);
    stroke.radius = pen->radius / scale_of(p);
    stroke.time = p->prints_time;
    stroke.points = p->prints;
    stroke.point_count = p->print_count;
    uint64_t count = info_of(p->drawn).stroke_count;
    if (count > p->finished)
        status = ebpo_paint_remove_stroke(p->drawn, count - 1, error);
    if (status == EBPO_OK)
        status = ebpo_paint_add_stroke(p->drawn, &stroke, error);
    p->changes++;
    return status;
}

/* Adds a print of at least `least` points to the stroke of the brush, or begins a stroke. Returns
 * true if points were added. The caller has the lock. */
static bool add_print(haptic_paint *p, const haptic_sample *sample, double pressure, uint64_t least)
{
    ebpo_error error = EBPO_ERROR_INIT;
    if (p->print_count + HAPTIC_BRUSH_MAX > PRINT_POINTS)
        end_stroke(p);
    if (p->print_count == 0)
        p->prints_time = stroke_time(p);
    uint64_t before = p->print_count;
    ebpo_status status = begin_contact(p, &error);
    if (status == EBPO_OK)
        status = take_print(p, sample, pressure, &error);
    if (status != EBPO_OK || p->print_count - before < least)
        p->print_count = before;
    bool added = p->print_count > before;
    if (added)
        p->print_size = p->print_count - before;
    bool removed = before > 0 && info_of(p->drawn).stroke_count == p->finished;
    if (status == EBPO_OK && (added || removed)) /* removed: by replace_stroke */
        status = add_prints(p, &error);
    if (status != EBPO_OK)
        report_painting(p, &error);
    return added && status == EBPO_OK;
}

/* Returns a length that no point of the brush has exceeded since it painted last. */
static double brush_motion(const haptic_paint *p, const haptic_sample *to)
{
    const haptic_sample *from = &p->print;
    double square = 0, cosine = 0;
    for (int k = 0; k < 3; k++)
        square += (to->proxy[k] - from->proxy[k]) * (to->proxy[k] - from->proxy[k]);
    for (int k = 0; k < 4; k++)
        cosine += to->rotation[k] * from->rotation[k];
    return sqrt(square) + 2 * p->arm * acos(fmin(1, fabs(cosine)));
}

/* Paints with the brush if it has moved by a step, is pressed harder by a level of opacity, or is
 * pressed in further by a step and with more points, since it painted last. The caller has the
 * lock. */
static void press_brush(haptic_paint *p, const haptic_sample *sample)
{
    ebpo_paint_input next = input_of(p, sample);
    double step = fmax(p->pen.pen.radius / 2, least_step(p));
    bool stays = p->pressed && next.pressure < p->print_pressure + 1.0 / LEVELS &&
                 brush_motion(p, sample) < step;
    if (sample->time < p->print_time + PRINT_MS || (stays && sample->depth < p->print.depth + step))
        return;
    memcpy(next.place, sample->proxy, sizeof next.place);
    int level = next_level(p, &next);
    if (p->level > 0 && level != p->level)
        (void)replace_stroke(p, &next, level);
    move_pen(p, &next, level);
    p->print_time = sample->time;
    uint64_t least = 1;
    if (stays) {
        p->print.depth = sample->depth;
        least = p->print_size < HAPTIC_BRUSH_MAX ? p->print_size + 1 : HAPTIC_BRUSH_MAX;
    }
    if (!add_print(p, sample, next.pressure, least))
        return;
    p->print = *sample;
    p->print_pressure = next.pressure;
    p->pressed = true;
}

/* Takes the next step, or steps in contact without a long gap. Returns their number. The caller has
 * the lock. */
static uint64_t take_some(haptic_paint *p, const haptic_sample *samples, uint64_t count)
{
    ebpo_paint_input input[SLICE + 1];
    uint64_t taken = 0, n = 0;
    bool touches = is_touching(&samples[0]);
    if (samples[0].lifted || samples[0].time - p->touched > (touches ? p->lost_ms : HAPTIC_LIFT_MS))
        lift_pen(p);
    if (!touches)
        return 1;
    p->touched = samples[0].time;
    if (atomic_load(p->pen.undone))
        return 1;
    if (p->pen.point_count > 0) {
        press_brush(p, &samples[0]);
        return 1;
    }
    /* Between two touches with a long gap, steps were lost. */
    for (; taken < SLICE && taken < count && is_touching(&samples[taken]) &&
           samples[taken].time - p->touched <= p->lost_ms;
         taken++) {
        ebpo_paint_input next = input_of(p, &samples[taken]);
        int level = next_level(p, &next), before = p->level;
        if (level != before && taken > 0)
            break;
        if (before > 0 && level != before && replace_stroke(p, &next, level)) {
            input[n] = p->first;
            input[n++].pressure = next.pressure;
        } else if (before > 0 && level != before) { /* the new stroke continues the path */
            input[n++] = p->last;
            move_pen(p, &p->last, level);
        }
        move_pen(p, &next, level);
        input[n++] = next;
        p->touched = samples[taken].time;
    }
    paint_contact(p, input, n);
    return taken;
}

/* Returns true if the step continues on the instance that was touched last. */
static bool is_same(const haptic_paint *p, const haptic_sample *s)
{
    return !is_touching(s) || s->instance == p->instance || s->instance == UINT64_MAX;
}

/* Changes to the instance of a step, with a lifted pen. Returns false while the pen has hardly left
 * the last one: where two instances meet, the pen would otherwise be lifted in each step. The
 * caller has the lock. */
static bool touch_instance(haptic_paint *p, const haptic_sample *s)
{
    if (is_same(p, s)) /* the pose of a first step may not be known */
        return !p->pen.poses || p->instance != UINT64_MAX || !is_touching(s);
    if (p->instance != UINT64_MAX && s->time - p->touched <= p->lost_ms)
        return false;
    lift_pen(p);
    p->instance = s->instance;
    p->pose = p->pen.poses ? &p->pen.poses[s->instance] : NULL;
    return true;
}

void haptic_paint_take(void *user, const haptic_sample *samples, uint64_t count)
{
    haptic_paint *p = user;
    for (uint64_t i = 0, same; i < count;) {
        lock_paint(p);
        bool touches = touch_instance(p, &samples[i]);
        for (same = 1; i + same < count && is_same(p, &samples[i + same]);)
            same++;
        i += touches ? take_some(p, samples + i, same) : 1;
        unlock_paint(p);
    }
}

/* --- commands --- */

/* Returns the last contact of this run that has painted; NULL: none. The caller has the lock, and
 * the pen is lifted. */
static const haptic_contact *last_contact(haptic_paint *p)
{
    uint64_t count = info_of(p->drawn).stroke_count;
    while (p->contact_count > 0 && p->contact[p->contact_count - 1].strokes == count)
        p->contact_count--;
    return p->contact_count > 0 ? &p->contact[p->contact_count - 1] : NULL;
}

double haptic_paint_last_contact(haptic_paint *p)
{
    lock_paint(p);
    lift_pen(p);
    const haptic_contact *last = last_contact(p);
    double begin = last ? last->begin : -INFINITY;
    unlock_paint(p);
    return begin;
}

/* Removes the strokes of the last contact of this run that has painted, and sets `undone` of the
 * pen. Returns false if there is none. The caller has the lock. */
static bool undo_contact(haptic_paint *p)
{
    const haptic_contact *last = last_contact(p);
    if (!last)
        return false;
    bool removed = remove_strokes(p, last->strokes);
    p->contact_count--;
    p->finished = info_of(p->drawn).stroke_count;
    if (p->copied > p->finished)
        p->copied = p->finished;
    atomic_store(p->pen.undone, true);
    return removed;
}

static bool add_layer(haptic_paint *p, const char *title)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_paint_layer layer = EBPO_PAINT_LAYER_INIT;
    layer.title = title;
    if (p->pen.pen.kind == EBPO_PAINT_PAINTS)
        layer.colour = p->pen.pen.colour;
    if (ebpo_paint_add_layer(p->drawn, &layer, &p->pen.pen.layer, &error) != EBPO_OK)
        return false;
    p->changes++;
    p->layer_changes++;
    return true;
}

static bool choose_number(haptic_paint *p, const char *text)
{
    char *end;
    unsigned long number = strtoul(text, &end, 10);
    if (*text < '0' || *text > '9' || *end || number >= info_of(p->drawn).layer_count)
        return false;
    p->pen.pen.layer = number;
    return true;
}

static bool set_radius(haptic_paint *p, const char *text)
{
    const char *end;
    double radius = number_read(text, text + strlen(text), &end);
    if (end == text || *end || !(radius >= 0x1p-200 && radius <= 0x1p200))
        return false;
    p->pen.pen.radius = radius;
    return true;
}

static bool set_colour(haptic_paint *p, const char *text)
{
    uint32_t colour;
    if (!words_read_colour(text, &colour))
        return false;
    p->colour = colour;
    p->pen.pen.kind = EBPO_PAINT_PAINTS;
    p->pen.pen.colour = colour;
    return true;
}

/* Sets the kind of the pen; its colour is that before erasing. */
static bool set_kind(haptic_paint *p, ebpo_paint_kind kind)
{
    p->pen.pen.kind = kind;
    p->pen.pen.colour = kind == EBPO_PAINT_ERASES ? 0 : p->colour;
    return true;
}

bool haptic_paint_command(haptic_paint *p, const char *text)
{
    size_t word = strcspn(text, " ");
    const char *value = text[word] ? text + word + 1 : "";
    char name[16] = "";
    if (word < sizeof name)
        memcpy(name, text, word);
    lock_paint(p);
    lift_pen(p);
    bool done = strcmp(text, "undo") == 0        ? undo_contact(p)
                : strcmp(text, "paint") == 0     ? set_kind(p, EBPO_PAINT_PAINTS)
                : strcmp(text, "erase") == 0     ? set_kind(p, EBPO_PAINT_ERASES)
                : strcmp(name, "colour") == 0    ? set_colour(p, value)
                : strcmp(name, "radius") == 0    ? set_radius(p, value)
                : strcmp(name, "layer") == 0     ? choose_number(p, value)
                : strcmp(name, "new-layer") == 0 ? add_layer(p, value)
                                                 : false;
    unlock_paint(p);
    return done;
}

/* --- news for pages --- */

static void write_text(FILE *f, const char *name, const char *text)
{
    fprintf(f, "\"%s\":\"", name);
    for (; text && *text; text++)
        if (*text == '"' || *text == '\\')
            fprintf(f, "\\%c", *text);
        else if ((unsigned char)*text >= ' ')
            fputc(*text, f);
    fputs("\",", f);
}

static void write_layers(const haptic_paint *p, FILE *f)
{
    uint64_t count = info_of(p->drawn).layer_count;
    fputs("\"layers\":[", f);
    for (uint64_t i = 0; i < count; i++) {
        ebpo_paint_layer layer = EBPO_PAINT_LAYER_INIT;
        ebpo_paint_get_layer(p->drawn, i, &layer);
        fputs(i ? ",{" : "{", f);
        write_text(f, "title", layer.title);
        write_text(f, "author", layer.author);
        write_text(f, "date", layer.date);
        write_text(f, "description", layer.description);
        fprintf(f, "\"colour\":%lu,\"opacity\":%u,\"visible\":%s}", (unsigned long)layer.colour,
                (unsigned)layer.opacity, layer.visible ? "true" : "false");
    }
    fputs("],", f);
}

/* Writes the points of a stroke from number `first` on, at most `most`. Returns their number. */
static uint64_t write_stroke(const ebpo_paint_stroke *s, uint64_t number, uint64_t first,
                             uint64_t most, FILE *f)
{
    uint64_t end = s->point_count - first < most ? s->point_count : first + most;
    fprintf(f,
            "{\"number\":%llu,\"layer\":%llu,\"erases\":%s,\"colour\":[%u,%u,%u,%u],"
            "\"radius\":%.17g,\"time\":%llu,\"points\":[",
            (unsigned long long)number, (unsigned long long)s->layer,
            s->kind == EBPO_PAINT_ERASES ? "true" : "false", s->colour >> 24 & 255,
            s->colour >> 16 & 255, s->colour >> 8 & 255, s->colour & 255, s->radius,
            (unsigned long long)s->time);
    for (uint64_t i = first; i < end; i++) {
        const ebpo_paint_point *q = &s->points[i];
        fprintf(f, "%s[%lu,%lu,%lu,%.17g,%.17g,%.17g,%u,%u,%lu]", i > first ? "," : "",
                (unsigned long)q->face, (unsigned long)q->weight[0], (unsigned long)q->weight[1],
                q->place[0], q->place[1], q->place[2], q->size, q->pressure,
                (unsigned long)q->time);
    }
    fputs("]}", f);
    return end - first;
}

/* Writes new points, at most MOST in one event. The caller has the lock. */
static void write_strokes(const haptic_paint *p, haptic_paint_cursor *at, FILE *f)
{
    enum { MOST = 4096 };
    uint64_t count = info_of(p->drawn).stroke_count, room = MOST;
    const char *comma = "";
    fputs("\"strokes\":[", f);
    for (uint64_t i = at->strokes ? at->strokes - 1 : 0; i < count && room; i++) {
        ebpo_paint_stroke stroke = EBPO_PAINT_STROKE_INIT;
        ebpo_paint_get_stroke(p->drawn, i, &stroke);
        if (i >= at->strokes)
            at->points = 0;
        at->strokes = i + 1;
        if (stroke.point_count == at->points)
            continue;
        fputs(comma, f);
        uint64_t written = write_stroke(&stroke, i, at->points, room, f);
        at->points += written;
        room -= written;
        comma = ",";
    }
    fputs("]", f);
}

void haptic_paint_write_news(haptic_paint *p, haptic_paint_cursor *at, FILE *out)
{
    lock_paint(p);
    ebpo_paint_info info = info_of(p->drawn);
    ebpo_paint_stroke last = EBPO_PAINT_STROKE_INIT;
    if (at->epoch != p->epoch) {
        ebpo_paint_stroke kept = EBPO_PAINT_STROKE_INIT;
        bool keeps = at->epoch >= p->kept_epoch && at->epoch < p->epoch && p->kept > 0;
        if (keeps && at->strokes > p->kept) {
            at->strokes = p->kept;
            ebpo_paint_get_stroke(p->drawn, p->kept - 1, &kept);
            at->points = kept.point_count;
        } else if (!keeps && at->strokes > 0)
            at->strokes = at->points = 0; /* everything is sent again */
    }
    if (info.stroke_count)
        ebpo_paint_get_stroke(p->drawn, info.stroke_count - 1, &last);
    if (at->epoch != p->epoch || at->layer_changes != p->layer_changes ||
        at->strokes != info.stroke_count || at->points != last.point_count) {
        fprintf(out, "event: paint\ndata: {\"count\":%llu,\"layer\":%llu,",
                (unsigned long long)at->strokes, (unsigned long long)p->pen.pen.layer);
        if (p->pen.name)
            write_text(out, "model", p->pen.name);
        if (at->layer_changes != p->layer_changes || at->epoch != p->epoch)
            write_layers(p, out);
        write_strokes(p, at, out);
        fputs("}\n\n", out);
        at->epoch = p->epoch;
        at->layer_changes = p->layer_changes;
    }
    unlock_paint(p);
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
    p->colour = p->pen.default_colour ? layer.colour : pen->colour;
    pen->colour = pen->kind == EBPO_PAINT_ERASES ? 0 : p->colour;
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
    atomic_store(&p->unsynced, status == EBPO_OK);
    return status == EBPO_OK ? ebpo_paint_open(p->pen.path, &p->drawn, error) : status;
}

static void free_paint(haptic_paint *p)
{
    ebpo_paint_drawing_free(p->drawing);
    ebpo_paint_free(p->drawn);
    ebpo_paint_free(p->saved);
    ebpo_context_free(p->context);
    pthread_mutex_destroy(&p->lock);
    pthread_mutex_destroy(&p->turn);
    free(p->contact);
    free(p->prints);
    haptic_brush_free(p->brush);
    free(p);
}

ebpo_status haptic_paint_open(haptic_paint **out, const haptic_pen *pen, const ebpo_file *file,
                              ebpo_model *model, ebpo_error *error)
{
    haptic_paint *p = calloc(1, sizeof *p);
    *out = NULL;
    if (!p)
        return fail_memory(error);
    pthread_mutex_init(&p->turn, NULL);
    pthread_mutex_init(&p->lock, NULL);
    p->pen = *pen;
    p->instance = UINT64_MAX;
    p->lost_ms = fmax(HAPTIC_LIFT_MS, 1500 / pen->rate);
    for (uint64_t i = 0; i < pen->point_count; i++)
        p->arm =
            fmax(p->arm, hypot(hypot(pen->points[i][0], pen->points[i][1]), pen->points[i][2]));
    p->error = p->save_error = (ebpo_error)EBPO_ERROR_INIT;
    p->print_time = -INFINITY;
    if (pen->point_count > 0) {
        p->prints = calloc(PRINT_POINTS, sizeof *p->prints);
        p->brush = haptic_brush_new(pen->points, pen->point_count);
    }
    ebpo_status status = pen->point_count > 0 && (!p->prints || !p->brush)
                             ? fail_memory(error)
                             : ebpo_context_new(model, &p->context, error);
    if (status == EBPO_OK)
        status = open_paints(p, file, error);
    if (status != EBPO_OK) {
        free_paint(p);
        return status;
    }
    p->copied = p->finished = p->strokes_before = info_of(p->drawn).stroke_count;
    p->points_before = info_of(p->drawn).point_count;
    bool saves = command_thread(&p->saver, save_often, p) == 0;
    if (!saves || command_thread(&p->syncer, sync_often, p) != 0) {
        atomic_store(&p->ended, true);
        if (saves)
            pthread_join(p->saver, NULL);
        free_paint(p);
        return fail_memory(error);
    }
    *out = p;
    return EBPO_OK;
}

/* Saves the paint to a new file beside its own file, or else in the folder for temporary files.
 * Appends to the message where it is, or that it is lost. */
static void save_elsewhere(const haptic_paint *p, ebpo_error *error)
{
    enum { MESSAGE = sizeof error->message };
    const char *folder = getenv("TMPDIR");
    char path[2][PATH_MAX], where[2 * PATH_MAX + 64] = "; the paint since the last save is lost";
    ebpo_error ignored = EBPO_ERROR_INIT;
    int saved = 0;
    folder = folder && *folder ? folder : "/tmp";
    snprintf(path[0], PATH_MAX, "%s.unsaved-%ld", p->pen.path, (long)getpid());
    snprintf(path[1], PATH_MAX, "%s/%s.unsaved-%ld", folder, words_file_name(p->pen.path),
             (long)getpid());
    while (saved < 2 && ebpo_paint_save(p->saved, path[saved], &ignored) != EBPO_OK)
        saved++;
    if (saved < 2)
        snprintf(where, sizeof where, "; the paint is in %s instead", path[saved]);
    /* The place is more important than the end of a long message. */
    size_t length = strnlen(where, MESSAGE - 1), at = strlen(error->message);
    if (at > MESSAGE - 1 - length)
        at = MESSAGE - 1 - length;
    memcpy(error->message + at, where, length);
    error->message[at + length] = 0;
}

ebpo_status haptic_paint_close(haptic_paint *p, haptic_painted *out, ebpo_error *error)
{
    if (!p)
        return EBPO_OK;
    atomic_store(&p->ended, true);
    pthread_join(p->saver, NULL);
    pthread_join(p->syncer, NULL);
    lock_paint(p);
    lift_pen(p);
    unlock_paint(p);
    ebpo_status status = save_paint(p);
    if (status == EBPO_OK)
        status = sync_paint(p, &p->save_error);
    const ebpo_error *last = status != EBPO_OK ? &p->save_error : &p->error;
    if (last->status != EBPO_OK)
        *error = *last;
    if (status != EBPO_OK)
        save_elsewhere(p, error);
    status = last->status;
    *out = p->result;
    out->strokes = info_of(p->saved).stroke_count - p->strokes_before;
    out->points = info_of(p->saved).point_count - p->points_before;
    free_paint(p);
    return status;
}
