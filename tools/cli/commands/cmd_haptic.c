/* ebpo haptic: runs a recorded, simulated or real haptic device at a steady rate, and measures the
 * times of the haptic steps. */
#include <float.h>
#include <math.h>
#include <signal.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/scene.h>

#include "cli/command.h"
#include "cli/commands/commands.h"
#include "cli/commands/haptic_device.h"
#include "cli/commands/haptic_live.h"
#include "cli/commands/haptic_paints.h"
#include "cli/commands/haptic_play.h"
#include "cli/commands/haptic_scene.h"
#include "cli/commands/haptic_view.h"
#include "cli/json.h"
#include "cli/model_memory.h"
#include "cli/numbers.h"
#include "cli/points.h"
#include "cli/remote_args.h"
#include "cli/words.h"

typedef struct values {
    /* as text; NULL: not given */
    const char *path, *device, *record, *tool, *memory, *paint, *colour, *viewer;
    double rate, seconds, radius, friction, stiffness, damping, skin, search_radius, pen_radius,
        full_force, thin, fade, spread;
    int64_t faces, density, layer, port;
    bool probe, json, erase, view;
    remote_values remote;
} values;

#include "cli/options/haptic.inc"

/* Returns true if the page of the viewer is the device. */
static bool is_page(const char *device) { return device && strcmp(device, "viewer") == 0; }

/* Returns true if the device is a 3D mouse. */
static bool is_mouse(const char *device) { return device && strcmp(device, "spacenav") == 0; }

typedef struct job {
    const values *v;
    const char *name;       /* FILE, the operand */
    ebpo_file *file;        /* NULL: the operand is a scene */
    ebpo_model *model;      /* NULL: a scene */
    haptic_scene scene;     /* not used with a model */
    haptic_surface surface; /* the model, for painting */
    double low[3], size[3]; /* box of the model or scene */
    ebpo_haptic *haptic;
    double *points; /* points of the tool, 3 numbers each */
    uint64_t point_count;
    ebpo_haptic_kind kind;
    haptic_device device;
    haptic_pose *record;    /* for --record; NULL: not requested */
    const char *scheduling; /* text of haptic_request_real_time */
    haptic_times empty;     /* times of steps that do nothing */
    haptic_times times;
    ebpo_haptic_stats stats;
    ebpo_error stopped; /* status EBPO_OK, or the error that ended loading */
    ebpo_model_stats memory;
    haptic_view *view;    /* NULL: not requested */
    haptic_paints *paint; /* NULL: not requested */
    haptic_painted painted;
    ebpo_error paint_error; /* status EBPO_OK, or why paint is missing in the file */
    uint64_t lost;          /* steps that were not painted, because painting was too slow */
} job;

/* --- output --- */

static const char *const kinds[] = { "a ball", "a probe", "a tool" };

static void print_times(const char *name, const haptic_times *t)
{
    printf("  %-8s %10llu %6llu %7llu %9.2f %9.2f %9.2f %9.2f %9.2f %11.2f %9.2f %10.2f %9.2f\n",
           name, (unsigned long long)t->step_count, (unsigned long long)t->late,
           (unsigned long long)t->over_ms, 1e6 * t->p50, 1e6 * t->p99, 1e6 * t->p99_9,
           1e6 * t->p99_99, 1e6 * t->max_time, 1e6 * t->wake_p99_9, 1e6 * t->wake_max,
           1e6 * t->cpu_p99_9, 1e6 * t->cpu_max);
}

static void print_bins(const haptic_times *t)
{
    puts("  microseconds from start to end: steps");
    for (int i = 0; i < HAPTIC_BINS; i++)
        if (t->bins[i])
            printf("  %6d %s %llu\n", i ? 1 << (i - 1) : 0,
                   i < HAPTIC_BINS - 1 ? "up  " : "and more", (unsigned long long)t->bins[i]);
}

static void print_report(const job *j)
{
    const ebpo_haptic_stats *s = &j->stats;
    printf("%s: %s at %g Hz, %s\n", remote_shown(j->name), kinds[j->kind], j->v->rate,
           j->scheduling);
    printf("  %-8s %10s %6s %7s %9s %9s %9s %9s %9s %11s %9s %10s %9s\n", "us", "steps", "missed",
           ">1 ms", "p50", "p99", "p99.9", "p99.99", "max", "wake p99.9", "max", "cpu p99.9",
           "max");
    print_times("haptic", &j->times);
    print_times("empty", &j->empty);
    printf("  contact %llu, waiting %llu, path unfinished %llu, faces omitted %llu; faces tested "
           "in a step: at most %llu; page faults %llu\n",
           (unsigned long long)s->contacts, (unsigned long long)s->waiting,
           (unsigned long long)s->path_unfinished, (unsigned long long)s->faces_omitted,
           (unsigned long long)s->work_max, (unsigned long long)j->times.page_faults);
    if (j->kind == EBPO_HAPTIC_PROBE)
        printf("  distances known to %g on average, %g at most\n", j->times.width_mean,
               j->times.width_max);
    printf("  boxes loaded %llu, taken %llu, too full %llu; %.3f s, the longest %.3f s; %llu "
           "bytes\n",
           (unsigned long long)s->loads, (unsigned long long)s->taken,
           (unsigned long long)s->too_many, s->load_seconds, s->load_seconds_max,
           (unsigned long long)s->memory);
    if (j->stopped.status != EBPO_OK)
        printf("  loading failed: in %llu steps\n", (unsigned long long)s->stopped);
    printf("  model: %llu bytes at most, %llu subtrees loaded\n",
           (unsigned long long)j->memory.memory_peak, (unsigned long long)j->memory.loads);
    if (j->v->paint)
        printf("  painted strokes %llu, points %llu; lost steps %llu; saved %llu times, failed "
               "%llu; longest %.3f s\n",
               (unsigned long long)j->painted.strokes, (unsigned long long)j->painted.points,
               (unsigned long long)j->lost, (unsigned long long)j->painted.saves,
               (unsigned long long)j->painted.failed_saves, j->painted.save_seconds_max);
    print_bins(&j->times);
}

static void json_times(json *out, const char *key, const haptic_times *t)
{
    json_object(out, key);
    json_uint(out, "steps", t->step_count);
    json_uint(out, "missed", t->late);
    json_real(out, "p50", t->p50);
    json_real(out, "p99", t->p99);
    json_real(out, "p99_9", t->p99_9);
    json_real(out, "p99_99", t->p99_99);
    json_real(out, "max", t->max_time);
    json_real(out, "wake_p99_9", t->wake_p99_9);
    json_real(out, "wake_max", t->wake_max);
    json_real(out, "cpu_p99_9", t->cpu_p99_9);
    json_real(out, "cpu_max", t->cpu_max);
    json_uint(out, "over_ms", t->over_ms);
    json_uint(out, "page_faults", t->page_faults);
    json_array(out, "histogram");
    for (int i = 0; i < HAPTIC_BINS; i++)
        json_uint(out, NULL, t->bins[i]);
    json_end(out);
    json_end(out);
}

static void json_painted(json *out, const job *j)
{
    json_object(out, "paint");
    json_text(out, "file", j->v->paint);
    json_uint(out, "strokes", j->painted.strokes);
    json_uint(out, "points", j->painted.points);
    json_uint(out, "lost_steps", j->lost);
    json_uint(out, "saves", j->painted.saves);
    json_uint(out, "failed_saves", j->painted.failed_saves);
    json_real(out, "save_seconds_max", j->painted.save_seconds_max);
    if (j->paint_error.status != EBPO_OK)
        json_text(out, "failure", j->paint_error.message);
    json_end(out);
}

static void json_report(const job *j)
{
    const ebpo_haptic_stats *s = &j->stats;
    json out;
    json_begin(&out, stdout);
    json_object(&out, NULL);
    json_text(&out, "file", remote_shown(j->name));
    json_text(&out, "device", kinds[j->kind] + 2);
    json_real(&out, "rate", j->v->rate);
    json_text(&out, "scheduling", j->scheduling);
    json_times(&out, "haptic", &j->times);
    json_times(&out, "empty", &j->empty);
    if (j->kind == EBPO_HAPTIC_PROBE) {
        json_real(&out, "between_mean", j->times.width_mean);
        json_real(&out, "between_max", j->times.width_max);
    }
    json_uint(&out, "contacts", s->contacts);
    json_uint(&out, "waiting", s->waiting);
    json_uint(&out, "path_unfinished", s->path_unfinished);
    json_uint(&out, "faces_omitted", s->faces_omitted);
    json_uint(&out, "faces_max", s->work_max);
    json_uint(&out, "loads", s->loads);
    json_uint(&out, "taken", s->taken);
    json_uint(&out, "too_full", s->too_many);
    json_real(&out, "load_seconds", s->load_seconds);
    json_real(&out, "load_seconds_max", s->load_seconds_max);
    json_uint(&out, "box_bytes", s->memory);
    json_uint(&out, "model_bytes_max", j->memory.memory_peak);
    json_uint(&out, "subtrees_loaded", j->memory.loads);
    json_uint(&out, "stopped", s->stopped);
    if (j->v->paint)
        json_painted(&out, j);
    if (j->stopped.status != EBPO_OK)
        json_text(&out, "failure", j->stopped.message);
    json_finish(&out);
}

/* --- running --- */

/* Sets the points of the tool to the vertices of a mesh file. Returns false after an error. */
static bool read_mesh_tool(job *j)
{
    ebpo_mesh_read_options read = EBPO_MESH_READ_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh mesh;
    if (ebpo_mesh_read(j->v->tool, &read, &mesh, &error) != EBPO_OK) {
        (void)command_failed("haptic", &error);
        return false;
    }
    j->point_count = mesh.vertex_count;
    j->points = malloc(3 * mesh.vertex_count * sizeof *j->points);
    for (uint64_t i = 0; j->points && i < 3 * mesh.vertex_count; i++)
        j->points[i] = mesh.xyz32 ? (double)mesh.xyz32[i] : mesh.xyz64[i];
    ebpo_mesh_free(&mesh);
    return j->points != NULL;
}

/* Reads the points of the tool from a file of points, in the formats that `ebpo inside` reads.
 * Returns false after an error. */
static bool read_point_tool(job *j)
{
    points p;
    double rows[3 * POINTS_BATCH];
    uint64_t point_count;
    bool complete = points_open(&p, "haptic", j->v->tool, POINTS, false, INFINITY);
    while (complete && (point_count = points_next(&p, rows)) > 0) {
        double *more = realloc(j->points, (j->point_count + point_count) * 3 * sizeof *more);
        complete = more != NULL;
        if (!complete)
            break;
        memcpy(more + 3 * j->point_count, rows, point_count * 3 * sizeof *more);
        j->points = more;
        j->point_count += point_count;
    }
    complete = complete && !p.failed;
    points_close(&p);
    return complete;
}

static bool read_tool(job *j)
{
    const char *name = j->v->tool;
    if (!name)
        return true;
    bool mesh = words_end_with(name, ".obj") || words_end_with(name, ".stl") ||
                words_end_with(name, ".off");
    if (!(mesh ? read_mesh_tool(j) : read_point_tool(j)))
        return false;
    if (j->point_count > 0 && j->point_count <= 10000)
        return true;
    fprintf(stderr, "ebpo haptic: the tool %s has %llu points; 1 to 10,000 are expected\n", name,
            (unsigned long long)j->point_count);
    return false;
}

/* Returns the radius of the ball, or the distance of the farthest point of the tool from the tool's
 * origin. */
static double tool_radius(const job *j)
{
    double radius = j->v->radius;
    for (uint64_t i = 0; i < j->point_count; i++)
        radius = fmax(radius,
                      hypot(hypot(j->points[3 * i], j->points[3 * i + 1]), j->points[3 * i + 2]));
    return radius;
}

static ebpo_status no_memory(ebpo_error *error, const char *what)
{
    *error = (ebpo_error){ .status = EBPO_E_MEMORY };
    snprintf(error->message, sizeof error->message, "not enough memory for %s", what);
    return EBPO_E_MEMORY;
}

static bool is_scene(const char *name) { return words_end_with(name, ".json"); }

static ebpo_status open_scene(job *j, uint64_t memory, ebpo_error *error)
{
    ebpo_load_options load = EBPO_LOAD_OPTIONS_INIT;
    load.memory = memory;
    load.max_expansion = (uint64_t)j->v->remote.max_expansion;
    ebpo_status status = haptic_scene_open(&j->scene, j->name, &load, error);
    memcpy(j->low, j->scene.low, sizeof j->low);
    memcpy(j->size, j->scene.size, sizeof j->size);
    if (status == EBPO_OK && j->v->paint)
        status = haptic_scene_paint_in(&j->scene, j->v->paint, j->v->record, error);
    return status;
}

static ebpo_status open_model(job *j, uint64_t memory, ebpo_error *error)
{
    ebpo_model_options opening = EBPO_MODEL_OPTIONS_INIT;
    opening.memory = memory;
    ebpo_status status = remote_open(&j->file, j->name, &j->v->remote, error);
    if (status == EBPO_OK && !j->v->memory)
        model_memory_default("haptic", j->file, j->name, &opening);
    if (status == EBPO_OK)
        status = ebpo_model_new(j->file, &opening, &j->model, error);
    if (status == EBPO_OK) {
        const ebpo_info *info = ebpo_file_info(j->file);
        memcpy(j->low, info->box_origin, sizeof j->low);
        memcpy(j->size, info->box_size, sizeof j->size);
    }
    if (status == EBPO_OK && !j->v->path && !j->v->device)
        status = haptic_builtin_open(&j->device, j->model, ebpo_file_info(j->file), j->v->rate,
                                     tool_radius(j), error);
    return status;
}

/* Opens a 3D mouse, which begins outside of the model. Returns false after an error, reported on
 * stderr. */
static bool open_mouse(job *j)
{
    return !is_mouse(j->v->device) ||
           haptic_spacenav_open(&j->device, j->low, j->size, j->v->rate, tool_radius(j));
}

static ebpo_status make_haptic(job *j, const double start[3], ebpo_error *error)
{
    const values *v = j->v;
    ebpo_haptic_options haptic_options = EBPO_HAPTIC_OPTIONS_INIT;
    haptic_options.radius = v->radius;
    haptic_options.friction = v->friction;
    haptic_options.stiffness = v->stiffness;
    haptic_options.damping = v->damping;
    haptic_options.skin = v->skin;
    haptic_options.search_radius = v->search_radius;
    haptic_options.step_seconds = 1 / v->rate;
    haptic_options.faces = (uint64_t)v->faces;
    haptic_options.kind = j->kind;
    haptic_options.points = (const double(*)[3])j->points;
    haptic_options.point_count = j->point_count;
    if (is_scene(j->name))
        return ebpo_haptic_new_posed(j->scene.instances, j->scene.instance_count, &haptic_options,
                                     start, &j->haptic, error);
    return ebpo_haptic_new(j->model, &haptic_options, start, &j->haptic, error);
}

static double diagonal_of(const job *j) { return hypot(hypot(j->size[0], j->size[1]), j->size[2]); }

/* Plays steps that do nothing for a tenth of the time, with a viewer at most for a second, to
 * measure the delays that the machine itself causes. Call before the device starts. */
static ebpo_status play_empty(job *j, ebpo_error *error)
{
    const values *v = j->v;
    uint64_t step_count = v->path ? j->device.step_count : 0;
    double seconds = (step_count ? (double)step_count / v->rate : v->seconds) / 10;
    const haptic_play empty = { .rate = v->rate, .seconds = v->view ? fmin(seconds, 1) : seconds };
    haptic_request_real_time();
    bool played = haptic_play_run(&empty, &j->empty);
    haptic_end_real_time(); /* so that the loading thread, which is created next, has normal
                               scheduling */
    return played ? EBPO_OK : no_memory(error, "the times of steps");
}

/* Returns the force of full pressure; without paint, that of 1 % of the model's diagonal. */
static double full_force(const job *j)
{
    const values *v = j->v;
    double depth = v->pen_radius > 0 ? v->pen_radius : v->radius;
    if (depth == 0)
        depth = 0.01 * diagonal_of(j);
    return v->full_force > 0 ? v->full_force : v->stiffness * depth;
}

/* Opens the paint file, or those of the models of a scene. */
static ebpo_status open_paint(job *j, ebpo_error *error)
{
    const values *v = j->v;
    haptic_pen pen = { .pen = EBPO_PAINT_PEN_INIT };
    if (!v->paint)
        return EBPO_OK;
    pen.pen.radius = v->pen_radius > 0 ? v->pen_radius : v->radius;
    pen.pen.kind = v->erase ? EBPO_PAINT_ERASES : EBPO_PAINT_PAINTS;
    pen.pen.spread = v->spread;
    pen.pen.density = (uint32_t)v->density;
    pen.pen.size_least = v->thin;
    pen.pen.layer = (uint64_t)v->layer;
    pen.default_layer = v->layer < 0;
    pen.default_colour = !v->colour;
    if (v->colour)
        (void)words_read_colour(v->colour, &pen.pen.colour); /* already checked */
    pen.dated = v->device != NULL;
    pen.stiffness = v->stiffness;
    pen.full_force = full_force(j);
    pen.fade = v->fade;
    pen.rate = v->rate;
    pen.points = (const double(*)[3])j->points;
    pen.point_count = v->spread > 0 ? 0 : j->point_count; /* a spray paints around the contact */
    pen.skin = v->skin;
    if (is_scene(j->name)) {
        pen.poses = j->scene.poses;
        return haptic_paints_open(&j->paint, &pen, j->scene.surfaces, j->scene.surface_count,
                                  j->scene.surface_of, error);
    }
    j->surface = (haptic_surface){ NULL, v->paint, j->file, j->model };
    return haptic_paints_open(&j->paint, &pen, &j->surface, 1, NULL, error);
}

static void stop_loop(int number)
{
    (void)number;
    haptic_play_stopped = 1;
}

/* The first SIGINT, SIGTERM or SIGHUP ends the loop, so that the paint is saved; a second one ends
 * the process. */
static void end_on_signals(void)
{
    static const int numbers[] = { SIGINT, SIGTERM, SIGHUP };
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        struct sigaction action = { .sa_handler = stop_loop }, before;
        action.sa_flags = (int)SA_RESETHAND;
        if (sigaction(numbers[i], NULL, &before) == 0 && before.sa_handler != SIG_IGN)
            sigaction(numbers[i], &action, NULL);
    }
}

/* Starts the viewer. Returns false after an error, which was reported. */
static bool open_view(job *j)
{
    const values *v = j->v;
    const haptic_view_options view = { .model = j->name,
                                       .scene = is_scene(j->name) ? &j->scene : NULL,
                                       .viewer = v->viewer,
                                       .port = v->port,
                                       .max_expansion = v->remote.max_expansion,
                                       .paint = j->paint,
                                       .radius = v->radius,
                                       .full_depth =
                                           v->stiffness > 0 ? full_force(j) / v->stiffness : 0,
                                       .is_device = is_page(v->device),
                                       .is_probe = v->probe };
    if (!v->view)
        return true;
    j->view = haptic_view_begin(&view);
    if (j->view && is_page(v->device))
        haptic_view_open_device(&j->device, j->view);
    return j->view != NULL;
}

/* A haptic_live_fn, whose `user` is a job. */
static void take_steps(void *user, const haptic_sample *samples, uint64_t count)
{
    job *j = user;
    if (j->paint)
        haptic_paints_take(j->paint, samples, count);
    if (j->view)
        haptic_view_take(j->view, samples, count);
}

/* Plays the device, and meanwhile paints and shows. */
static ebpo_status play_live(job *j, haptic_play *all, ebpo_error *error)
{
    if (j->paint || j->view) {
        all->live = haptic_live_begin(take_steps, j);
        if (!all->live)
            return no_memory(error, "painting");
        end_on_signals();
    }
    j->scheduling = haptic_request_real_time();
    bool played = haptic_play_run(all, &j->times);
    if (all->live)
        haptic_end_real_time();
    j->lost = haptic_live_end(all->live);
    haptic_view_end(j->view);
    j->view = NULL;
    (void)haptic_paints_close(j->paint, &j->painted, &j->paint_error);
    j->paint = NULL;
    return played ? EBPO_OK : no_memory(error, "the times of steps");
}

static ebpo_status play_device(job *j, const haptic_pose *first, ebpo_error *error)
{
    const values *v = j->v;
    haptic_play all = { .rate = v->rate,
                        .seconds = v->seconds,
                        .haptic = j->haptic,
                        .device = &j->device,
                        .first = *first,
                        .kind = j->kind,
                        .range = diagonal_of(j) / 20,
                        .points = j->points };
    if (v->record) {
        j->record = calloc(haptic_play_steps(&all), sizeof *j->record);
        if (!j->record)
            return no_memory(error, "the record");
        all.record = j->record;
    }
    ebpo_status status = play_live(j, &all, error);
    if (status != EBPO_OK)
        return status;
    ebpo_haptic_get_stats(j->haptic, &j->stats);
    if (is_scene(j->name)) {
        ebpo_scene_stats scene = EBPO_SCENE_STATS_INIT;
        (void)ebpo_scene_get_stats(j->scene.scene, &scene);
        j->memory.memory_peak = scene.memory;
        j->memory.loads = scene.loads;
    } else {
        ebpo_model_get_stats(j->model, &j->memory);
    }
    j->stopped.status = ebpo_haptic_check(j->haptic, &j->stopped);
    return EBPO_OK;
}

/* Writes the recorded poses in the format that --path reads. Each number has enough digits to
 * restore all its bits. */
static ebpo_status write_record(const job *j, ebpo_error *error)
{
    enum { LINE = 8 * (NUMBER_CAPACITY + 1) }; /* maximum length of a line: 8 numbers */
    char *text = malloc(j->times.step_count * LINE + 1), *at = text;
    if (!text)
        return no_memory(error, "the text of the record");
    for (uint64_t i = 0; i < j->times.step_count; i++) {
        const haptic_pose *p = &j->record[i];
        for (int k = 0; k < 7; k++) {
            at = number_write(at, k < 3 ? p->position[k] : p->rotation[k - 3]);
            *at++ = ' ';
        }
        if (p->lifted || p->pressure > 0)
            at = number_write(at, p->lifted ? 0 : p->pressure);
        else
            at--; /* the force sets the pressure */
        *at++ = '\n';
    }
    ebpo_status status = ebpo_write_file(j->v->record, text, (size_t)(at - text), error);
    free(text);
    return status;
}

static int run_job(job *j, uint64_t memory)
{
    ebpo_error error = EBPO_ERROR_INIT;
    haptic_pose start;
    ebpo_status status = j->v->record ? ebpo_check_output(j->v->record, &error) : EBPO_OK;
    if (status == EBPO_OK)
        status = is_scene(j->name) ? open_scene(j, memory, &error) : open_model(j, memory, &error);
    if (status == EBPO_OK && is_scene(j->name) && j->v->record &&
        haptic_scene_overwrites(&j->scene, j->v->record))
        return EXIT_USAGE;
    if (status == EBPO_OK && !open_mouse(j))
        return EXIT_FAILED;
    if (status == EBPO_OK)
        status = play_empty(j, &error);
    if (status == EBPO_OK)
        status = open_paint(j, &error);
    if (status == EBPO_OK && !open_view(j))
        return EXIT_FAILED;
    if (status == EBPO_OK && !j->device.begin(j->device.self, j->v->seconds, &start))
        return EXIT_FAILED;
    if (status == EBPO_OK)
        status = make_haptic(j, start.position, &error);
    if (status == EBPO_OK)
        status = play_device(j, &start, &error);
    if (status == EBPO_OK && j->v->record)
        status = write_record(j, &error);
    if (status != EBPO_OK)
        return command_failed("haptic", &error);
    if (j->v->json)
        json_report(j);
    else
        print_report(j);
    if (j->paint_error.status != EBPO_OK)
        (void)command_failed("haptic", &j->paint_error);
    if (j->stopped.status != EBPO_OK)
        (void)command_failed("haptic", &j->stopped);
    return j->stopped.status == EBPO_OK && j->paint_error.status == EBPO_OK ? EXIT_OK : EXIT_FAILED;
}

/* Checks the options of painting. Returns an exit code. */
static int check_pen(const values *v)
{
    uint32_t colour;
    bool pen = v->colour || v->erase || v->pen_radius > 0 || v->full_force > 0 || v->thin != 0.25 ||
               v->fade != 1 || v->spread > 0 || v->density != 1 || v->layer >= 0;
    if (pen && !v->paint)
        return command_usage("haptic", "--pen-radius, --colour and other options of a pen belong "
                                       "to --paint");
    if (v->paint && v->probe)
        return command_usage("haptic", "--paint and --probe cannot be used together: a probe "
                                       "touches nothing");
    if (v->paint && v->pen_radius == 0 && v->radius == 0)
        return command_usage("haptic", "--paint needs --pen-radius, or a ball with --radius");
    if (v->paint && v->stiffness == 0)
        return command_usage("haptic", "--paint needs a --stiffness above 0, because the force "
                                       "is the pressure of the pen");
    if (v->colour && !words_read_colour(v->colour, &colour))
        return command_usage("haptic", "--colour '%s': expected " WORDS_COLOUR_EXPECTED, v->colour);
    if (v->colour && v->erase)
        return command_usage("haptic", "--erase and --colour cannot be used together");
    if (v->fade != 1 && v->erase)
        return command_usage("haptic", "--erase and --fade cannot be used together");
    return v->density != 1 && v->spread == 0
               ? command_usage("haptic", "--density belongs to --spread")
               : EXIT_OK;
}

/* Checks the values of the options, and sets *memory. Returns an exit code. */
static int check_values(const values *v, const char *model, uint64_t *memory)
{
    if (v->memory && !words_read_size(v->memory, memory))
        return command_usage("haptic", "--memory '%s': expected " WORDS_SIZE_EXPECTED, v->memory);
    if (is_scene(model) && !v->path && !v->device)
        return command_usage("haptic", "%s: a scene needs --path or --device", model);
    if (is_scene(model) && v->remote.compat)
        return command_usage("haptic",
                             "%s: --compat cannot be used with a scene; rewrite its models with "
                             "`ebpo repack --compat`",
                             model);
    if (v->path && v->seconds != 10)
        return command_usage("haptic", "--seconds cannot be combined with --path, which ends at "
                                       "its last position");
    if (v->path && v->device)
        return command_usage("haptic", "--path and --device cannot be used together: both move the "
                                       "tool");
    if (v->device && !is_page(v->device) && !is_mouse(v->device) && !haptic_udp_named(v->device))
        return command_usage("haptic",
                             "--device '%s': expected udp:PORT, udp:ADDRESS:PORT, spacenav or "
                             "viewer",
                             v->device);
    if (is_page(v->device) && !v->view)
        return command_usage("haptic", "--device viewer needs --view");
    if (is_page(v->device) && v->tool)
        return command_usage("haptic", "--device viewer moves a ball or a probe, not a --tool");
    if (!v->view && (v->viewer || v->port != 8080))
        return command_usage("haptic", "--port and --viewer belong to --view");
    if (v->view && (strncmp(model, "http://", 7) == 0 || strncmp(model, "https://", 8) == 0))
        return command_usage("haptic", "--view needs a model on this machine; fetch it first");
    if (v->tool && v->probe)
        return command_usage("haptic", "--tool and --probe cannot be used together: a probe is a "
                                       "point");
    if ((v->tool || v->probe) && v->radius > 0)
        return command_usage("haptic", "--radius is for a ball, without --tool and --probe");
    return check_pen(v);
}

/* Returns true if the record or the paint would overwrite an input, or the record the paint. */
static bool overwrites_input(const values *v, const char *model)
{
    const char *in[] = { model, v->path, v->tool }, *out[] = { v->record, v->paint };
    for (int i = 0; i < 2; i++)
        for (int k = 0; out[i] && k < 3; k++)
            if (in[k] && command_overwrites("haptic", in[k], out[i]))
                return true;
    return v->record && v->paint && command_overwrites("haptic", v->paint, v->record);
}

static int run_haptic(void *given, const char **operand)
{
    const values *v = given;
    job j = { .v = v,
              .name = operand[0],
              .kind = v->tool    ? EBPO_HAPTIC_TOOL
                      : v->probe ? EBPO_HAPTIC_PROBE
                                 : EBPO_HAPTIC_BALL,
              .stats = EBPO_HAPTIC_STATS_INIT,
              .memory = EBPO_MODEL_STATS_INIT };
    uint64_t memory = 0;
    int code = check_values(v, operand[0], &memory);
    if (code != 0 || overwrites_input(v, operand[0]))
        return EXIT_USAGE;
    bool prepared = (is_scene(j.name) || command_requires_hdf5("haptic", operand[0])) &&
                    read_tool(&j) && (!v->path || haptic_path_open(&j.device, v->path)) &&
                    (!haptic_udp_named(v->device) || haptic_udp_open(&j.device, v->device));
    code = prepared ? run_job(&j, memory) : EXIT_FAILED;
    haptic_view_end(j.view);
    (void)haptic_paints_close(j.paint, &j.painted, &j.paint_error);
    ebpo_haptic_free(j.haptic);
    ebpo_model_free(j.model);
    ebpo_close(j.file);
    haptic_scene_close(&j.scene);
    if (j.device.end)
        j.device.end(j.device.self);
    free(j.points);
    free(j.record);
    return code;
}

static const values standard = { .rate = 1000,
                                 .seconds = 10,
                                 .stiffness = 400,
                                 .damping = 0.4,
                                 .faces = 1 << 14,
                                 .thin = 0.25,
                                 .fade = 1,
                                 .density = 1,
                                 .layer = -1,
                                 .port = 8080,
                                 .remote = REMOTE_VALUES_INIT };

const command command_haptic = { &spec, sizeof standard, &standard, run_haptic };
