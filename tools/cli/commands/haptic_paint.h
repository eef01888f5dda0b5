/* Paints what a haptic device touches, into a paint file, while the device moves. */
#ifndef EBPO_TOOLS_HAPTIC_PAINT_H
#define EBPO_TOOLS_HAPTIC_PAINT_H

#include <stdatomic.h>
#include <stdio.h>

#include <ebpo/haptic.h>
#include <ebpo/paint.h>

#include "cli/commands/haptic_live.h"

/* The pen is lifted when it was not in contact for this time. Shorter gaps do not end a stroke,
 * unless the device lifts the pen. */
enum { HAPTIC_LIFT_MS = 30 };

/* The pen. Its pressure is that of the device's stylus or, without one, the force of the spring
 * divided by full_force, at most 1. Its lengths are in the unit of the world. */
typedef struct haptic_pen {
    const char *path;       /* paint file; a new file gets a layer */
    const char *name;       /* of the model in its scene; NULL: a single model */
    const ebpo_pose *poses; /* [instances of the scene]; NULL: the model is not posed */
    atomic_bool *undone;    /* nothing is painted while it is true; undo sets it */
    ebpo_paint_pen pen;     /* seed, time and progress are not used */
    bool default_colour;    /* pen.colour is that of the layer */
    bool default_layer;     /* pen.layer is the topmost one */
    bool dated;             /* strokes have the time at which they begin */
    double stiffness, full_force;
    double fade; /* opacity at no pressure, as a share of that of the colour; 1: constant */
    const double (*points)[3]; /* [point_count] points of a brush */
    uint64_t point_count;      /* 0: not a brush; it paints at the contact */
    double skin;               /* distance that the proxy of a brush keeps from faces */
    double diagonal;           /* of the model's box, in its unit */
    double rate;               /* steps per second */
} haptic_pen;

/* Results of painting. */
typedef struct haptic_painted {
    uint64_t strokes, points; /* added to the file */
    uint64_t saves, failed_saves;
    double save_seconds_max;
} haptic_painted;

typedef struct haptic_paint haptic_paint;

/* Opens or makes the file, locks it until haptic_paint_close, saves it once, and starts the thread
 * that saves it. The file and the model must outlive the object. Returns EBPO_E_IO if another
 * program is changing the paint file. */
ebpo_status haptic_paint_open(haptic_paint **out, const haptic_pen *pen, const ebpo_file *file,
                              ebpo_model *model, ebpo_error *error);

/* Paints in these steps: a haptic_live_fn, whose `user` is a haptic_paint. Errors are reported on
 * stderr. */
void haptic_paint_take(void *user, const haptic_sample *samples, uint64_t count);

/* What a page of the viewer has. */
typedef struct haptic_paint_cursor {
    uint64_t epoch, layer_changes;
    uint64_t strokes, points; /* number of strokes, and of points of the last one */
} haptic_paint_cursor;

#define HAPTIC_PAINT_CURSOR_INIT     \
    {                                \
        UINT64_MAX, UINT64_MAX, 0, 0 \
    }

/* Writes events "paint" with the strokes and layers that a page does not have. Each has the members
 *     model     the model's name in its scene; absent: a single model
 *     count     number of strokes that the page must keep; later ones were removed
 *     layers    [{ title, author, date, description, colour, opacity, visible }]; absent: unchanged
 *     layer     the layer that the pen paints on
 *     strokes   [{ number, layer, erases, colour, radius, time, points: [[face, weights, place,
 * size, pressure, time]] }] with points that are to be added to stroke `number` */
void haptic_paint_write_news(haptic_paint *paint, haptic_paint_cursor *cursor, FILE *out);

/* Changes the pen: "paint", "erase", "colour RRGGBB[AA]", "radius R", "layer N", "new-layer TITLE";
 * or removes the strokes of the last contact of this run: "undo". Returns false for other texts and
 * values. */
bool haptic_paint_command(haptic_paint *paint, const char *text);

/* Lifts the pen, and returns the time of the first step of the last contact of this run that has
 * painted; -INFINITY: there is none. */
double haptic_paint_last_contact(haptic_paint *paint);

/* Saves the rest, and frees the object, which may be NULL. Returns the error of the last save or,
 * if points could not be painted, of painting. If the last save fails, the paint is saved to
 * <path>.unsaved-<process>, beside the file or in $TMPDIR; the message says where, or that it is
 * lost. */
ebpo_status haptic_paint_close(haptic_paint *paint, haptic_painted *out, ebpo_error *error);

#endif
