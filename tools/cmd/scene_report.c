/* Who meets in a scene, time after time. */
#include "cmd/scene_report.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/json.h"
#include "cli/progress.h"
#include "cmd/scene_rows.h"

typedef struct report {
    const scene_values *v;
    ebpo_scene *scene;
    ebpo_scene_ask_options how;
    uint64_t meetings, frames_met, asked;
    scene_frame frame;
    uint64_t capacity; /* of its meetings */
    bool prints;       /* rows on standard output */
    json j;
    ebpo_scene_record *record; /* NULL: none is written */
} report;

/* --- a frame --- */

static bool keep_meetings(void *user, const ebpo_scene_meeting *meetings, uint64_t count)
{
    report *r = user;
    if (count > r->capacity) {
        free(r->frame.meetings);
        r->frame.meetings = malloc(count * sizeof *meetings);
        r->capacity = r->frame.meetings ? count : 0;
    }
    if (r->frame.meetings)
        memcpy(r->frame.meetings, meetings, count * sizeof *meetings);
    r->frame.count = count;
    return true;
}

static ebpo_status ask_frame(report *r, double time, ebpo_error *error)
{
    ebpo_scene_stats before = EBPO_SCENE_STATS_INIT, after = EBPO_SCENE_STATS_INIT;
    scene_frame *f = &r->frame;
    double begun = progress_now();
    (void)ebpo_scene_get_stats(r->scene, &before);
    f->count = 0;
    f->cost = (ebpo_scene_frame){ .time = time };
    ebpo_status status =
        ebpo_scene_meet(r->scene, time, &r->how, keep_meetings, r, &f->cost.asked, error);
    if (status == EBPO_OK && f->count && !f->meetings) {
        snprintf(error->message, sizeof error->message, "no memory for %llu meetings",
                 (unsigned long long)f->count);
        status = error->status = EBPO_E_MEMORY;
    }
    (void)ebpo_scene_get_stats(r->scene, &after);
    f->cost.nanoseconds = (uint64_t)((progress_now() - begun) * 1e9);
    f->cost.bytes_read = after.bytes_read - before.bytes_read;
    f->cost.models = after.models - before.models;
    f->cost.loads = after.loads - before.loads;
    r->asked += f->cost.asked;
    r->meetings += f->count;
    r->frames_met += f->count > 0;
    return status;
}

/* --- what is told of it --- */

static void frame_json(report *r)
{
    const ebpo_scene_frame *cost = &r->frame.cost;
    json_object(&r->j, NULL);
    json_real(&r->j, "time", cost->time);
    json_array(&r->j, "meetings");
    for (uint64_t i = 0; i < r->frame.count; i++)
        scene_row_json(&r->j, r->v, r->scene, &r->frame.meetings[i]);
    json_end(&r->j);
    json_uint(&r->j, "pairs_asked", cost->asked);
    json_real(&r->j, "seconds", (double)cost->nanoseconds * 1e-9);
    json_uint(&r->j, "bytes_read", cost->bytes_read);
    json_uint(&r->j, "models_read", cost->models);
    json_uint(&r->j, "loads", cost->loads);
    json_end(&r->j);
}

static void print_frame(report *r)
{
    const scene_frame *f = &r->frame;
    if (r->v->json)
        frame_json(r);
    for (uint64_t i = 0; i < f->count && !r->v->json; i++)
        (r->v->csv ? scene_row_csv : scene_row_words)(r->v, r->scene, f->cost.time,
                                                      &f->meetings[i]);
}

static ebpo_status tell_frame(report *r, ebpo_error *error)
{
    const scene_frame *f = &r->frame;
    if (r->prints)
        print_frame(r);
    return r->record ? ebpo_scene_record_add(r->record, &f->cost, f->meetings, f->count, error)
                     : EBPO_OK;
}

static ebpo_status begin(report *r, ebpo_error *error)
{
    if (r->prints && r->v->json) {
        json_begin(&r->j, stdout);
        json_object(&r->j, NULL);
        json_array(&r->j, "frames");
    } else if (r->prints && r->v->csv) {
        scene_head_csv(r->v);
    }
    return r->v->out ? ebpo_scene_record_new(r->scene, r->v->out, &r->record, error) : EBPO_OK;
}

static ebpo_status finish(report *r, uint64_t frames, double seconds, ebpo_error *error)
{
    if (r->prints && r->v->json) {
        json_end(&r->j);
        json_uint(&r->j, "pairs_asked", r->asked);
        json_uint(&r->j, "pairs_that_meet", r->meetings);
        json_real(&r->j, "seconds", seconds);
        json_finish(&r->j);
    } else if (!r->v->quiet) {
        fprintf(stderr,
                "%llu times, %llu of them with meetings; %llu pairs asked, %llu meet; %.3g s\n",
                (unsigned long long)frames, (unsigned long long)r->frames_met,
                (unsigned long long)r->asked, (unsigned long long)r->meetings, seconds);
    }
    return r->record ? ebpo_scene_record_finish(r->record, error) : EBPO_OK;
}

/* --- all frames --- */

/* Of the frame `n`: the last one is at the last time. */
static double time_of(const scene_values *v, uint64_t n, uint64_t frames)
{
    return n + 1 == frames ? v->to : v->from + v->step * (double)n;
}

static uint64_t frames_of(const scene_values *v)
{
    return v->to > v->from /* the command has seen to it that these are not too many */
               ? 1 + (uint64_t)ceil((v->to - v->from) / v->step * (1 - 0x1p-40))
               : 1;
}

ebpo_status scene_report(const scene_values *v, const char *path, ebpo_scene *scene,
                         ebpo_error *error)
{
    report r = { .v = v, .scene = scene, .how = EBPO_SCENE_ASK_OPTIONS_INIT };
    double begun = progress_now();
    uint64_t frames = frames_of(v);
    progress_line line;
    (void)path;
    r.prints = !v->out || v->csv || v->json;
    r.how.count = v->count;
    r.how.places = v->places;
    r.how.relate = v->solids || v->depth > 0;
    r.how.depth = v->depth;
    r.how.threads = (unsigned)v->threads;
    r.how.progress = progress_start(&line, "scene", v->quiet);
    ebpo_status status = begin(&r, error);
    for (uint64_t n = 0; n < frames && status == EBPO_OK; n++) {
        status = ask_frame(&r, time_of(v, n, frames), error);
        if (status == EBPO_OK)
            status = tell_frame(&r, error);
    }
    progress_wipe(&line);
    if (status == EBPO_OK)
        status = finish(&r, frames, progress_now() - begun, error);
    ebpo_scene_record_free(r.record);
    free(r.frame.meetings);
    return status;
}
