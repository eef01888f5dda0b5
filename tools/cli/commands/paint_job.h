/* What `ebpo paint` was asked for, as its files share it. */
#ifndef EBPO_TOOLS_PAINT_JOB_H
#define EBPO_TOOLS_PAINT_JOB_H

#include <ebpo/paint.h>

#include "cli/remote_args.h"

typedef struct paint_values {
    const char *new_layer, *title, *author, *date, *description, *colour, *path, *note, *at, *out,
        *bake, *base, *memory;
    int64_t layer, opacity, density, seed, undo, remove_stroke, remove_note, remove_layer, fineness,
        threads;
    double radius, spread, thin, step, within, pressure, rate;
    bool show, hide, erase, area, strokes, points, json, quiet;
    remote_values remote;
} paint_values;

typedef struct paint_job {
    const paint_values *v;
    const char *paint_path, *model_path; /* the latter NULL: not given */
    ebpo_paint *paint;
    ebpo_file *file;
    ebpo_model *model;
    ebpo_context *context;
    ebpo_progress progress;
    bool changed;            /* in memory */
    ebpo_paint_laid laid;    /* by --path */
    ebpo_paint_baked baked;  /* by --bake */
    ebpo_paint_areas areas;  /* by --area */
    uint64_t colours_of_own; /* by --bake: the model has colours of vertices */
} paint_job;

/* "RRGGBB" or "RRGGBBAA" as 0xRRGGBBAA. False: it is not that. */
bool paint_read_colour(const char *text, uint32_t *out);
/* Three numbers with commas. False: it is not that. */
bool paint_read_place(const char *text, double out[3]);
/* The hand's way; the caller frees it. False: what is wrong was said. */
bool paint_read_path(const paint_values *v, ebpo_paint_hand **hand, uint64_t *count);

/* The number of --layer, or of the topmost. EBPO_E_ARGUMENT: there is none. */
EBPO_MUST_USE ebpo_status paint_layer(const paint_job *job, uint64_t *layer, ebpo_error *error);
/* The change that was asked for; a paint that is not there is made before. Exit code, said. */
EBPO_MUST_USE ebpo_status paint_change(paint_job *job, const ebpo_paint_hand *hand, uint64_t count,
                                       ebpo_error *error);
EBPO_MUST_USE ebpo_status paint_bake(paint_job *job, ebpo_error *error);

/* Prints the list, and what was done. */
void paint_tell(const paint_job *job);

#endif
