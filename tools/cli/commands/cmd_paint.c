/* ebpo paint: paint and notes on a model, in a file beside it. */
#include <errno.h>
#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/model_memory.h"
#include "cli/progress.h"
#include "cli/words.h"
#include "cli/commands/commands.h"
#include "cli/commands/paint_job.h"

#include "cli/options/paint.inc"

static const paint_values usual = { .layer = -1,
                                    .opacity = -1,
                                    .density = 1,
                                    .seed = 1,
                                    .remove_stroke = -1,
                                    .remove_note = -1,
                                    .remove_layer = -1,
                                    .fineness = 256,
                                    .thin = 1,
                                    .within = INFINITY,
                                    .pressure = 1,
                                    .rate = 1000,
                                    .remote = REMOTE_VALUES_INIT };

/* --- what is asked for --- */

static bool says_of_layer(const paint_values *v)
{
    return v->description || v->opacity >= 0 || v->show || v->hide;
}

/* Says something of a layer that is there, and nothing else. */
static bool sets_layer(const paint_values *v)
{
    return !v->new_layer && !v->path && !v->note &&
           (says_of_layer(v) || v->title || v->author || v->date || v->colour);
}

static int removals(const paint_values *v)
{
    return (v->undo > 0) + (v->remove_stroke >= 0) + (v->remove_note >= 0) + (v->remove_layer >= 0);
}

static bool changes(const paint_values *v)
{
    return v->new_layer || v->path || v->note || removals(v) || sets_layer(v);
}

static int check_pen(const paint_values *v)
{
    bool pen = v->radius != 0 || v->spread != 0 || v->density != 1 || v->thin != 1 ||
               v->step != 0 || isfinite(v->within) || v->pressure != 1 || v->rate != 1000 ||
               v->seed != 1 || v->erase;
    if (pen && !v->path)
        return command_usage("paint", "--radius and other options of a pen belong to --path");
    if (v->path && v->radius == 0)
        return command_usage("paint", "--path needs --radius: how large are points?");
    if (v->density != 1 && v->spread == 0)
        return command_usage("paint", "--density belongs to --spread");
    if (v->erase && v->colour)
        return command_usage("paint", "--erase has no colour");
    return EXIT_FINE;
}

static int check_texts(const paint_values *v)
{
    uint32_t colour;
    double place[3];
    if (v->colour && !paint_read_colour(v->colour, &colour))
        return command_usage("paint", "--colour '%s': expected RRGGBB or RRGGBBAA in hexadecimal",
                             v->colour);
    if (v->base && (!paint_read_colour(v->base, &colour) || strlen(v->base) != 6))
        return command_usage("paint", "--base '%s': expected RRGGBB in hexadecimal", v->base);
    if (v->at && !paint_read_place(v->at, place))
        return command_usage("paint", "--at '%s': expected X,Y,Z", v->at);
    if (v->date && !ebpo_is_date(v->date))
        return command_usage("paint", "--date '%s': expected " WORDS_DATE_EXPECTED, v->date);
    if ((v->at != NULL) != (v->note != NULL))
        return command_usage("paint", "--note and --at belong together");
    if (v->bake && !words_end_with(v->bake, ".ply") && !words_end_with(v->bake, ".glb") &&
        !words_end_with(v->bake, ".gltf") && !words_end_with(v->bake, ".obj"))
        return command_usage(
            "paint", "--bake '%s': expected a name that ends with .ply, .glb, .gltf or .obj",
            v->bake);
    return EXIT_FINE;
}

static int check(const paint_values *v)
{
    int kinds = removals(v) + (v->new_layer || v->path || v->note || sets_layer(v)) +
                (v->bake != NULL) + v->area;
    if (kinds > 1)
        return command_usage("paint", "one thing at a time: add or change, --undo or one --remove, "
                                      "--bake, --area");
    if ((v->path || v->note) && !v->new_layer && says_of_layer(v))
        return command_usage("paint", "--description, --opacity, --show and --hide belong to a "
                                      "layer: --new-layer, or a run of their own");
    if (v->new_layer && (v->layer >= 0 || v->title || v->note))
        return command_usage("paint", "--new-layer has its title, and goes with neither --layer, "
                                      "--title nor --note");
    if (v->path && v->note)
        return command_usage("paint", "--path and --note are runs of their own");
    if (v->path && !v->new_layer && (v->title || v->author || v->date))
        return command_usage("paint", "--title, --author and --date belong to layers and notes");
    if (v->show && v->hide)
        return command_usage("paint", "--show and --hide cannot be used together");
    if (v->base && !v->bake)
        return command_usage("paint", "--base belongs to --bake");
    if (v->fineness != 256 && !v->area)
        return command_usage("paint", "--fineness belongs to --area");
    if (v->points && !v->json)
        return command_usage("paint", "--points needs --json");
    if (v->out && !changes(v))
        return command_usage("paint", "--output is for a paint that is changed");
    if (v->layer >= 0 && !v->path && !v->note && !sets_layer(v))
        return command_usage("paint", "--layer N: what of it? --remove-layer removes one");
    int code = check_pen(v);
    return code == EXIT_FINE ? check_texts(v) : code;
}

static bool needs_model(const paint_values *v) { return v->path || v->note || v->bake || v->area; }

static int overwrites(const paint_job *j)
{
    const char *outs[] = { j->v->out, j->v->bake }, *paint = j->paint_path, *model = j->model_path;
    for (int i = 0; i < 2; i++)
        if (outs[i] && model && command_overwrites("paint", model, outs[i]))
            return EXIT_USAGE;
    if (model && command_overwrites("paint", model, paint))
        return EXIT_USAGE;
    if (j->v->out && j->v->path && command_overwrites("paint", j->v->path, j->v->out))
        return EXIT_USAGE;
    return j->v->bake && command_overwrites("paint", paint, j->v->bake) ? EXIT_USAGE : EXIT_FINE;
}

/* --- running --- */

/* Seconds to wait for other commands that change the same paint. */
static const double WAIT = 600;

/* Opens the paint; one that is to be changed once no other command changes it. One that is not
 * there is made where a layer is added. */
static ebpo_status open_paint(paint_job *j, ebpo_error *error)
{
    const paint_values *v = j->v;
    bool absent = access(j->paint_path, F_OK) != 0 && errno == ENOENT,
         make = v->new_layer && j->file,
         in_place = changes(v) && (!v->out || strcmp(v->out, j->paint_path) == 0 ||
                                   command_same_file(v->out, j->paint_path));
    if (absent && !make) {
        *error = (ebpo_error){ .status = EBPO_E_IO, .offset = -1 };
        snprintf(
            error->message, sizeof error->message,
            "%.200s: no such file; 'ebpo paint PAINT FILE --new-layer TITLE' makes a new one, for "
            "the model FILE",
            j->paint_path);
        return error->status;
    }
    if (in_place)
        return ebpo_paint_open_to_change(j->paint_path, make ? j->file : NULL, WAIT, &j->progress,
                                         &j->paint, error);
    return absent ? ebpo_paint_new(j->file, &j->paint, error)
                  : ebpo_paint_open(j->paint_path, &j->paint, error);
}

static ebpo_status open_model(paint_job *j, uint64_t memory, ebpo_error *error)
{
    ebpo_model_options o = EBPO_MODEL_OPTIONS_INIT;
    o.memory = memory;
    o.threads = (unsigned)j->v->threads;
    o.progress = j->progress;
    if (!j->v->memory)
        model_memory_usual("paint", j->file, j->model_path, &o);
    ebpo_status status = ebpo_model_new(j->file, &o, &j->model, error);
    return status == EBPO_OK ? ebpo_context_new(j->model, &j->context, error) : status;
}

static ebpo_status measure(paint_job *j, ebpo_error *error)
{
    ebpo_paint_options o = EBPO_PAINT_OPTIONS_INIT;
    o.fineness = (unsigned)j->v->fineness;
    o.threads = (unsigned)j->v->threads;
    o.progress = j->progress;
    return ebpo_paint_measure(j->paint, j->context, &o, &j->areas, error);
}

static ebpo_status work(paint_job *j, const ebpo_paint_hand *hand, uint64_t count, uint64_t memory,
                        ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    ebpo_paint_info info = EBPO_PAINT_INFO_INIT;
    j->changed = changes(j->v);
    ebpo_paint_get_info(j->paint, &info);
    bool check =
        j->file && (info.point_count || info.note_count) && (j->changed || needs_model(j->v));
    if (needs_model(j->v) || check)
        status = open_model(j, memory, error);
    if (status == EBPO_OK && check) /* all of it, whatever is asked for */
        status = ebpo_paint_check_points(j->paint, j->context, &j->progress, error);
    if (status == EBPO_OK && j->changed)
        status = paint_change(j, hand, count, error);
    if (status == EBPO_OK && j->v->bake)
        status = paint_bake(j, error);
    if (status == EBPO_OK && j->v->area)
        status = measure(j, error);
    return status;
}

static int run_job(paint_job *j, const ebpo_paint_hand *hand, uint64_t count, uint64_t memory)
{
    ebpo_error error = EBPO_ERROR_INIT;
    progress_line line;
    j->progress = progress_start(&line, "paint", j->v->quiet || j->v->json);
    ebpo_status status =
        j->model_path ? remote_open(&j->file, j->model_path, &j->v->remote, &error) : EBPO_OK;
    if (status == EBPO_OK)
        status = open_paint(j, &error);
    if (status != EBPO_OK)
        return command_failed("paint", &error);
    if (j->file)
        status = ebpo_paint_check_model(j->paint, j->file, &error);
    if (status != EBPO_OK) {
        int code = command_failed("paint", &error);
        return status == EBPO_E_ARGUMENT ? EXIT_DIFFERS : code;
    }
    status = work(j, hand, count, memory, &error);
    progress_wipe(&line);
    if (status != EBPO_OK)
        return command_failed("paint", &error);
    paint_tell(j);
    return EXIT_FINE;
}

static int run(void *given, const char **operand)
{
    const paint_values *v = given;
    paint_job j = { .v = v,
                    .paint_path = operand[0],
                    .model_path = operand[1],
                    .laid = EBPO_PAINT_LAID_INIT,
                    .baked = EBPO_PAINT_BAKED_INIT,
                    .areas = EBPO_PAINT_AREAS_INIT };
    ebpo_paint_hand *hand = NULL;
    uint64_t memory = 0, count = 0;
    int code = check(v);
    if (code == EXIT_FINE && v->memory && !words_read_size(v->memory, &memory))
        code = command_usage("paint", "--memory '%s': expected " WORDS_SIZE_EXPECTED, v->memory);
    if (code == EXIT_FINE && needs_model(v) && !j.model_path)
        code = command_usage("paint", "the model is needed: ebpo paint PAINT FILE");
    if (code == EXIT_FINE)
        code = overwrites(&j);
    if (code == EXIT_FINE && j.model_path && !command_wants_hdf5("paint", j.model_path))
        code = EXIT_FAILED;
    if (code == EXIT_FINE && v->path && !paint_read_path(v, &hand, &count))
        code = EXIT_FAILED;
    if (code == EXIT_FINE)
        code = run_job(&j, hand, count, memory);
    ebpo_paint_areas_free(&j.areas);
    ebpo_context_free(j.context);
    ebpo_model_free(j.model);
    ebpo_close(j.file);
    ebpo_paint_free(j.paint);
    free(hand);
    return code;
}

const command command_paint = { &spec, sizeof usual, &usual, run };
