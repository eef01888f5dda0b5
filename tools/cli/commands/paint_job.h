/* Options and results of `ebpo paint`, shared by its files. */
#ifndef EBPO_TOOLS_PAINT_JOB_H
#define EBPO_TOOLS_PAINT_JOB_H

#include <ebpo/paint.h>

#include "cli/remote_args.h"

/* Values of the options. */
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
    const char *paint_path;
    const char *model_path; /* NULL: not given; then `file`, `model` and `context` are NULL, too */
    ebpo_paint *paint;
    ebpo_file *file;
    ebpo_model *model;
    ebpo_context *context;
    ebpo_progress progress;
    bool changed;           /* the command changes the paint */
    ebpo_paint_drawn drawn; /* result of --path */
    ebpo_paint_baked baked; /* result of --bake */
    ebpo_paint_areas areas; /* result of --area */
    bool has_own_colours;   /* with --bake: the model has colours of vertices */
} paint_job;

/* Prints the layers and notes of the paint, and the results of the command. */
void paint_report(const paint_job *job);

#endif
