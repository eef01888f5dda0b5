#include "cli/commands/haptic_paints.h"

#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

struct haptic_paints {
    const uint64_t *of;      /* [instances] index of the model of each instance; NULL: 0 */
    uint64_t count, current; /* current: the model that was touched last */
    atomic_bool undone;      /* since an undo, the pen was not lifted */
    double touched;          /* time of the last contact */
    double lift_ms;          /* the pen is lifted when it was not in contact for this time */
    haptic_paint *paint[];   /* [count] */
};

ebpo_status haptic_paints_open(haptic_paints **out, const haptic_pen *pen,
                               const haptic_surface *surfaces, uint64_t count, const uint64_t *of,
                               ebpo_error *error)
{
    haptic_paints *p = calloc(1, sizeof *p + count * sizeof *p->paint);
    haptic_painted ignored;
    ebpo_error first;
    ebpo_status status = EBPO_OK;
    *out = NULL;
    if (!p) {
        *error = (ebpo_error){ .status = EBPO_E_MEMORY };
        snprintf(error->message, sizeof error->message, "not enough memory for painting");
        return EBPO_E_MEMORY;
    }
    p->of = of;
    p->touched = -INFINITY;
    p->lift_ms = fmax(HAPTIC_LIFT_MS, 1500 / pen->rate);
    for (; p->count < count && status == EBPO_OK; p->count += status == EBPO_OK) {
        const haptic_surface *s = &surfaces[p->count];
        const double *size = ebpo_file_info(s->file)->box_size;
        haptic_pen own = *pen;
        own.path = s->paint;
        own.name = s->name;
        own.undone = &p->undone;
        own.diagonal = hypot(hypot(size[0], size[1]), size[2]);
        status = haptic_paint_open(&p->paint[p->count], &own, s->file, s->model, error);
    }
    if (status != EBPO_OK) {
        first = *error;
        (void)haptic_paints_close(p, &ignored, error);
        *error = first;
        return status;
    }
    *out = p;
    return EBPO_OK;
}

/* Returns the model that is painted in a step: without contact, the last one. */
static uint64_t model_of(const haptic_paints *p, const haptic_sample *s)
{
    bool touches = s->flags & EBPO_HAPTIC_CONTACT && s->instance != UINT64_MAX;
    return touches && p->of ? p->of[s->instance] : p->current;
}

/* Returns true if the pen was lifted after the last contact, or is lifted in this step. */
static bool is_lifted(const haptic_paints *p, const haptic_sample *s)
{
    return s->lifted || s->time - p->touched > p->lift_ms;
}

/* Passes runs of steps on one model. A lifted pen begins a run, which ends an undo. */
void haptic_paints_take(void *user, const haptic_sample *samples, uint64_t count)
{
    haptic_paints *p = user;
    for (uint64_t i = 0, end; i < count; i = end) {
        if (is_lifted(p, &samples[i]))
            atomic_store(&p->undone, false);
        p->current = model_of(p, &samples[i]);
        for (end = i; end == i || (end < count && model_of(p, &samples[end]) == p->current &&
                                   !is_lifted(p, &samples[end]));
             end++)
            if (samples[end].flags & EBPO_HAPTIC_CONTACT && !samples[end].lifted)
                p->touched = samples[end].time;
        haptic_paint_take(p->paint[p->current], samples + i, end - i);
    }
}

haptic_paint_cursor *haptic_paints_cursor(const haptic_paints *p)
{
    haptic_paint_cursor *cursor = malloc(p->count * sizeof *cursor);
    for (uint64_t i = 0; cursor && i < p->count; i++)
        cursor[i] = (haptic_paint_cursor)HAPTIC_PAINT_CURSOR_INIT;
    return cursor;
}

void haptic_paints_write_news(haptic_paints *p, haptic_paint_cursor *cursor, FILE *out)
{
    for (uint64_t i = 0; i < p->count; i++)
        haptic_paint_write_news(p->paint[i], &cursor[i], out);
}

/* Removes the last contact of all models. */
static bool undo_last(haptic_paints *p)
{
    double latest = -INFINITY;
    uint64_t last = 0;
    for (uint64_t i = 0; i < p->count; i++) {
        double begin = haptic_paint_last_contact(p->paint[i]);
        if (begin > latest) {
            latest = begin;
            last = i;
        }
    }
    return haptic_paint_command(p->paint[last], "undo");
}

bool haptic_paints_command(haptic_paints *p, const char *text)
{
    bool done = true;
    if (strcmp(text, "undo") == 0)
        return undo_last(p);
    if (p->count > 1 && strncmp(text, "layer", 5) == 0)
        return false;
    for (uint64_t i = 0; i < p->count; i++)
        done = haptic_paint_command(p->paint[i], text) && done;
    return done;
}

ebpo_status haptic_paints_close(haptic_paints *p, haptic_painted *out, ebpo_error *error)
{
    ebpo_error first = EBPO_ERROR_INIT;
    haptic_painted sum = { .strokes = 0 };
    for (uint64_t i = 0; p && i < p->count; i++) {
        haptic_painted one;
        ebpo_error own = EBPO_ERROR_INIT;
        if (haptic_paint_close(p->paint[i], &one, &own) != EBPO_OK && first.status == EBPO_OK)
            first = own;
        sum.strokes += one.strokes;
        sum.points += one.points;
        sum.saves += one.saves;
        sum.failed_saves += one.failed_saves;
        sum.save_seconds_max = fmax(sum.save_seconds_max, one.save_seconds_max);
    }
    if (p)
        *out = sum;
    if (first.status != EBPO_OK)
        *error = first;
    free(p);
    return first.status;
}
