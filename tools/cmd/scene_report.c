/* Who meets in a scene, time after time. */
#include "cmd/scene_report.h"

#include <math.h>
#include <stdio.h>

#include "cli/json.h"
#include "cli/progress.h"

static const char *const kinds[] = { "none", "near", "touching", "coplanar", "crossing" };

typedef struct report {
    const scene_values *v;
    const ebpo_scene *scene;
    double time;
    uint64_t meetings, frames_met, asked;
    json j;
} report;

static const char *name_of(const report *r, uint64_t instance)
{
    ebpo_scene_instance i = EBPO_SCENE_INSTANCE_INIT;
    (void)ebpo_scene_get_instance(r->scene, instance, &i);
    return i.name;
}

static void meeting_json(report *r, const ebpo_scene_meeting *m)
{
    json *j = &r->j;
    json_object(j, NULL);
    json_text(j, "a", name_of(r, m->a));
    json_text(j, "b", name_of(r, m->b));
    json_text(j, "kind", kinds[m->kind]);
    json_uint(j, "face_a", m->face_a);
    json_uint(j, "face_b", m->face_b);
    if (r->v->count) {
        json_uint(j, "touching", m->touching);
        json_uint(j, "coplanar", m->coplanar);
        json_uint(j, "crossing", m->crossing);
    }
    json_real(j, "clearance", m->clearance);
    json_real(j, "distance", m->distance);
    json_end(j);
}

/* Quotes are doubled. */
static void csv_text(const char *text)
{
    putchar('"');
    for (; *text; text++) {
        if (*text == '"')
            putchar('"');
        putchar(*text);
    }
    putchar('"');
}

static void counts_csv(const report *r, const ebpo_scene_meeting *m)
{
    if (r->v->count)
        printf(",%llu,%llu,%llu", (unsigned long long)m->touching, (unsigned long long)m->coplanar,
               (unsigned long long)m->crossing);
}

static void meeting_csv(const report *r, const ebpo_scene_meeting *m)
{
    printf("%.17g,", r->time);
    csv_text(name_of(r, m->a));
    putchar(',');
    csv_text(name_of(r, m->b));
    printf(",%s,%.17g,%llu,%llu", kinds[m->kind], m->distance, (unsigned long long)m->face_a,
           (unsigned long long)m->face_b);
    counts_csv(r, m);
    putchar('\n');
}

static void meeting_words(const report *r, const ebpo_scene_meeting *m)
{
    printf("%.9g\t%s\t%s\t%s", r->time, kinds[m->kind], name_of(r, m->a), name_of(r, m->b));
    if (m->kind == EBPO_MEETING_NEAR)
        printf("\t%.9g of %.9g", m->distance, m->clearance);
    else if (r->v->count)
        printf("\t%llu pairs of faces",
               (unsigned long long)(m->touching + m->coplanar + m->crossing));
    putchar('\n');
}

static bool print_meetings(void *user, const ebpo_scene_meeting *meetings, uint64_t count)
{
    report *r = user;
    r->meetings += count;
    r->frames_met++;
    for (uint64_t i = 0; i < count; i++) {
        if (r->v->json)
            meeting_json(r, &meetings[i]);
        else if (r->v->csv)
            meeting_csv(r, &meetings[i]);
        else
            meeting_words(r, &meetings[i]);
    }
    return true;
}

static ebpo_status frame(report *r, ebpo_scene *scene, const ebpo_scene_ask_options *how,
                         ebpo_error *error)
{
    uint64_t asked = 0;
    double begun = progress_now();
    if (r->v->json) {
        json_object(&r->j, NULL);
        json_real(&r->j, "time", r->time);
        json_array(&r->j, "meetings");
    }
    ebpo_status status = ebpo_scene_meet(scene, r->time, how, print_meetings, r, &asked, error);
    r->asked += asked;
    if (r->v->json) {
        json_end(&r->j);
        json_uint(&r->j, "pairs_asked", asked);
        json_real(&r->j, "seconds", progress_now() - begun);
        json_end(&r->j);
    }
    return status;
}

/* Of the frame `n`: the last one is at the last time. */
static double time_of(const scene_values *v, uint64_t n, uint64_t frames)
{
    return n + 1 == frames ? v->to : v->from + v->step * (double)n;
}

static void begin(report *r)
{
    if (r->v->json) {
        json_begin(&r->j, stdout);
        json_object(&r->j, NULL);
        json_array(&r->j, "frames");
    } else if (r->v->csv) {
        printf("time,a,b,kind,distance,face_a,face_b%s\n",
               r->v->count ? ",touching,coplanar,crossing" : "");
    }
}

static void finish(report *r, uint64_t frames, double seconds)
{
    if (r->v->json) {
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
}

ebpo_status scene_report(const scene_values *v, const char *path, ebpo_scene *scene,
                         ebpo_error *error)
{
    report r = { .v = v, .scene = scene };
    ebpo_scene_ask_options how = EBPO_SCENE_ASK_OPTIONS_INIT;
    double begun = progress_now();
    uint64_t frames = 1;
    ebpo_status status = EBPO_OK;
    progress_line line;
    (void)path;
    if (v->to > v->from) /* the command has seen to it that these are not too many */
        frames += (uint64_t)ceil((v->to - v->from) / v->step * (1 - 0x1p-40));
    how.count = v->count;
    how.threads = (unsigned)v->threads;
    how.progress = progress_start(&line, "scene", v->quiet);
    begin(&r);
    for (uint64_t n = 0; n < frames && status == EBPO_OK; n++) {
        r.time = time_of(v, n, frames);
        status = frame(&r, scene, &how, error);
    }
    progress_wipe(&line);
    if (status == EBPO_OK)
        finish(&r, frames, progress_now() - begun);
    return status;
}
