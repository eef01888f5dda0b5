/* ebpo paint: adds paint and notes to a model, in a separate file. */
#include <errno.h>
#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/commands/commands.h"
#include "cli/commands/paint_job.h"
#include "cli/model_memory.h"
#include "cli/numbers.h"
#include "cli/progress.h"
#include "cli/words.h"

/* --- paths --- */

/* Reads numbers separated by blanks or commas. Returns the count of the numbers; -1: other text, or
 * more than `most` numbers. */
static int read_numbers(const char *text, double *out, int most)
{
    int count = 0;
    for (;;) {
        text += strspn(text, " \t\r\n,");
        if (*text == 0 || *text == '#')
            return count;
        const char *end;
        double v = number_read(text, text + strlen(text), &end);
        bool ends = *end == 0 || strchr(" \t\r\n,#", *end);
        if (end == text || !ends || count == most || !isfinite(v))
            return -1;
        out[count++] = v;
        text = end;
    }
}

/* Reads three numbers separated by commas. Returns false for other text. */
static bool paint_read_position(const char *text, double out[3])
{
    return read_numbers(text, out, 3) == 3;
}

static bool fail_line(const paint_values *v, uint64_t line, const char *what)
{
    fprintf(stderr, "ebpo paint: %s: line %llu: %s\n", v->path, (unsigned long long)line, what);
    return false;
}

/* Sets *out to the position of the pen in a line of `count` numbers. Returns NULL, or a text that
 * says what is wrong. number: index of the position. */
static const char *set_input(const paint_values *v, const double *row, int count, uint64_t number,
                             ebpo_paint_input *out)
{
    if (count < 3)
        return "expected three to five numbers: x y z [pressure [ms]]";
    memcpy(out->place, row, sizeof out->place);
    out->pressure = count > 3 ? row[3] : v->pressure;
    out->time = count > 4 ? row[4] : (double)number * 1000 / v->rate;
    if (!(out->pressure >= 0 && out->pressure <= 1))
        return "the pressure is not from 0 to 1";
    return out->time >= 0 && out->time <= UINT32_MAX
               ? NULL
               : "the time is not from 0 to 2^32 - 1 milliseconds, which are 49 days";
}

/* Reads a path from `in`. Returns false after an error, which was reported. */
static bool read_lines(const paint_values *v, FILE *in, ebpo_paint_input **input, uint64_t *count)
{
    char *line = NULL;
    size_t space = 0;
    uint64_t number = 0, capacity = 0;
    const char *problem = NULL;
    ssize_t length;
    while (!problem && (length = getline(&line, &space, in)) >= 0) {
        double row[5];
        const char *text = number++ ? line : number_skip_mark(line);
        int found = strlen(line) == (size_t)length ? read_numbers(text, row, 5) : -1;
        if (found == 0)
            continue;
        if (*count == capacity) {
            capacity = capacity ? 2 * capacity : 1024;
            ebpo_paint_input *more = realloc(*input, capacity * sizeof *more);
            problem = more ? NULL : "not enough memory";
            *input = more ? more : *input;
        }
        if (!problem)
            problem = set_input(v, row, found, *count, &(*input)[*count]);
        *count += !problem;
    }
    free(line);
    if (problem)
        return fail_line(v, number, problem);
    if (ferror(in))
        return fail_line(v, number + 1, strerror(errno));
    if (*count == 0)
        fprintf(stderr, "ebpo paint: the path '%s' has no position\n", v->path);
    return *count > 0;
}

/* Reads the path of the pen; the caller frees it. Returns false after an error, which was reported.
 */
static bool paint_read_path(const paint_values *v, ebpo_paint_input **input, uint64_t *count)
{
    bool standard = strcmp(v->path, "-") == 0;
    FILE *in = standard ? stdin : fopen(v->path, "r");
    *input = NULL;
    *count = 0;
    if (!in) {
        fprintf(stderr, "ebpo paint: %s: cannot be opened: %s\n", v->path, strerror(errno));
        return false;
    }
    bool complete = read_lines(v, in, input, count);
    if (!standard)
        fclose(in);
    return complete;
}

/* --- changes --- */

static ebpo_status fail_paint(ebpo_error *error, ebpo_status status, const char *what)
{
    *error = (ebpo_error){ .status = status, .offset = -1 };
    snprintf(error->message, sizeof error->message, "%s", what);
    return status;
}

static ebpo_paint_info info_of(const paint_job *j)
{
    ebpo_paint_info info = EBPO_PAINT_INFO_INIT;
    ebpo_paint_get_info(j->paint, &info);
    return info;
}

/* Sets *layer to the layer of --layer, or to the topmost layer. EBPO_E_ARGUMENT: this layer does
 * not exist. */
static ebpo_status paint_layer(const paint_job *j, uint64_t *layer, ebpo_error *error)
{
    ebpo_paint_info info = info_of(j);
    *layer = j->v->layer >= 0 ? (uint64_t)j->v->layer : info.layer_count - 1;
    if (info.layer_count == 0)
        return fail_paint(error, EBPO_E_ARGUMENT,
                          "the paint has no layer; add one with --new-layer");
    if (*layer < info.layer_count)
        return EBPO_OK;
    char what[120];
    snprintf(what, sizeof what,
             "there is no layer %llu: layers are counted from 0, and the paint has %llu",
             (unsigned long long)*layer, (unsigned long long)info.layer_count);
    return fail_paint(error, EBPO_E_ARGUMENT, what);
}

/* --- layers and notes --- */

/* Sets the facts of a layer from the command line. */
static void set_layer_facts(const paint_values *v, ebpo_paint_layer *layer)
{
    layer->title = v->new_layer ? v->new_layer : v->title ? v->title : layer->title;
    layer->author = v->author ? v->author : layer->author;
    layer->date = v->date ? v->date : layer->date;
    layer->description = v->description ? v->description : layer->description;
    if (v->colour)
        (void)words_read_colour(v->colour, &layer->colour); /* already checked */
    if (v->opacity >= 0)
        layer->opacity = (uint32_t)v->opacity;
    if (v->show || v->hide)
        layer->visible = v->show;
}

static ebpo_status add_layer(paint_job *j, ebpo_error *error)
{
    ebpo_paint_layer layer = EBPO_PAINT_LAYER_INIT;
    set_layer_facts(j->v, &layer);
    return ebpo_paint_add_layer(j->paint, &layer, NULL, error);
}

static ebpo_status set_layer(paint_job *j, ebpo_error *error)
{
    ebpo_paint_layer layer = EBPO_PAINT_LAYER_INIT;
    uint64_t number;
    ebpo_status status = paint_layer(j, &number, error);
    if (status != EBPO_OK)
        return status;
    ebpo_paint_get_layer(j->paint, number, &layer);
    set_layer_facts(j->v, &layer);
    return ebpo_paint_set_layer(j->paint, number, &layer, error);
}

/* Returns the text with U+2028 as line separators. The caller frees it. */
static char *separate_lines(const char *text)
{
    char *out = malloc(3 * strlen(text) + 1), *to = out;
    for (; out && *text; text++) {
        if (*text == '\n') {
            memcpy(to, "\xe2\x80\xa8", 3);
            to += 3;
        } else {
            *to++ = *text;
        }
    }
    if (out)
        *to = 0;
    return out;
}

static ebpo_status add_note(paint_job *j, ebpo_error *error)
{
    ebpo_paint_note note = EBPO_PAINT_NOTE_INIT;
    double place[3] = { 0, 0, 0 };
    (void)paint_read_position(j->v->at, place); /* already checked */
    ebpo_status status = paint_layer(j, &note.layer, error);
    if (status == EBPO_OK)
        status = ebpo_paint_locate(j->paint, j->context, place, &note.at, error);
    if (status != EBPO_OK)
        return status;
    char *body = separate_lines(j->v->note);
    if (!body)
        return fail_paint(error, EBPO_E_MEMORY, "not enough memory for the note");
    note.title = j->v->title;
    note.author = j->v->author;
    note.date = j->v->date;
    note.body = body;
    status = ebpo_paint_add_note(j->paint, &note, error);
    free(body);
    return status;
}

/* --- strokes --- */

static ebpo_status draw_stroke(paint_job *j, const ebpo_paint_input *input, uint64_t count,
                               ebpo_error *error)
{
    const paint_values *v = j->v;
    ebpo_paint_pen pen = EBPO_PAINT_PEN_INIT;
    ebpo_paint_layer layer = EBPO_PAINT_LAYER_INIT;
    ebpo_status status = paint_layer(j, &pen.layer, error);
    if (status != EBPO_OK)
        return status;
    ebpo_paint_get_layer(j->paint, pen.layer, &layer);
    pen.kind = v->erase ? EBPO_PAINT_ERASES : EBPO_PAINT_PAINTS;
    pen.colour = v->erase ? 0 : layer.colour;
    if (v->colour)
        (void)words_read_colour(v->colour, &pen.colour);
    pen.radius = v->radius;
    pen.spread = v->spread;
    pen.density = (uint32_t)v->density;
    pen.size_least = v->thin;
    pen.step = v->step;
    pen.within = v->within;
    pen.seed = (uint64_t)v->seed;
    pen.progress = j->progress;
    status = ebpo_paint_draw(j->paint, j->context, input, count, &pen, &j->drawn, error);
    return status != EBPO_OK || j->drawn.points
               ? status
               : fail_paint(
                     error, EBPO_E_ARGUMENT,
                     "the pen was nowhere on the surface: give a greater --within, or a path that "
                     "is closer to the surface");
}

static ebpo_status undo_strokes(paint_job *j, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    uint64_t strokes = info_of(j).stroke_count;
    if ((uint64_t)j->v->undo > strokes) {
        char what[80];
        char count[40];
        snprintf(what, sizeof what, "--undo %lld: the paint has only %s", (long long)j->v->undo,
                 words_plural(count, sizeof count, strokes, "stroke", "strokes"));
        return fail_paint(error, EBPO_E_ARGUMENT, what);
    }
    for (int64_t i = 0; i < j->v->undo && status == EBPO_OK; i++)
        status = ebpo_paint_remove_stroke(j->paint, info_of(j).stroke_count - 1, error);
    return status;
}

/* Applies the requested change, and saves the paint. input: positions of --path; NULL: no --path.
 */
static ebpo_status paint_change(paint_job *j, const ebpo_paint_input *input, uint64_t count,
                                ebpo_error *error)
{
    const paint_values *v = j->v;
    ebpo_status status = EBPO_OK;
    if (v->new_layer)
        status = add_layer(j, error);
    else if (input || v->note)
        ; /* strokes and notes are added below; a stroke can be combined with --new-layer */
    else if (v->undo)
        status = undo_strokes(j, error);
    else if (v->remove_stroke >= 0)
        status = ebpo_paint_remove_stroke(j->paint, (uint64_t)v->remove_stroke, error);
    else if (v->remove_note >= 0)
        status = ebpo_paint_remove_note(j->paint, (uint64_t)v->remove_note, error);
    else if (v->remove_layer >= 0)
        status = ebpo_paint_remove_layer(j->paint, (uint64_t)v->remove_layer, error);
    else
        status = set_layer(j, error);
    if (status == EBPO_OK && input)
        status = draw_stroke(j, input, count, error);
    if (status == EBPO_OK && v->note)
        status = add_note(j, error);
    return status == EBPO_OK ? ebpo_paint_save(j->paint, v->out ? v->out : j->paint_path, error)
                             : status;
}

/* --- baking --- */

/* Sets *rgba to the colours of vertices before painting, [vertex_count][4]: the colours of the
 * model or, if it has none, the colour of --base. The caller frees *rgba. */
static ebpo_status base_colours(paint_job *j, const ebpo_mesh *mesh, uint8_t **rgba,
                                ebpo_error *error)
{
    ebpo_colours colours;
    uint32_t base = 0xe6e6e6ff;
    *rgba = NULL;
    if (j->v->base)
        (void)words_read_colour(j->v->base, &base);
    ebpo_status status = ebpo_mesh_colours(mesh, &colours, error);
    if (status != EBPO_OK)
        return status;
    *rgba = colours.vertex;
    colours.vertex = NULL;
    ebpo_colours_free(&colours);
    j->has_own_colours = *rgba != NULL;
    if (*rgba)
        return EBPO_OK;
    *rgba = malloc(4 * mesh->vertex_count);
    if (!*rgba)
        return fail_paint(error, EBPO_E_MEMORY,
                          "not enough memory for the colours of all vertices");
    for (uint64_t i = 0; i < 4 * mesh->vertex_count; i++)
        (*rgba)[i] = (uint8_t)(base >> (24 - 8 * (i % 4)));
    return EBPO_OK;
}

static ebpo_status write_baked(paint_job *j, ebpo_mesh *mesh, const uint8_t *rgba,
                               ebpo_error *error)
{
    const char *out = j->v->bake;
    if (words_end_with(out, ".ply")) {
        ebpo_status status = ebpo_paint_colour_mesh(mesh, rgba, error);
        return status == EBPO_OK ? ebpo_mesh_write_ply(mesh, out, error) : status;
    }
    ebpo_export_options o = EBPO_EXPORT_OPTIONS_INIT;
    o.threads = (unsigned)j->v->threads;
    o.progress = j->progress;
    o.vertex_colours = rgba;
    ebpo_mesh_free(mesh); /* ebpo_export reads the mesh again */
    return ebpo_export(j->file, out,
                       words_end_with(out, ".glb")    ? EBPO_EXPORT_GLB
                       : words_end_with(out, ".gltf") ? EBPO_EXPORT_GLTF
                                                      : EBPO_EXPORT_OBJ,
                       &o, NULL, error);
}

static ebpo_status paint_bake(paint_job *j, ebpo_error *error)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_paint_options options = EBPO_PAINT_OPTIONS_INIT;
    ebpo_mesh mesh;
    read.threads = (unsigned)j->v->threads;
    read.attributes = 1;
    options.threads = (unsigned)j->v->threads;
    options.progress = j->progress;
    ebpo_status status = ebpo_check_output(j->v->bake, error);
    if (status == EBPO_OK)
        status = ebpo_file_read_source_mesh(j->file, &read, &mesh, NULL, error);
    if (status != EBPO_OK)
        return status;
    uint8_t *rgba;
    status = base_colours(j, &mesh, &rgba, error);
    if (status == EBPO_OK)
        status = ebpo_paint_bake(j->paint, j->context, &mesh, &options, rgba, &j->baked, error);
    if (status == EBPO_OK)
        status = write_baked(j, &mesh, rgba, error);
    free(rgba);
    ebpo_mesh_free(&mesh);
    return status;
}

/* --- the command --- */

#include "cli/options/paint.inc"

static const paint_values defaults = { .layer = -1,
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

/* --- options --- */

static bool gives_layer_facts(const paint_values *v)
{
    return v->description || v->opacity >= 0 || v->show || v->hide;
}

/* Returns true if the command sets facts of an existing layer. */
static bool sets_layer(const paint_values *v)
{
    return !v->new_layer && !v->path && !v->note &&
           (gives_layer_facts(v) || v->title || v->author || v->date || v->colour);
}

static int count_removals(const paint_values *v)
{
    return (v->undo > 0) + (v->remove_stroke >= 0) + (v->remove_note >= 0) + (v->remove_layer >= 0);
}

static bool changes_paint(const paint_values *v)
{
    return v->new_layer || v->path || v->note || count_removals(v) || sets_layer(v);
}

static int check_pen(const paint_values *v)
{
    bool pen = v->radius != 0 || v->spread != 0 || v->density != 1 || v->thin != 1 ||
               v->step != 0 || isfinite(v->within) || v->pressure != 1 || v->rate != 1000 ||
               v->seed != 1 || v->erase;
    if (pen && !v->path)
        return command_usage("paint", "--radius and other options of a pen belong to --path");
    if (v->path && v->radius == 0)
        return command_usage("paint", "--path needs --radius, the size of points");
    if (v->density != 1 && v->spread == 0)
        return command_usage("paint", "--density belongs to --spread");
    if (v->erase && v->colour)
        return command_usage("paint", "--erase and --colour cannot be used together");
    return EXIT_OK;
}

static int check_texts(const paint_values *v)
{
    uint32_t colour;
    double place[3];
    if (v->colour && !words_read_colour(v->colour, &colour))
        return command_usage("paint", "--colour '%s': expected " WORDS_COLOUR_EXPECTED, v->colour);
    if (v->base && (!words_read_colour(v->base, &colour) || strlen(v->base) != 6))
        return command_usage("paint", "--base '%s': expected RRGGBB in hexadecimal", v->base);
    if (v->at && !paint_read_position(v->at, place))
        return command_usage("paint", "--at '%s': expected X,Y,Z", v->at);
    if (v->date && !ebpo_is_date(v->date))
        return command_usage("paint", "--date '%s': expected " WORDS_DATE_EXPECTED, v->date);
    if ((v->at != NULL) != (v->note != NULL))
        return command_usage("paint", "--note and --at need each other; give both");
    if (v->bake && !words_end_with(v->bake, ".ply") && !words_end_with(v->bake, ".glb") &&
        !words_end_with(v->bake, ".gltf") && !words_end_with(v->bake, ".obj"))
        return command_usage(
            "paint", "--bake '%s': expected a name that ends with .ply, .glb, .gltf or .obj",
            v->bake);
    return EXIT_OK;
}

static int check_values(const paint_values *v)
{
    int kinds = count_removals(v) + (v->new_layer || v->path || v->note || sets_layer(v)) +
                (v->bake != NULL) + v->area;
    if (kinds > 1)
        return command_usage("paint",
                             "only one action at a time: add or change, --undo or one --remove, "
                             "--bake, --area");
    if ((v->path || v->note) && !v->new_layer && gives_layer_facts(v))
        return command_usage("paint", "--description, --opacity, --show and --hide belong to a "
                                      "layer: use them with --new-layer or in a separate run");
    if (v->new_layer && (v->layer >= 0 || v->title || v->note))
        return command_usage("paint", "--new-layer has its title, and goes with neither --layer, "
                                      "--title nor --note");
    if (v->path && v->note)
        return command_usage("paint",
                             "--path and --note cannot be used together; use separate runs");
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
    if (v->out && !changes_paint(v))
        return command_usage("paint", "--output is for a paint that is changed");
    if (v->layer >= 0 && !v->path && !v->note && !sets_layer(v))
        return command_usage("paint", "--layer N: nothing to do; --remove-layer removes a layer");
    int code = check_pen(v);
    return code == EXIT_OK ? check_texts(v) : code;
}

/* Returns true if the command computes positions on the model. */
static bool needs_model(const paint_values *v) { return v->path || v->note || v->bake || v->area; }

static int check_outputs(const paint_job *j)
{
    const char *outs[] = { j->v->out, j->v->bake }, *paint = j->paint_path, *model = j->model_path;
    for (int i = 0; i < 2; i++)
        if (outs[i] && model && command_overwrites("paint", model, outs[i]))
            return EXIT_USAGE;
    if (model && command_overwrites("paint", model, paint))
        return EXIT_USAGE;
    if (j->v->out && j->v->path && command_overwrites("paint", j->v->path, j->v->out))
        return EXIT_USAGE;
    return j->v->bake && command_overwrites("paint", paint, j->v->bake) ? EXIT_USAGE : EXIT_OK;
}

/* --- running --- */

/* Seconds to wait for other commands that change the same paint. */
static const double LOCK_SECONDS = 600;

/* Opens the paint; makes a new paint if the file does not exist and --new-layer is given. If this
 * command will change the file, waits until other commands that change it have ended. */
static ebpo_status open_paint(paint_job *j, ebpo_error *error)
{
    const paint_values *v = j->v;
    bool absent = access(j->paint_path, F_OK) != 0 && errno == ENOENT,
         may_make = v->new_layer && j->file,
         in_place = changes_paint(v) && (!v->out || strcmp(v->out, j->paint_path) == 0 ||
                                         command_same_file(v->out, j->paint_path));
    if (absent && !may_make) {
        *error = (ebpo_error){ .status = EBPO_E_IO, .offset = -1 };
        snprintf(
            error->message, sizeof error->message,
            "%.200s: no such file; 'ebpo paint PAINT FILE --new-layer TITLE' makes a new one, for "
            "the model FILE",
            j->paint_path);
        return error->status;
    }
    if (in_place)
        return ebpo_paint_open_to_change(j->paint_path, may_make ? j->file : NULL, LOCK_SECONDS,
                                         &j->progress, &j->paint, error);
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
        model_memory_default("paint", j->file, j->model_path, &o);
    ebpo_status status = ebpo_model_new(j->file, &o, &j->model, error);
    return status == EBPO_OK ? ebpo_context_new(j->model, &j->context, error) : status;
}

static ebpo_status measure_areas(paint_job *j, ebpo_error *error)
{
    ebpo_paint_options o = EBPO_PAINT_OPTIONS_INIT;
    o.fineness = (unsigned)j->v->fineness;
    o.threads = (unsigned)j->v->threads;
    o.progress = j->progress;
    return ebpo_paint_measure(j->paint, j->context, &o, &j->areas, error);
}

static ebpo_status run_steps(paint_job *j, const ebpo_paint_input *input, uint64_t count,
                             uint64_t memory, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    ebpo_paint_info info = EBPO_PAINT_INFO_INIT;
    j->changed = changes_paint(j->v);
    ebpo_paint_get_info(j->paint, &info);
    bool has_points_to_check =
        j->file && (info.point_count || info.note_count) && (j->changed || needs_model(j->v));
    if (needs_model(j->v) || has_points_to_check)
        status = open_model(j, memory, error);
    if (status == EBPO_OK && has_points_to_check)
        status = ebpo_paint_check_points(j->paint, j->context, &j->progress, error);
    if (status == EBPO_OK && j->changed)
        status = paint_change(j, input, count, error);
    if (status == EBPO_OK && j->v->bake)
        status = paint_bake(j, error);
    if (status == EBPO_OK && j->v->area)
        status = measure_areas(j, error);
    return status;
}

static int run_job(paint_job *j, const ebpo_paint_input *input, uint64_t count, uint64_t memory)
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
    status = run_steps(j, input, count, memory, &error);
    progress_wipe(&line);
    if (status != EBPO_OK)
        return command_failed("paint", &error);
    paint_report(j);
    return EXIT_OK;
}

static int run_paint(void *given, const char **operand)
{
    const paint_values *v = given;
    paint_job j = { .v = v,
                    .paint_path = operand[0],
                    .model_path = operand[1],
                    .drawn = EBPO_PAINT_DRAWN_INIT,
                    .baked = EBPO_PAINT_BAKED_INIT,
                    .areas = EBPO_PAINT_AREAS_INIT };
    ebpo_paint_input *input = NULL;
    uint64_t memory = 0, count = 0;
    int code = check_values(v);
    if (code == EXIT_OK && v->memory && !words_read_size(v->memory, &memory))
        code = command_usage("paint", "--memory '%s': expected " WORDS_SIZE_EXPECTED, v->memory);
    if (code == EXIT_OK && needs_model(v) && !j.model_path)
        code = command_usage("paint", "the model is needed: ebpo paint PAINT FILE");
    if (code == EXIT_OK)
        code = check_outputs(&j);
    if (code == EXIT_OK && j.model_path && !command_requires_hdf5("paint", j.model_path))
        code = EXIT_FAILED;
    if (code == EXIT_OK && v->path && !paint_read_path(v, &input, &count))
        code = EXIT_FAILED;
    if (code == EXIT_OK)
        code = run_job(&j, input, count, memory);
    ebpo_paint_areas_free(&j.areas);
    ebpo_context_free(j.context);
    ebpo_model_free(j.model);
    ebpo_close(j.file);
    ebpo_paint_free(j.paint);
    free(input);
    return code;
}

const command command_paint = { &spec, sizeof defaults, &defaults, run_paint };
